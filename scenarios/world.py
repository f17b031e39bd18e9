"""Builds the simulator that a scenario describes."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np

from scenarios.errors import unknown
from scenarios.spec import CameraSpec, ChairSpec, PersonSpec, Scenario, SensorSpec
from sim.body import Soles
from sim.camera_path import CameraPath, HalfspherePath, RecordedPath, RpyPath, StaticPath, XyzPath, read_recorded
from sim.chairs import office_chair_surfaces
from sim.errors import CameraPathError
from sim.geometry import FloatArray, look_at
from sim.humans import CHARACTERS, Character, load_character
from sim.motion import Sitter, Stander, Walker
from sim.office import LIGHTS, build_office, chair_obstacles
from sim.physics import ChairPush, ChairStart, bake_chairs
from sim.records import CameraModel
from sim.renderers.visibility_buffer import VisibilityBufferRenderer
from sim.scene import Motion, Scene, SceneObject
from sim.sensor import SensorModel
from sim.simulator import Renderer, Simulator

RENDERERS: Mapping[str, Callable[[Scene, CameraModel, int], Renderer]] = MappingProxyType(
    {"numba": VisibilityBufferRenderer}
)

PATHS = MappingProxyType({"static": StaticPath, "xyz": XyzPath, "rpy": RpyPath, "halfsphere": HalfspherePath})

FIRST_PERSON_ID, FIRST_CHAIR_ID = 1, 51

HIPS_BEHIND_SEAT_M = 0.1
"""The hip joints of a sitting person are this far behind the middle of the seat."""


def build_simulator(scenario: Scenario, renderer: str, threads: int) -> Simulator:
    """The simulator of `scenario`.

    Args:
        scenario: what happens.
        renderer: a key of RENDERERS.
        threads: of the renderer; the bytes do not depend on it.

    Raises:
        ScenarioError: no such renderer, character or outfit.
        SimError: a recorded trajectory cannot be replayed, or a motion cannot be built.
    """
    if renderer not in RENDERERS:
        raise unknown("renderer", renderer, RENDERERS)
    camera_path = _camera_path(scenario)
    people = [_person(person, scenario, FIRST_PERSON_ID + number) for number, person in enumerate(scenario.people.cast)]
    scene = Scene(objects=(*build_office(scenario.seed), *people, *_chairs(scenario)), lights=LIGHTS)
    camera = _camera_model(scenario.camera)
    return Simulator(
        scene=scene,
        camera=camera,
        camera_path=camera_path,
        sensor=_sensor(scenario.sensor),
        renderer=RENDERERS[renderer](scene, camera, threads),
        seed=scenario.seed,
        frames=scenario.frames,
        frame_rate_hz=scenario.frame_rate_hz,
    )


def _camera_model(spec: CameraSpec) -> CameraModel:
    return CameraModel(width=spec.width, height=spec.height, fx=spec.fx, fy=spec.fy, cx=spec.cx, cy=spec.cy)


def _nominal_camera(spec: CameraSpec) -> FloatArray:
    """`T_world_camera` (4, 4) in the middle of the path."""
    heading, tilt = math.radians(spec.heading_deg), math.radians(spec.tilt_deg)
    forward = (math.cos(heading) * math.cos(tilt), math.sin(heading) * math.cos(tilt), -math.sin(tilt))
    return look_at(spec.position_m, np.add(spec.position_m, forward))


def _camera_path(scenario: Scenario) -> CameraPath:
    spec = scenario.camera
    if spec.trajectory is None:
        nominal = _nominal_camera(spec)
        return PATHS[spec.path](T_world_camera=nominal, seed=scenario.seed, amplitude=spec.amplitude, speed=spec.speed)
    path = RecordedPath.placed(
        read_recorded(Path(spec.trajectory)),
        position_world=spec.position_m,
        heading_rad=math.radians(spec.heading_deg),
        speed=spec.speed,
    )
    if path.duration_s < scenario.duration_s:
        enough = int(path.duration_s * scenario.frame_rate_hz) + 1
        raise CameraPathError(
            f"{spec.trajectory}: lasts {path.duration_s:.2f} s at speed {spec.speed:g}, but {scenario.frames} frames "
            f"need {scenario.duration_s:.2f} s; use --frames {enough} at most"
        )
    return path


def _person(spec: PersonSpec, scenario: Scenario, instance_id: int) -> SceneObject:
    if spec.character not in CHARACTERS:
        raise unknown("character", spec.character, CHARACTERS)
    if spec.outfit not in CHARACTERS[spec.character]:
        raise unknown(f"outfit of {spec.character}", spec.outfit, CHARACTERS[spec.character])
    character = load_character(spec.character, spec.outfit)
    return SceneObject(
        name=spec.name,
        class_name="person",
        instance_id=instance_id,
        surfaces=character.surfaces,
        motion=_motion(spec, scenario, character),
        is_actor=True,
    )


def _motion(spec: PersonSpec, scenario: Scenario, character: Character) -> Motion:
    soles, heading = _soles(character), math.radians(spec.heading_deg)
    if spec.action == "walk":
        return Walker(
            character.skeleton,
            soles,
            spec.waypoints_m,
            spec.speed_m_s * scenario.people.speed,
            closed=spec.closed,
            start_m=spec.start_m,
            seed=scenario.seed,
        )
    place = np.array(spec.waypoints_m[0])
    if spec.action == "stand":
        return Stander(character.skeleton, soles, place, heading, amplitude=spec.amplitude, seed=scenario.seed)
    hips = place - HIPS_BEHIND_SEAT_M * np.array([math.cos(heading), math.sin(heading)])
    return Sitter(character.skeleton, soles, hips, heading, amplitude=spec.amplitude, seed=scenario.seed)


def _soles(character: Character) -> Soles:
    """The points under the feet, gathered from all surfaces."""
    points, bones, weights = [], [], []
    for surface, indices in zip(character.surfaces, character.soles, strict=True):
        assert surface.bones is not None
        assert surface.weights is not None
        points.append(surface.vertices[indices])
        bones.append(surface.bones[indices])
        weights.append(surface.weights[indices])
    return Soles(
        points=np.concatenate(points).astype(np.float64),
        bones=np.concatenate(bones).astype(np.int64),
        weights=np.concatenate(weights).astype(np.float64),
    )


def _chairs(scenario: Scenario) -> list[SceneObject]:
    starts = [ChairStart(position_m=c.position_m, yaw_rad=_chair_yaw(c)) for c in scenario.chairs]
    pushes = [
        ChairPush(
            chair=number,
            time_s=push.time_s,
            impulse_n_s=push.impulse_n_s,
            height_m=push.height_m,
            offset_m=push.offset_m,
        )
        for number, chair in enumerate(scenario.chairs)
        for push in chair.pushes
        if push.time_s < scenario.duration_s
    ]
    motions = bake_chairs(starts, pushes, chair_obstacles(), max(scenario.duration_s, 1.0)) if starts else ()
    return [
        SceneObject(
            name=chair.name,
            class_name="chair",
            instance_id=FIRST_CHAIR_ID + number,
            surfaces=office_chair_surfaces(scenario.seed, chair.colour),
            motion=motion,
            is_actor=True,
        )
        for number, (chair, motion) in enumerate(zip(scenario.chairs, motions, strict=True))
    ]


def _chair_yaw(chair: ChairSpec) -> float:
    """A chair at yaw 0 faces -y, at heading 0 it faces +x."""
    return math.radians(chair.heading_deg + 90.0)


def _sensor(spec: SensorSpec) -> SensorModel:
    return SensorModel() if spec.noise else SensorModel.perfect()
