"""The small movements of people who stand, and the gestures of people who sit, as functions of time."""

from dataclasses import replace

import numpy as np

from sim.people.body import Posture
from sim.randomness import child


class Idle:
    """Breath, sway and glances, in no common period, and gestures that come and go.

    Args:
        seed: of the scene.
        name: of the person; with the seed it decides rates and phases.
    """

    def __init__(self, seed: int, name: str) -> None:
        generator = child(seed, "idle", name)
        hertz = np.array([0.23, 0.31, 0.25, 0.11, 0.07, 0.17, 0.13, 0.19, 0.16, 0.21, 0.27, 0.29])
        self._phase = generator.uniform(0.0, 2.0 * np.pi, len(hertz))
        self._rate = 2.0 * np.pi * hertz * generator.uniform(0.85, 1.15, len(hertz))
        self._gesture_phase = child(seed, "gesture", name).uniform(0.0, 2.0 * np.pi, 8)

    def swayed(self, posture: Posture, time_s: float, amount: float, *, sway: float = 1.0) -> Posture:
        """`posture` with breath, sway and glances.

        Args:
            posture: without them.
            time_s: seconds.
            amount: their size, 0 for none; at 1 the 95th percentile of the surface speed of a standing person is about
                0.04 m/s (0.02 to 0.09), at 0.2 it stays below 0.02 m/s.
            sway: 0..1, share of it in which the hips sway; 0 for people who sit.
        """
        w = (amount * np.sin(self._rate * time_s + self._phase)).tolist()
        breath = w[2]
        return replace(
            posture,
            hips=posture.hips + sway * np.array([0.006 * w[0], 0.005 * w[1], 0.0]),
            chest=posture.chest + np.radians([1.5 * w[3], 0.3 * w[0], 0.8 * breath]),
            head=posture.head + np.radians([9.0 * w[4] + 2.0 * w[5], 0.8 * w[6], 2.0 * w[7]]),
            shoulders=posture.shoulders + np.radians([[2.0 * w[8], 0.8 * breath], [2.0 * w[9], 0.8 * breath]]),
            elbows=posture.elbows + np.radians([[4.0 * w[10], 0.0], [4.0 * w[11], 0.0]]),
        )

    def gesturing(self, posture: Posture, time_s: float, amount: float) -> Posture:
        """`posture` of a person who sits, in conversation: hands are lifted and beat, the head turns to listen.

        Args:
            posture: with the hands in the lap.
            time_s: seconds.
            amount: 0 for none; at 1 the 95th percentile of the surface speed is about 0.15 m/s (0.03 to 0.4).
        """
        p = self._gesture_phase

        def wave(hertz: float, k: int) -> float:
            return float(np.sin(2.0 * np.pi * hertz * time_s + p[k]))

        left, right = amount * wave(0.04, 0) ** 4, amount * wave(0.055, 1) ** 4
        shoulders, elbows = [], []
        for lifted, beat, swing in ((left, wave(0.9, 2), wave(0.6, 3)), (right, wave(0.8, 4), wave(0.7, 5))):
            shoulders.append([12.0 * lifted, 4.0 * lifted])
            elbows.append([lifted * (38.0 + 12.0 * beat), 8.0 * lifted * swing])
        return replace(
            posture,
            chest=posture.chest + np.radians([4.0 * amount * wave(0.09, 6), 0.0, 0.0]),
            head=posture.head + np.radians([16.0 * amount * wave(0.12, 7), 0.0, 3.0 * amount * wave(0.31, 5)]),
            shoulders=posture.shoulders + np.radians(shoulders),
            elbows=posture.elbows + np.radians(elbows),
        )
