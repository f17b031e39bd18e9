"""Steps: when which foot stands where. From them follows the movement of the whole body."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d, minimum_filter1d

from sim.geometry import FloatArray
from sim.people import gait
from sim.people.body import Body
from sim.people.kernels import rotation
from sim.people.rows import (
    ANKLES,
    ARMS,
    CHEST,
    COLUMNS,
    HEAD,
    HIPS,
    PELVIS,
    ROOT,
    SIZE,
    STRAIGHTEST,
    YAW,
    half_width_m,
    standing_height_m,
)

STEP_S = 0.005
HEIGHT_SMOOTHING_S = 0.055


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Steps:
    """A movement on foot, sampled about every STEP_S.

    The phase counts steps, see `sim.people.gait`: print k is made by the right foot if k is even, and a foot is put
    down at phase k. The feet stand on prints `first` and `first + 1` at the beginning.

    Attributes:
        root_world: (n, 2) metres.
        heading: (n,) radians, where the body faces, without jumps.
        size: (n,) of the gait, see `gait.amplitude`.
        phase: (n,) not falling.
        look: (n,) radians, how far the head turns to the left beyond its part in the gait.
        first: number of the first print.
        print_world: (k, 2) metres, the middle between the feet beside each print.
        print_heading: (k,) radians.
        print_size: (k,) size of the gait there.
        is_loop: whether the movement repeats itself: the last sample is the first again, print k + 2 follows on print
            k for all k, modulo their number.
    """

    root_world: FloatArray
    heading: FloatArray
    size: FloatArray
    phase: FloatArray
    look: FloatArray
    first: int
    print_world: FloatArray
    print_heading: FloatArray
    print_size: FloatArray
    is_loop: bool

    def rows(self, body: Body) -> FloatArray:
        """(n, COLUMNS) see `sim.people.rows`.

        A planted foot rolls on its print without sliding, a swinging foot goes from one print to the next but one;
        the pelvis rides as high as both legs allow.
        """
        phase, size = self.phase, self.size
        table = np.empty((len(phase), COLUMNS))
        table[:, ROOT] = self.root_world
        table[:, YAW] = self.heading + np.pi / 2
        table[:, SIZE] = size
        table[:, PELVIS] = gait.pelvis_angles(phase, size)
        table[:, CHEST] = gait.chest_angles(phase, size)
        table[:, HEAD] = gait.head_angles(phase, size)
        table[:, HEAD.start] += self.look
        table[:, ARMS] = gait.arm_angles(phase, size).reshape(-1, 8)
        for side in range(2):
            ankle, yaw, pitch = self._foot(body, side, table[:, YAW])
            table[:, ANKLES.start + 3 * side : ANKLES.start + 3 * side + 3] = ankle
            table[:, 30 + side], table[:, 32 + side] = yaw, pitch
        table[:, HIPS] = self._hips(body, table)
        return table

    def _index(self, number: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """Where in the arrays print `number` is."""
        count = len(self.print_size)
        if self.is_loop:
            return np.asarray(np.mod(number - self.first, count))
        return np.clip(number - self.first, 0, count - 1)  # before the first and after the last a foot stays

    def _foot(self, body: Body, side: int, root_yaw: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(n, 3) ankle, (n,) yaw and (n,) pitch of one foot in the root frame."""
        parity = 1 - side  # the right foot strikes at even numbers
        strike = (2 * np.floor((self.phase - parity) / 2) + parity).astype(np.int64)
        since = self.phase - strike
        here, there = self._index(strike), self._index(strike + 2)
        progress = gait.swing_progress(since)
        yaw = self.print_heading[here] + np.pi / 2
        yaw = yaw + progress * _wrapped(self.print_heading[there] + np.pi / 2 - yaw)
        start, end = self._print(body, side, here), self._print(body, side, there)
        pitch = gait.foot_pitch(since, self.size)
        forward, up = body.rolled_ankle(side, pitch)
        place = start + progress[:, None] * (end - start) + forward[:, None] * _turned(body.foot_ahead[side], yaw)
        ankle = np.empty((len(since), 3))
        ankle[:, :2] = _turned(place - self.root_world, -root_yaw)
        ankle[:, 2] = up + gait.swing_clearance_m(since, self.size)
        return ankle, _wrapped(yaw - root_yaw), pitch

    def _print(self, body: Body, side: int, index: npt.NDArray[np.int64]) -> FloatArray:
        """(n, 2) metres in the world, the ankle of a flat foot over the prints at `index`."""
        heading = self.print_heading[index]
        outward = (1.0 - 2.0 * side) * half_width_m(body, self.print_size[index])
        left = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
        return np.asarray(self.print_world[index] + outward[:, None] * left)

    def _hips(self, body: Body, table: FloatArray) -> FloatArray:
        """(n, 3) the root bone in the root frame: standing height, less where a leg would not reach its foot."""
        shift = gait.pelvis_shift_m(self.phase, self.size)
        limit = standing_height_m(body) - gait.mid_stance_drop_m(self.size)
        offsets = np.array([rotation(*angles) @ body.hip_offset.T for angles in table[:, PELVIS].tolist()])
        for side in range(2):
            offset = offsets[:, :, side]
            ankle = table[:, ANKLES.start + 3 * side : ANKLES.start + 3 * side + 3]
            across = ankle[:, :2] - offset[:, :2] - shift
            reach = STRAIGHTEST * (body.thigh_m[side] + body.shin_m[side])
            room = np.maximum(reach**2 - np.sum(across**2, axis=1), 0.0)
            limit = np.minimum(limit, ankle[:, 2] + np.sqrt(room) - offset[:, 2])
        half = round(HEIGHT_SMOOTHING_S / STEP_S)
        mode = "wrap" if self.is_loop else "nearest"
        # A blur no wider than the minimum filter cannot exceed the limit.
        low = minimum_filter1d(limit[:-1], 2 * half + 1, mode=mode)
        height = gaussian_filter1d(low, half / 2.5, mode=mode, radius=half)
        return np.column_stack([shift, np.append(height, height[0] if self.is_loop else height[-1])])


def _wrapped(angle: FloatArray) -> FloatArray:
    """The same angle in [-pi, pi)."""
    return np.asarray(np.mod(angle + np.pi, 2.0 * np.pi) - np.pi)


def _turned(vector: FloatArray, angle: FloatArray) -> FloatArray:
    """(n, 2) vectors (or one (2,)), each turned by its angle (n,)."""
    c, s = np.cos(angle), np.sin(angle)
    x, y = vector[..., 0], vector[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)
