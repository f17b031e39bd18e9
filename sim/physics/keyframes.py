"""A rigid motion that is replayed from keyframes."""

from dataclasses import dataclass

import numpy as np

from sim.errors import MotionError
from sim.geometry import FloatArray, pose
from sim.quaternions import rotation_from_quaternion, slerp


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class KeyframeMotion:
    """A rigid motion between keyframes; before the first and after the last the object stands still.

    Positions are cubic Hermite curves, rotations great arcs (slerp). Where two neighbours are equal and both
    velocities are zero, the pose between them is exactly theirs.

    Attributes:
        times_s: (n,) strictly increasing.
        p_world: (n, 3) metres.
        v_world: (n, 3) metres per second.
        q_world_xyzw: (n, 4) unit quaternions.
    """

    times_s: FloatArray
    p_world: FloatArray
    v_world: FloatArray
    q_world_xyzw: FloatArray

    def __post_init__(self) -> None:
        """Refuse what is no motion."""
        n = len(self.times_s)
        if n < 1 or self.p_world.shape != (n, 3) or self.v_world.shape != (n, 3) or self.q_world_xyzw.shape != (n, 4):
            raise MotionError("keyframes: need times (n,), positions (n, 3), velocities (n, 3), quaternions (n, 4)")
        if not np.all(np.diff(self.times_s) > 0):
            raise MotionError("keyframes: the times must increase")

    def pose_at(self, time_s: float) -> FloatArray:
        """`T_world_object` (4, 4)."""
        times = self.times_s
        if len(times) == 1 or time_s <= times[0]:
            return pose(rotation_from_quaternion(self.q_world_xyzw[0]), self.p_world[0])
        if time_s >= times[-1]:
            return pose(rotation_from_quaternion(self.q_world_xyzw[-1]), self.p_world[-1])
        k = int(np.searchsorted(times, time_s, side="right")) - 1
        step = float(times[k + 1] - times[k])
        s = (time_s - float(times[k])) / step
        p0, p1 = self.p_world[k], self.p_world[k + 1]
        v0, v1 = self.v_world[k], self.v_world[k + 1]
        p = p0 + s * s * (3 - 2 * s) * (p1 - p0) + step * s * (1 - s) * ((1 - s) * v0 - s * v1)
        q0, q1 = self.q_world_xyzw[k], self.q_world_xyzw[k + 1]
        return pose(rotation_from_quaternion(q0 if np.array_equal(q0, q1) else slerp(q0, q1, s)), p)

    def palette_at(self, time_s: float) -> FloatArray:
        """(1, 4, 4) rest frame to world."""
        return self.pose_at(time_s)[None]
