"""What a session's runs and a baseline say about each other."""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from dotmask.records import FloatArray
from pytest_dotmask.baseline import RunFigures, RunKey
from pytest_dotmask.comparison import LEAST_SEEDS, Verdict, verdicts
from pytest_dotmask.metrics import METRICS, Metric


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Change:
    """How one figure of a test has changed.

    Attributes:
        metric: which.
        seeds: (n) that have the figure in both runs, in order.
        before, now: (n,) its values.
        verdict: on the change.
    """

    metric: Metric
    seeds: tuple[int, ...]
    before: FloatArray
    now: FloatArray
    verdict: Verdict

    @property
    def losses(self) -> FloatArray:
        """(n,) by seed."""
        return self.metric.losses(self.before, self.now)

    @property
    def worse_seeds(self) -> tuple[int, ...]:
        """Those in which it is worse by more than the margin."""
        return tuple(np.array(self.seeds)[self.losses > self.metric.margin].tolist())

    @property
    def text(self) -> str:
        """The values and the change, for people."""
        values = (self.metric.value_text(self.metric.middle(v)) for v in (self.before, self.now))
        verdict = self.verdict
        return f"{' -> '.join(values)}: {self.metric.change_text(verdict.loss, verdict.low, verdict.high)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Compared:
    """What is said of one run of a test, over all its seeds.

    Attributes:
        test, name, scenario: as in the baseline.
        problem: why it cannot be compared, and what to do; None where it was.
        is_skipped: whether it was not compared because few of its seeds were run.
        changes: of all figures that both have.
    """

    test: str
    name: str
    scenario: str
    problem: str | None = None
    is_skipped: bool = False
    changes: tuple[Change, ...] = ()

    @property
    def node_id(self) -> str:
        """The name of the comparison as a test."""
        return f"{self.test.removesuffix(']')}-{self.name}-baseline]"

    @property
    def worse(self) -> tuple[Change, ...]:
        """The figures that got worse."""
        return tuple(change for change in self.changes if change.verdict.is_worse)


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """What is said of all runs.

    Attributes:
        compared: in the order of the runs.
        count: of figures that were compared together.
        not_run: runs of the baseline that have no partner in this session.
    """

    compared: tuple[Compared, ...]
    count: int
    not_run: int


def judge(stored: Mapping[RunKey, RunFigures], runs: Mapping[RunKey, RunFigures]) -> Judgement:
    """Compare the runs of a session with those of a baseline."""
    groups: dict[tuple[str, str], list[RunFigures]] = defaultdict(list)
    for run in runs.values():
        groups[run.test, run.name].append(run)
    compared: list[Compared] = []
    asked: list[tuple[int, Metric, tuple[int, ...], FloatArray, FloatArray]] = []
    for (test, name), members in groups.items():
        known = {key[2]: run for key, run in stored.items() if key[:2] == (test, name)}
        members = sorted(members, key=lambda run: run.seed)
        one = Compared(test=test, name=name, scenario=members[0].scenario, problem=_problem(members, known))
        if one.problem is None and len(members) < LEAST_SEEDS:
            one = replace(one, is_skipped=True)
        elif one.problem is None:
            asked += [(len(compared), *pair) for pair in _pairs(members, known)]
        compared.append(one)
    losses = [metric.losses(before, now) for _, metric, _, before, now in asked]
    answers = verdicts(losses, [metric.margin for _, metric, *_ in asked])
    for (place, metric, seeds, before, now), verdict in zip(asked, answers, strict=True):
        change = Change(metric=metric, seeds=seeds, before=before, now=now, verdict=verdict)
        compared[place] = replace(compared[place], changes=(*compared[place].changes, change))
    return Judgement(compared=tuple(compared), count=len(asked), not_run=len(stored.keys() - runs.keys()))


RENEW = "renew it with --dotmask-update-baseline"


def _problem(runs: list[RunFigures], known: Mapping[int, RunFigures]) -> str | None:
    """Why the runs of a test cannot be compared with those that are known of it, by seed."""
    missing = [run.seed for run in runs if run.seed not in known]
    if missing:
        return f"the baseline does not know {'seeds ' + _listed(missing) if known else 'this test'}: {RENEW}"
    if len(known) < LEAST_SEEDS:
        return (
            f"the baseline has {len(known)} seeds of this test, {LEAST_SEEDS} are the least: raise seeds= and {RENEW}"
        )
    other = [run for run in runs if run.frame_hash != known[run.seed].frame_hash]
    if other:
        then, now = known[other[0].seed].version, other[0].version
        return (
            f"the frames of seeds {_listed([run.seed for run in other])} are not those that the baseline was made with "
            f"(by dotmask {then}; this is {now}): another scenario, renderer or number of frames. "
            f"Check that this is meant, and {RENEW}"
        )
    return None


def _pairs(
    runs: list[RunFigures], known: Mapping[int, RunFigures]
) -> list[tuple[Metric, tuple[int, ...], FloatArray, FloatArray]]:
    """For every figure the seeds that have it in both, and its values.

    Where a figure was not measured another one says why: without a pose there is no error but `lost_share` is 1,
    without a detection there is no IoU but leak is.
    """
    found = []
    for metric in METRICS:
        both = [
            (run.seed, before, now)
            for run in runs
            if (before := known[run.seed].figures.get(metric.name)) is not None
            and (now := run.figures.get(metric.name)) is not None
        ]
        if len(both) >= LEAST_SEEDS:
            seeds, before_now = tuple(seed for seed, *_ in both), np.array([values for _, *values in both])
            found.append((metric, seeds, before_now[:, 0], before_now[:, 1]))
    return found


def _listed(seeds: list[int]) -> str:
    return ", ".join(map(str, seeds))
