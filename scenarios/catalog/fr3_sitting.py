"""Two people at a desk, after the sequences fr3/sitting_* of the TUM RGB-D benchmark.

One sits and gestures, one stands and talks: objects of interest that hardly move and carry many useful features.
"""

from scenarios.spec import CameraSpec, ChairSpec, PeopleSpec, PersonSpec, Scenario

PEOPLE = PeopleSpec(
    cast=(
        PersonSpec(
            name="anton",
            character="man",
            outfit="plaid",
            action="sit",
            waypoints_m=((-0.75, 0.5),),
            heading_deg=-60,
            amplitude=0.5,
        ),
        PersonSpec(
            name="berta",
            character="woman",
            outfit="stripes",
            action="stand",
            waypoints_m=((0.85, 0.35),),
            heading_deg=-110,
            amplitude=0.5,
        ),
    )
)

CHAIRS = (
    ChairSpec(name="chair_left", position_m=(-0.75, 0.5), heading_deg=-60, colour="blue"),
    ChairSpec(name="chair_right", position_m=(1.5, 0.7), heading_deg=130, colour="black"),
)


def _sitting(path: str, frames: int, motion: str) -> Scenario:
    return Scenario(
        name=f"fr3_sitting_{path}",
        description=f"One person sits, one stands, with small motions; the camera {motion}.",
        tags=("paper", "sitting"),
        frames=frames,
        camera=CameraSpec.model_validate({"path": path}),
        people=PEOPLE,
        chairs=CHAIRS,
    )


SCENARIOS = (
    _sitting("static", 708, "is held still by hand"),
    _sitting("xyz", 1275, "moves along its three axes"),
)
