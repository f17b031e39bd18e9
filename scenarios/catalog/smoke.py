"""A small and quick run of everything, for a first look and for continuous integration."""

from scenarios.catalog.fr3_walking import CHAIRS, PEOPLE
from scenarios.spec import CameraSpec, Scenario

SCENARIOS = (
    Scenario(
        name="smoke",
        description="Two seconds of fr3_walking_xyz at a quarter of the pixels: everything once, in seconds.",
        tags=("quick",),
        frames=60,
        camera=CameraSpec(width=320, height=240, fx=267.7, fy=269.6, cx=159.8, cy=123.55),
        people=PEOPLE,
        things=CHAIRS,
    ),
)
