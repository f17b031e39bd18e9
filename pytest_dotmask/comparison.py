"""Whether figures got worse: paired bootstrap over the seeds, for all figures of a session together."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dotmask.records import FloatArray
from sim.randomness import child

CONFIDENCE = 0.95
"""That nothing is called worse, of all that is compared together, where nothing is."""

LEAST_SEEDS = 3
"""With fewer there is next to nothing to tell from noise."""

RESAMPLES = 20_000
SMOOTHING = 1.06
"""Silverman's rule for the width of the noise, in standard deviations, before the factor n^(-1/5)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What a comparison says.

    Attributes:
        loss: mean over the seeds; above 0, worse.
        low, high: of its interval, which holds for all comparisons together.
        is_worse: whether the whole interval lies above the margin.
        is_better: whether the whole interval lies as far below 0.
    """

    loss: float
    low: float
    high: float
    is_worse: bool
    is_better: bool


def verdicts(losses: Sequence[FloatArray], margins: Sequence[float]) -> list[Verdict]:
    """Which of several figures got worse.

    Each figure has a loss for every seed, the difference between two runs on the same frames. The seeds are drawn anew,
    with replacement: a paired bootstrap of the mean loss. What makes it sound for five to eight seeds:

    - *It is studentised.* The usual percentile interval is far too narrow here: of five seeds without any change in the
      mean it calls 8 % worse that should be 2.5 % (normal noise), because it knows neither the factor
      sqrt(n / (n - 1)) nor that the standard deviation is itself uncertain. The bootstrap-t interval
      (Efron and Tibshirani 1993, section 12.5) knows both.
    - *It is smoothed* (Silverman and Young 1987): a little normal noise is added to each draw. Of five seeds there are
      3125 draws, some of one seed five times, whose standard error is 0; without noise these decide what is asked
      below, a probability of a few in ten thousand.
    - *There is a margin*: a loss counts from a size on that somebody would care about. A refactoring that shifts a mask
      by a few pixels changes all seeds a little in the same direction, which no test of significance forgives.
    - *All figures are judged together*, by Holm's procedure (1979): where nothing is worse, anything at all is called
      so in 2.5 % of the sessions at most, the upper half of 5 %. The intervals are those of the levels that Holm tests
      at, so that a figure is worse exactly where its whole interval lies above the margin.

    Two runs that give the same figures have no loss and an interval without width. The draws are the same in every
    process and on every machine.

    Args:
        losses: for each figure (n,), n at least LEAST_SEEDS.
        margins: for each figure the loss that does not count, above 0.
    """
    tail = 0.5 * (1 - CONFIDENCE)
    resamples = max(RESAMPLES, math.ceil(2 * len(losses) / tail))  # the strictest level must be reachable
    samples = [_Sample.of(loss, resamples) for loss in losses]
    probabilities = [sample.probability(margin) for sample, margin in zip(samples, margins, strict=True)]
    found: dict[int, Verdict] = {}
    is_open = True
    level = tail / max(len(losses), 1)
    for rank, index in enumerate(np.argsort(probabilities, kind="stable").tolist()):
        if is_open:
            level = tail / (len(losses) - rank)
            is_open = probabilities[index] <= level
        low, high = samples[index].interval(level)
        found[index] = Verdict(
            loss=samples[index].mean,
            low=low,
            high=high,
            is_worse=is_open,
            is_better=high < -margins[index],
        )
    return [found[index] for index in range(len(losses))]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Sample:
    """Losses and their resampled, studentised means.

    Attributes:
        mean: of the losses.
        error: the standard error of the mean; 0 where all losses are equal.
        studentised: (R,) ascending: by how many of its own standard errors each resampled mean is off the mean.
    """

    mean: float
    error: float
    studentised: FloatArray

    @classmethod
    def of(cls, losses: FloatArray, resamples: int) -> "_Sample":
        count = len(losses)
        mean, deviation = float(losses.mean()), float(losses.std(ddof=1))
        if deviation <= 1e-9 * float(np.abs(losses).max()):
            return cls(mean=mean, error=0.0, studentised=np.zeros(resamples))
        drawn, noise = _draws(count, resamples)
        resampled = (losses - mean)[drawn] + SMOOTHING * count**-0.2 * deviation * noise
        errors = resampled.std(axis=1, ddof=1) / math.sqrt(count)
        return cls(
            mean=mean,
            error=deviation / math.sqrt(count),
            studentised=np.sort(resampled.mean(axis=1) / errors),
        )

    def probability(self, margin: float) -> float:
        """Of such losses or larger ones where the true mean loss is the margin."""
        resamples = len(self.studentised)
        if self.error == 0.0:
            return 1 / (resamples + 1) if self.mean > margin else 1.0
        larger = resamples - int(np.searchsorted(self.studentised, (self.mean - margin) / self.error, side="left"))
        return (1 + larger) / (resamples + 1)

    def interval(self, level: float) -> tuple[float, float]:
        """Bounds of the true mean, each of which it passes with the probability `level` at most."""
        outside = max(math.floor(level * (len(self.studentised) + 1)) - 1, 0)
        low = self.mean - self.error * float(self.studentised[-1 - outside])
        return low, self.mean - self.error * float(self.studentised[outside])


@lru_cache(maxsize=8)
def _draws(count: int, resamples: int) -> tuple[np.ndarray, FloatArray]:
    """(R, count) numbers of seeds, drawn with replacement, and noise for them."""
    random = child(0, "baseline-bootstrap", count, resamples)
    return random.integers(count, size=(resamples, count)), random.standard_normal((resamples, count))
