"""Judges how soon the moving object classification answers when an object starts to move, or comes to rest.

What moves a little is truly moving in some frames and truly at rest in the next (a person who breathes). So a motion
or a rest is what lasts `SPELL_FRAMES` frames in which the object is seen; shorter spells of the other truth neither
begin nor end one.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dotmask.evaluation.classification import ClassificationRecord

SPELL_FRAMES = 10

SETS_OFF_M_S = 0.1
"""Speed of the centre above which an object is on its way: more than a standing person sways, less than a step."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LatencyScores:
    """How many frames the answers took; None where there was no answer to wait for.

    A start is what a person does who stands and walks off, or a chair that is pushed: the centre sets off after a
    rest, in view, and in some of the last `SPELL_FRAMES` frames before the object was tracked and not flagged. The
    hands may move, and be flagged, earlier: then the latency is 0. What appears on its way is no start, nor is a
    motion that stays in place.

    Attributes:
        flag_median_frames: from the beginning of a motion, or the appearance of a mover, to the first flagged frame.
        unflag_median_frames: from the beginning of a rest, or the appearance of a resting object, to the first frame
            without flag.
        unanswered: motions and rests that ended, or were still on at the last frame, before the answer came.
        starts: number of starts.
        missed_starts: those that were never flagged before the centre rested again.
        start_median_frames: from a start to the first flagged frame, over the starts that were flagged.
        start_max_frames: the longest of them.
    """

    flag_median_frames: float | None
    unflag_median_frames: float | None
    unanswered: int
    starts: int
    missed_starts: int
    start_median_frames: float | None
    start_max_frames: int | None


def latency_scores(records: Iterable[ClassificationRecord]) -> LatencyScores:
    """Latencies over all objects; the records may come in any order.

    Frames in which the object has no record do not end its motion or rest.
    """
    by_instance: dict[int, list[ClassificationRecord]] = defaultdict(list)
    for record in records:
        by_instance[record.instance_id].append(record)
    histories = [sorted(history, key=lambda r: r.frame) for history in by_instance.values()]
    waits = [(s[0].is_moving, _wait(s, s[0].is_moving)) for history in histories for s in _motions_and_rests(history)]
    starts = [_wait(way, True) for history in histories for way in _starts(history)]
    flagged = [wait for wait in starts if wait is not None]
    return LatencyScores(
        flag_median_frames=_median([wait for moves, wait in waits if moves and wait is not None]),
        unflag_median_frames=_median([wait for moves, wait in waits if not moves and wait is not None]),
        unanswered=sum(wait is None for _, wait in waits),
        starts=len(starts),
        missed_starts=len(starts) - len(flagged),
        start_median_frames=_median(flagged),
        start_max_frames=max(flagged, default=None),
    )


def _motions_and_rests(history: Sequence[ClassificationRecord]) -> Iterator[Sequence[ClassificationRecord]]:
    for begin, end in pairwise([*_beginnings([r.is_moving for r in history]), len(history)]):
        yield history[begin:end]


def _starts(history: Sequence[ClassificationRecord]) -> Iterator[Sequence[ClassificationRecord]]:
    """From each start on, until the centre rests again."""
    is_on_its_way = [r.true_speed_m_s > SETS_OFF_M_S for r in history]
    beginnings = _beginnings(is_on_its_way)
    for begin, end in pairwise([*beginnings[1:], len(history)]):
        before, way = history[begin - SPELL_FRAMES : begin], history[begin:end]
        is_in_view = before[-1].frame == way[0].frame - 1
        if is_on_its_way[begin] and is_in_view and not all(r.is_flagged for r in before):
            yield way


def _beginnings(truths: Sequence[bool]) -> list[int]:
    """Where spells of True and of False begin, in turn; shorter ones than `SPELL_FRAMES` are passed over."""
    beginnings: list[int] = []
    begin = 0
    for k, truth in enumerate(truths):
        if truth is not truths[begin]:
            begin = k
        is_new = not beginnings or truths[beginnings[-1]] is not truth
        if is_new and k - begin + 1 == SPELL_FRAMES:
            beginnings.append(begin)
    return beginnings


def _wait(spell: Sequence[ClassificationRecord], answer: bool) -> int | None:
    """Frames from the beginning of `spell` to the first with that answer; None: it never came."""
    return next((r.frame - spell[0].frame for r in spell if r.is_flagged is answer), None)


def _median(values: Sequence[int]) -> float | None:
    return float(np.median(values)) if values else None
