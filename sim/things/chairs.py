"""Chairs: the office chair on casters, and a plain one with four legs. Who sits on them faces -y."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sim.geometry import FloatArray, rotation_z
from sim.physics.bodies import Body, Part, Top
from sim.randomness import child
from sim.scene import Surface
from sim.things.meshes import Mesh, box, lathe, merged, rounded_box, tube
from sim.things.textures import Colour, Image, cloth, plain, wood

CHAIR_COLOURS: dict[str, Colour] = {
    "blue": (46, 74, 142),
    "black": (48, 48, 54),
    "red": (146, 44, 44),
    "green": (50, 104, 66),
    "grey": (112, 114, 118),
}
CASTER_CIRCLE_M = 0.27
"""Distance of the casters from the chair's axis."""
CASTERS = 5
CASTER_TRAIL_M = 0.022
"""A caster's wheels run this far behind its pin."""
SEAT_HEIGHT_M = 0.47
"""Top of the seat."""
SEAT_EXTENT_M = (0.48, 0.46)
"""Width and depth of the seat."""
BACK_TOP_M = 1.02
"""Upper edge of the back."""
BASE_BONE, TOP_BONE, FIRST_CASTER_BONE = 0, 1, 2
"""Bones of a jointed chair: the star, what turns on it, and each caster."""

