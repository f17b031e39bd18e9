"""What makes odometry and networks fail for reasons of their own: a camera on its side, a room without texture."""

from scenarios.catalog.fr3_walking import CHAIRS, PEOPLE
from scenarios.catalog.tours import stops
from scenarios.spec import CameraSpec, PeopleSpec, PersonSpec, Scenario, ThingSpec, TourCameraSpec, WalkLoopAct

ROLLING = stops(
    (0.0, 0.0, -2.3, 1.4, 0.0, 1.0, 1.0, 0.0),
    (3.0, 0.25, -2.25, 1.45, 0.1, 1.0, 1.0, 20.0),
    (7.0, 0.3, -2.35, 1.35, 0.0, 1.0, 1.05, 90.0),
    (9.0, 0.1, -2.4, 1.3, -0.1, 1.0, 1.05, 95.0),
    (13.0, -0.25, -2.35, 1.4, 0.0, 1.0, 1.0, 175.0),
    (15.5, -0.3, -2.3, 1.45, 0.1, 1.0, 1.0, 183.0),
    (20.0, 0.0, -2.4, 1.4, 0.0, 1.0, 1.0, 80.0),
    (24.0, 0.2, -2.3, 1.35, -0.1, 1.0, 1.0, 0.0),
    (28.0, 0.0, -2.35, 1.4, 0.0, 1.0, 1.05, -60.0),
    (31.0, 0.0, -2.3, 1.4, 0.0, 1.0, 1.0, -90.0),
)

SCENARIOS = (
    Scenario(
        name="tilted",
        description="Two people walk; the camera rolls onto its side and upside down.",
        tags=("walking", "stress"),
        frames=920,
        camera=TourCameraSpec(stops=ROLLING),
        people=PEOPLE,
        things=CHAIRS,
    ),
    Scenario(
        name="low_texture",
        description="A person walks through a bare room with few features on its walls.",
        tags=("walking", "stress"),
        frames=600,
        room="bare",
        camera=CameraSpec(position_m=(0.0, -1.75, 1.35), heading_deg=82, amplitude=0.7),
        people=PeopleSpec(
            cast=(
                PersonSpec(
                    name="carl",
                    character="tall_man",
                    outfit="oxford",
                    position_m=(-1.1, 0.1),
                    acts=(WalkLoopAct(waypoints_m=((1.1, 0.1), (1.1, 1.05), (-1.1, 1.05)), start_m=0.5),),
                ),
            )
        ),
        things=(ThingSpec(name="chair", kind="chair", look="blue", position_m=(0.3, 1.8, 0.0), heading_deg=-70),),
    ),
)
