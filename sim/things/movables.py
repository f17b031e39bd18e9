"""The things that can move: what each looks like, weighs, and rubs, by kind and look."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from sim.geometry import FloatArray
from sim.physics.bake import Baked
from sim.physics.bodies import Body, Vector
from sim.randomness import child
from sim.scene import Motion, Surface
from sim.things import boxes, chairs, vessels
from sim.things.chair_motion import chair_motion


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Movable:
    """A thing that can move.

    Attributes:
        surfaces: its parts; rest frame: origin at its foot, z up, front towards -y.
        body: as physics sees it.
        casters_rad: (5,) how the casters of an office chair stand at first; None of all other things.
    """

    surfaces: tuple[Surface, ...]
    body: Body
    casters_rad: FloatArray | None = None

    def motion(self, baked: Baked) -> Motion:
        """The motion of the thing's surfaces when physics moved its body like this."""
        if self.casters_rad is None or baked.top is None:
            return baked.base
        return chair_motion(baked.base, baked.top, self.casters_rad)


Maker = Callable[[int, str, Vector | None], Movable]


def _chair(seed: int, look: str, size_m: Vector | None) -> Movable:
    chair = chairs.CHAIR_LOOKS[look]
    if chair.is_visitor:
        return Movable(surfaces=chairs.visitor_chair_surfaces(seed, chair.colour), body=chairs.visitor_chair_body())
    surfaces = chairs.office_chair_surfaces(seed, chair.colour, arms=chair.arms, jointed=True)
    casters_rad = chairs.caster_start_rad(seed, chair.colour)
    return Movable(surfaces=surfaces, body=chairs.office_chair_body(), casters_rad=casters_rad)


def _cup(seed: int, look: str, size_m: Vector | None) -> Movable:
    return Movable(surfaces=vessels.cup(child(seed, "cup", look), look), body=vessels.cup_body())


def _bottle(seed: int, look: str, size_m: Vector | None) -> Movable:
    return Movable(surfaces=vessels.bottle(child(seed, "bottle", look), look), body=vessels.bottle_body(look))


def _box(seed: int, look: str, size_m: Vector | None) -> Movable:
    size = boxes.DEFAULT_SIZE_M if size_m is None else size_m
    return Movable(surfaces=boxes.carton(child(seed, "box", look), size, look), body=boxes.carton_body(size))


KINDS: Mapping[str, tuple[Maker, tuple[str, ...]]] = MappingProxyType(
    {
        "chair": (_chair, tuple(chairs.CHAIR_LOOKS)),
        "cup": (_cup, vessels.CUP_LOOKS),
        "bottle": (_bottle, vessels.BOTTLE_LOOKS),
        "box": (_box, boxes.BOX_LOOKS),
    }
)
"""By kind: what makes it, and the looks that it comes in; the first is the default."""


def movable(kind: str, look: str, seed: int, size_m: Vector | None = None) -> Movable:
    """A thing that can move.

    Args:
        kind: a key of KINDS.
        look: one of the kind's looks, or "default".
        seed: of its small differences.
        size_m: full extents of a box.

    Raises:
        KeyError: no such kind or look.
    """
    maker, looks = KINDS[kind]
    if look == "default":
        look = looks[0]
    if look not in looks:
        raise KeyError(look)
    return maker(seed, look, size_m)
