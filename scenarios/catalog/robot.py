"""A camera on a wheeled robot: behind a person, and along a corridor, as in the paper's own trial (section IV)."""

from scenarios.spec import (
    FollowCameraSpec,
    ImpulseSpec,
    PeopleSpec,
    PersonSpec,
    RobotCameraSpec,
    Scenario,
    StandAct,
    ThingSpec,
    TurnAct,
    WalkAct,
    WalkLoopAct,
)

FOLLOWED = PersonSpec(
    name="berta",
    character="woman",
    outfit="stripes",
    position_m=(-2.9, -2.05),
    acts=(WalkLoopAct(waypoints_m=((2.9, -2.05), (2.9, 2.05), (-2.9, 2.05)), speed_m_s=1.1, start_m=2.6),),
)

LONG_OFFICE_CHAIRS = (
    ThingSpec(name="chair_a", kind="chair", look="blue", position_m=(-0.85, -1.12, 0.0), heading_deg=80),
    ThingSpec(name="chair_b", kind="chair", look="black", position_m=(0.9, 1.12, 0.0), heading_deg=-95),
)

CORRIDOR_PEOPLE = PeopleSpec(
    cast=(
        PersonSpec(
            name="anton",
            character="man",
            outfit="plaid",
            position_m=(0.55, 12.0),
            heading_deg=-90,
            acts=(WalkAct(waypoints_m=((0.55, -0.1),), speed_m_s=1.0),),
        ),
        PersonSpec(
            name="berta",
            character="woman",
            outfit="stripes",
            position_m=(-0.2, 1.7),
            heading_deg=90,
            acts=(
                WalkAct(waypoints_m=((-0.2, 13.0),), speed_m_s=0.9),
                StandAct(duration_s=3.0),
                TurnAct(heading_deg=-90),
                WalkAct(waypoints_m=((-0.75, 11.5), (-0.7, 7.2)), speed_m_s=1.0),
            ),
        ),
        PersonSpec(
            name="carl",
            character="tall_man",
            outfit="sweater",
            position_m=(-1.05, 5.9),
            heading_deg=-20,
            acts=(StandAct(duration_s=3600.0),),
        ),
    )
)

CORRIDOR_CHAIRS = (
    ThingSpec(name="chair_a", kind="chair", look="blue", position_m=(1.15, 4.7, 0.0), heading_deg=170),
    ThingSpec(
        name="chair_b",
        kind="chair",
        look="black",
        position_m=(1.1, 8.9, 0.0),
        heading_deg=200,
        impulses=(ImpulseSpec(time_s=15.01, impulse_n_s=(-6.0, 0.5, 0.0), offset_m=0.06),),
    ),
    ThingSpec(name="chair_c", kind="chair", look="red", position_m=(-1.15, 2.0, 0.0), heading_deg=30),
)

SCENARIOS = (
    Scenario(
        name="robot_follows_person",
        description="A robot drives behind a walking person, as fast as the person, around two desk islands.",
        tags=("robot", "fast camera"),
        frames=600,
        room="long_office",
        camera=FollowCameraSpec(person="berta", distance_m=2.0, height_m=0.9, gaze_m=0.95),
        people=PeopleSpec(cast=(FOLLOWED,)),
        things=LONG_OFFICE_CHAIRS,
    ),
    Scenario(
        name="robot_corridor",
        description="A robot drives along a corridor among chairs and people: the trial of the paper.",
        tags=("paper", "robot"),
        frames=900,
        room="corridor",
        camera=RobotCameraSpec(
            waypoints_m=((0.0, 0.0), (-0.2, 2.5), (-0.18, 4.2), (0.15, 6.5), (0.05, 9.0), (0.2, 11.4)),
            speed_m_s=0.4,
            height_m=0.75,
            tilt_deg=-4,
        ),
        people=CORRIDOR_PEOPLE,
        things=CORRIDOR_CHAIRS,
    ),
)
