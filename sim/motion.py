"""How people move over time: walking along a path, standing, sitting. Every pose is a pure function of time."""

from math import floor

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d, minimum_filter1d

from sim import gait
from sim.body import Body, Posture, Soles, rotation
from sim.errors import MotionError
from sim.geometry import FloatArray, pose, rotation_z
from sim.randomness import child
from sim.skeleton import Skeleton
from sim.walk_path import WalkPath
from sim.walk_plan import Pause, WalkPlan

__all__ = ["Idle", "Pause", "Sitter", "Soles", "Stander", "Walker"]

STRAIGHTEST = 0.9985
"""Largest share of the leg's length between hip and ankle: 6° of knee flexion remain."""

SAMPLE_S = 0.005
HEIGHT_SMOOTHING_S = 0.055

HIP_OVER_SEAT_M = 0.112
"""Height of the hip joints of a sitting person over the seat."""

# Columns of the table of a walker's postures over one loop.
_ROOT, _YAW, _SIZE = slice(0, 2), 2, 3
_HIPS, _PELVIS, _CHEST, _HEAD = slice(4, 7), slice(7, 10), slice(10, 13), slice(13, 16)
_ARMS, _ANKLES, _FOOT_YAW, _FOOT_PITCH, _COLUMNS = slice(16, 24), slice(24, 30), slice(30, 32), slice(32, 34), 34


