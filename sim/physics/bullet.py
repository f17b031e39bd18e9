"""A world of rigid bodies in Bullet: the one module that knows pybullet.

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

from sim.errors import MotionError
from sim.physics.bodies import Part, Vector
from sim.physics.events import Start
from sim.rooms.room import Obstacle

GRAVITY_M_S2 = 9.81
_HELD_UPRIGHT_KG_M2 = 1e5
"""What is upright does not tip: its tilt is held by this inertia."""
_MOVER_MASS_KG = 1e4
_ALL, _THINGS, _MOVERS = 1, 2, 4
_TURNING = 0  # the index of the one joint, and of the link that it turns

Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """Where a body is and how it moves.

    Attributes:
        p_world: (3,) of the centre of mass of its lower half.
        q_world_xyzw: (4,).
        v_world, w_world: (3,) speed of that centre, and rate of turn.
        top_rad, top_rad_s: angle and rate of the top relative to the lower half.
    """

    p_world: Vector
    q_world_xyzw: Quaternion
    v_world: Vector = (0.0, 0.0, 0.0)
    w_world: Vector = (0.0, 0.0, 0.0)
    top_rad: float = 0.0
    top_rad_s: float = 0.0


def yaw_quaternion(yaw_rad: float) -> Quaternion:
    """(x, y, z, w) of a turn about z."""
    return (0.0, 0.0, math.sin(yaw_rad / 2), math.cos(yaw_rad / 2))


class BulletWorld:
    """Obstacles, things that move freely, and movers that nothing stops.

    Use it as a context manager: it holds a connection.

    Args:
        obstacles: what stands.
        starts: the things; their numbers are their places in this sequence.
        step_rate_hz: steps per second.
    """

    def __init__(self, obstacles: Sequence[Obstacle], starts: Sequence[Start], step_rate_hz: int) -> None:
        self.step_rate_hz = step_rate_hz
        self._bodies = [start.body for start in starts]
        self._bullet = _import_bullet()
        with _silence():
            self._client = int(self._bullet.connect(self._bullet.DIRECT))
        bullet = self._bullet
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=1 / step_rate_hz,
            numSubSteps=1,
            numSolverIterations=60,
            deterministicOverlappingPairs=1,
            enableConeFriction=1,
            physicsClientId=self._client,
        )
        bullet.setGravity(0, 0, -GRAVITY_M_S2, physicsClientId=self._client)
        floor = bullet.createMultiBody(
            0,
            bullet.createCollisionShape(bullet.GEOM_PLANE, physicsClientId=self._client),
            physicsClientId=self._client,
        )
        self._set_surface(floor, -1, friction=1.0, restitution=1.0)
        self._obstacles = {self._add_obstacle(box): box for box in obstacles}
        self._things = [self._add_thing(start) for start in starts]
        self._movers: list[int] = []

    def __enter__(self) -> "BulletWorld":
        return self

    def __exit__(self, *_: object) -> None:
        self._bullet.disconnect(self._client)

    def _set_surface(
        self, body: int, link: int, *, friction: float, restitution: float, rolling_m: float = 0.0
    ) -> None:
        self._bullet.changeDynamics(
            body,
            link,
            lateralFriction=friction,
            rollingFriction=rolling_m,
            spinningFriction=rolling_m,
            restitution=restitution,
            linearDamping=0.0,
            angularDamping=0.0,
            jointDamping=0.0,
            physicsClientId=self._client,
        )

    def _add_obstacle(self, box: Obstacle) -> int:
        shape = self._bullet.createCollisionShape(
            self._bullet.GEOM_BOX, halfExtents=[extent / 2 for extent in box.size_m], physicsClientId=self._client
        )
        body = self._bullet.createMultiBody(
            0,
            shape,
            basePosition=box.centre_m,
            baseOrientation=yaw_quaternion(box.yaw_rad),
            physicsClientId=self._client,
        )
        self._set_surface(body, -1, friction=1.0, restitution=1.0)
        return int(body)

    def _shape(self, parts: Sequence[Part], origin_m: Vector) -> int:
        """A collision shape of several parts, whose frame is at `origin_m` of the thing's rest frame."""
        bullet = self._bullet
        kinds = {"box": bullet.GEOM_BOX, "cylinder": bullet.GEOM_CYLINDER, "sphere": bullet.GEOM_SPHERE}
        places = [[c - o for c, o in zip(part.centre_m, origin_m, strict=True)] for part in parts]
        return int(
            bullet.createCollisionShapeArray(
                shapeTypes=[kinds[part.kind] for part in parts],
                radii=[part.size_m[0] / 2 for part in parts],
                halfExtents=[[extent / 2 for extent in part.size_m] for part in parts],
                lengths=[part.size_m[2] for part in parts],
                collisionFramePositions=places,
                physicsClientId=self._client,
            )
        )

    def _add_thing(self, start: Start) -> int:
        body, bullet = start.body, self._bullet
        state = start_state(start)
        links: dict[str, object] = {}
        if body.top is not None:
            axis = (0.0, 0.0, body.top.centre_of_mass_m)
            links = {
                "linkMasses": [body.top.mass_kg],
                "linkCollisionShapeIndices": [self._shape(body.top.parts, axis)],
                "linkVisualShapeIndices": [-1],
                "linkPositions": [[0.0, 0.0, body.top.centre_of_mass_m - body.centre_of_mass_m[2]]],
                "linkOrientations": [[0.0, 0.0, 0.0, 1.0]],
                "linkInertialFramePositions": [[0.0, 0.0, 0.0]],
                "linkInertialFrameOrientations": [[0.0, 0.0, 0.0, 1.0]],
                "linkParentIndices": [0],
                "linkJointTypes": [bullet.JOINT_REVOLUTE],
                "linkJointAxis": [[0.0, 0.0, 1.0]],
            }
        thing = int(
            bullet.createMultiBody(
                0.0 if start.held else body.mass_kg,
                self._shape(body.parts, body.centre_of_mass_m),
                basePosition=state.p_world,
                baseOrientation=state.q_world_xyzw,
                physicsClientId=self._client,
                **links,
            )
        )
        self._set_surface(thing, -1, friction=body.friction, restitution=body.restitution, rolling_m=body.rolling_m)
        inertia = list(body.inertia_kg_m2)
        if body.upright:
            inertia[:2] = [_HELD_UPRIGHT_KG_M2] * 2
        if not start.held:
            bullet.changeDynamics(thing, -1, localInertiaDiagonal=inertia, physicsClientId=self._client)
        if body.top is not None:
            about = body.top.inertia_kg_m2
            self._set_surface(thing, _TURNING, friction=body.top.friction, restitution=body.restitution)
            bullet.changeDynamics(
                thing, _TURNING, localInertiaDiagonal=[about, about, about], physicsClientId=self._client
            )
            bullet.setJointMotorControl2(
                thing,
                _TURNING,
                bullet.VELOCITY_CONTROL,
                targetVelocity=0.0,
                force=body.top.bearing_n_m,
                physicsClientId=self._client,
            )
        self._set_group(thing, -1, _THINGS, _ALL | _THINGS | _MOVERS)
        if body.top is not None:
            self._set_group(thing, _TURNING, _THINGS, _ALL | _THINGS | _MOVERS)
        return thing

    def _set_group(self, body: int, link: int, group: int, others: int) -> None:
        self._bullet.setCollisionFilterGroupMask(body, link, group, others, physicsClientId=self._client)

    def add_mover(self, part: Part, friction: float, ignores: Sequence[int]) -> int:
        """A solid that `place_mover` moves and nothing stops; it touches things only. Its number.

        Args:
            part: its shape, about the place that it is put to.
            friction: of its surface.
            ignores: numbers of things that it passes through.
        """
        mover = int(
            self._bullet.createMultiBody(
                _MOVER_MASS_KG,
                self._shape([part], (0.0, 0.0, 0.0)),
                basePosition=[0.0, 0.0, 100.0 + 10.0 * len(self._movers)],
                physicsClientId=self._client,
            )
        )
        self._set_surface(mover, -1, friction=friction, restitution=0.0)
        self._set_group(mover, -1, _MOVERS, _THINGS)
        for thing in ignores:
            for link in (-1, _TURNING) if self._bodies[thing].top else (-1,):
                self._bullet.setCollisionFilterPair(
                    mover, self._things[thing], -1, link, 0, physicsClientId=self._client
                )
        self._movers.append(mover)
        return len(self._movers) - 1

    def place_mover(self, number: int, p_world: Vector | None, v_world: Vector = (0.0, 0.0, 0.0)) -> None:
        """Put a mover somewhere for the next step, with the speed that its contacts feel; None: out of the world."""
        where = p_world if p_world is not None else (0.0, 0.0, 100.0 + 10.0 * number)
        self._bullet.resetBasePositionAndOrientation(
            self._movers[number], where, [0.0, 0.0, 0.0, 1.0], physicsClientId=self._client
        )
        lifted = [v_world[0], v_world[1], v_world[2] + GRAVITY_M_S2 / self.step_rate_hz]
        self._bullet.resetBaseVelocity(self._movers[number], lifted, [0.0, 0.0, 0.0], physicsClientId=self._client)

    def overlap_m(self, number: int, thing: int) -> float:
        """How deep a mover is inside a thing, 0 when it is not."""
        points = self._bullet.getClosestPoints(
            self._movers[number], self._things[thing], 0.0, physicsClientId=self._client
        )
        return max((-float(point[8]) for point in points), default=0.0)

    def push(self, thing: int, impulse_n_s: Vector, point_world: Vector, *, top: bool) -> None:
        """An impulse of the next step on a thing, or on its top."""
        self._bullet.applyExternalForce(
            self._things[thing],
            _TURNING if top else -1,
            [self.step_rate_hz * part for part in impulse_n_s],
            point_world,
            self._bullet.WORLD_FRAME,
            physicsClientId=self._client,
        )

    def step(self) -> None:
        """Advance by one step."""
        self._bullet.stepSimulation(physicsClientId=self._client)

    def put(self, thing: int, state: State) -> None:
        """Set a thing's place and speed."""
        body = self._things[thing]
        self._bullet.resetBasePositionAndOrientation(
            body, state.p_world, state.q_world_xyzw, physicsClientId=self._client
        )
        self._bullet.resetBaseVelocity(body, state.v_world, state.w_world, physicsClientId=self._client)
        if self._bodies[thing].top is not None:
            self._bullet.resetJointState(body, _TURNING, state.top_rad, state.top_rad_s, physicsClientId=self._client)

    def state(self, thing: int) -> State:
        """A thing's place and speed."""
        body = self._things[thing]
        p, q = self._bullet.getBasePositionAndOrientation(body, physicsClientId=self._client)
        v, w = self._bullet.getBaseVelocity(body, physicsClientId=self._client)
        if self._bodies[thing].top is None:
            return State(p_world=p, q_world_xyzw=q, v_world=v, w_world=w)
        angle, rate, _, _ = self._bullet.getJointState(body, _TURNING, physicsClientId=self._client)
        return State(p_world=p, q_world_xyzw=q, v_world=v, w_world=w, top_rad=angle, top_rad_s=rate)

    def touching(self, thing: int) -> tuple[bool, frozenset[int], bool]:
        """What pressed on a thing in the last step: anything at all; which other things; a mover."""
        contacts = self._bullet.getContactPoints(bodyA=self._things[thing], physicsClientId=self._client)
        others = {int(contact[2]) for contact in contacts if contact[9] > 0}
        things = frozenset(number for number, body in enumerate(self._things) if body in others)
        return bool(others), things, any(mover in others for mover in self._movers)

    def check_start(self, names: Sequence[str], tolerance_m: float) -> None:
        """Refuse things that stand in each other or in an obstacle.

        Raises:
            MotionError: one does.
        """
        self._bullet.performCollisionDetection(physicsClientId=self._client)
        for number, body in enumerate(self._things):
            for contact in self._bullet.getContactPoints(bodyA=body, physicsClientId=self._client):
                other = int(contact[2])
                if contact[8] < -tolerance_m and other not in self._movers:
                    raise MotionError(
                        f"{names[number]}: stands {-1e3 * contact[8]:.0f} mm deep in {self._name(other, names)}; "
                        "move one of them"
                    )

    def _name(self, body: int, names: Sequence[str]) -> str:
        if body in self._things:
            return names[self._things.index(body)]
        if body not in self._obstacles:
            return "the floor"
        box = self._obstacles[body]
        sizes = " x ".join(f"{extent:.2f}" for extent in box.size_m)
        return f"the obstacle of {sizes} m at ({', '.join(f'{v:.2f}' for v in box.centre_m)})"


def start_state(start: Start) -> State:
    """The state of a thing that stands at its start."""
    c, s = math.cos(start.yaw_rad), math.sin(start.yaw_rad)
    x, y, z = start.body.centre_of_mass_m
    p = (start.position_m[0] + c * x - s * y, start.position_m[1] + s * x + c * y, start.position_m[2] + z)
    return State(p_world=p, q_world_xyzw=yaw_quaternion(start.yaw_rad))


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Drop what native code prints on file descriptors 1 and 2."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [(descriptor, os.dup(descriptor)) for descriptor in (1, 2)]
    try:
        with open(os.devnull, "wb") as sink:
            for descriptor, _ in kept:
                os.dup2(sink.fileno(), descriptor)
        yield
    finally:
        for descriptor, copy in kept:
            os.dup2(copy, descriptor)
            os.close(copy)


def _import_bullet() -> ModuleType:
    """The pybullet module, imported at the first bake because it is heavy and greets on stderr."""
    if "pybullet" not in sys.modules:
        with _silence():
            import pybullet
    import pybullet

    return pybullet  # type: ignore[no-any-return]  # the library has no types
