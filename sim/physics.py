"""Chairs that are pushed, roll, turn and come to rest: simulated once with Bullet, then replayed from keyframes.

Bullet repeats itself bit for bit when a fresh world gets the same commands in the same order (its author in
bullet3#2394, its users in bullet3#3099); every bake makes its own world and steps it at a fixed rate.
"""

import contextlib
import math
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from types import ModuleType

import numpy as np

from sim.chairs import BACK_TOP_M, CASTER_CIRCLE_M, SEAT_EXTENT_M, SEAT_HEIGHT_M
from sim.errors import MotionError
from sim.geometry import FloatArray, pose
from sim.quaternions import rotation_from_quaternion, slerp

STEP_RATE_HZ = 240
CHAIR_MASS_KG = 12.0
ROLLING_FRICTION = 0.045
"""Friction of casters on carpet: a deceleration of 0.44 m/s²."""
GRAVITY_M_S2 = 9.81
_CASTER_RADIUS_M = 0.03
_YAW_INERTIA_KG_M2 = 0.55
_TILT_INERTIA_KG_M2 = 1e5  # a push at the back does not tip an office chair: its tilt is held by this inertia
_CENTRE_OF_MASS_M = 0.22
_WAKE_M_S = 0.03
_REST_M_S, _REST_RAD_S, _REST_STEPS = 0.01, 0.04, 24
_MAX_SINK_M, _MAX_TILT_RAD = 0.005, 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class ChairStart:
    """Where a chair stands at time 0.

    Attributes:
        position_m: (x, y) on the floor.
        yaw_rad: about z; at 0 who sits on it faces -y.
    """

    position_m: tuple[float, float]
    yaw_rad: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ChairPush:
    """A push: a constant force over a short time.

    Attributes:
        chair: index of the chair.
        time_s: when it begins.
        impulse_n_s: (3,) in the world; the vertical part only loads the casters.
        height_m: above the floor, where it acts.
        offset_m: how far beside the chair's axis it acts, to the left of the impulse's direction; turns the chair.
        duration_s: how long it takes.
    """

    chair: int
    time_s: float
    impulse_n_s: tuple[float, float, float]
    height_m: float = 0.45
    offset_m: float = 0.0
    duration_s: float = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticBox:
    """Something that a chair runs into.

    Attributes:
        centre_m: (3,) in the world.
        size_m: (3,) full extents.
        yaw_rad: about z.
    """

    centre_m: tuple[float, float, float]
    size_m: tuple[float, float, float]
    yaw_rad: float = 0.0


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


