"""What the segmenter gets wrong. Every fault is off by default; docs/faults.md shows them."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from scenarios.spec.base import Spec

Probability = Annotated[float, Field(ge=0, le=1)]

LEAST_GAP_FRAMES = 1.25
"""Mean length of the gaps between two bursts of misses, at least."""


class MissedSpec(Spec):
    """An instance is not found, independently in every frame, with `probability`."""

    probability: Probability = 0.0


class MissedBurstsSpec(Spec):
    """An instance is not found for some frames in a row: a Markov chain of two states for each instance.

    Attributes:
        share: of the frames in which it is not found; 0 is off.
        mean_frames: mean length of a burst.
    """

    share: Annotated[float, Field(ge=0, lt=1)] = 0.0
    mean_frames: Annotated[float, Field(ge=1, le=300)] = 10.0

    @model_validator(mode="after")
    def _possible(self) -> Self:
        """Short bursts cannot fill any share: the gaps between them last for LEAST_GAP_FRAMES on average."""
        most = self.mean_frames / (self.mean_frames + LEAST_GAP_FRAMES)
        if self.share > most:
            raise ValueError(
                f"bursts of {self.mean_frames:g} frames can take {most:.3g} of all frames at most; "
                f"make share smaller or mean_frames larger"
            )
        return self


class FalsePositivesSpec(Spec):
    """Something is found where nothing is: a blob of a known class on what stands still, fixed to a point of the world.

    Attributes:
        per_frame: mean number in a frame, before those that leave the view or are hidden; 0 is off.
        frames: how long each of them stays.
    """

    per_frame: Annotated[float, Field(ge=0, le=20)] = 0.0
    frames: Annotated[int, Field(ge=1, le=10)] = 8


class LateSpec(Spec):
    """The answer for a frame is that of `frames` frames before; at the beginning there is none."""

    frames: Annotated[int, Field(ge=0, le=10)] = 0


class BordersSpec(Spec):
    """Masks are grown (positive) or shrunk (negative) by `pixels`; one of which nothing is left is not reported."""

    pixels: Annotated[int, Field(ge=-50, le=50)] = 0


class SplitSpec(Spec):
    """One instance becomes two detections with `probability`: its mask is cut across its longer side."""

    probability: Probability = 0.0


class MergedSpec(Spec):
    """Two instances of one class whose boxes touch or overlap become one detection with `probability`."""

    probability: Probability = 0.0


class ClassFlipsSpec(Spec):
    """An instance is given one of the other three class names with `probability`."""

    probability: Probability = 0.0


class TiltedSpec(Spec):
    """People are not found while the camera is rolled by more than `beyond_deg` against upright; 180 is off."""

    beyond_deg: Annotated[float, Field(ge=0, le=180)] = 180.0


class LimitSpec(Spec):
    """At most `most` detections, those with the largest masks; null is no limit."""

    most: Annotated[int, Field(ge=1)] | None = None


class ScoresSpec(Spec):
    """Scores are drawn evenly from `lowest` to `highest`; a method drops those below its own threshold."""

    lowest: Probability = 1.0
    highest: Probability = 1.0

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.lowest > self.highest:
            raise ValueError(f"lowest {self.lowest:g} is above highest {self.highest:g}")
        return self


class OrderSpec(Spec):
    """Whether the detections of every frame come in another order, drawn at random."""

    is_shuffled: bool = False


class FaultsSpec(Spec):
    """The faults of the segmenter; with the defaults it makes none.

    They act in the order in which they stand here, but for `late`, which comes last: a late answer has the faults of
    the frame that it was made for.
    """

    tilted: TiltedSpec = TiltedSpec()
    missed: MissedSpec = MissedSpec()
    missed_bursts: MissedBurstsSpec = MissedBurstsSpec()
    borders: BordersSpec = BordersSpec()
    merged: MergedSpec = MergedSpec()
    split: SplitSpec = SplitSpec()
    class_flips: ClassFlipsSpec = ClassFlipsSpec()
    false_positives: FalsePositivesSpec = FalsePositivesSpec()
    limit: LimitSpec = LimitSpec()
    scores: ScoresSpec = ScoresSpec()
    order: OrderSpec = OrderSpec()
    late: LateSpec = LateSpec()
