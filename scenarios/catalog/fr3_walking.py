"""Two people walk through an office, after the sequences fr3/walking_* of the TUM RGB-D benchmark.

They pass between 0.8 and 3.5 m from the camera and at times cover more than half of the image. One wears a plaid
shirt: many features that move, the case that the paper names (section III-B).
"""

from scenarios.spec import CameraSpec, ImpulseSpec, PeopleSpec, PersonSpec, Scenario, ThingSpec, WalkLoopAct

NEAR_CAMERA_Y_M = -1.39
"""Where people pass a moving camera: 0.9 m from its middle position."""
NEAR_STILL_CAMERA_Y_M = -1.52
"""A camera that is held still can be passed at 0.8 m."""


def _people(near_y_m: float, speed_m_s: float) -> PeopleSpec:
    """Two people, one behind the other, round and round the low shelf: past the camera, and back behind the shelf."""
    way = ((1.0, near_y_m), (1.0, -0.4), (-1.0, -0.4))

    def person(name: str, character: str, outfit: str, start_m: float) -> PersonSpec:
        walk = WalkLoopAct(waypoints_m=way, speed_m_s=speed_m_s, start_m=start_m)
        return PersonSpec(name=name, character=character, outfit=outfit, position_m=(-1.0, near_y_m), acts=(walk,))

    return PeopleSpec(cast=(person("anton", "man", "plaid", 0.4), person("berta", "woman", "stripes", 1.55)))


PEOPLE = _people(NEAR_CAMERA_Y_M, speed_m_s=1.0)
SLOW_PEOPLE = _people(NEAR_STILL_CAMERA_Y_M, speed_m_s=0.6)

CHAIRS = (
    ThingSpec(name="chair_left", kind="chair", look="blue", position_m=(-1.0, 0.95, 0.0), heading_deg=60),
    ThingSpec(
        name="chair_right",
        kind="chair",
        look="black",
        position_m=(1.0, 0.95, 0.0),
        heading_deg=130,
        impulses=(
            ImpulseSpec(time_s=6.0, impulse_n_s=(-9.0, -2.0, 0.0), offset_m=0.08),
            ImpulseSpec(time_s=18.0, impulse_n_s=(9.0, 1.0, 0.0), offset_m=-0.08),
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
        things=CHAIRS,
    )


SCENARIOS = (
    _walking("static", 744, "is held still by hand", SLOW_PEOPLE),
    _walking("xyz", 864, "moves along its three axes"),
    _walking("rpy", 918, "turns about its three axes"),
    _walking("halfsphere", 1074, "moves on a half sphere"),
)
