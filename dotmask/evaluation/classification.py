"""Judges the moving object classification: how often it is right, by class, and what its speeds could give at best."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dotmask.records import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassificationRecord:
    """One object in one frame.

    Attributes:
        frame: number of the frame.
        instance_id: the true instance.
        class_name: its true class.
        is_moving: the truth.
        true_speed_m_s: of its centre.
        is_flagged: the answer.
        speed_m_s: that its track was given; None: it has no track.
    """

    frame: int
    instance_id: int
    class_name: str
    is_moving: bool
    true_speed_m_s: float
    is_flagged: bool
    speed_m_s: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Confusion:
    """How often an object in a frame was what, and called what; positive = moving.

    Attributes:
        true_positive: moves and is flagged.
        false_positive: rests and is flagged.
        false_negative: moves and is not flagged.
        true_negative: rests and is not flagged.
    """

    true_positive: int = 0
    false_positive: int = 0
    false_negative: int = 0
    true_negative: int = 0

    @property
    def precision(self) -> float | None:
        """Share of flagged objects that move; None where none is flagged."""
        return _share(self.true_positive, self.false_positive)

    @property
    def recall(self) -> float | None:
        """Share of moving objects that are flagged; None where none moves."""
        return _share(self.true_positive, self.false_negative)

    @property
    def idle_flag_rate(self) -> float | None:
        """Share of resting objects that are flagged; None where none rests."""
        return _share(self.false_positive, self.true_negative)


def confusion(records: Iterable[ClassificationRecord]) -> Confusion:
    """Counts of all records."""
    answers = [(record.is_moving, record.is_flagged) for record in records]
    return Confusion(
        true_positive=answers.count((True, True)),
        false_positive=answers.count((False, True)),
        false_negative=answers.count((True, False)),
        true_negative=answers.count((False, False)),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Roc:
    """What every threshold on a score would give (receiver operating characteristic).

    Attributes:
        thresholds: (T,) descending: an object is called moving if its score is at least so high. The first is infinite.
        true_positive_rate: (T,) share of the moving objects that are called moving.
        false_positive_rate: (T,) share of the resting objects that are called moving.
    """

    thresholds: FloatArray
    true_positive_rate: FloatArray
    false_positive_rate: FloatArray

    @property
    def auc(self) -> float:
        """Area under the curve: the probability that a mover's score is above a resting object's (ties count half)."""
        return float(np.trapezoid(self.true_positive_rate, self.false_positive_rate))


def roc(scores: FloatArray, is_moving: npt.NDArray[np.bool_]) -> Roc | None:
    """The ROC curve of scores; None unless something moves and something rests.

    Args:
        scores: (N,) for example speeds.
        is_moving: (N,) the truth.
    """
    moving, resting = np.sort(scores[is_moving]), np.sort(scores[~is_moving])
    if not len(moving) or not len(resting):
        return None
    thresholds = np.concatenate([[np.inf], np.unique(scores)[::-1]])
    return Roc(
        thresholds=thresholds,
        true_positive_rate=1.0 - np.searchsorted(moving, thresholds) / len(moving),
        false_positive_rate=1.0 - np.searchsorted(resting, thresholds) / len(resting),
    )


def _share(part: int, rest: int) -> float | None:
    return part / (part + rest) if part + rest else None
