"""How an office chair moves: its star, the seat that turns on it, and casters that trail behind their pins."""

from dataclasses import dataclass

import numpy as np

from sim.geometry import FloatArray
from sim.physics.keyframes import KeyframeMotion
from sim.things.chairs import CASTER_TRAIL_M, CASTERS, caster_place

_PLACES = np.array([caster_place(number) for number in range(CASTERS)])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChairMotion:
    """The motion of a jointed office chair. Its root frame is that of the seat.

    Attributes:
        base: of the star.
        top: of seat and back, with the same keyframes.
        casters_rad: (n, 5) turn of the casters relative to the star, at the keyframes.
    """

    base: KeyframeMotion
    top: KeyframeMotion
    casters_rad: FloatArray

    def pose_at(self, time_s: float) -> FloatArray:
        """`T_world_object` (4, 4): on the floor under the seat, -y ahead of who sits on it."""
        return self.top.pose_at(time_s)

    def palette_at(self, time_s: float) -> FloatArray:
        """(7, 4, 4): star, top, casters."""
        palette = np.empty((2 + CASTERS, 4, 4))
        palette[0], palette[1] = self.base.pose_at(time_s), self.top.pose_at(time_s)
        palette[2:] = palette[0] @ _about(_PLACES, self._casters_at(time_s))
        return palette

    def _casters_at(self, time_s: float) -> FloatArray:
        """(5,) radians."""
        times = self.base.times_s
        if len(times) == 1 or time_s <= times[0]:
            return np.asarray(self.casters_rad[0])
        if time_s >= times[-1]:
            return np.asarray(self.casters_rad[-1])
        k = int(np.searchsorted(times, time_s, side="right")) - 1
        before, after = self.casters_rad[k], self.casters_rad[k + 1]
        return np.asarray(before + (after - before) / (times[k + 1] - times[k]) * (time_s - times[k]))


def chair_motion(base: KeyframeMotion, top: KeyframeMotion, casters_rad: FloatArray) -> ChairMotion:
    """The motion of a chair whose casters stand at `casters_rad` (5,) at first.

    A caster's wheels roll along the line from their contact to the pin and do not slip sideways. With `e` the
    direction from pin to contact, `n` at right angles to it and `v` the pin's velocity, the contact moves along `n`
    by `v.n + trail * turn rate = 0`: a pulled caster falls in behind its pin (kinematics of a trailer).
    """
    yaw = np.unwrap(2 * np.arctan2(base.q_world_xyzw[:, 2], base.q_world_xyzw[:, 3]))
    angles = np.tile(casters_rad, (len(yaw), 1)) + yaw[0]  # in the world
    places = _PLACES[:, :2]
    steps = np.diff(base.times_s)
    for k in range(len(steps)):
        c, s = np.cos(yaw[k]), np.sin(yaw[k])
        arms = places @ np.array([[c, s], [-s, c]])
        spin = (yaw[k + 1] - yaw[k]) / steps[k]
        v = (base.p_world[k + 1] - base.p_world[k])[:2] / steps[k] + spin * np.stack([-arms[:, 1], arms[:, 0]], axis=1)
        sideways = -v[:, 0] * np.sin(angles[k]) + v[:, 1] * np.cos(angles[k])
        turn = np.clip(-sideways * steps[k] / CASTER_TRAIL_M, -0.5, 0.5)
        angles[k + 1] = angles[k] + turn
    return ChairMotion(base=base, top=top, casters_rad=angles - yaw[:, None])


def _about(places: FloatArray, angles_rad: FloatArray) -> FloatArray:
    """The turns (N, 4, 4) about the upright lines through `places` (N, 3)."""
    c, s = np.cos(angles_rad), np.sin(angles_rad)
    x, y, _ = places.T
    T = np.zeros((len(places), 4, 4))
    T[:, 0, 0] = T[:, 1, 1] = c
    T[:, 0, 1], T[:, 1, 0] = -s, s
    T[:, 0, 3], T[:, 1, 3] = x - (c * x - s * y), y - (s * x + c * y)
    T[:, 2, 2] = T[:, 3, 3] = 1.0
    return T
