"""A long office and a household, after the sequence fr3/long_office_household of the TUM RGB-D benchmark."""

from scenarios.catalog import tours
from scenarios.spec import Scenario, ThingSpec, TourCameraSpec

CHAIRS = (
    ThingSpec(name="chair_a", kind="chair", look="blue", position_m=(-0.85, -1.12, 0.0), heading_deg=80),
    ThingSpec(name="chair_b", kind="chair", look="black_armless", position_m=(-0.75, 1.15, 0.0), heading_deg=-95),
    ThingSpec(name="chair_c", kind="chair", look="red_visitor", position_m=(0.95, -1.12, 0.0), heading_deg=110),
)

SCENARIOS = (
    Scenario(
        name="fr3_long_office_household",
        description="The camera goes around two desk islands and sees its beginning again; nothing moves.",
        tags=("paper", "static", "loop"),
        frames=2613,
        room="long_office",
        camera=TourCameraSpec(stops=tours.LONG_OFFICE),
        things=CHAIRS,
    ),
)
