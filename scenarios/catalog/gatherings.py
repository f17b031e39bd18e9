"""One person who fills the view, two who hide each other, six who do both."""

from scenarios.spec import (
    CameraSpec,
    PeopleSpec,
    PersonSpec,
    Scenario,
    SitAct,
    StandAct,
    ThingSpec,
    WalkAct,
    WalkLoopAct,
)

NEAR_LOOP = ((-1.0, -1.42), (1.0, -1.42), (1.0, -0.4), (-1.0, -0.4))
"""Past the camera to the right, and back behind the low shelf."""
FAR_LOOP = ((1.1, 0.25), (-1.1, 0.25), (-1.1, 0.84), (1.1, 0.84))
"""Beyond the shelf to the left, and back along the desks."""


def _walker(
    name: str, looks: tuple[str, str], loop: tuple[tuple[float, float], ...], start_m: float, speed_m_s: float
) -> PersonSpec:
    walk = WalkLoopAct(waypoints_m=loop[1:], speed_m_s=speed_m_s, start_m=start_m)
    return PersonSpec(name=name, character=looks[0], outfit=looks[1], position_m=loop[0], acts=(walk,))


def _stander(name: str, looks: tuple[str, str], position_m: tuple[float, float], heading_deg: float) -> PersonSpec:
    return PersonSpec(
        name=name,
        character=looks[0],
        outfit=looks[1],
        position_m=position_m,
        heading_deg=heading_deg,
        acts=(StandAct(duration_s=3600.0),),
    )


CROWD = Scenario(
    name="crowd",
    description="Four people walk and two stand; often less than half of the view is static.",
    tags=("walking", "occlusion", "stress"),
    frames=600,
    camera=CameraSpec(position_m=(0.0, -2.65, 1.45), amplitude=0.5),
    people=PeopleSpec(
        cast=(
            _walker("anton", ("man", "plaid"), NEAR_LOOP, 0.4, 1.0),
            _walker("berta", ("woman", "stripes"), NEAR_LOOP, 3.1, 1.0),
            _walker("carl", ("tall_man", "oxford"), FAR_LOOP, 0.3, 0.9),
            _walker("dora", ("short_woman", "gingham"), FAR_LOOP, 2.9, 0.9),
            _stander("emil", ("tall_man", "sweater"), (-1.8, 0.5), -40.0),
            _stander("fanny", ("short_woman", "dots"), (1.8, 0.45), 215.0),
        )
    ),
)

STILL = 0.2
"""Amplitude of small movements of a person who counts as at rest."""
PAUSE = StandAct(duration_s=1.8, amplitude=STILL)
WAYS = ((0.5, 0.0), (-0.8, 0.1), (0.4, -0.1), (-0.9, 0.0), (0.5, 0.0))

STOP_AND_GO = Scenario(
    name="stop_and_go",
    description="A person stands, sets off, and stands again, five times; another one sits still.",
    tags=("walking", "idle"),
    frames=600,
    camera=CameraSpec(position_m=(0.0, -2.5, 1.4), amplitude=0.5),
    people=PeopleSpec(
        cast=(
            PersonSpec(
                name="anton",
                character="man",
                outfit="plaid",
                position_m=(-0.9, 0.0),
                acts=(
                    *(act for way_m in WAYS for act in (PAUSE, WalkAct(waypoints_m=(way_m,), speed_m_s=1.0))),
                    StandAct(duration_s=3600.0, amplitude=STILL),
                ),
            ),
            PersonSpec(
                name="berta",
                character="woman",
                outfit="stripes",
                seated_on="chair",
                acts=(SitAct(duration_s=3600.0, amplitude=0.0),),
            ),
        )
    ),
    things=(ThingSpec(name="chair", kind="chair", look="blue", position_m=(1.35, 0.55, 0.0), heading_deg=-115),),
)

SCENARIOS = (
    Scenario(
        name="plaid_idle",
        description="A person in a plaid shirt stands close before the camera: idle, and most of the features.",
        tags=("idle", "stress"),
        frames=450,
        camera=CameraSpec(position_m=(0.0, -2.5, 1.3), tilt_deg=-4, amplitude=0.3),
        people=PeopleSpec(cast=(_stander("anton", ("man", "plaid"), (0.0, -1.55), -90.0),)),
    ),
    Scenario(
        name="crossing",
        description="Two people walk opposite ways and hide each other.",
        tags=("walking", "occlusion"),
        frames=600,
        camera=CameraSpec(position_m=(0.0, -2.6, 1.4), amplitude=0.5),
        people=PeopleSpec(
            cast=(
                _walker("anton", ("man", "plaid"), NEAR_LOOP, 0.4, 1.0),
                _walker("berta", ("woman", "stripes"), FAR_LOOP, 0.3, 0.9),
            )
        ),
    ),
    CROWD,
    STOP_AND_GO,
)
