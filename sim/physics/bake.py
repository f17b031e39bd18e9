"""Simulate things once, and keep keyframes of their motions."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim.errors import MotionError
from sim.physics.bodies import Body, Part
from sim.physics.bullet import BulletWorld, State, start_state, yaw_quaternion
from sim.physics.events import Bystander, Hit, Pusher, Start
from sim.physics.keyframes import KeyframeMotion
from sim.physics.movers import LOOK_UP_S, MARGIN_M, Pillar, hands
from sim.quaternions import rotation_from_quaternion
from sim.rooms.room import Obstacle

UPRIGHT_STEP_RATE_HZ, TUMBLING_STEP_RATE_HZ = 480, 1920
"""Steps per second of a world of chairs, and of one with things that can fall: these hit the floor at 4 m/s."""
STEPS_PER_KEYFRAME = 4
_WAKE_M_S, _WAKE_RAD_S = 0.03, 0.1
_REST_M_S, _REST_RAD_S, _REST_S = 0.01, 0.06, 0.1
_MAX_START_OVERLAP_M, _MAX_SINK_M, _MAX_TILT_RAD = 0.012, 0.005, 0.02


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Baked:
    """The motion of a thing.

    Attributes:
        base: of the thing, or of its lower half.
        top: of its upper half, None when it has none; at the same keyframes.
    """

    base: KeyframeMotion
    top: KeyframeMotion | None


def bake(
    starts: Sequence[Start],
    obstacles: Sequence[Obstacle],
    duration_s: float,
    *,
    names: Sequence[str],
    hits: Sequence[Hit] = (),
    pushers: Sequence[Pusher] = (),
    bystanders: Sequence[Bystander] = (),
) -> tuple[Baked, ...]:
    """The motions of things from time 0 to `duration_s`, in one world.

    What nothing touches stands exactly still; what comes nearly to rest is put to rest. An upright body keeps its
    height and does not tip: of its motion only the place on the floor and the turn about z are kept.

    Args:
        starts: the things.
        obstacles: what stands in their way, and under them.
        duration_s: how long to simulate.
        names: of the things, for messages.
        hits: impulses.
        pushers: hands.
        bystanders: people in the way.

    Returns:
        One motion per thing, in order.

    Raises:
        MotionError: a hit is not finite, names no thing or lies outside the duration; two things stand in each other;
            or an upright thing was lifted or tilted.
    """
    _check(starts, hits, duration_s)
    if not starts:
        return ()
    is_calm = all(start.body.upright or start.held for start in starts)
    rate_hz = UPRIGHT_STEP_RATE_HZ if is_calm else TUMBLING_STEP_RATE_HZ
    with BulletWorld(obstacles, starts, rate_hz) as world:
        world.check_start(names, _MAX_START_OVERLAP_M)
        return _Bake(world, starts, names, hits, pushers, bystanders).run(math.ceil(duration_s * rate_hz))


def stand(start: Start) -> Baked:
    """The motion of a thing that nothing ever moves."""
    still = KeyframeMotion(
        times_s=np.zeros(1),
        p_world=np.array([start.position_m]),
        v_world=np.zeros((1, 3)),
        q_world_xyzw=np.array([yaw_quaternion(start.yaw_rad)]),
    )
    return Baked(base=still, top=still if start.body.top else None)


def _check(starts: Sequence[Start], hits: Sequence[Hit], duration_s: float) -> None:
    if not (math.isfinite(duration_s) and duration_s > 0):
        raise MotionError(f"physics: the duration must be above 0, got {duration_s}")
    for index, start in enumerate(starts):
        if not all(math.isfinite(v) for v in (*start.position_m, start.yaw_rad)):
            raise MotionError(f"physics: thing {index} has a start that is not finite")
    for index, hit in enumerate(hits):
        if not 0 <= hit.thing < len(starts):
            raise MotionError(f"physics: hit {index} is for thing {hit.thing}, but there are {len(starts)}")
        if not all(math.isfinite(v) for v in (hit.time_s, *hit.impulse_n_s, hit.height_m, hit.offset_m)):
            raise MotionError(f"physics: hit {index} has a value that is not finite")
        if not 0 <= hit.time_s <= duration_s:
            raise MotionError(f"physics: hit {index} at {hit.time_s} s is outside the {duration_s} s")


class _Recorder:
    """Keyframes of one thing, only where it moves."""

    def __init__(self, start: Start, keyframe_s: float) -> None:
        self._body, self._start, self._keyframe_s = start.body, start, keyframe_s
        self._rows: list[list[float]] = []
        self.rest = self._row(start_state(start))
        self._rows.append([0.0, *self.rest])

    def keep(self, keyframe: int, state: State, *, moving: bool) -> None:
        """The state at a keyframe; what rests is written only at the beginning and the end of its rest."""
        if moving:
            before = (keyframe - 1) * self._keyframe_s
            if self._rows[-1][0] < before:
                self._rows.append([before, *self.rest])
            row = self._row(state)
            self.rest = [*row[:3], 0.0, 0.0, 0.0, *row[6:]]
            self._rows.append([keyframe * self._keyframe_s, *row])
        elif any(self._rows[-1][4:7]) or self._rows[-1][1:] != self.rest:
            self._rows.append([keyframe * self._keyframe_s, *self.rest])

    def _row(self, state: State) -> list[float]:
        """Position, velocity and rotation of the foot, and the rotation of the top."""
        if self._body.upright:
            x, y = state.p_world[:2]
            turn = rotation_from_quaternion(np.array(state.q_world_xyzw))
            yaw = math.atan2(float(turn[1, 0]), float(turn[0, 0]))
            return [
                x, y, self._start.position_m[2], *state.v_world[:2], 0.0,
                *yaw_quaternion(yaw), *yaw_quaternion(yaw + state.top_rad),
            ]  # fmt: skip
        R = rotation_from_quaternion(np.array(state.q_world_xyzw))
        arm = -np.sum(R * np.array(self._body.centre_of_mass_m), axis=1)
        foot = np.array(state.p_world) + arm
        v = np.array(state.v_world) + np.cross(np.array(state.w_world), arm)
        return [*foot.tolist(), *v.tolist(), *state.q_world_xyzw, *state.q_world_xyzw]

    def baked(self) -> Baked:
        """The motion."""
        rows = np.array(self._rows, dtype=np.float64)

        def motion(first: int) -> KeyframeMotion:
            return KeyframeMotion(
                times_s=rows[:, 0],
                p_world=rows[:, 1:4],
                v_world=rows[:, 4:7],
                q_world_xyzw=rows[:, first : first + 4],
            )

        return Baked(base=motion(7), top=motion(11) if self._body.top else None)


class _Bake:
    """One run of a world."""

    def __init__(
        self,
        world: BulletWorld,
        starts: Sequence[Start],
        names: Sequence[str],
        hits: Sequence[Hit],
        pushers: Sequence[Pusher],
        bystanders: Sequence[Bystander],
    ) -> None:
        self._world, self._starts, self._names, self._hits = world, starts, names, hits
        self._hands = [hand for pusher in pushers for hand in hands(world, pusher, len(starts))]
        self._pillars = [Pillar(world, bystander) for bystander in bystanders]
        self._states = [start_state(start) for start in starts]
        self._free = [k for k, start in enumerate(starts) if not start.held]
        self._awake = [False] * len(starts)
        self._calm = [0] * len(starts)
        self._reaches = [_reach(start.body) for start in starts]
        self._quiet = -1  # the look-up interval that is known to be quiet

    def run(self, steps: int) -> tuple[Baked, ...]:
        """Step, and keep keyframes."""
        recorders = [_Recorder(start, STEPS_PER_KEYFRAME / self._world.step_rate_hz) for start in self._starts]
        moved = [False] * len(self._starts)
        for step in range(steps):
            self._step(step)
            for k in self._free:
                moved[k] = moved[k] or self._awake[k]
            if (step + 1) % STEPS_PER_KEYFRAME == 0:
                for k in self._free:
                    recorders[k].keep((step + 1) // STEPS_PER_KEYFRAME, self._states[k], moving=moved[k])
                    moved[k] = self._awake[k]
        return tuple(recorder.baked() for recorder in recorders)

    def _step(self, step: int) -> None:
        time_s = step / self._world.step_rate_hz
        struck = self._strike(step)
        working = [hand for hand in self._hands if hand.is_at_work(time_s)]
        if step and not (struck or working or any(self._awake)) and self._is_quiet(time_s):
            return
        self._quiet = -1
        for hand in self._hands:
            hand.place(time_s)
        for pillar in self._pillars:
            pillar.place(time_s)
        for k in self._free:
            if not self._awake[k]:
                self._world.put(k, self._states[k])
        self._world.step()
        pushed = {hand.pusher.thing for hand in working}
        woken = [
            k
            for k in self._free
            if self._awake[k] or k in struck or ((step == 0 or k in pushed or self._is_reached(k)) and self._wakes(k))
        ]
        for k in woken:
            self._settle(k)

    def _strike(self, step: int) -> set[int]:
        """Apply the hits of this step; the things that feel one."""
        struck = set()
        for hit in self._hits:
            if round(hit.time_s * self._world.step_rate_hz) != step:
                continue
            state, body = self._states[hit.thing], self._starts[hit.thing].body
            self._world.put(hit.thing, state)
            jx, jy, _ = hit.impulse_n_s
            across = math.hypot(jx, jy)
            left = (-jy / across, jx / across) if across > 0 else (0.0, 0.0)
            # On the thing's own axis: of what has fallen over, the point lies as far from its foot as when it stood.
            up = rotation_from_quaternion(np.array(state.q_world_xyzw))[:, 2]
            along = hit.height_m - body.centre_of_mass_m[2]
            x, y, z = (float(p + along * u) for p, u in zip(state.p_world, up, strict=True))
            point = (x + hit.offset_m * left[0], y + hit.offset_m * left[1], z)
            on_top = body.top is not None and hit.height_m >= min(
                part.centre_m[2] - part.size_m[2] / 2 for part in body.top.parts
            )
            self._world.push(hit.thing, hit.impulse_n_s, point, top=on_top)
            struck.add(hit.thing)
        return struck

    def _is_quiet(self, time_s: float) -> bool:
        """Whether no person can touch a thing in this look-up interval while all things rest."""
        interval = int(time_s / LOOK_UP_S)
        if interval != self._quiet:
            if any(pillar.is_near(time_s, self._states, self._reaches) for pillar in self._pillars):
                return False
            self._quiet = interval
        return True

    def _is_reached(self, k: int) -> bool:
        """Whether a person or a thing that moves is so near that it may touch a thing at rest."""
        x, y, z = self._states[k].p_world
        for other in self._free:
            if self._awake[other]:
                ox, oy, oz = self._states[other].p_world
                up = 0.0 if self._starts[k].body.upright or self._starts[other].body.upright else z - oz
                reach = self._reaches[k] + self._reaches[other] + MARGIN_M
                if (x - ox) ** 2 + (y - oy) ** 2 + up * up < reach * reach:
                    return True
        return any(pillar.touches(k, x, y, self._reaches[k]) for pillar in self._pillars)

    def _wakes(self, k: int) -> bool:
        """Whether a thing at rest was set in motion by something that moves, or by the lack of a support."""
        state = self._world.state(k)
        if _speed(state) < _WAKE_M_S and _turn_rate(state) < _WAKE_RAD_S:
            return False
        pressed, things, by_mover = self._world.touching(k)
        return not pressed or by_mover or any(self._awake[other] for other in things)

    def _settle(self, k: int) -> None:
        """Read a moving thing, and put it to rest when it has hardly moved for a while."""
        state = self._world.state(k)
        body = self._starts[k].body
        if body.upright:
            self._check_upright(k, body, state)
        is_calm = _speed(state) < _REST_M_S and _turn_rate(state) < _REST_RAD_S
        self._calm[k] = self._calm[k] + 1 if is_calm else 0
        self._awake[k] = self._calm[k] < _REST_S * self._world.step_rate_hz
        if not self._awake[k]:
            self._calm[k] = 0
            state = State(p_world=state.p_world, q_world_xyzw=state.q_world_xyzw, top_rad=state.top_rad)
        self._states[k] = state

    def _check_upright(self, k: int, body: Body, state: State) -> None:
        lift = state.p_world[2] - body.centre_of_mass_m[2] - self._starts[k].position_m[2]
        tilt = math.acos(min(1.0, float(rotation_from_quaternion(np.array(state.q_world_xyzw))[2, 2])))
        if abs(lift) > _MAX_SINK_M or tilt > _MAX_TILT_RAD:
            raise MotionError(
                f"{self._names[k]}: left the floor by {1e3 * lift:.1f} mm and tilted by {tilt:.3f} rad; "
                "weaken the push, or keep things and obstacles apart at the start"
            )


def _reach(body: Body) -> float:
    """How far a body reaches, at most, sideways from its centre of mass; one that can tip, in all directions."""
    parts = (*body.parts, *(body.top.parts if body.top else ()))
    x, y, z = body.centre_of_mass_m

    def corner(part: Part) -> float:
        (px, py, pz), (sx, sy, sz) = part.centre_m, part.size_m
        up = 0.0 if body.upright else abs(pz - z) + sz / 2
        return math.hypot(abs(px - x) + sx / 2, abs(py - y) + sy / 2, up)

    return max(corner(part) for part in parts)


def _speed(state: State) -> float:
    return math.sqrt(sum(part * part for part in state.v_world))


def _turn_rate(state: State) -> float:
    return max(math.sqrt(sum(part * part for part in state.w_world)), abs(state.top_rad_s))
