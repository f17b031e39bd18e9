"""Cardboard boxes: the mover that no COCO network knows. Rest frame: the origin below the thing, front towards -y."""

import numpy as np

from sim.physics.bodies import Body, Part, Vector, box_inertia
from sim.scene import Surface
from sim.things import wrappers
from sim.things.meshes import box, merged, panel

BOX_LOOKS = ("taped", "plain", "open")
DEFAULT_SIZE_M = (0.35, 0.28, 0.25)
DENSITY_KG_M3 = 90.0
"""Of a carton with something in it (assumed): 2.2 kg at 0.35 by 0.28 by 0.25 m."""
FRICTION = 0.4
"""Cardboard on carpet and on wood (assumed; tables for paper and card give 0.3 to 0.6)."""


def carton(rng: np.random.Generator, size_m: Vector, look: str = "taped") -> tuple[Surface, ...]:
    """A cardboard box.

    Args:
        rng: of its card and its print.
        size_m: full extents; of an open one without the flaps.
        look: one of BOX_LOOKS.
    """
    w, d, h = (extent / 2 for extent in size_m)
    sides = merged(
        panel((0, -d, h), (w, 0, 0), (0, 0, h)),
        panel((0, d, h), (-w, 0, 0), (0, 0, h)),
        panel((w, 0, h), (0, d, 0), (0, 0, h)),
        panel((-w, 0, h), (0, -d, 0), (0, 0, h)),
    )
    bottom = panel((0, 0, 0), (w, 0, 0), (0, -d, 0))
    print_on_sides = wrappers.carton_side(rng, is_printed=look != "plain")
    if look == "open":
        return (*_open_top(rng, (w, d, h)), merged(sides, bottom).surface(print_on_sides))
    top = panel((0, 0, 2 * h), (w, 0, 0), (0, d, 0))
    tape = wrappers.carton_top(rng, size_m[:2], is_taped=look == "taped")
    ends = []
    if look == "taped":
        strip = min(0.06, 0.12 * h)
        for side in (-1.0, 1.0):
            ends.append(panel((side * (w + 0.0006), 0, 2 * h - strip), (0, side * 0.025, 0), (0, 0, strip)))
    return (
        merged(sides, bottom).surface(print_on_sides),
        top.surface(tape),
        *((merged(*ends).surface(wrappers.tape(rng)),) if ends else ()),
    )


def _open_top(rng: np.random.Generator, half_m: Vector) -> tuple[Surface, ...]:
    """The inside and four flaps that hang outwards."""
    w, d, h = half_m
    t = 0.004
    inside = merged(
        panel((0, -d + t, h), (-w, 0, 0), (0, 0, h)),
        panel((0, d - t, h), (w, 0, 0), (0, 0, h)),
        panel((w - t, 0, h), (0, -d, 0), (0, 0, h)),
        panel((-w + t, 0, h), (0, d, 0), (0, 0, h)),
        panel((0, 0, 0.012), (w, 0, 0), (0, d, 0)),
    )
    flaps = []
    for angle, (x, y), along, reach in (
        (float(rng.uniform(0.5, 1.0)), (0.0, -1.0), w, 0.9 * d),
        (float(rng.uniform(0.3, 0.8)), (0.0, 1.0), w, 0.9 * d),
        (float(rng.uniform(0.1, 0.6)), (1.0, 0.0), d, 0.9 * d),
        (float(rng.uniform(0.4, 1.0)), (-1.0, 0.0), d, 0.9 * d),
    ):
        out, drop = reach / 2 * np.cos(angle), -reach / 2 * np.sin(angle)
        middle = (x * (w + out) if x else 0.0, y * (d + out) if y else 0.0, 2 * h + drop)
        right = (-y * along, x * along, 0.0)
        flap = panel(middle, right, (-x * out, -y * out, -drop))
        flaps.append(flap.two_sided())
    card = wrappers.card(rng, 128)
    rim = merged(
        *(box((0, s * (d - t / 2), 2 * h - 0.001), (2 * w, t, 0.002)) for s in (-1, 1)),
        *(box((s * (w - t / 2), 0, 2 * h - 0.001), (t, 2 * d, 0.002)) for s in (-1, 1)),
    )
    return (merged(*flaps, rim).surface(card), inside.surface(wrappers.card(rng, 128, shade=0.72)))


def carton_body(size_m: Vector) -> Body:
    """A box of even density that slides."""
    mass = DENSITY_KG_M3 * size_m[0] * size_m[1] * size_m[2]
    middle = (0.0, 0.0, size_m[2] / 2)
    return Body(
        mass_kg=mass,
        centre_of_mass_m=middle,
        inertia_kg_m2=box_inertia(mass, size_m),
        parts=(Part(kind="box", centre_m=middle, size_m=size_m),),
        friction=FRICTION,
        restitution=0.1,
    )
