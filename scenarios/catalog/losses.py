"""What makes SLAM lose the camera, and where it can find it again."""

from scenarios.catalog.fr3_walking import CHAIRS, PEOPLE
from scenarios.catalog.tours import stops
from scenarios.spec import CameraSpec, Scenario, SensorFailureSpec, SensorSpec, TourCameraSpec

SHORT = (
    SensorFailureSpec(kind="black", first=60),
    SensorFailureSpec(kind="no_depth", first=120),
    SensorFailureSpec(kind="missing", first=180, frames=10),
    SensorFailureSpec(kind="black", first=240, frames=15),
    SensorFailureSpec(kind="no_depth", first=300, frames=15),
)

CARRIED_OFF = stops(
    (0.0, 0.0, -2.0, 1.35, 0.0, 1.0, 1.0, 0.0),
    (3.0, 0.1, -1.9, 1.4, 0.1, 1.0, 1.0, 0.0),
    (4.0, 0.1, -1.6, 1.4, 2.8, -1.6, 1.2, 0.0),
    (5.0, 0.0, -1.4, 1.4, 0.0, -3.4, 1.2, 0.0),
    (7.0, 0.1, -1.5, 1.4, 0.1, -3.4, 1.2, 0.0),
    (8.0, 0.1, -1.6, 1.4, 2.8, -1.6, 1.2, 0.0),
    (9.0, 0.1, -1.9, 1.4, 0.1, 1.0, 1.0, 0.0),
    (11.0, 0.0, -2.0, 1.35, 0.0, 1.0, 1.0, 0.0),
)
"""It looks at the desks, turns to the wall behind, and back to the desks."""

TO_THE_WALL = stops(
    (0.0, -0.5, -0.6, 1.4, 1.6, 2.4, 1.3, 0.0),
    (3.0, -0.4, -0.5, 1.4, 1.5, 2.4, 1.3, 0.0),
    (5.0, -1.2, 1.2, 1.4, -1.2, 2.5, 1.5, 0.0),
    (6.5, -1.0, 1.3, 1.45, -1.0, 2.5, 1.5, 0.0),
    (9.0, -0.4, -0.5, 1.4, 1.5, 2.4, 1.3, 0.0),
    (11.0, -0.5, -0.6, 1.4, 1.6, 2.4, 1.3, 0.0),
)
"""It looks at the picture and the carton, goes up to the painted wall, and returns."""

SCENARIOS = (
    Scenario(
        name="failing_sensor",
        description="fr3_walking_xyz with black images, depth images without returns, and missing frames.",
        tags=("walking", "loss"),
        frames=400,
        camera=CameraSpec(),
        people=PEOPLE,
        things=CHAIRS,
        sensor=SensorSpec(failures=SHORT),
    ),
    Scenario(
        name="kidnapped",
        description="The lens is covered while the camera is turned to a wall it never saw; then it returns.",
        tags=("static", "loss"),
        frames=330,
        camera=TourCameraSpec(stops=CARRIED_OFF),
        things=CHAIRS,
        sensor=SensorSpec(failures=(SensorFailureSpec(kind="black", first=92, frames=50),)),
    ),
    Scenario(
        name="blank_wall",
        description="The camera goes up to a painted wall without a mark, and returns.",
        tags=("static", "loss"),
        frames=330,
        room="bare",
        camera=TourCameraSpec(stops=TO_THE_WALL),
    ),
)
