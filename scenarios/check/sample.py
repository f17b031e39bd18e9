"""What the checks look at: two frames that follow each other, with all that the simulator says about them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenarios.errors import ScenarioError
from sim.geometry import FloatArray
from sim.people.clearance import Clearance, clearances
from sim.records import CameraModel, ObjectTruth, RenderedImages
from sim.rooms.room import Obstacle
from sim.scene import SceneObject
from sim.simulator import Simulator
from sim.truth import SurfaceMoments

STEPS_A_FRAME = 8
"""The velocity is compared with differences over eighths of a frame: people's centres shake from frame to frame."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class View:
    """One frame.

    Attributes:
        images: perfect, with normals; those of the first frame with flow.
        T_world_camera: (4, 4) as the truth states it.
        objects: the truth about every actor.
        palettes: (B, 4, 4) rest-to-world matrices of every actor, by name.
    """

    images: RenderedImages
    T_world_camera: FloatArray
    objects: tuple[ObjectTruth, ...]
    palettes: Mapping[str, FloatArray]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sample:
    """A frame and the next one.

    Attributes:
        index: of the first frame.
        camera: of the images.
        step_s: from one of the centres to the next.
        scene: all objects.
        now: the first frame; its flow leads to the next one.
        then: the next frame.
        near: least distance of every person to each obstacle and to each other person, over the times that the frame
            stands for.
        centres: (5, 3) of every actor, from two steps before `now` to two after, by name.
    """

    index: int
    camera: CameraModel
    step_s: float
    scene: tuple[SceneObject, ...]
    now: View
    then: View
    near: tuple[Clearance, ...]
    centres: Mapping[str, FloatArray]


def sample_indices(frames: int, number: int) -> list[int]:
    """At most `number` frames spread evenly over a sequence, away from its ends.

    Raises:
        ScenarioError: the sequence is too short.
    """
    if frames < 3:
        raise ScenarioError(f"check: needs a scenario of at least 3 frames, this one has {frames}")
    return sorted({round(float(x)) for x in np.linspace(1, frames - 2, max(number, 1))})


def take_sample(simulator: Simulator, index: int, obstacles: Sequence[Obstacle], times_s: FloatArray) -> Sample:
    """Ask the simulator about frame `index` and the next one.

    Args:
        simulator: of the scenario.
        index: of the first frame.
        obstacles: of the room.
        times_s: that the frame stands for, at which people are asked where they are.
    """
    people = {actor.name: actor.motion for actor in simulator.scene.actors if actor.class_name == "person"}
    named = {f"obstacle {number}": obstacle for number, obstacle in enumerate(obstacles)}
    step_s = (simulator.time_s(index + 1) - simulator.time_s(index)) / STEPS_A_FRAME
    around_s = [simulator.time_s(index) + step * step_s for step in range(-2, 3)]
    centres = {}
    for actor in simulator.scene.actors:
        surface = SurfaceMoments.of(actor)
        centres[actor.name] = np.array([surface.centre(actor.motion.palette_at(time_s)) for time_s in around_s])
    return Sample(
        index=index,
        camera=simulator.camera,
        step_s=step_s,
        scene=simulator.scene.objects,
        now=_view(simulator, index, flow=True),
        then=_view(simulator, index + 1, flow=False),
        near=clearances(people, named, times_s),
        centres=centres,
    )


def _view(simulator: Simulator, index: int, *, flow: bool) -> View:
    truth = simulator.frame(index).truth
    images, moment = simulator.render(index, normals=True, flow=flow)
    return View(images=images, T_world_camera=truth.T_world_camera, objects=truth.objects, palettes=moment.palettes)


def posed_vertices(obj: SceneObject, palette: FloatArray) -> FloatArray:
    """(n, 3) world positions of all vertices of an object, by linear blend skinning."""
    posed = []
    for surface in obj.surfaces:
        rest = np.concatenate([surface.vertices.astype(float), np.ones((len(surface.vertices), 1))], axis=1)
        if surface.bones is None or surface.weights is None:
            posed.append(np.einsum("ij,nj->ni", palette[0, :3], rest))
        else:
            weights = surface.weights / surface.weights.sum(axis=1, keepdims=True)
            posed.append(np.einsum("nk,nkij,nj->ni", weights, palette[surface.bones][:, :, :3], rest))
    return np.concatenate(posed)


def rays(camera: CameraModel) -> FloatArray:
    """(H, W, 3) points at depth 1 of all pixels, camera frame."""
    v, u = np.mgrid[0 : camera.height, 0 : camera.width].astype(float)
    return np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones_like(u)], axis=-1)


def world_points(view: View, camera: CameraModel) -> FloatArray:
    """(H, W, 3) the surface point of every pixel in the world; the camera's own place where nothing was hit."""
    points = rays(camera) * view.images.depth_m[..., None].astype(float)
    return np.asarray(np.einsum("ij,vuj->vui", view.T_world_camera[:3, :3], points) + view.T_world_camera[:3, 3])


def camera_points(points_world: FloatArray, view: View) -> FloatArray:
    """(..., 3) world points in the camera frame of `view`."""
    # Poses are rounded to a grid: the inverse, and not the transpose, which is off by a part in ten million.
    R_camera_world = np.linalg.inv(view.T_world_camera[:3, :3])
    return np.asarray(np.einsum("ij,...j->...i", R_camera_world, points_world - view.T_world_camera[:3, 3]))


def pixels_of(points: FloatArray, camera: CameraModel) -> FloatArray:
    """(..., 2) u, v of points of the camera frame; NaN behind the camera."""
    depth = np.where(points[..., 2:] > 0, points[..., 2:], np.nan)
    return np.asarray(points[..., :2] / depth * (camera.fx, camera.fy) + (camera.cx, camera.cy))


def neighbours(image: npt.NDArray[np.float64]) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Left, right, upper and lower neighbour of every pixel; NaN beyond the border."""
    padded = np.pad(image, 1, constant_values=np.nan)
    return padded[1:-1, :-2], padded[1:-1, 2:], padded[:-2, 1:-1], padded[2:, 1:-1]
