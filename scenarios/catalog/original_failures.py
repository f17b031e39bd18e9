"""One failure of the authors' released program each: `dotmask run NAME --profile original`, and then `calibrated`.

The camera is the one that the program takes every camera for, so that only the failure acts that is named
(docs/original.md). The frame rates are those of a camera (30 Hz), of the program on a desktop (15 Hz) and on a laptop
(8 Hz), as in Vincent et al. 2020, section IV.
"""

from scenarios.spec import (
    CameraSpec,
    ImpulseSpec,
    PeopleSpec,
    PersonSpec,
    RobotCameraSpec,
    Scenario,
    StandAct,
    ThingSpec,
    WalkAct,
    WalkLoopAct,
)

STANDING = CameraSpec(
    fx=525.0,
    fy=525.0,
    cx=319.5,
    cy=239.5,
    path="static",
    position_m=(0.0, -2.1, 1.4),
    tilt_deg=12,
    amplitude=0.3,
)
CHAIR = ThingSpec(name="chair", kind="chair", look="blue", position_m=(0.35, 0.2, 0.0), heading_deg=-70)


def _walker(start_m: tuple[float, float], end_m: tuple[float, float]) -> PeopleSpec:
    """A person who walks to the left."""
    return PeopleSpec(
        cast=(
            PersonSpec(
                name="anton",
                character="man",
                outfit="plaid",
                position_m=start_m,
                heading_deg=180,
                acts=(WalkAct(waypoints_m=(end_m,), speed_m_s=1.2),),
            ),
        )
    )


SCENARIOS = (
    Scenario(
        name="detection_order",
        description="A person walks from the right to the left behind a chair: listed after it, then before it.",
        tags=("original", "chair"),
        frames=40,
        frame_rate_hz=15.0,
        room="bare",
        camera=STANDING,
        people=_walker((1.5, 0.9), (-2.0, 0.9)),
        things=(CHAIR,),
    ),
    Scenario(
        name="ageless_track",
        description="A person walks behind a chair and leaves the view; the chair stays.",
        tags=("original", "chair"),
        frames=75,
        frame_rate_hz=15.0,
        room="bare",
        camera=STANDING,
        people=_walker((0.9, 0.9), (-2.7, 0.9)),
        things=(CHAIR,),
    ),
    Scenario(
        name="fixed_time_step",
        description="A chair that was kicked rolls down a corridor at about 1 m/s, filmed at 30 Hz.",
        tags=("original", "chair"),
        frames=70,
        room="corridor",
        camera=STANDING.model_copy(update={"position_m": (0.0, 0.0, 1.4)}),
        things=(
            ThingSpec(
                name="chair",
                kind="chair",
                look="red",
                position_m=(0.5, 2.3, 0.0),
                heading_deg=100,
                impulses=(ImpulseSpec(time_s=0.8, impulse_n_s=(-4.0, 15.0, 0.0)),),
            ),
        ),
    ),
    Scenario(
        name="wide_covariance",
        description="A person walks past in full view, before the camera that the filter is made for.",
        tags=("original",),
        frames=45,
        frame_rate_hz=15.0,
        room="bare",
        camera=STANDING,
        people=_walker((1.5, 0.9), (-2.0, 0.9)),
    ),
    Scenario(
        name="new_mover",
        description="A person walks through the view from the first frame on.",
        tags=("original",),
        frames=20,
        frame_rate_hz=15.0,
        room="bare",
        camera=STANDING,
        people=PeopleSpec(
            cast=(
                PersonSpec(
                    name="anton",
                    character="man",
                    outfit="plaid",
                    position_m=(-1.9, 0.7),
                    acts=(WalkLoopAct(waypoints_m=((1.9, 0.7),), closed=False, start_m=1.0),),
                ),
            )
        ),
    ),
    Scenario(
        name="approaching_person",
        description="A robot drives up to a person who stands still.",
        tags=("original", "robot", "idle"),
        frames=31,
        frame_rate_hz=8.0,
        room="corridor",
        camera=RobotCameraSpec(
            fx=525.0,
            fy=525.0,
            cx=319.5,
            cy=239.5,
            waypoints_m=((0.0, 0.0), (0.0, 3.2)),
            speed_m_s=1.4,
            height_m=0.95,
            amplitude=0.3,
        ),
        people=PeopleSpec(
            cast=(
                PersonSpec(
                    name="carl",
                    character="man",
                    outfit="plaid",
                    position_m=(0.0, 5.6),
                    heading_deg=-90,
                    acts=(StandAct(duration_s=3600.0, amplitude=0.0),),
                ),
            )
        ),
    ),
)
