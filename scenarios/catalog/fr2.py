"""A desk full of things, after the sequences fr2/desk and fr2/desk_with_person of the TUM RGB-D benchmark."""

from scenarios.catalog import tours
from scenarios.spec import PeopleSpec, PersonSpec, Scenario, SitAct, ThingSpec, TourCameraSpec

CHAIRS = (
    ThingSpec(name="chair_front", kind="chair", look="blue", position_m=(0.0, -1.2, 0.0), heading_deg=90),
    ThingSpec(name="chair_back", kind="chair", look="black", position_m=(0.25, 1.2, 0.0), heading_deg=-75),
)

SCENARIOS = (
    Scenario(
        name="fr2_desk",
        description="The camera goes around a desk full of things; nothing moves.",
        tags=("paper", "static"),
        frames=2981,
        room="desk",
        camera=TourCameraSpec(stops=tours.DESK),
        things=CHAIRS,
    ),
    Scenario(
        name="fr2_desk_with_person",
        description="The camera goes to and fro beside a desk at which a person sits and gestures.",
        tags=("paper", "sitting"),
        frames=4263,
        room="desk",
        camera=TourCameraSpec(stops=tours.DESK_WITH_PERSON),
        people=PeopleSpec(
            cast=(
                PersonSpec(
                    name="berta",
                    character="short_woman",
                    outfit="dots",
                    seated_on="chair_front",
                    acts=(SitAct(duration_s=3600.0),),
                ),
            )
        ),
        things=CHAIRS,
    ),
)
