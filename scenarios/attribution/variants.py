"""The stages that can be replaced by the truth, and the variants of the method that follow."""

from dataclasses import dataclass
from typing import Literal, get_args

Stage = Literal["masks", "depth", "pose", "association", "moc"]
"""`masks`: what the segmenter finds. `depth`: what the front end measures. `pose`: the camera pose that the tracker is
given. `association`: which observation belongs to which track. `moc`: which tracks move."""

STAGES: tuple[Stage, ...] = get_args(Stage)


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """The method with some of its stages true.

    Attributes:
        name: as in tables and files.
        true_stages: those that are replaced by the truth.
    """

    name: str
    true_stages: frozenset[Stage]


BASELINE = Variant(name="baseline", true_stages=frozenset())
ALL_TRUE = Variant(name="all_true", true_stages=frozenset(STAGES))


def only(stage: Stage) -> Variant:
    """The variant in which `stage` alone is true."""
    return Variant(name=f"true_{stage}", true_stages=frozenset({stage}))


def all_but(stage: Stage) -> Variant:
    """The variant in which `stage` alone is the method's own."""
    return Variant(name=f"all_true_but_{stage}", true_stages=frozenset(STAGES) - {stage})


VARIANTS: tuple[Variant, ...] = (BASELINE, *map(only, STAGES), *map(all_but, STAGES), ALL_TRUE)
