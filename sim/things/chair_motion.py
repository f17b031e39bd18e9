"""How an office chair moves: its star, the seat that turns on it, and casters that trail behind their pins."""

from dataclasses import dataclass

import numpy as np

from sim.geometry import FloatArray, pose, rotation_z
from sim.physics.keyframes import KeyframeMotion
from sim.things.chairs import CASTER_TRAIL_M, CASTERS, caster_place


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
        T_world_base = self.base.pose_at(time_s)
        casters = [
            T_world_base @ _about(caster_place(k), np.interp(time_s, self.base.times_s, self.casters_rad[:, k]))
            for k in range(CASTERS)
        ]
        return np.stack([T_world_base, self.top.pose_at(time_s), *casters])


def chair_motion(base: KeyframeMotion, top: KeyframeMotion, casters_rad: FloatArray) -> ChairMotion:
    """The motion of a chair whose casters stand at `casters_rad` (5,) at first.

    A caster's wheels roll along the line from their contact to the pin and do not slip sideways. With `e` the
    direction from pin to contact, `n` at right angles to it and `v` the pin's velocity, the contact moves along `n`
    by `v.n + trail * turn rate = 0`: a pulled caster falls in behind its pin (kinematics of a trailer).
    """
    yaw = np.unwrap(2 * np.arctan2(base.q_world_xyzw[:, 2], base.q_world_xyzw[:, 3]))
    angles = np.tile(casters_rad, (len(yaw), 1)) + yaw[0]  # in the world
    places = np.stack([caster_place(k)[:2] for k in range(CASTERS)])
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


def _about(place: FloatArray, angle_rad: float) -> FloatArray:
    """The turn (4, 4) about the upright line through `place` (3,)."""
    R = rotation_z(angle_rad)
    return pose(R, place - R @ place)
