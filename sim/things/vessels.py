"""Cups and bottles. Rest frame: the origin below the thing, z up; a cup's handle points towards +x."""

from dataclasses import dataclass

import numpy as np

from sim.physics.bodies import Body, Part, cylinder_inertia, tube_inertia
from sim.scene import Surface
from sim.things import textures, wrappers
from sim.things.meshes import Mesh, lathe, merged, tube
from sim.things.textures import Colour

CUP_LOOKS = ("white", "red", "blue", "speckled", "stripes")
CUP_HEIGHT_M, CUP_RADIUS_M = 0.095, 0.041
CUP_MASS_KG = 0.36
"""A stoneware mug, as sold 0.3 to 0.4 kg, with little left in it (assumed)."""
CUP_FRICTION = 0.35
"""Glaze on wood and carpet (assumed)."""
BOTTLE_LOOKS = ("water", "wine", "flask")

_INSIDE: dict[str, Colour] = {
    "white": (228, 226, 218),
    "red": (232, 226, 214),
    "blue": (52, 88, 138),
    "speckled": (196, 188, 170),
    "stripes": (232, 228, 216),
}
_HANDLE: dict[str, Colour] = {
    "white": (236, 234, 226),
    "red": (178, 38, 34),
    "blue": (42, 78, 132),
    "speckled": (206, 198, 180),
    "stripes": (238, 234, 222),
}


def cup(rng: np.random.Generator, look: str = "white") -> tuple[Surface, ...]:
    """A mug with a handle, a rim and what is left of a drink.

    Args:
        rng: of its glaze.
        look: one of CUP_LOOKS.
    """
    r, h = CUP_RADIUS_M, CUP_HEIGHT_M
    outside = lathe(
        [(0.86 * r, 0.0), (0.92 * r, 0.003), (0.985 * r, 0.01), (r, 0.02), (r, h - 0.002)], segments=32, crease_deg=40
    )
    inner = r - 0.0035
    rim = lathe([(r, h - 0.002), (r - 0.0008, h), (inner + 0.0006, h), (inner, h - 0.002)], segments=32, crease_deg=95)
    inside = lathe([(inner, h - 0.002), (inner, 0.012), (0.8 * inner, 0.006)], segments=32)
    bottom = lathe([(0.0, 0.001), (0.86 * r, 0.001), (0.86 * r, 0.0)], segments=32)
    level = h * float(rng.uniform(0.55, 0.85))
    drink = lathe([(inner, level), (0.0, level)], segments=32)
    drink_colour = ((58, 34, 20), (118, 78, 44), (96, 46, 18))[int(rng.integers(3))]
    pale = textures.plain(rng, _INSIDE[look], 16, 0.02)
    return (
        outside.surface(wrappers.glaze(rng, look)),
        merged(rim, inside, bottom).surface(pale),
        _handle(r).surface(textures.plain(rng, _HANDLE[look], 16, 0.03)),
        drink.surface(textures.plain(rng, drink_colour, 16, 0.05)),
    )


def _handle(radius_m: float) -> Mesh:
    """A bow like an ear, flatter than wide, that grows out of the wall."""
    out = (-0.003, 0.010, 0.021, 0.028, 0.031, 0.031, 0.028, 0.021, 0.010, -0.003)
    up = (0.0790, 0.0800, 0.0775, 0.0710, 0.0610, 0.0450, 0.0350, 0.0285, 0.0260, 0.0270)
    thick = (0.0058, 0.0050, 0.0046, 0.0045, 0.0045, 0.0045, 0.0045, 0.0046, 0.0050, 0.0058)
    bow = np.stack([radius_m + np.array(out), np.zeros(10), np.array(up)], axis=1)
    return tube(bow, thick, segments=10).bent(lambda p: p * np.array([1.0, 1.4, 1.0]))


