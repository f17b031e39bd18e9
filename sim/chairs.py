"""The office chair: five-star base on casters, gas lift, cushions and arms."""

import numpy as np

from sim.geometry import FloatArray, rotation_z
from sim.meshes import Mesh, box, lathe, merged, rounded_box, tube
from sim.randomness import child
from sim.scene import Surface
from sim.textures import Colour, cloth, plain

CHAIR_COLOURS: dict[str, Colour] = {
    "blue": (46, 74, 142),
    "black": (48, 48, 54),
    "red": (146, 44, 44),
    "green": (50, 104, 66),
}
CASTER_CIRCLE_M = 0.27
"""Distance of the casters from the chair's axis."""
SEAT_HEIGHT_M = 0.47
"""Top of the seat."""
SEAT_EXTENT_M = (0.48, 0.46)
"""Width and depth of the seat."""
BACK_TOP_M = 1.02
"""Upper edge of the back."""


def office_chair_surfaces(seed: int, colour: str = "blue", *, arms: bool = True) -> tuple[Surface, ...]:
    """An office chair; its axis is the z axis, and who sits on it faces -y.

    Args:
        seed: of its cloth and of small differences between chairs.
        colour: of the cloth, one of `CHAIR_COLOURS`.
        arms: whether it has arm rests.

    Raises:
        ValueError: unknown colour.
    """
    if colour not in CHAIR_COLOURS:
        raise ValueError(f"chair colour {colour!r}: expected one of {', '.join(CHAIR_COLOURS)}")
    rng = child(seed, "chair", colour)
    star_rad = float(rng.uniform(0.0, 2 * np.pi / 5))
    caster_rad = rng.uniform(0.0, 2 * np.pi, 5)
    plastic = [_base(star_rad, caster_rad), _frame()]
    if arms:
        plastic += [_arm(-1.0), _arm(1.0)]
    return (
        merged(_seat(), _back()).surface(cloth(rng, CHAIR_COLOURS[colour])),
        merged(*plastic).surface(plain(rng, (42, 42, 46), 64, 0.06)),
        _lift().surface(plain(rng, (150, 152, 156), 32, 0.04)),
    )


def _base(star_rad: float, caster_rad: FloatArray) -> Mesh:
    """Hub, five legs and their twin-wheel casters that stand as they came to rest."""
    parts = [lathe([(0, 0.075), (0.05, 0.075), (0.045, 0.12), (0.032, 0.15), (0, 0.15)], segments=16)]
    wheel = lathe(
        [(0, -0.009), (0.022, -0.009), (0.027, -0.005), (0.027, 0.005), (0.022, 0.009), (0, 0.009)],
        segments=12,
        crease_deg=50,
    )
    on_side = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # the wheel's axis along x
    for leg in range(5):
        turn = rotation_z(star_rad + leg * 2 * np.pi / 5)
        spine = [[0.035, 0.0, 0.115], [0.16, 0.0, 0.102], [CASTER_CIRCLE_M, 0.0, 0.078]]
        parts.append(tube(np.array(spine) @ turn.T, [0.024, 0.021, 0.015], segments=8))
        foot = turn @ np.array([CASTER_CIRCLE_M, 0.0, 0.0])
        parts.append(tube([[0, 0, 0.036], [0, 0, 0.08]], 0.009, segments=6).moved(foot))
        parts.append(rounded_box((0, 0, 0.046), (0.03, 0.03, 0.016), 0.007, segments=1).moved(foot))
        swivel = rotation_z(float(caster_rad[leg]))
        for side in (-0.014, 0.014):
            parts.append(wheel.moved(rotation=on_side).moved([side, 0.0, 0.027]).moved(foot, swivel))
    return merged(*parts)


def _lift() -> Mesh:
    """The gas spring, in two stages."""
    return lathe(
        [(0, 0.14), (0.026, 0.14), (0.026, 0.29), (0.015, 0.295), (0.015, 0.39), (0, 0.39)],
        segments=14,
    )


def _frame() -> Mesh:
    """The mechanism below the seat and the bar that carries the back."""
    bar = [[0, 0.05, 0.385], [0, 0.2, 0.375], [0, 0.27, 0.42], [0, 0.285, 0.56], [0, 0.275, 0.74]]
    return merged(
        rounded_box((0, 0.01, 0.385), (0.2, 0.24, 0.035), 0.012, segments=2),
        box((0, 0, 0.405), (0.36, 0.34, 0.012)),
        tube(bar, 0.02, segments=8),
        tube([[0.08, -0.02, 0.385], [0.25, -0.03, 0.38]], 0.007, segments=6),
    )


def _seat() -> Mesh:
    """A cushion with a hollow for the sitter and a front edge that falls off."""
    width, depth = SEAT_EXTENT_M
    cushion = rounded_box((0, 0, 0), (width, depth, 0.075), 0.036, segments=3, spans=5, texture_m=0.5)

    def hollow(p: FloatArray) -> FloatArray:
        x, y, z = p.T
        sink = 0.014 * np.clip(1 - (x / 0.2) ** 2, 0, 1) * np.clip(1 - (y / 0.2) ** 2, 0, 1) * (z > 0)
        fall = 0.9 * np.clip(-y - 0.13, 0, None) ** 2 / 0.1
        rounding = 1 - 0.12 * np.clip(-y / depth, 0, 1) ** 2
        return np.stack([x * rounding, y, z - sink - fall], axis=1)

    return cushion.bent(hollow).moved([0, 0, SEAT_HEIGHT_M - 0.0375])


def _back() -> Mesh:
    """A cushion, hollow from side to side and convex at the small of the back."""
    height = BACK_TOP_M - 0.56
    cushion = rounded_box((0, 0, 0), (0.45, 0.06, height), 0.029, segments=3, spans=5, texture_m=0.5)

    def curved(p: FloatArray) -> FloatArray:
        x, y, z = p.T
        wrap = -0.9 * x**2
        lumbar = -0.022 * np.clip(1 - ((z + 0.08) / 0.17) ** 2, 0, 1)
        lean = 0.16 * (z + height / 2)
        narrowing = 1 - 0.14 * np.clip(z / height + 0.1, 0, 1)
        return np.stack([x * narrowing, y + wrap + lumbar + lean, z], axis=1)

    return cushion.bent(curved).moved([0, 0.235, 0.56 + height / 2])


def _arm(side: float) -> Mesh:
    """An arm rest on a bow from below the seat; `side` is -1 or 1."""
    x = side * 0.275
    bow = [[side * 0.17, 0.0, 0.4], [x, 0.0, 0.41], [x, 0.0, 0.5], [x, 0.01, 0.635]]
    pad = rounded_box((x, -0.01, 0.65), (0.06, 0.26, 0.032), 0.014, segments=2)
    return merged(tube(bow, 0.016, segments=8), pad)