def bake_chairs(
    chairs: Sequence[ChairStart],
    pushes: Sequence[ChairPush],
    obstacles: Sequence[StaticBox],
    duration_s: float,
    *,
    keyframe_rate_hz: int = 120,
) -> tuple[KeyframeMotion, ...]:
    """The motions of the chairs from time 0 to `duration_s`.

    A chair is a rigid body on five gliding casters that stays upright: what is kept is its place on the floor and its
    yaw. A chair that nothing pushes stands exactly still; one that comes nearly to rest is put to rest.

    Args:
        chairs: where they stand.
        pushes: what happens to them.
        obstacles: what stands in their way.
        duration_s: how long to simulate.
        keyframe_rate_hz: keyframes per second; a divisor of STEP_RATE_HZ.

    Returns:
        One motion per chair, in order.

    Raises:
        MotionError: the step rate is not a multiple of the keyframe rate; a push names no chair or lies outside the
            duration; a value is not finite; or the simulation lifted, sank or tilted a chair.
    """
    _check(chairs, pushes, duration_s, keyframe_rate_hz)
    bullet = _bullet()
    with _output_to(os.devnull):
        client = bullet.connect(bullet.DIRECT)
    try:
        world = _World(bullet, client, chairs, obstacles)
        tracks = world.run(pushes, math.ceil(duration_s * STEP_RATE_HZ), STEP_RATE_HZ // keyframe_rate_hz)
    finally:
        bullet.disconnect(client)
    return tracks


def _check(chairs: Sequence[ChairStart], pushes: Sequence[ChairPush], duration_s: float, keyframe_rate_hz: int) -> None:
    if keyframe_rate_hz < 1 or STEP_RATE_HZ % keyframe_rate_hz:
        raise MotionError(
            f"chairs: the step rate of {STEP_RATE_HZ} Hz must be a multiple of the keyframe rate, "
            f"got {keyframe_rate_hz} Hz"
        )
    if not (math.isfinite(duration_s) and duration_s > 0):
        raise MotionError(f"chairs: the duration must be above 0, got {duration_s}")
    for index, push in enumerate(pushes):
        if not 0 <= push.chair < len(chairs):
            raise MotionError(f"chairs: push {index} is for chair {push.chair}, but there are {len(chairs)} chairs")
        values = (push.time_s, *push.impulse_n_s, push.height_m, push.offset_m, push.duration_s)
        if not all(math.isfinite(v) for v in values) or push.duration_s <= 0:
            raise MotionError(f"chairs: push {index} has a value that is not finite, or no duration")
        if not 0 <= push.time_s <= duration_s:
            raise MotionError(f"chairs: push {index} at {push.time_s} s is outside the {duration_s} s")
    for index, chair in enumerate(chairs):
        if not all(math.isfinite(v) for v in (*chair.position_m, chair.yaw_rad)):
            raise MotionError(f"chairs: chair {index} has a start that is not finite")


@contextlib.contextmanager
def _output_to(path: str) -> Iterator[None]:
    """Send what native code prints on file descriptors 1 and 2 to `path`."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [(descriptor, os.dup(descriptor)) for descriptor in (1, 2)]
    try:
        with open(path, "wb") as sink:
            for descriptor, _ in kept:
                os.dup2(sink.fileno(), descriptor)
        yield
    finally:
        for descriptor, copy in kept:
            os.dup2(copy, descriptor)
            os.close(copy)


def _bullet() -> ModuleType:
    """The pybullet module, imported at the first bake because it is heavy and greets on stderr."""
    if "pybullet" not in sys.modules:
        with _output_to(os.devnull):
            import pybullet
    import pybullet

    return pybullet  # type: ignore[no-any-return]  # the library has no types


class _World:
    """One Bullet world with its chairs."""

    def __init__(
        self, bullet: ModuleType, client: int, chairs: Sequence[ChairStart], obstacles: Sequence[StaticBox]
    ) -> None:
        self._bullet, self._client, self._starts = bullet, client, chairs
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=1 / STEP_RATE_HZ,
            numSubSteps=1,
            numSolverIterations=50,
            deterministicOverlappingPairs=1,
            enableConeFriction=1,
            physicsClientId=client,
        )
        bullet.setGravity(0, 0, -GRAVITY_M_S2, physicsClientId=client)
        floor = bullet.createCollisionShape(bullet.GEOM_PLANE, physicsClientId=client)
        body = bullet.createMultiBody(0, floor, physicsClientId=client)
        bullet.changeDynamics(body, -1, lateralFriction=1.0, restitution=0.0, physicsClientId=client)
        for box in obstacles:
            self._add_obstacle(box)
        self._bodies = [self._add_chair(chair) for chair in chairs]

    def _add_obstacle(self, box: StaticBox) -> None:
        bullet = self._bullet
        half = [extent / 2 for extent in box.size_m]
        shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=half, physicsClientId=self._client)
        body = bullet.createMultiBody(
            0,
            shape,
            basePosition=box.centre_m,
            baseOrientation=_yaw_quaternion(box.yaw_rad),
            physicsClientId=self._client,
        )
        # Sliding along furniture with little friction: plastic on wood.
        bullet.changeDynamics(body, -1, lateralFriction=4.0, restitution=0.0, physicsClientId=self._client)

    def _add_chair(self, start: ChairStart) -> int:
        bullet = self._bullet
        types, radii, halves, lengths, places = [], [], [], [], []

        def part(kind: int, place: tuple[float, float, float], half: tuple[float, float, float], radius: float) -> None:
            types.append(kind)
            places.append([place[0], place[1], place[2] - _CENTRE_OF_MASS_M])
            halves.append(list(half))
            radii.append(radius)
            lengths.append(2 * half[2])

        unused = (0.1, 0.1, 0.1)
        for k in range(5):
            angle = 2 * math.pi * k / 5
            at = (CASTER_CIRCLE_M * math.cos(angle), CASTER_CIRCLE_M * math.sin(angle), _CASTER_RADIUS_M)
            part(bullet.GEOM_SPHERE, at, unused, _CASTER_RADIUS_M)
        rim = CASTER_CIRCLE_M + _CASTER_RADIUS_M
        part(bullet.GEOM_CYLINDER, (0, 0, 0.07), (rim, rim, 0.02), rim)
        width, depth = SEAT_EXTENT_M
        part(bullet.GEOM_BOX, (0, 0, SEAT_HEIGHT_M - 0.04), (width / 2, depth / 2, 0.04), 0.1)
        part(bullet.GEOM_BOX, (0, 0.26, (0.56 + BACK_TOP_M) / 2), (0.22, 0.05, (BACK_TOP_M - 0.56) / 2), 0.1)
        shape = bullet.createCollisionShapeArray(
            shapeTypes=types,
            radii=radii,
            halfExtents=halves,
            lengths=lengths,
            collisionFramePositions=places,
            physicsClientId=self._client,
        )
        body = bullet.createMultiBody(
            CHAIR_MASS_KG,
            shape,
            basePosition=[*start.position_m, _CENTRE_OF_MASS_M],
            baseOrientation=_yaw_quaternion(start.yaw_rad),
            physicsClientId=self._client,
        )
        bullet.changeDynamics(
            body,
            -1,
            lateralFriction=ROLLING_FRICTION,
            restitution=0.05,
            linearDamping=0.0,
            angularDamping=0.0,
            localInertiaDiagonal=[_TILT_INERTIA_KG_M2, _TILT_INERTIA_KG_M2, _YAW_INERTIA_KG_M2],
            physicsClientId=self._client,
        )
        return int(body)

    def run(self, pushes: Sequence[ChairPush], steps: int, steps_per_keyframe: int) -> tuple[KeyframeMotion, ...]:
        """Step the world and read keyframes, the first at time 0."""
        count = len(self._bodies)
        # (x, y, yaw, vx, vy) of every chair; a resting chair keeps its numbers to the last bit.
        state = np.zeros((count, 5))
        for k, start in enumerate(self._starts):
            state[k, :3] = (*start.position_m, start.yaw_rad)
        awake, calm = [False] * count, [0] * count
        frames: list[FloatArray] = [state.copy()]
        for step in range(steps):
            pushed = self._push(pushes, step, state)
            for k in range(count):
                if not awake[k] and k not in pushed:
                    self._hold(k, state[k])
            self._bullet.stepSimulation(physicsClientId=self._client)
            for k, body in enumerate(self._bodies):
                (vx, vy, _), (_, _, spin) = self._bullet.getBaseVelocity(body, physicsClientId=self._client)
                speed = math.hypot(vx, vy)
                if not awake[k] and k not in pushed and speed < _WAKE_M_S and abs(spin) < _WAKE_M_S / CASTER_CIRCLE_M:
                    continue
                is_calm = speed < _REST_M_S and abs(spin) < _REST_RAD_S and k not in pushed
                calm[k] = calm[k] + 1 if is_calm else 0
                awake[k] = calm[k] < _REST_STEPS
                state[k] = self._read(k, float(state[k, 2]))
                state[k, 3:] = (vx, vy) if awake[k] else 0.0
            if (step + 1) % steps_per_keyframe == 0:
                frames.append(state.copy())
        times = np.arange(len(frames), dtype=np.float64) * (steps_per_keyframe / STEP_RATE_HZ)
        states = np.array(frames, dtype=np.float64)
        return tuple(_motion(times, states[:, k]) for k in range(count))

    def _push(self, pushes: Sequence[ChairPush], step: int, state: FloatArray) -> set[int]:
        """Apply the forces of this step; the chairs that feel one."""
        pushed = set()
        for push in pushes:
            first = round(push.time_s * STEP_RATE_HZ)
            length = max(1, round(push.duration_s * STEP_RATE_HZ))
            if not first <= step < first + length:
                continue
            force = np.array(push.impulse_n_s) * (STEP_RATE_HZ / length)
            across = math.hypot(force[0], force[1])
            left = np.array([-force[1], force[0]]) / across if across > 0 else np.zeros(2)
            place = state[push.chair, :2] + push.offset_m * left
            self._bullet.applyExternalForce(
                self._bodies[push.chair],
                -1,
                force.tolist(),
                [*place.tolist(), push.height_m],
                self._bullet.WORLD_FRAME,
                physicsClientId=self._client,
            )
            pushed.add(push.chair)
        return pushed

    def _hold(self, k: int, state: FloatArray) -> None:
        """Keep a resting chair where it is, at no speed."""
        x, y, yaw = (float(value) for value in state[:3])
        body = self._bodies[k]
        self._bullet.resetBasePositionAndOrientation(
            body, [x, y, _CENTRE_OF_MASS_M], _yaw_quaternion(yaw), physicsClientId=self._client
        )
        self._bullet.resetBaseVelocity(body, [0, 0, 0], [0, 0, 0], physicsClientId=self._client)

    def _read(self, k: int, previous_yaw: float) -> FloatArray:
        """(x, y, yaw, 0, 0) of a chair; the yaw continues the previous one."""
        (x, y, z), q = self._bullet.getBasePositionAndOrientation(self._bodies[k], physicsClientId=self._client)
        R = rotation_from_quaternion(np.array(q))
        tilt = math.acos(min(1.0, float(R[2, 2])))
        if abs(z - _CENTRE_OF_MASS_M) > _MAX_SINK_M or tilt > _MAX_TILT_RAD:
            raise MotionError(
                f"chairs: chair {k} left the floor by {1e3 * (z - _CENTRE_OF_MASS_M):.1f} mm and tilted by "
                f"{tilt:.3f} rad; weaken the push, or keep chairs and obstacles apart at the start"
            )
        yaw = math.atan2(float(R[1, 0]), float(R[0, 0]))
        yaw += 2 * math.pi * round((previous_yaw - yaw) / (2 * math.pi))
        return np.array([x, y, yaw, 0.0, 0.0])


def _motion(times_s: FloatArray, states: FloatArray) -> KeyframeMotion:
    """A motion of (n, 5) states; keyframes of rest that lie between equal ones stay exactly equal."""
    zeros = np.zeros(len(times_s))
    return KeyframeMotion(
        times_s=times_s,
        p_world=np.stack([states[:, 0], states[:, 1], zeros], axis=1),
        v_world=np.stack([states[:, 3], states[:, 4], zeros], axis=1),
        q_world_xyzw=np.array([_yaw_quaternion(float(yaw)) for yaw in states[:, 2]]),
    )


def _yaw_quaternion(yaw_rad: float) -> list[float]:
    """(x, y, z, w) of a turn about z."""
    return [0.0, 0.0, math.sin(yaw_rad / 2), math.cos(yaw_rad / 2)]
