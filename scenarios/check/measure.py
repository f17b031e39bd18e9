"""What a check finds, and when that is good enough."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from scenarios.check.sample import Sample


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """What a check found.

    Attributes:
        worst: largest error; None where nothing could be tested.
        tested: number of tested pixels, points or objects.
        total: number of those that there were.
    """

    worst: float | None
    tested: int
    total: int

    @classmethod
    def of(cls, errors: Iterable[float], total: int) -> "Measured":
        """The largest of these errors, of `total` that there might have been."""
        listed = [float(error) for error in errors]
        return cls(worst=max(listed, default=None), tested=len(listed), total=total)


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """A property that the truth must have.

    Attributes:
        name: short.
        what: what is compared with what.
        unit: of error and bound.
        bound: largest error that passes.
        least_share: share of what there is that must have been tested.
        measure: finds the errors in a sample.
    """

    name: str
    what: str
    unit: str
    bound: float
    least_share: float
    measure: Callable[[Sample], Measured]


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """What a check found in a scenario.

    Attributes:
        scenario: its name.
        check: what was checked.
        measured: of all samples together.
        index: frame of the largest error; None where nothing could be tested.
    """

    scenario: str
    check: Check
    measured: Measured
    index: int | None

    @property
    def share(self) -> float | None:
        """Share of what there was that was tested; None where there was nothing."""
        return self.measured.tested / self.measured.total if self.measured.total else None

    @property
    def passes(self) -> bool:
        """Whether the error is within the bound and enough was tested."""
        worst_is_well = self.measured.worst is None or self.measured.worst <= self.check.bound
        return worst_is_well and (self.share is None or self.share >= self.check.least_share)


def joined(scenario: str, check: Check, measured: dict[int, Measured]) -> Finding:
    """The finding of a check from what it measured in each sample, by frame."""
    worst = {index: one.worst for index, one in measured.items() if one.worst is not None}
    # NaN is an error that no bound holds: it must win.
    index = max(worst, key=lambda i: float("inf") if worst[i] != worst[i] else worst[i], default=None)
    return Finding(
        scenario=scenario,
        check=check,
        measured=Measured(
            worst=None if index is None else worst[index],
            tested=sum(one.tested for one in measured.values()),
            total=sum(one.total for one in measured.values()),
        ),
        index=index,
    )
