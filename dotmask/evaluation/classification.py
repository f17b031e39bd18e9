"""Judges the moving object classification: precision, recall, and how late it answers."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassificationRecord:
    """One object in one frame.

    Attributes:
        frame: number of the frame.
        instance_id: the true instance.
        is_moving: the truth.
        is_flagged: the answer.
    """

    frame: int
    instance_id: int
    is_moving: bool
    is_flagged: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassificationScores:
    """Quality of the answers; None where a figure has nothing to rest on.

    Attributes:
        precision: share of flagged objects that move.
        recall: share of moving objects that are flagged.
        flag_latency_frames: median number of frames from the start of a motion to the first flagged frame.
        unflag_latency_frames: median number of frames from the end of a motion to the first frame without flag.
        unanswered: motions and rests that ended, or were still on at the last frame, before the answer came.
    """

    precision: float | None
    recall: float | None
    flag_latency_frames: float | None
    unflag_latency_frames: float | None
    unanswered: int


def classification_scores(records: Iterable[ClassificationRecord]) -> ClassificationScores:
    """Scores of all records.

    An object that appears counts as a start (of motion or of rest) as well: what matters to odometry is how long a new
    mover stays unmasked. Frames in which the object has no record do not end its motion or rest.
    """
    by_instance: dict[int, list[ClassificationRecord]] = defaultdict(list)
    counts = {(moving, flagged): 0 for moving in (True, False) for flagged in (True, False)}
    for record in records:
        by_instance[record.instance_id].append(record)
        counts[record.is_moving, record.is_flagged] += 1
    latencies: dict[bool, list[int]] = {True: [], False: []}
    unanswered = 0
    for history in by_instance.values():
        for spell in _spells(sorted(history, key=lambda r: r.frame)):
            truth, start = spell[0].is_moving, spell[0].frame
            answers = [r.frame - start for r in spell if r.is_flagged is truth]
            if answers:
                latencies[truth].append(answers[0])
            else:
                unanswered += 1
    hits, flagged = counts[True, True], counts[True, True] + counts[False, True]
    moving = counts[True, True] + counts[True, False]
    return ClassificationScores(
        precision=hits / flagged if flagged else None,
        recall=hits / moving if moving else None,
        flag_latency_frames=_median(latencies[True]),
        unflag_latency_frames=_median(latencies[False]),
        unanswered=unanswered,
    )


def _spells(history: Sequence[ClassificationRecord]) -> list[list[ClassificationRecord]]:
    """`history` cut wherever the truth changes."""
    spells: list[list[ClassificationRecord]] = []
    for record in history:
        if spells and spells[-1][-1].is_moving is record.is_moving:
            spells[-1].append(record)
        else:
            spells.append([record])
    return spells


def _median(values: Sequence[int]) -> float | None:
    return float(np.median(values)) if values else None
