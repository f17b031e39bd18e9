"""The small motions that whoever carries a camera adds: a hand that never is still, wheels on a floor."""

from functools import lru_cache

import numpy as np

from sim.geometry import FloatArray
from sim.randomness import child


@lru_cache(maxsize=64)
def _phases(seed: int, motion: str) -> FloatArray:
    """(3, 2) phases of `sway`, different for every seed and motion."""
    phases = child(seed, "camera_path", motion).uniform(0.0, 2 * np.pi, (3, 2))
    # The beats of the three axes are a third of a period apart, so that the axes take turns.
    phases[:, 1] = phases[0, 1] + np.array([0.0, 1.0, 2.0]) * (np.pi / 3) + 0.2 * (phases[:, 1] - np.pi) / np.pi
    phases.setflags(write=False)
    return phases


def sway(
    time_s: float, seed: int, motion: str, frequencies_hz: tuple[float, float, float], beat_hz: float
) -> FloatArray:
    """(3,) in -1..1: one oscillation per axis that swells and fades with the beat.

    `cos a · cos b` is the sum of two sines; with frequencies that have no common period it never repeats.
    """
    phases = _phases(seed, motion)
    carrier = np.sin(2 * np.pi * np.asarray(frequencies_hz) * time_s + phases[:, 0])
    swell = 0.62 + 0.38 * np.cos(2 * np.pi * 2 * beat_hz * time_s + 2 * phases[:, 1])
    return np.asarray(carrier * swell)


def hand_shake(time_s: float, seed: int) -> tuple[FloatArray, FloatArray]:
    """What a hand that tries to hold still does: offset (3,) in metres and rotation vector (3,) in radians."""
    slow_m = sway(time_s, seed, "hand slow position", (0.231, 0.317, 0.273), 0.071)
    slow_rad = sway(time_s, seed, "hand slow rotation", (0.287, 0.243, 0.351), 0.083)
    fast_m = sway(time_s, seed, "hand fast position", (1.713, 2.131, 1.927), 0.197)
    fast_rad = sway(time_s, seed, "hand fast rotation", (1.871, 1.637, 2.213), 0.173)
    return 0.0082 * slow_m + 0.00045 * fast_m, 0.0134 * slow_rad + 0.0013 * fast_rad


def wheel_shake(time_s: float, seed: int) -> tuple[FloatArray, FloatArray]:
    """What wheels on a carpet do to a camera on a mast: offset (3,) in metres and rotation vector (3,) in radians.

    Up and down (the camera's y) by half a millimetre, a nod of a tenth of a degree; with the frequencies of a small
    robot's mast and of its wheels' turning.
    """
    fast_m = sway(time_s, seed, "wheels fast position", (5.31, 7.93, 4.77), 0.131)
    fast_rad = sway(time_s, seed, "wheels fast rotation", (6.17, 4.39, 5.83), 0.113)
    slow_rad = sway(time_s, seed, "wheels slow rotation", (0.613, 0.467, 0.539), 0.059)
    offset_m = np.array([0.00025, 0.0005, 0.0002]) * fast_m
    return offset_m, np.array([0.0016, 0.0006, 0.001]) * fast_rad + np.array([0.002, 0.004, 0.002]) * slow_rad
