"""Builds the simulator that a scenario describes."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType

from scenarios.camera import camera_model, camera_path
from scenarios.cast import build_cast
from scenarios.errors import unknown
from scenarios.props import build_props
from scenarios.spec import Scenario, SensorSpec
from sim.camera_paths.driven import DrivenPath
from sim.records import CameraModel
from sim.renderers.visibility_buffer import VisibilityBufferRenderer
from sim.rooms.bare import build_bare
from sim.rooms.corridor import build_corridor
from sim.rooms.desk import build_desk_room
from sim.rooms.long_office import build_long_office
from sim.rooms.office import build_office
from sim.rooms.room import Room
from sim.scene import Frozen, Scene, SceneObject
from sim.sensor.failures import SensorFailure
from sim.sensor.parameters import SENSORS, Sensor
from sim.sensor.timing import Timing
from sim.simulator import Renderer, Simulator


def _pyrender(scene: Scene, camera: CameraModel, threads: int) -> Renderer:
    """The second renderer; its library is imported here alone, and OpenGL has threads of its own.

    Raises:
        SimError: there is no OpenGL library.
    """
    from sim.renderers.pyrender_renderer.renderer import PyrenderRenderer

    return PyrenderRenderer(scene, camera)


RENDERERS: Mapping[str, Callable[[Scene, CameraModel, int], Renderer]] = MappingProxyType(
    {"numba": VisibilityBufferRenderer, "pyrender": _pyrender}
)
"""By name."""

ROOMS: Mapping[str, Callable[[int], Room]] = MappingProxyType(
    {
        "office": build_office,
        "desk": build_desk_room,
        "long_office": build_long_office,
        "corridor": build_corridor,
        "bare": build_bare,
    }
)


def build_simulator(
    scenario: Scenario, renderer: str, threads: int, driven_path: DrivenPath | None = None
) -> Simulator:
    """The simulator of `scenario`.

    Args:
        scenario: what happens.
        renderer: a key of RENDERERS.
        threads: of the renderer; the bytes do not depend on it.
        driven_path: where the camera is, in place of the scenario's own path.

    Raises:
        ScenarioError: no such renderer, character or outfit.
        SimError: a recorded trajectory cannot be replayed, or a motion cannot be built.
    """
    if renderer not in RENDERERS:
        raise unknown("renderer", renderer, RENDERERS)
    path = camera_path(scenario) if driven_path is None else driven_path
    scene = build_scene(scenario)
    camera = camera_model(scenario.camera)
    return Simulator(
        scene=scene,
        camera=camera,
        camera_path=path,
        sensor=_sensor(scenario.sensor),
        renderer=RENDERERS[renderer](scene, camera, threads),
        seed=scenario.seed,
        frames=scenario.frames,
        frame_rate_hz=scenario.frame_rate_hz,
    )


def build_scene(scenario: Scenario) -> Scene:
    """Everything that stands and moves in a scenario, without camera and sensor.

    Raises:
        ScenarioError, SimError: as `build_simulator`.
    """
    room = ROOMS[scenario.room](scenario.seed)
    cast = build_cast(scenario)
    props = build_props(scenario, cast, room.obstacles)
    return Scene(objects=(*room.objects, *_varied(scenario.variant, cast, props)), lights=room.lights)


def _varied(variant: str, cast: tuple[SceneObject, ...], props: tuple[SceneObject, ...]) -> tuple[SceneObject, ...]:
    """The actors of a counterfactual: all that move, all as they are at time 0, or the things alone, as at time 0."""
    if variant == "moving":
        return (*cast, *props)
    staying = (*cast, *props) if variant == "frozen" else props
    return tuple(replace(actor, motion=Frozen(actor.motion)) for actor in staying)


def _sensor(spec: SensorSpec) -> Sensor:
    sensor = SENSORS[spec.model]
    return replace(
        sensor,
        timing=sensor.timing if spec.motion_errors else Timing(),
        failures=tuple(SensorFailure(kind=f.kind, first=f.first, frames=f.frames) for f in spec.failures),
    )
