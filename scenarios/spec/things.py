"""The things that can move: chairs, boxes, cups and bottles."""

from typing import Literal

from scenarios.spec.base import Metres3, NotNegative, Positive, Spec


class ImpulseSpec(Spec):
    """What hits a thing.

    Attributes:
        time_s: when.
        impulse_n_s: in the world, newton seconds.
        height_m: of the point that is hit, above the foot of the thing; along its axis when it has fallen over.
        offset_m: how far that point lies to the left of the middle, seen along the impulse; turns the thing.
    """

    time_s: NotNegative
    impulse_n_s: Metres3
    height_m: NotNegative = 0.45
    offset_m: float = 0.0


class ThingSpec(Spec):
    """A thing that can move.

    Attributes:
        name: unique in the scene.
        kind: "box" is the one that is of no COCO class: the out-of-class mover.
        look: a colour or another variant that `kind` comes in, see docs/things.md; "default" is the first of them.
        position_m: of its foot in the world; z is the height of what it stands on.
        heading_deg: where its front faces; 0 is along +x.
        size_m: full extents of a box; other kinds have their own.
        impulses: what hits it.
    """

    name: str
    kind: Literal["chair", "box", "cup", "bottle"]
    look: str = "default"
    position_m: Metres3
    heading_deg: float = 0.0
    size_m: tuple[Positive, Positive, Positive] | None = None
    impulses: tuple[ImpulseSpec, ...] = ()
