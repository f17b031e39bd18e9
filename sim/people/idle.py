"""The small movements of people who stand, and the gestures of people who sit, as functions of time."""

from dataclasses import replace

import numpy as np

from sim.people.body import Posture
from sim.randomness import child

SPEAKING_S, LISTENING_S, TURNS = (5.0, 9.0), (4.0, 8.0), 8
"""A turn of a conversation lasts some seconds; after so many of both the pattern repeats."""
LIFT_S = 0.7
"""In this time the hands are lifted from the lap."""


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
        gestures = child(seed, "gesture", name)
        self._gesture_phase = gestures.uniform(0.0, 2.0 * np.pi, 8)
        self._side = float(gestures.choice([-1.0, 1.0]))
        turns = np.stack([gestures.uniform(*SPEAKING_S, TURNS), gestures.uniform(*LISTENING_S, TURNS)], axis=1)
        self._turns_s = np.cumsum(turns.ravel())

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
        """`posture` of a person who sits in conversation.

        By turns it speaks, with hands that are lifted and beat, and listens, with the hands in the lap.

        Args:
            posture: with the hands in the lap.
            time_s: seconds.
            amount: size of the gestures, 0 for none; at 1 the 95th percentile of the surface speed of a speaking person
                is about 0.2 m/s (0.1 to 0.4).
        """
        p = self._gesture_phase
        speaks = amount * self._speaks(time_s)
        if speaks == 0.0:
            return posture

        def wave(hertz: float, k: int) -> float:
            return float(np.sin(2.0 * np.pi * hertz * time_s + p[k]))

        shoulders, elbows = [], []
        for lifted, beat, swing in ((1.0, wave(0.9, 2), wave(0.6, 3)), (0.8, wave(0.8, 4), wave(0.7, 5))):
            shoulders.append([speaks * 12.0 * lifted, speaks * 4.0 * lifted])
            elbows.append([speaks * lifted * (38.0 + 14.0 * beat), speaks * 8.0 * lifted * swing])
        return replace(
            posture,
            chest=posture.chest + np.radians([3.0 * speaks, 0.0, 0.0]),
            head=posture.head + np.radians([14.0 * speaks * self._side, 0.0, 3.0 * speaks * wave(0.5, 6)]),
            shoulders=posture.shoulders + np.radians(shoulders),
            elbows=posture.elbows + np.radians(elbows),
        )

    def _speaks(self, time_s: float) -> float:
        """1 while the person has its turn of the conversation, 0 while it listens, with a smooth change between."""
        time_s = time_s % float(self._turns_s[-1])
        turn = int(np.searchsorted(self._turns_s, time_s, side="right"))
        if turn % 2:  # listens
            return 0.0
        start = float(self._turns_s[turn - 1]) if turn else 0.0
        nearest = min(time_s - start, float(self._turns_s[turn]) - time_s) / LIFT_S
        x = min(max(nearest, 0.0), 1.0)
        return x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)  # least jerk (Flash and Hogan 1985)
