"""Faults that leave detections out."""

import math

import numpy as np

from dotmask.records import FloatArray
from scenarios.faults.found import Dice, Found
from scenarios.spec import LimitSpec, MissedBurstsSpec, MissedSpec, TiltedSpec


def roll_deg(T_world_camera: FloatArray) -> float:
    """By how much the camera is rolled about its viewing direction against upright, degrees in 0..180."""
    right, down = T_world_camera[2, 0], T_world_camera[2, 1]  # heights of the ends of the image's axes
    return abs(math.degrees(math.atan2(-right, -down)))


def tilted(found: Found, spec: TiltedSpec, T_world_camera: FloatArray) -> Found:
    """Networks are trained on upright people: none is found beyond an angle."""
    if roll_deg(T_world_camera) <= spec.beyond_deg:
        return found
    return found.keep([class_name != "person" for class_name in found.detections.class_names])


def missed(found: Found, spec: MissedSpec, dice: Dice) -> Found:
    """Each detection is lost by its own throw of the dice."""
    if spec.probability == 0:
        return found
    return found.keep([dice.throw("missed", name).random() >= spec.probability for name in found.names])


def missed_bursts(found: Found, spec: MissedBurstsSpec, dice: Dice) -> Found:
    """Each detection is lost while its instance's Markov chain says so."""
    if spec.share == 0:
        return found
    return found.keep([not _is_in_burst(spec, dice, name) for name in found.names])


def _is_in_burst(spec: MissedBurstsSpec, dice: Dice, name: str) -> bool:
    """State of the stationary chain of `name` in this frame, without a memory of the frames before.

    Every frame has one number u, and the chain is in a burst when u is below `stay`, coming from a burst, or below
    `start`, coming from none. Below both, or above both, the state does not depend on the one before, so going back to
    such a frame is enough, and the answer is an exact draw (coupling from the past, Propp and Wilson 1996). Between
    them the state is the last one's, or, where bursts are so short that `stay` is below `start`, its opposite.
    """
    stay = 1.0 - 1.0 / spec.mean_frames
    start = spec.share / (1.0 - spec.share) / spec.mean_frames
    frames_ago, is_opposite = 0, False
    while True:
        u = dice.throw("missed bursts", name, frames_ago).random()
        if u < min(stay, start):
            return not is_opposite
        if u >= max(stay, start):
            return is_opposite
        is_opposite ^= stay < start
        frames_ago += 1


def limit(found: Found, spec: LimitSpec) -> Found:
    """The largest masks alone; of two equal ones the first."""
    if spec.most is None or len(found.names) <= spec.most:
        return found
    sizes = found.detections.masks.sum(axis=(1, 2))
    largest = set(np.argsort(-sizes, kind="stable")[: spec.most].tolist())
    return found.keep([index in largest for index in range(len(sizes))])
