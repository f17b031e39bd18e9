"""The simulator: it asks every actor where it is, renders, states the truth, and lets the sensor err."""

from collections.abc import Iterator
from typing import Protocol

from sim.camera_path import CameraPath
from sim.geometry import FloatArray, on_grid
from sim.records import CameraModel, GroundTruth, RenderedImages, SimFrame
from sim.scene import Scene
from sim.sensor import SensorModel
from sim.truth import SurfaceMoments, object_truth


class Renderer(Protocol):
    """Draws a scene. One instance belongs to one scene and one camera model."""

    def render(self, T_world_camera: FloatArray, palettes: dict[str, FloatArray]) -> RenderedImages:
        """Images of one moment; `palettes` holds (B, 4, 4) rest-to-world matrices by actor name."""
        ...

    def unoccluded_pixels(self, name: str) -> int:
        """Pixels inside the image that an actor of the last frame would cover if it were alone."""
        ...


class Simulator:
    """A finite sequence of frames; each is a pure function of its index, so any can be made alone, in any order.

    Args:
        scene: what stands in the world.
        camera: of both images.
        camera_path: where the camera is over time.
        sensor: what it does to perfect images.
        renderer: made for `scene` and `camera`.
        seed: of the sensor's noise.
        frames: number of frames.
        frame_rate_hz: stamps are `index / frame_rate_hz`.
    """

    def __init__(
        self,
        *,
        scene: Scene,
        camera: CameraModel,
        camera_path: CameraPath,
        sensor: SensorModel,
        renderer: Renderer,
        seed: int,
        frames: int,
        frame_rate_hz: float,
    ) -> None:
        self.scene, self.camera, self.frames = scene, camera, frames
        self._path, self._sensor, self._renderer, self._seed = camera_path, sensor, renderer, seed
        self._frame_rate_hz = frame_rate_hz
        self._moments = {actor.name: SurfaceMoments.of(actor) for actor in scene.actors}

    def __len__(self) -> int:
        return self.frames

    def __iter__(self) -> Iterator[SimFrame]:
        return (self.frame(index) for index in range(self.frames))

    def time_s(self, index: int) -> float:
        """Time stamp of frame `index`.

        Raises:
            IndexError: the sequence has no such frame.
        """
        if not 0 <= index < self.frames:
            raise IndexError(f"frame {index} of a sequence of {self.frames}")
        return index / self._frame_rate_hz

    def render(self, index: int) -> tuple[RenderedImages, FloatArray, dict[str, FloatArray]]:
        """Perfect images of frame `index`, with the camera pose (4, 4) and the actors' palettes they show."""
        time_s = self.time_s(index)
        T_world_camera = on_grid(self._path.pose_at(time_s))
        palettes = {actor.name: on_grid(actor.motion.palette_at(time_s)) for actor in self.scene.actors}
        return self._renderer.render(T_world_camera, palettes), T_world_camera, palettes

    def frame(self, index: int) -> SimFrame:
        """Frame `index`, with its truth.

        Raises:
            IndexError: the sequence has no such frame.
        """
        time_s = self.time_s(index)
        images, T_world_camera, palettes = self.render(index)
        objects = tuple(
            object_truth(
                actor,
                self._moments[actor.name],
                time_s,
                palettes[actor.name],
                images,
                self.camera,
                T_world_camera,
                self._renderer.unoccluded_pixels(actor.name),
            )
            for actor in self.scene.actors
        )
        rgb, depth_m = self._sensor.measure(images, self.camera, self._seed, index)
        return SimFrame(
            index=index,
            timestamp_s=time_s,
            camera=self.camera,
            rgb=rgb,
            depth_m=depth_m,
            truth=GroundTruth(
                T_world_camera=T_world_camera,
                depth_m=images.depth_m,
                instance_ids=images.instance_ids,
                objects=objects,
            ),
        )