BASE_MASS_KG, TOP_MASS_KG = 5.0, 7.0
"""Star with gas lift, and seat with back: 12 kg, in the middle of what makers state for task chairs (assumed)."""
BASE_INERTIA_KG_M2 = 0.2
TOP_INERTIA_KG_M2 = 0.35
"""About the axis, from the shape: 4 kg at 0.14 m and 3 kg at 0.3 m."""
BEARING_N_M = 0.35
"""Dry friction of the swivel (assumed): a seat set going at one turn a second comes to rest after three turns."""
CASTER_FRICTION = 0.045
"""Rolling resistance of casters on carpet (assumed): a deceleration of 0.44 m/s²."""
UPHOLSTERY_FRICTION = 0.4
VISITOR_MASS_KG, VISITOR_FRICTION = 6.0, 0.35
"""A chair of steel tube; plastic feet on carpet (assumed)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChairLook:
    """A variant.

    Attributes:
        colour: of the cloth, a key of CHAIR_COLOURS.
        arms: whether it has arm rests.
        is_visitor: four legs in place of the star.
    """

    colour: str
    arms: bool = True
    is_visitor: bool = False


CHAIR_LOOKS: dict[str, ChairLook] = {
    **{colour: ChairLook(colour=colour) for colour in CHAIR_COLOURS},
    **{f"{colour}_armless": ChairLook(colour=colour, arms=False) for colour in CHAIR_COLOURS},
    **{f"{colour}_visitor": ChairLook(colour=colour, arms=False, is_visitor=True) for colour in CHAIR_COLOURS},
}


def office_chair_surfaces(
    seed: int, colour: str = "blue", *, arms: bool = True, jointed: bool = False
) -> tuple[Surface, ...]:
    """An office chair; its axis is the z axis.

    Args:
        seed: of its cloth.
        colour: of the cloth, one of `CHAIR_COLOURS`.
        arms: whether it has arm rests.
        jointed: with the bones that `sim.things.chair_motion` moves, else rigid.

    Raises:
        ValueError: unknown colour.
    """
    if colour not in CHAIR_COLOURS:
        raise ValueError(f"chair colour {colour!r}: expected one of {', '.join(CHAIR_COLOURS)}")
    rng = child(seed, "chair", colour)
    turns = None if jointed else caster_start_rad(seed, colour)
    arm_rests = [_arm(-1.0), _arm(1.0)] if arms else []
    black = [(BASE_BONE, _star()), (TOP_BONE, merged(_frame(), *arm_rests))]
    for number in range(CASTERS):
        caster = _caster()
        if turns is not None:
            caster = caster.moved(rotation=rotation_z(float(turns[number])))
        black.append((FIRST_CASTER_BONE + number, caster.moved(caster_place(number))))
    return (
        _surface([(TOP_BONE, merged(_seat(), _back()))], cloth(rng, CHAIR_COLOURS[colour]), jointed=jointed),
        _surface(black, plain(rng, (42, 42, 46), 64, 0.06), jointed=jointed),
        _surface([(BASE_BONE, _lift())], plain(rng, (150, 152, 156), 32, 0.04), jointed=jointed),
    )


def caster_place(number: int) -> FloatArray:
    """(3,) foot of a caster's pin, in the chair's frame; one leg of the star points to the back."""
    angle = math.pi / 2 + 2 * math.pi * number / CASTERS
    return np.array([CASTER_CIRCLE_M * math.cos(angle), CASTER_CIRCLE_M * math.sin(angle), 0.0])


def caster_start_rad(seed: int, colour: str) -> FloatArray:
    """(5,) how the casters stand at first, relative to the star: as they came to rest."""
    return child(seed, "chair", colour, "casters").uniform(0.0, 2 * np.pi, CASTERS)


def _surface(parts: list[tuple[int, Mesh]], texture: Image, *, jointed: bool) -> Surface:
    """Meshes of one material as a surface, each on its bone when jointed."""
    surface = merged(*(mesh for _, mesh in parts)).surface(texture)
    if not jointed:
        return surface
    bones: npt.NDArray[np.int32] = np.zeros((len(surface.vertices), 4), np.int32)
    bones[:, 0] = np.repeat([bone for bone, _ in parts], [len(mesh.vertices) for _, mesh in parts])
    weights = np.zeros((len(bones), 4), np.float32)
    weights[:, 0] = 1.0
    return Surface(
        vertices=surface.vertices,
        normals=surface.normals,
        uv=surface.uv,
        faces=surface.faces,
        texture=texture,
        bones=bones,
        weights=weights,
    )


def _star() -> Mesh:
    """Hub and five legs, each with the pin of a caster."""
    parts = [lathe([(0, 0.075), (0.05, 0.075), (0.045, 0.12), (0.032, 0.15), (0, 0.15)], segments=16)]
    for number in range(CASTERS):
        foot = caster_place(number)
        turn = rotation_z(math.pi / 2 + 2 * math.pi * number / CASTERS)
        spine = [[0.035, 0.0, 0.115], [0.16, 0.0, 0.102], [CASTER_CIRCLE_M + 0.01, 0.0, 0.076]]
        leg = tube(np.array(spine), [0.024, 0.021, 0.015], segments=8)
        parts.append(leg.bent(lambda p: p * np.array([1.0, 1.25, 1.0])).moved(rotation=turn))
        parts.append(tube([[0, 0, 0.05], [0, 0, 0.08]], 0.009, segments=6).moved(foot))
    return merged(*parts)


def _caster() -> Mesh:
    """A hooded caster with twin wheels that trail along +x."""
    wheel = lathe(
        [(0, -0.009), (0.022, -0.009), (0.027, -0.005), (0.027, 0.005), (0.022, 0.009), (0, 0.009)],
        segments=12,
        crease_deg=50,
    )
    across = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # the wheel's axis along y
    hood = rounded_box((0.012, 0.0, 0.047), (0.05, 0.02, 0.018), 0.008, segments=1)
    wheels = [wheel.moved(rotation=across).moved([CASTER_TRAIL_M, side, 0.027]) for side in (-0.015, 0.015)]
    return merged(hood, *wheels)


def _lift() -> Mesh:
    """The gas spring, in two stages."""
    return lathe(
        [(0, 0.14), (0.026, 0.14), (0.026, 0.29), (0.015, 0.295), (0.015, 0.39), (0, 0.39)],
        segments=14,
    )


def _frame() -> Mesh:
    """The mechanism below the seat with its lever, and the bar that carries the back."""
    bar = [[0, 0.05, 0.385], [0, 0.2, 0.375], [0, 0.27, 0.42], [0, 0.285, 0.56], [0, 0.275, 0.74]]
    return merged(
        rounded_box((0, 0.01, 0.385), (0.2, 0.24, 0.035), 0.012, segments=2),
        box((0, 0, 0.405), (0.36, 0.34, 0.012)),
        tube(bar, 0.02, segments=8).bent(lambda p: p * np.array([1.7, 1.0, 1.0])),
        tube([[0.08, -0.02, 0.385], [0.25, -0.03, 0.38]], 0.007, segments=6),
        rounded_box((0.245, -0.03, 0.378), (0.05, 0.022, 0.012), 0.005, segments=1),
        _back_shell(),
    )


def _seat() -> Mesh:
    """A cushion with a hollow for the sitter and a front edge that falls off."""
    width, depth = SEAT_EXTENT_M
    cushion = rounded_box((0, 0, 0), (width, depth, 0.075), 0.036, segments=3, spans=5, texture_m=0.5)

    def hollow(p: FloatArray) -> FloatArray:
        x, y, z = p.T
        sink = 0.014 * np.clip(1 - (x / 0.2) ** 2, 0, 1) * np.clip(1 - (y / 0.2) ** 2, 0, 1) * (z > 0)
        fall = 0.4 * np.clip(-y - 0.11, 0, None) ** 2 / 0.1
        rounding = 1 - 0.12 * np.clip(-y / depth, 0, 1) ** 2
        return np.stack([x * rounding, y, z - sink - fall], axis=1)

    return cushion.bent(hollow).moved([0, 0, SEAT_HEIGHT_M - 0.0375])


def _curved_back(p: FloatArray) -> FloatArray:
    """Hollow from side to side, convex at the small of the back, narrower and further back at the top."""
    height = BACK_TOP_M - 0.56
    x, y, z = p.T
    wrap = -0.9 * x**2
    lumbar = -0.022 * np.clip(1 - ((z + 0.08) / 0.17) ** 2, 0, 1)
    lean = 0.16 * (z + height / 2)
    narrowing = 1 - 0.14 * np.clip(z / height + 0.1, 0, 1)
    return np.stack([x * narrowing, y + wrap + lumbar + lean, z], axis=1)


def _back() -> Mesh:
    """The cushion of the back."""
    height = BACK_TOP_M - 0.56
    cushion = rounded_box((0, 0, 0), (0.45, 0.06, height), 0.029, segments=3, spans=5, texture_m=0.5)
    return cushion.bent(_curved_back).moved([0, 0.235, 0.56 + height / 2])


def _back_shell() -> Mesh:
    """The plastic shell behind the cushion."""
    height = BACK_TOP_M - 0.56
    shell = rounded_box((0, 0.03, 0), (0.4, 0.02, 0.86 * height), 0.009, segments=1, spans=5)
    return shell.bent(_curved_back).moved([0, 0.237, 0.56 + height / 2])


def _arm(side: float) -> Mesh:
    """An arm rest on a bow from below the seat; `side` is -1 or 1."""
    x = side * 0.275
    bow = [[side * 0.17, 0.0, 0.4], [x, 0.0, 0.41], [x, 0.0, 0.5], [x, 0.01, 0.635]]
    pad = rounded_box((x, -0.01, 0.65), (0.06, 0.26, 0.032), 0.014, segments=2)
    return merged(tube(bow, 0.016, segments=8), pad)


def office_chair_body() -> Body:
    """Casters that glide with the resistance of rolling ones, and a top that turns. It does not tip."""
    rim = CASTER_CIRCLE_M + 0.03
    casters = []
    for number in range(CASTERS):
        x, y, _ = caster_place(number).tolist()
        casters.append(Part(kind="sphere", centre_m=(x, y, 0.03), size_m=(0.06, 0.06, 0.06)))
    width, depth = SEAT_EXTENT_M
    back = BACK_TOP_M - 0.56
    return Body(
        mass_kg=BASE_MASS_KG,
        centre_of_mass_m=(0.0, 0.0, 0.12),
        inertia_kg_m2=(BASE_INERTIA_KG_M2, BASE_INERTIA_KG_M2, BASE_INERTIA_KG_M2),
        parts=(
            *casters,
            Part(kind="cylinder", centre_m=(0.0, 0.0, 0.075), size_m=(2 * rim, 2 * rim, 0.03)),
            Part(kind="cylinder", centre_m=(0.0, 0.0, 0.23), size_m=(0.052, 0.052, 0.3)),
        ),
        friction=CASTER_FRICTION,
        restitution=0.05,
        upright=True,
        top=Top(
            mass_kg=TOP_MASS_KG,
            centre_of_mass_m=0.6,
            inertia_kg_m2=TOP_INERTIA_KG_M2,
            bearing_n_m=BEARING_N_M,
            parts=(
                Part(kind="box", centre_m=(0.0, 0.0, SEAT_HEIGHT_M - 0.04), size_m=(width, depth, 0.08)),
                Part(kind="box", centre_m=(0.0, 0.26, 0.56 + back / 2), size_m=(0.44, 0.1, back)),
            ),
            friction=UPHOLSTERY_FRICTION,
        ),
    )


def visitor_chair_surfaces(seed: int, colour: str = "grey") -> tuple[Surface, ...]:
    """A chair with four legs of steel tube, a cushioned seat and a wooden back.

    Args:
        seed: of its cloth and its wood.
        colour: of the cloth, one of `CHAIR_COLOURS`.
    """
    rng = child(seed, "visitor chair", colour)
    tubes, feet = [], []
    for side in (-1.0, 1.0):
        x = side * 0.2
        tubes.append(tube([[x, -0.2, 0.44], [1.08 * x, -0.23, 0.012]], 0.012, segments=10))
        spine = [[1.08 * x, 0.27, 0.012], [x, 0.21, 0.42], [x, 0.215, 0.52], [0.98 * x, 0.29, 0.84]]
        tubes.append(tube(spine, 0.012, segments=10))
        tubes.append(tube([[x, -0.2, 0.43], [x, 0.212, 0.43]], 0.011, segments=8))
        feet += [tube([[1.08 * x, y, 0.0], [1.08 * x, y, 0.025]], 0.015, segments=10) for y in (-0.23, 0.27)]
    tubes += [tube([[-0.2, y, 0.43], [0.2, y, 0.43]], 0.011, segments=8) for y in (-0.19, 0.2)]
    seat = rounded_box((0, 0, 0.45), (0.45, 0.43, 0.05), 0.022, segments=3, spans=3, texture_m=0.5)
    back = rounded_box((0, 0.0, 0.72), (0.43, 0.02, 0.22), 0.009, segments=2, spans=5, texture_m=0.9)
    back = back.bent(
        lambda p: p + np.stack([0 * p[:, 0], 0.245 + 0.23 * (p[:, 2] - 0.7) - 0.5 * p[:, 0] ** 2, 0 * p[:, 0]], 1)
    )
    return (
        seat.surface(cloth(rng, CHAIR_COLOURS[colour])),
        back.surface(wood(rng, 128)),
        merged(*tubes).surface(plain(rng, (158, 160, 164), 32, 0.05)),
        merged(*feet).surface(plain(rng, (36, 36, 38), 16)),
    )


def visitor_chair_body() -> Body:
    """Four feet that slide, a seat and a back. It does not tip."""
    legs = [
        Part(kind="cylinder", centre_m=(x, y, 0.22), size_m=(0.03, 0.03, 0.44))
        for x in (-0.21, 0.21)
        for y in (-0.22, 0.26)
    ]
    return Body(
        mass_kg=VISITOR_MASS_KG,
        centre_of_mass_m=(0.0, 0.0, 0.42),
        inertia_kg_m2=(0.5, 0.5, 0.3),
        parts=(
            *legs,
            Part(kind="box", centre_m=(0.0, 0.0, 0.45), size_m=(0.45, 0.43, 0.05)),
            Part(kind="box", centre_m=(0.0, 0.25, 0.7), size_m=(0.43, 0.08, 0.26)),
        ),
        friction=VISITOR_FRICTION,
        restitution=0.05,
        upright=True,
    )