class Walker:
    """A person who walks a closed path for ever.

    Footprints are planned along the path; a planted foot rolls on its print without sliding, a swinging foot goes from
    one print to the next; hips and knees follow by inverse kinematics, the pelvis rides as high as both legs allow.

    Args:
        skeleton: of the person.
        soles: its sole points.
        waypoints_world: (N, 2) metres.
        speed_m_s: on straight parts, within gait.SPEED_RANGE_M_S; turns are slower, see WalkPlan.
        closed: see WalkPath; False walks there and back.
        turn_radius_m: see WalkPath.
        start_m: how far along the path the person is at time 0.
        pauses: stops at waypoints.
        seed: of the small movements while it stands.

    Raises:
        MotionError: the path cannot be walked, or the speed is not one of walking.
    """

    def __init__(
        self,
        skeleton: Skeleton,
        soles: Soles,
        waypoints_world: npt.ArrayLike,
        speed_m_s: float,
        *,
        closed: bool = False,
        turn_radius_m: float = 0.35,
        start_m: float = 0.0,
        pauses: tuple[Pause, ...] = (),
        seed: int = 0,
    ) -> None:
        self.body = Body(skeleton, soles)
        self.path = WalkPath(waypoints_world, closed=closed, turn_radius_m=turn_radius_m)
        self.plan = WalkPlan(self.path, waypoints_world, speed_m_s, self.body.leg_m, pauses)
        self.period_s = self.plan.period_s
        self._start_s = self.plan.time_of(start_m)
        self._idle = Idle(seed)
        # Half the distance between the feet across the path: as wide as the hips in standing, narrower in walking.
        hip = abs(float(self.body.hip_offset[0, 0]))
        self._half_width = hip * (0.85 - 0.25 * np.minimum(self.plan.print_size, 1.0))
        self._postures = self._planned()

    def pose_at(self, time_s: float) -> FloatArray:
        """`T_world_object` (4, 4): on the path, facing along it (the body faces the frame's -y axis)."""
        return self._row_at(time_s)[0]

    def palette_at(self, time_s: float) -> FloatArray:
        """(B, 4, 4) rest frame to world."""
        T_world_root, row = self._row_at(time_s)
        return np.asarray(T_world_root @ self.body.palette(self._posture(time_s, row)))

    def posture_at(self, time_s: float) -> Posture:
        """The posture in the root frame `pose_at(time_s)`."""
        return self._posture(time_s, self._row_at(time_s)[1])

    def _row_at(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        """The root pose and the row of the table at a time."""
        t = time_s + self._start_s
        row = self._postures(t - floor(t / self.period_s) * self.period_s)
        return pose(rotation_z(row[_YAW]), [row[0], row[1], 0.0]), row

    def _posture(self, time_s: float, row: FloatArray) -> Posture:
        arms = row[_ARMS].reshape(2, 4)
        posture = Posture(
            hips=row[_HIPS],
            ankles=row[_ANKLES].reshape(2, 3),
            foot_yaw=row[_FOOT_YAW],
            foot_pitch=row[_FOOT_PITCH],
            pelvis=row[_PELVIS],
            chest=row[_CHEST],
            head=row[_HEAD],
            shoulders=arms[:, :2],
            elbows=arms[:, 2:],
        )
        stillness = 1.0 - 2.5 * float(row[_SIZE])
        return self._idle.added_to(posture, time_s, stillness**2) if stillness > 0.0 else posture

    def _planned(self) -> CubicSpline:
        """The spline through the postures of one loop, one row of columns every SAMPLE_S."""
        n = int(np.ceil(self.period_s / SAMPLE_S))
        t = np.linspace(0.0, self.period_s, n + 1)
        plan = self.plan
        phase, size, s = plan.phase_at(t), gait.amplitude(plan.speed_at(t)), plan.distance_at(t)
        table = np.empty((n + 1, _COLUMNS))
        table[:, _ROOT] = self.path.position_at(s)
        table[:, _YAW] = np.unwrap(self.path.heading_at(s)) + np.pi / 2
        table[:, _SIZE] = size
        table[:, _PELVIS] = gait.pelvis_angles(phase, size)
        table[:, _CHEST] = gait.chest_angles(phase, size)
        table[:, _HEAD] = gait.head_angles(phase, size)
        table[:, _ARMS] = gait.arm_angles(phase, size).reshape(-1, 8)
        for side in range(2):
            ankle, yaw, pitch = self._foot(side, phase, size, table[:, _ROOT], table[:, _YAW])
            table[:, 24 + 3 * side : 27 + 3 * side] = ankle
            table[:, 30 + side], table[:, 32 + side] = yaw, pitch
        table[:, _HIPS] = self._hips(phase, size, table)
        turn = table[-1, _YAW] - table[0, _YAW]
        drift = turn * t / self.period_s  # a loop may end a whole turn further: only the rest is periodic
        table[:, _YAW] -= drift
        table[-1] = table[0]
        spline = CubicSpline(t, table, bc_type="periodic")
        spline.c[-2, :, _YAW] += turn / self.period_s
        spline.c[-1, :, _YAW] += drift[:-1]
        return spline

    def _foot(
        self, side: int, phase: FloatArray, size: FloatArray, root_world: FloatArray, root_yaw: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(n, 3) ankle, (n,) yaw and (n,) pitch of one foot in the root frame."""
        plan, body = self.plan, self.body
        parity = 1 - side  # the right foot strikes at even numbers
        strike = 2 * np.floor((phase - parity) / 2) + parity
        since = phase - strike
        here = np.mod(strike.astype(np.int64), plan.steps)
        there = np.mod(here + 2, plan.steps)
        progress = gait.swing_progress(since)
        yaw = plan.print_heading[here] + np.pi / 2
        yaw = yaw + progress * _wrapped(plan.print_heading[there] + np.pi / 2 - yaw)
        start, end = self._print(side, here), self._print(side, there)
        pitch = gait.foot_pitch(since, size)
        forward, up = body.rolled_ankle(side, pitch)
        place = start + progress[:, None] * (end - start) + forward[:, None] * _turned(body.foot_ahead[side], yaw)
        ankle = np.empty((len(phase), 3))
        ankle[:, :2] = _turned(place - root_world, -root_yaw)
        ankle[:, 2] = up + gait.swing_clearance_m(since, size)
        return ankle, _wrapped(yaw - root_yaw), pitch

    def _print(self, side: int, number: npt.NDArray[np.int64]) -> FloatArray:
        """(n, 2) metres in the world, the ankle of a flat foot over the prints `number`."""
        heading = self.plan.print_heading[number]
        outward = (1.0 - 2.0 * side) * self._half_width[number]
        left = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
        return np.asarray(self.plan.print_world[number] + outward[:, None] * left)

    def _hips(self, phase: FloatArray, size: FloatArray, table: FloatArray) -> FloatArray:
        """(n + 1, 3) the root bone in the root frame: standing height, less where a leg would not reach its foot."""
        shift = gait.pelvis_shift_m(phase, size)
        limit = _standing_height_m(self.body) - gait.mid_stance_drop_m(size)
        offsets = np.array([rotation(*angles) @ self.body.hip_offset.T for angles in table[:, _PELVIS].tolist()])
        for side in range(2):
            offset = offsets[:, :, side]
            ankle = table[:, 24 + 3 * side : 27 + 3 * side]
            across = ankle[:, :2] - offset[:, :2] - shift
            reach = STRAIGHTEST * (self.body.thigh_m[side] + self.body.shin_m[side])
            room = np.maximum(reach**2 - np.sum(across**2, axis=1), 0.0)
            limit = np.minimum(limit, ankle[:, 2] + np.sqrt(room) - offset[:, 2])
        half = round(HEIGHT_SMOOTHING_S / SAMPLE_S)
        # A blur no wider than the minimum filter cannot exceed the limit.
        low = minimum_filter1d(limit[:-1], 2 * half + 1, mode="wrap")
        height = gaussian_filter1d(low, half / 2.5, mode="wrap", radius=half)
        return np.column_stack([shift, np.append(height, height[0])])


class Idle:
    """The small movements of a person who does nothing: breath, sway, glances, in no common period."""

    def __init__(self, seed: int) -> None:
        generator = child(seed, "idle")
        hertz = np.array([0.23, 0.31, 0.25, 0.11, 0.07, 0.17, 0.13, 0.19, 0.16, 0.21, 0.27, 0.29])
        self._phase = generator.uniform(0.0, 2.0 * np.pi, len(hertz))
        self._rate = 2.0 * np.pi * hertz * generator.uniform(0.85, 1.15, len(hertz))

    def added_to(self, posture: Posture, time_s: float, amount: float) -> Posture:
        """`posture` with these movements at their full size (amount 1), or less; none for amount 0."""
        w = (amount * np.sin(self._rate * time_s + self._phase)).tolist()
        breath = w[2]
        return Posture(
            hips=posture.hips + np.array([0.006 * w[0], 0.005 * w[1], 0.0]),
            ankles=posture.ankles,
            foot_yaw=posture.foot_yaw,
            foot_pitch=posture.foot_pitch,
            pelvis=posture.pelvis,
            chest=posture.chest + np.radians([1.5 * w[3], 0.3 * w[0], 0.8 * breath]),
            head=posture.head + np.radians([9.0 * w[4] + 2.0 * w[5], 0.8 * w[6], 2.0 * w[7]]),
            shoulders=posture.shoulders + np.radians([[2.0 * w[8], 0.8 * breath], [2.0 * w[9], 0.8 * breath]]),
            elbows=posture.elbows + np.radians([[4.0 * w[10], 0.0], [4.0 * w[11], 0.0]]),
        )


class Stander:
    """A person who stands.

    At amplitude 1 the 95th percentile of the surface speed is about 0.04 m/s (0.02 to 0.09): moving by the simulator's
    definition. At 0.2 it stays below 0.02 m/s.

    Args:
        skeleton: of the person.
        soles: its sole points.
        position_world: (2,) metres on the floor, under the hips.
        heading_rad: direction it faces, from the world's x axis.
        amplitude: of breath, sway, arms and glances; 0 = frozen, 1 = at ease, at most 2.
        seed: of these movements.

    Raises:
        MotionError: the amplitude is out of range.
    """

    def __init__(
        self,
        skeleton: Skeleton,
        soles: Soles,
        position_world: npt.ArrayLike,
        heading_rad: float,
        *,
        amplitude: float = 1.0,
        seed: int = 0,
    ) -> None:
        _check_amplitude(amplitude)
        self.body = Body(skeleton, soles)
        self._T_world_object = _root(position_world, heading_rad)
        self._amplitude = amplitude
        self._idle = Idle(seed)
        still = np.zeros(1)
        ankles = self.body.ankle_rest.copy()
        ankles[:, 0] = 0.85 * self.body.hip_offset[:, 0]
        ankles[:, 1] = self.body.hip_offset[:, 1] + 0.01
        arms = gait.arm_angles(still, still)[0]
        # The sway of the hips (Idle) must not over-extend a leg: 6 mm lower.
        self._still = Posture(
            hips=np.array([0.0, -0.015, _standing_height_m(self.body) - 0.006]),
            ankles=ankles,
            chest=gait.chest_angles(still, still)[0],
            head=gait.head_angles(still, still)[0],
            shoulders=arms[:, :2],
            elbows=arms[:, 2:],
        )

    def pose_at(self, time_s: float) -> FloatArray:
        """`T_world_object` (4, 4), always the same."""
        return self._T_world_object

    def palette_at(self, time_s: float) -> FloatArray:
        """(B, 4, 4) rest frame to world."""
        return np.asarray(self._T_world_object @ self.body.palette(self.posture_at(time_s)))

    def posture_at(self, time_s: float) -> Posture:
        """The posture in the root frame."""
        return self._idle.added_to(self._still, time_s, self._amplitude)


class Sitter:
    """A person who sits on a chair, feet on the floor, and may gesture.

    At amplitude 1 the 95th percentile of the surface speed is about 0.15 m/s (0.03 to 0.4).

    Args:
        skeleton: of the person.
        soles: its sole points.
        position_world: (2,) metres, the point of the floor under the hips (about 0.1 m behind the middle of the seat).
        heading_rad: direction it faces, from the world's x axis.
        seat_height_m: of the seat's surface, 0.35 to 0.6.
        amplitude: of gestures, glances and breath; 0 = frozen, 1 = in conversation, at most 2.
        seed: of these movements.

    Raises:
        MotionError: the seat's height or the amplitude is out of range.
    """

    def __init__(
        self,
        skeleton: Skeleton,
        soles: Soles,
        position_world: npt.ArrayLike,
        heading_rad: float,
        *,
        seat_height_m: float = 0.46,
        amplitude: float = 1.0,
        seed: int = 0,
    ) -> None:
        _check_amplitude(amplitude)
        if not 0.35 <= seat_height_m <= 0.6:
            raise MotionError(f"seat_height_m: people sit on 0.35 to 0.6 m, got {seat_height_m}")
        self.body = Body(skeleton, soles)
        self._T_world_object = _root(position_world, heading_rad)
        self._amplitude = amplitude
        self._idle = Idle(seed)
        generator = child(seed, "gesture")
        self._phase = generator.uniform(0.0, 2.0 * np.pi, 8)
        hip_height = seat_height_m + HIP_OVER_SEAT_M
        self._hips = np.array([0.0, 0.0, hip_height - self.body.hip_offset[:, 2].mean()])
        self._ankles = self.body.ankle_rest.copy()
        for side, further in enumerate((0.03, -0.02)):
            thigh, shin = float(self.body.thigh_m[side]), float(self.body.shin_m[side])
            drop = hip_height - float(self._ankles[side, 2]) - shin  # from hip to knee when the shin is upright
            ahead = np.sqrt(max(thigh**2 - drop**2, 0.0)) + further
            self._ankles[side, 0] *= (abs(self.body.hip_offset[side, 0]) + 0.03) / abs(self._ankles[side, 0])
            self._ankles[side, 1] = self.body.hip_offset[side, 1] - ahead

    def pose_at(self, time_s: float) -> FloatArray:
        """`T_world_object` (4, 4), always the same."""
        return self._T_world_object

    def palette_at(self, time_s: float) -> FloatArray:
        """(B, 4, 4) rest frame to world."""
        return np.asarray(self._T_world_object @ self.body.palette(self.posture_at(time_s)))

    def posture_at(self, time_s: float) -> Posture:
        """The posture in the root frame. Gestures of the two hands come and go, the head turns to listen."""
        a, p = self._amplitude, self._phase

        def wave(hertz: float, k: int) -> float:
            return float(np.sin(2.0 * np.pi * hertz * time_s + p[k]))

        left, right = a * wave(0.04, 0) ** 4, a * wave(0.055, 1) ** 4
        shoulders, elbows = [], []
        for lifted, beat, swing in ((left, wave(0.9, 2), wave(0.6, 3)), (right, wave(0.8, 4), wave(0.7, 5))):
            shoulders.append([20.0 + 12.0 * lifted, 4.0 + 4.0 * lifted])
            elbows.append([46.0 + lifted * (38.0 + 12.0 * beat), 12.0 + 8.0 * lifted * swing])
        posture = Posture(
            hips=self._hips,
            ankles=self._ankles,
            pelvis=np.radians([0.0, 0.0, -10.0]),
            chest=np.radians([4.0 * a * wave(0.09, 6), 0.0, 1.0]),
            head=np.radians([16.0 * a * wave(0.12, 7), 0.0, 3.0 + 3.0 * a * wave(0.31, 5)]),
            shoulders=np.radians(shoulders),
            elbows=np.radians(elbows),
        )
        moved = self._idle.added_to(posture, time_s, a)
        return Posture(
            hips=posture.hips,
            ankles=posture.ankles,
            pelvis=posture.pelvis,
            chest=moved.chest,
            head=moved.head,
            shoulders=moved.shoulders,
            elbows=moved.elbows,
        )


def _standing_height_m(body: Body) -> float:
    """Height of the root bone when standing with nearly straight legs."""
    return float(np.min(body.ankle_rest[:, 2] - body.hip_offset[:, 2])) + STRAIGHTEST * body.leg_m


def _wrapped(angle: FloatArray) -> FloatArray:
    """The same angle in [-pi, pi)."""
    return np.asarray(np.mod(angle + np.pi, 2.0 * np.pi) - np.pi)


def _turned(vector: FloatArray, angle: FloatArray) -> FloatArray:
    """(n, 2) vectors (or one (2,)), each turned by its angle (n,)."""
    c, s = np.cos(angle), np.sin(angle)
    x, y = vector[..., 0], vector[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def _root(position_world: npt.ArrayLike, heading_rad: float) -> FloatArray:
    """`T_world_object` of a body that faces `heading_rad`."""
    x, y = np.asarray(position_world, float)
    return pose(rotation_z(heading_rad + np.pi / 2), [x, y, 0.0])


def _check_amplitude(amplitude: float) -> None:
    if not 0.0 <= amplitude <= 2.0:
        raise MotionError(f"amplitude: must be 0 (frozen) to 2, got {amplitude}")
