"""Two people at a desk, after the sequences fr3/sitting_* of the TUM RGB-D benchmark.

One sits and speaks by turns, with gestures, one stands and listens: objects of interest that stay where they are and
carry many useful features.
"""

from scenarios.spec import CameraSpec, PeopleSpec, PersonSpec, Scenario, SitAct, StandAct, ThingSpec

PEOPLE = PeopleSpec(
    cast=(
        PersonSpec(
            name="anton",
            character="man",
            outfit="plaid",
            seated_on="chair_left",
            acts=(SitAct(duration_s=3600.0),),
        ),
        PersonSpec(
            name="berta",
            character="woman",
            outfit="stripes",
            position_m=(0.85, 0.35),
            heading_deg=-110,
            acts=(StandAct(duration_s=3600.0, amplitude=0.5),),
        ),
    )
)

CHAIRS = (
    ThingSpec(name="chair_left", kind="chair", look="blue", position_m=(-0.75, 0.5, 0.0), heading_deg=-60),
    ThingSpec(name="chair_right", kind="chair", look="black", position_m=(1.5, 0.7, 0.0), heading_deg=130),
)


def _sitting(path: str, frames: int, motion: str, *, amplitude: float, translation: float) -> Scenario:
    camera = CameraSpec.model_validate({"path": path, "amplitude": amplitude, "translation": translation})
    return Scenario(
        name=f"fr3_sitting_{path}",
        description=f"One person sits, one stands, with small motions; the camera {motion}.",
        tags=("paper", "sitting"),
        frames=frames,
        camera=camera,
        people=PEOPLE,
        things=CHAIRS,
    )


SCENARIOS = (
    _sitting("static", 709, "is held still by hand", amplitude=1.2, translation=0.78),
    _sitting("xyz", 1276, "moves along its three axes", amplitude=0.64, translation=1.0),
    _sitting("rpy", 826, "turns about its three axes", amplitude=1.13, translation=0.4),
    _sitting("halfsphere", 1117, "moves on a half sphere", amplitude=1.04, translation=0.78),
)
