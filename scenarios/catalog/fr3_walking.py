"""Two people walk through an office, after the sequences fr3/walking_* of the TUM RGB-D benchmark.

They pass between 0.8 and 3.5 m from the camera and at times cover more than half of the image. One wears a plaid
shirt: many features that move, the case that the paper names (section III-B).
"""

from scenarios.spec import CameraSpec, ChairSpec, PeopleSpec, PersonSpec, PushSpec, Scenario

NEAR_CAMERA_Y_M = -1.42
"""Where people pass a moving camera: 0.9 m from its middle position."""
NEAR_STILL_CAMERA_Y_M = -1.52
"""A camera that is held still can be passed at 0.8 m."""


def _people(near_y_m: float, speed_m_s: float) -> PeopleSpec:
    """Two people, one behind the other, round and round the low shelf: past the camera, and back behind the shelf."""
    way = ((-1.0, near_y_m), (1.0, near_y_m), (1.0, -0.4), (-1.0, -0.4))
    return PeopleSpec(
        cast=(
            PersonSpec(
                name="anton", character="man", outfit="plaid", waypoints_m=way, speed_m_s=speed_m_s, start_m=0.4
            ),
            PersonSpec(
                name="berta", character="woman", outfit="stripes", waypoints_m=way, speed_m_s=speed_m_s, start_m=1.55
            ),
        )
    )


PEOPLE = _people(NEAR_CAMERA_Y_M, speed_m_s=1.0)
SLOW_PEOPLE = _people(NEAR_STILL_CAMERA_Y_M, speed_m_s=0.6)

CHAIRS = (
    ChairSpec(name="chair_left", position_m=(-1.0, 0.95), heading_deg=60, colour="blue"),
    ChairSpec(
        name="chair_right",
        position_m=(1.0, 0.95),
        heading_deg=130,
        colour="black",
        pushes=(
            PushSpec(time_s=6.0, impulse_n_s=(-9.0, -2.0, 0.0), offset_m=0.08),
            PushSpec(time_s=18.0, impulse_n_s=(9.0, 1.0, 0.0), offset_m=-0.08),
        ),
    ),
)


def _walking(path: str, frames: int, motion: str, people: PeopleSpec = PEOPLE) -> Scenario:
    return Scenario(
        name=f"fr3_walking_{path}",
        description=f"Two people walk through the office; the camera {motion}.",
        tags=("paper", "walking"),
        frames=frames,
        camera=CameraSpec.model_validate({"path": path}),
        people=people,
        chairs=CHAIRS,
    )


SCENARIOS = (
    _walking("static", 744, "is held still by hand", SLOW_PEOPLE),
    _walking("xyz", 864, "moves along its three axes"),
    _walking("rpy", 918, "turns about its three axes"),
    _walking("halfsphere", 1074, "moves on a half sphere"),
)
