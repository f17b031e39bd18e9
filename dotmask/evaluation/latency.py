"""Judges how soon the moving object classification answers when an object starts to move, or comes to rest.

What moves a little is truly moving in some frames and truly at rest in the next (a person who breathes). So a motion
or a rest is what lasts `SPELL_FRAMES` frames in which the object is seen; shorter spells of the other truth neither
begin nor end one.
"""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dotmask.evaluation.classification import ClassificationRecord

SPELL_FRAMES = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class LatencyScores:
    """How many frames the answers took; None where there was no answer to wait for.

    A start is a motion that begins after a rest, while the object is tracked and not flagged: a person who stands and
    walks off. What is already flagged when it starts, or appears in motion, is no start.

    Attributes:
        flag_median_frames: from the beginning of a motion (starts, appearances and all others) to the first flagged
            frame.
        unflag_median_frames: from the beginning of a rest (of an object that appears as well) to the first frame
            without flag.
        unanswered: motions and rests that ended, or were still on at the last frame, before the answer came.
        starts: number of starts.
        missed_starts: those that were never flagged.
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
    latencies: dict[bool, list[int]] = {True: [], False: []}
    starts: list[int | None] = []
    unanswered = 0
    for unsorted in by_instance.values():
        history = sorted(unsorted, key=lambda r: r.frame)
        beginnings = _beginnings(history)
        for begin, end in pairwise([*beginnings, len(history)]):
            first = history[begin]
            waits = (r.frame - first.frame for r in history[begin:end] if r.is_flagged is first.is_moving)
            latency = next(waits, None)
            if latency is None:
                unanswered += 1
            else:
                latencies[first.is_moving].append(latency)
            is_after_rest = first.is_moving and begin != beginnings[0]
            if is_after_rest and history[begin - 1].frame == first.frame - 1 and not history[begin - 1].is_flagged:
                starts.append(latency)
    flagged = [latency for latency in starts if latency is not None]
    return LatencyScores(
        flag_median_frames=_median(latencies[True]),
        unflag_median_frames=_median(latencies[False]),
        unanswered=unanswered,
        starts=len(starts),
        missed_starts=len(starts) - len(flagged),
        start_median_frames=_median(flagged),
        start_max_frames=max(flagged, default=None),
    )


def _beginnings(history: Sequence[ClassificationRecord]) -> list[int]:
    """Where in `history` motions and rests begin, in turn; the first of them is the object's first."""
    beginnings: list[int] = []
    begin = 0
    for k, record in enumerate(history):
        if record.is_moving is not history[begin].is_moving:
            begin = k
        is_new = not beginnings or history[beginnings[-1]].is_moving is not record.is_moving
        if is_new and k - begin + 1 == SPELL_FRAMES:
            beginnings.append(begin)
    return beginnings


def _median(values: Sequence[int]) -> float | None:
    return float(np.median(values)) if values else None
