"""What `dotmask doctor` looks at: is everything here that a run needs, and is it unharmed?"""

import os
import platform
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import sim
from dotmask.errors import SegmenterError, SlamError
from dotmask.segmentation.networks import pytorch
from dotmask.slam.rtabmap.library import DEPTHAI_VERSION, core
from scenarios.run_folder import versions
from scenarios.world import RENDERERS
from sim.assets import AssetState, verify_assets
from sim.errors import AssetError, SimError
from sim.records import CameraModel, Moment
from sim.scene import Placed, Scene, SceneObject, Surface


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One thing looked at.

    Attributes:
        what: its name.
        said: what was found, and what to do where it is not well.
        is_well: whether it is as it should be.
        is_needed: whether a run fails without it.
    """

    what: str
    said: str
    is_well: bool
    is_needed: bool = True


def _python() -> Finding:
    well = (3, 11) <= sys.version_info < (3, 14)
    return Finding(
        what="python", said=platform.python_version() + ("" if well else ": use Python 3.11 to 3.13"), is_well=well
    )


def _packages() -> Finding:
    return Finding(what="packages", said=", ".join(f"{k} {v}" for k, v in versions().items()), is_well=True)


def _owner_of_sim() -> Finding:
    return Finding(what="package sim", said=str(Path(sim.__file__ or "").parent), is_well=True)


def _assets() -> Finding:
    try:
        states = verify_assets()
    except AssetError as error:
        return Finding(what="assets", said=str(error), is_well=False)
    harmed = [f"{name} is {state.value}" for name, state in states.items() if state is not AssetState.OK]
    if harmed:
        return Finding(what="assets", said=", ".join(harmed) + ": restore the checkout or reinstall", is_well=False)
    return Finding(what="assets", said=f"{len(states)} files agree with the manifest", is_well=True)


def _threads() -> Finding:
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return Finding(what="cores", said=str(cores), is_well=True)


def _default_renderer() -> Finding:
    return _renderer("numba", is_needed=True)


def _second_renderer() -> Finding:
    return _renderer("pyrender", is_needed=False)


def _renderer(name: str, is_needed: bool) -> Finding:
    """Whether a renderer draws: a wall at 2 m must be at 2 m."""
    what, distance_m = f"renderer {name}", 2.0
    camera = CameraModel(width=16, height=16, fx=16.0, fy=16.0, cx=7.5, cy=7.5)
    scene = Scene(objects=(_wall(distance_m),), lights=())
    try:
        depth_m = RENDERERS[name](scene, camera, 1).render(Moment(T_world_camera=np.eye(4), palettes={})).depth_m
    except SimError as error:
        return Finding(what=what, said=str(error), is_well=False, is_needed=is_needed)
    error_m = float(np.abs(depth_m - distance_m).max())
    said = f"draws, {1e3 * error_m:.4f} mm off" if error_m < 1e-3 else f"draws a wall {error_m:.3f} m off: report this"
    platform = os.environ.get("PYOPENGL_PLATFORM") if name == "pyrender" else None
    return Finding(
        what=what, said=said + (f", on {platform}" if platform else ""), is_well=error_m < 1e-3, is_needed=is_needed
    )


def _rtabmap() -> Finding:
    what = "SLAM rtabmap"
    try:
        rtabmap = core()
    except SlamError as error:
        return Finding(what=what, said=str(error), is_well=False, is_needed=False)
    return Finding(what=what, said=f"RTAB-Map {rtabmap.version} of depthai {DEPTHAI_VERSION}", is_well=True)


def _networks() -> Finding:
    what = "networks"
    try:
        return Finding(what=what, said=pytorch(), is_well=True)
    except SegmenterError as error:
        return Finding(what=what, said=str(error), is_well=False, is_needed=False)


def _wall(distance_m: float) -> SceneObject:
    """A square before a camera at the origin that looks along z, far larger than the image."""
    side = 10.0 * distance_m
    corners = [(-side, -side), (-side, side), (side, side), (side, -side)]
    surface = Surface(
        vertices=np.array([(x, y, distance_m) for x, y in corners], np.float32),
        normals=np.array([(0, 0, -1)] * 4, np.float32),
        uv=np.zeros((4, 2), np.float32),
        faces=np.array([(0, 1, 2), (0, 2, 3)], np.int32),
        texture=np.full((1, 1, 3), 200, np.uint8),
    )
    return SceneObject(name="wall", class_name="wall", instance_id=1, surfaces=(surface,), motion=Placed(np.eye(4)))


EXAMINATIONS: tuple[Callable[[], Finding], ...] = (
    _python,
    _packages,
    _owner_of_sim,
    _assets,
    _threads,
    _default_renderer,
    _second_renderer,
    _rtabmap,
    _networks,
)


def examine() -> list[Finding]:
    """All findings."""
    return [look() for look in EXAMINATIONS]
