"""All faults of a scenario, one after another, on the oracle's answer."""

from collections import deque

import numpy as np

from dotmask.records import Detections
from scenarios.bridge import intrinsics_from_camera
from scenarios.camera import camera_model
from scenarios.faults.false_positives import Shown, false_positives
from scenarios.faults.found import Dice, Found
from scenarios.faults.labels import class_flips, order, scores
from scenarios.faults.missing import limit, missed, missed_bursts, tilted
from scenarios.faults.shapes import borders, merged, split
from scenarios.spec import Scenario
from sim.records import GroundTruth


class Faults:
    """Turns the exact detections of each frame into what a poor segmenter would answer.

    False positives and lateness need the frames before, in order, and remember as many as they last, ten at most; with
    the other faults any frame may be asked alone.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._spec, self._seed = scenario.faults, scenario.seed
        self._camera = intrinsics_from_camera(camera_model(scenario.camera))
        stay = self._spec.false_positives.frames if self._spec.false_positives.per_frame > 0 else 1
        self._past: deque[Shown] = deque(maxlen=stay)
        self._answers: deque[tuple[int, Detections]] = deque(maxlen=self._spec.late.frames + 1)

    def __call__(self, frame_index: int, truth: GroundTruth, detections: Detections) -> Detections:
        """The answer for a frame, whose exact detections are given; they themselves where no fault acts."""
        spec, dice = self._spec, Dice(seed=self._seed, frame_index=frame_index)
        self._past.append(Shown(frame_index=frame_index, truth=truth))
        found = Found.by_truth(detections, truth)
        found = tilted(found, spec.tilted, truth.T_world_camera)
        found = missed(found, spec.missed, dice)
        found = missed_bursts(found, spec.missed_bursts, dice)
        found = borders(found, spec.borders)
        found = merged(found, spec.merged, dice)
        found = split(found, spec.split, dice)
        found = class_flips(found, spec.class_flips, dice)
        found = false_positives(found, spec.false_positives, self._past, self._seed, self._camera)
        found = limit(found, spec.limit)
        found = scores(found, spec.scores, dice)
        found = order(found, spec.order, dice)
        self._answers.append((frame_index, found.detections))
        return self._late(frame_index)

    def _late(self, frame_index: int) -> Detections:
        """The answer that was made `late.frames` frames ago; nothing where there was none."""
        due = frame_index - self._spec.late.frames
        for made_for, answer in reversed(self._answers):
            if made_for == due:
                return answer
        return self._answers[-1][1].select(np.zeros(0, np.intp))
