"""Things that move: a box of no known class, a chair that is pushed, a bottle that falls, a cup that is carried."""

from scenarios.spec import (
    CameraSpec,
    ImpulseSpec,
    PeopleSpec,
    PersonSpec,
    PushAct,
    Scenario,
    StandAct,
    ThingSpec,
    WalkLoopAct,
)


def _kicks(first_s: float, every_s: float, ways: str) -> tuple[ImpulseSpec, ...]:
    """Kicks to the right (+) and to the left (-), one after another."""
    return tuple(
        ImpulseSpec(
            time_s=first_s + every_s * k,
            impulse_n_s=(27.0 if way == "+" else -27.0, 0.0, 0.0),
            height_m=0.2,
            offset_m=0.02 if k % 2 else -0.02,
        )
        for k, way in enumerate(ways)
    )


SCENARIOS = (
    Scenario(
        name="unknown_mover",
        description="A carton slides across the floor again and again: it moves, and no network knows its class.",
        tags=("out of class", "stress"),
        frames=600,
        camera=CameraSpec(position_m=(0.0, -2.3, 1.5), tilt_deg=15, amplitude=0.5),
        things=(
            ThingSpec(
                name="carton",
                kind="box",
                position_m=(-0.95, 0.1, 0.0),
                heading_deg=-80,
                size_m=(0.5, 0.4, 0.55),
                impulses=_kicks(1.0, 2.3, "++--++--"),
            ),
            ThingSpec(name="chair", kind="chair", look="blue", position_m=(1.6, 0.7, 0.0), heading_deg=-60),
        ),
    ),
    Scenario(
        name="pushed_chair",
        description="A person pushes a chair across the office and stops.",
        tags=("chair", "contact"),
        frames=420,
        camera=CameraSpec(position_m=(0.0, -2.5, 1.45), tilt_deg=12, amplitude=0.4),
        people=PeopleSpec(
            cast=(
                PersonSpec(
                    name="anton",
                    character="man",
                    outfit="green",
                    position_m=(-1.65, 0.15),
                    heading_deg=0,
                    acts=(
                        StandAct(duration_s=1.0),
                        PushAct(chair="chair", distance_m=1.9),
                        StandAct(duration_s=3600.0),
                    ),
                ),
            )
        ),
        things=(ThingSpec(name="chair", kind="chair", look="red", position_m=(-0.84, 0.15, 0.0), heading_deg=0),),
    ),
    Scenario(
        name="falling_bottle",
        description="Two bottles on a low shelf are knocked over and fall.",
        tags=("small", "contact"),
        frames=300,
        camera=CameraSpec(position_m=(0.05, -2.45, 1.5), tilt_deg=36, amplitude=0.3),
        things=(
            ThingSpec(
                name="bottle_near",
                kind="bottle",
                look="water",
                position_m=(0.03, -0.95, 0.7),
                impulses=(ImpulseSpec(time_s=2.0, impulse_n_s=(0.02, -0.3, 0.0), height_m=0.17),),
            ),
            ThingSpec(
                name="bottle_far",
                kind="bottle",
                look="wine",
                position_m=(-0.22, -0.92, 0.7),
                impulses=(ImpulseSpec(time_s=6.0, impulse_n_s=(0.15, -0.75, 0.0), height_m=0.22),),
            ),
        ),
    ),
    Scenario(
        name="carried_cup",
        description="A person walks past with a cup in the hand.",
        tags=("small", "walking"),
        frames=600,
        camera=CameraSpec(position_m=(0.0, -2.4, 1.4), amplitude=0.5),
        people=PeopleSpec(
            cast=(
                PersonSpec(
                    name="dora",
                    character="short_woman",
                    outfit="gingham",
                    position_m=(-1.05, -0.35),
                    carries="cup",
                    acts=(
                        WalkLoopAct(waypoints_m=((1.05, -0.35), (1.05, 0.5), (-1.05, 0.5)), speed_m_s=0.8, start_m=0.2),
                    ),
                ),
            )
        ),
        things=(
            ThingSpec(name="cup", kind="cup", look="red", position_m=(-0.05, 1.36, 0.74)),
            ThingSpec(name="chair", kind="chair", look="blue", position_m=(1.75, 0.6, 0.0), heading_deg=160),
        ),
    ),
)