def cup_body() -> Body:
    """A thin cylinder with a box for the handle."""
    middle = (0.0, 0.0, 0.46 * CUP_HEIGHT_M)
    wide = 2 * CUP_RADIUS_M
    return Body(
        mass_kg=CUP_MASS_KG,
        centre_of_mass_m=middle,
        inertia_kg_m2=tube_inertia(CUP_MASS_KG, CUP_RADIUS_M, CUP_HEIGHT_M),
        parts=(
            Part(kind="cylinder", centre_m=(0.0, 0.0, CUP_HEIGHT_M / 2), size_m=(wide, wide, CUP_HEIGHT_M)),
            Part(kind="box", centre_m=(CUP_RADIUS_M + 0.014, 0.0, 0.05), size_m=(0.036, 0.014, 0.06)),
        ),
        friction=CUP_FRICTION,
        rolling_m=0.001,
        restitution=0.15,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class BottleShape:
    """Sizes of a bottle, and what it weighs.

    Attributes:
        height_m, radius_m: of the whole.
        shoulder_m: height where the body ends.
        neck_radius_m, neck_m: radius of the neck, and the height where it begins.
        label_m: lower and upper edge of the label, None without one.
        mass_kg: full.
    """

    height_m: float
    radius_m: float
    shoulder_m: float
    neck_radius_m: float
    neck_m: float
    label_m: tuple[float, float] | None
    mass_kg: float


BOTTLES: dict[str, BottleShape] = {
    "water": BottleShape(
        height_m=0.222, radius_m=0.033, shoulder_m=0.145, neck_radius_m=0.0125, neck_m=0.196,
        label_m=(0.075, 0.135), mass_kg=0.53,
    ),
    "wine": BottleShape(
        height_m=0.3, radius_m=0.0375, shoulder_m=0.185, neck_radius_m=0.0142, neck_m=0.222,
        label_m=(0.05, 0.15), mass_kg=1.25,
    ),
    "flask": BottleShape(
        height_m=0.262, radius_m=0.0355, shoulder_m=0.195, neck_radius_m=0.022, neck_m=0.214,
        label_m=None, mass_kg=0.8,
    ),
}  # fmt: skip
"""A 0.5 l bottle of water, a 0.75 l bottle of wine, a 0.5 l steel flask: sizes and full masses as sold (assumed)."""
BOTTLE_FRICTION = 0.4
"""Plastic, glass and lacquer on wood and carpet (assumed)."""
BOTTLE_ROLLING_M = 0.0015
"""Arm of the rolling resistance on carpet (assumed)."""


def bottle(rng: np.random.Generator, look: str = "water") -> tuple[Surface, ...]:
    """A full bottle with a cap; not see-through: a depth camera sees its label and what is in it.

    Args:
        rng: of its label and its colours.
        look: one of BOTTLE_LOOKS.
    """
    shape = BOTTLES[look]
    r, n = shape.radius_m, shape.neck_radius_m
    cap_m = shape.height_m - (0.05 if look == "wine" else 0.02 if look == "water" else 0.045)
    foot = [(0.55 * r, 0.0), (0.9 * r, 0.0), (r, 0.006)]
    shoulder = [
        (r + (n - r) * (1 - np.cos(np.pi * t)) / 2, shape.shoulder_m + (shape.neck_m - shape.shoulder_m) * t)
        for t in np.linspace(0.0, 1.0, 7)
    ]
    body = _ribs(r, 0.012, shape.shoulder_m) if look == "water" else []
    profile = [(0.0, 0.004), *foot, *body, *shoulder, (n, cap_m)]
    wall = lathe([(float(a), float(b)) for a, b in profile], segments=28, crease_deg=60)
    colours: dict[str, Colour] = {"water": (128, 176, 204), "wine": (26, 40, 26), "flask": (44, 122, 104)}
    surfaces = [wall.surface(wrappers.glass(rng, colours[look]))]
    if shape.label_m is not None:
        low, high = shape.label_m
        label = lathe([(r + 0.0006, low), (r + 0.0006, high)], segments=28)
        surfaces.append(label.surface(wrappers.bottle_label(rng, look)))
    return (*surfaces, _cap(look, shape, cap_m).surface(textures.plain(rng, _cap_colour(rng, look), 16, 0.04)))


def _ribs(radius_m: float, low_m: float, high_m: float) -> list[tuple[float, float]]:
    """The profile of a thin-walled body with grooves below its label."""
    points = []
    for k in range(4):
        z = low_m + k * 0.014
        points += [(radius_m, z), (radius_m, z + 0.008), (radius_m - 0.0016, z + 0.011)]
    return [*points, (radius_m, low_m + 0.06), (radius_m, high_m - 0.004)]


def _cap(look: str, shape: BottleShape, cap_m: float) -> Mesh:
    """The screw cap of a water bottle, the capsule of a wine bottle, the lid of a flask."""
    top, n = shape.height_m, shape.neck_radius_m
    if look == "wine":
        profile = [(n, cap_m), (n + 0.0006, cap_m), (n + 0.0006, top - 0.018), (n + 0.0022, top - 0.016),
                   (n + 0.0022, top - 0.004), (n + 0.001, top), (0.0, top)]  # fmt: skip
    elif look == "water":
        profile = [(n, cap_m), (n + 0.005, cap_m), (n + 0.005, cap_m + 0.002), (n + 0.0028, cap_m + 0.003),
                   (n + 0.0028, top - 0.001), (n + 0.0018, top), (0.0, top)]  # fmt: skip
    else:
        profile = [(n, cap_m), (n + 0.006, cap_m), (n + 0.007, cap_m + 0.003), (n + 0.006, top - 0.006),
                   (n + 0.002, top), (0.0, top)]  # fmt: skip
    return lathe(profile, segments=24, crease_deg=50)


def _cap_colour(rng: np.random.Generator, look: str) -> Colour:
    if look == "water":
        return ((28, 92, 178), (232, 236, 240), (36, 128, 92))[int(rng.integers(3))]
    return (116, 22, 34) if look == "wine" else (46, 46, 50)


def bottle_body(look: str) -> Body:
    """A full bottle as two cylinders."""
    shape = BOTTLES[look]
    wide, slim = 2 * shape.radius_m, 2 * (shape.neck_radius_m + 0.003)
    middle = (shape.shoulder_m + shape.neck_m) / 2
    waist = (shape.shoulder_m + middle) / 2
    return Body(
        mass_kg=shape.mass_kg,
        centre_of_mass_m=(0.0, 0.0, 0.52 * shape.neck_m),
        inertia_kg_m2=cylinder_inertia(shape.mass_kg, shape.radius_m, shape.neck_m),
        parts=(
            Part(kind="cylinder", centre_m=(0.0, 0.0, waist / 2), size_m=(wide, wide, waist)),
            Part(
                kind="cylinder",
                centre_m=(0.0, 0.0, (waist + shape.height_m) / 2),
                size_m=(slim, slim, shape.height_m - waist),
            ),
        ),
        friction=BOTTLE_FRICTION,
        rolling_m=BOTTLE_ROLLING_M,
        restitution=0.3,
    )
