"""The simulator: it asks every actor where it is, renders, states the truth, and lets the sensor err.

The time of a frame is the middle of the exposure of the middle row of its colour image. The truth is of that time, and
so is the stamp but for its jitter. The depth image may be of another time, see `sim.sensor.timing`.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from sim.camera_paths.path import CameraPath
from sim.geometry import on_grid
from sim.records import CameraModel, GroundTruth, Moment, RenderedImages, SimFrame
from sim.scene import Scene
from sim.sensor.exposure import expose
from sim.sensor.failures import delivered, failed
from sim.sensor.parameters import Sensor
from sim.truth import SurfaceMoments, object_truth

_SPEED_STEP_S = 0.005


class Renderer(Protocol):
    """Draws a scene. One instance belongs to one scene and one camera model."""

    def render(self, moment: Moment, *, normals: bool = False, flow_to: Moment | None = None) -> RenderedImages:
        """Images of one moment.

        Args:
            moment: where everything is.
            normals: whether to give the surface normals as well.
            flow_to: the moment to which the flow is asked for.
        """
        ...

    def render_colour(self, moment: Moment, rows: tuple[int, int]) -> npt.NDArray[np.uint8]:
        """The rows first..last-1 of `render(moment).rgb` alone, (last - first, W, 3): for exposures in parts."""
        ...

    def unoccluded_pixels(self, name: str) -> int:
        """Pixels inside the image that an actor of the last frame would cover if it were alone."""
        ...


class Simulator:
    """A finite sequence of delivered frames; each is a pure function of its index, so any can be made alone.

    Args:
        scene: what stands in the world.
        camera: of both images.
        camera_path: where the camera is over time.
        sensor: what it does to perfect images, and when it looks.
        renderer: made for `scene` and `camera`.
        seed: of the sensor's noise.
        frames: number of captured frames; the sequence has as many if the sensor drops none.
        frame_rate_hz: frames are captured at multiples of its inverse, from time 0.
    """

    def __init__(
        self,
        *,
        scene: Scene,
        camera: CameraModel,
        camera_path: CameraPath,
        sensor: Sensor,
        renderer: Renderer,
        seed: int,
        frames: int,
        frame_rate_hz: float,
    ) -> None:
        self.scene, self.camera, self.sensor = scene, camera, sensor
        self._path, self._renderer, self._seed = camera_path, renderer, seed
        self._period_s = 1.0 / frame_rate_hz
        self._moments = {actor.name: SurfaceMoments.of(actor) for actor in scene.actors}
        self._last_s = (frames - 1) / frame_rate_hz
        self._captured = delivered(sensor.timing.delivered(frames, seed), sensor.failures)
        self._times_s = self._captured / frame_rate_hz
        self._stamps_s = sensor.timing.stamps_s(self._captured, frame_rate_hz, seed)

    def __len__(self) -> int:
        return len(self._captured)

    def __iter__(self) -> Iterator[SimFrame]:
        return (self.frame(index) for index in range(len(self)))

    def time_s(self, index: int) -> float:
        """True time of frame `index`: the middle of the exposure of the middle row of its colour image.

        Raises:
            IndexError: the sequence has no such frame.
        """
        if not 0 <= index < len(self):
            raise IndexError(f"frame {index} of a sequence of {len(self)}")
        return float(self._times_s[index])

    def moment(self, time_s: float) -> Moment:
        """Where everything is at a time, on the grid of poses."""
        return Moment(
            T_world_camera=on_grid(self._path.pose_at(time_s)),
            palettes={actor.name: on_grid(actor.motion.palette_at(time_s)) for actor in self.scene.actors},
        )

    def render(self, index: int, *, normals: bool = False, flow: bool = False) -> tuple[RenderedImages, Moment]:
        """Perfect images of the time of frame `index`, with the moment they show.

        The flow leads to frame `index + 1`, and from the last one to a period later.
        """
        time_s = self.time_s(index)
        moment = self.moment(time_s)
        is_last = index + 1 == len(self)
        flow_to = self.moment(time_s + self._period_s if is_last else self.time_s(index + 1)) if flow else None
        return self._renderer.render(moment, normals=normals, flow_to=flow_to), moment

    def frame(self, index: int) -> SimFrame:
        """Frame `index`, with its truth.

        Raises:
            IndexError: the sequence has no such frame.
        """
        time_s = self.time_s(index)
        images, moment = self.render(index, normals=self.sensor.model.needs_normals)
        objects = tuple(
            object_truth(
                actor,
                self._moments[actor.name],
                time_s,
                moment.palettes[actor.name],
                images,
                self.camera,
                moment.T_world_camera,
                self._renderer.unoccluded_pixels(actor.name),
            )
            for actor in self.scene.actors
        )
        captured = int(self._captured[index])
        measured = self.sensor.model.measure(self._seen(images, time_s), self.camera, self._seed, captured)
        rgb, depth_m = failed(*measured, captured, self.sensor.failures)
        return SimFrame(
            index=index,
            timestamp_s=float(self._stamps_s[index]),
            camera=self.camera,
            rgb=rgb,
            depth_m=depth_m,
            truth=GroundTruth(
                T_world_camera=moment.T_world_camera,
                depth_m=images.depth_m,
                instance_ids=images.instance_ids,
                objects=objects,
            ),
        )

    def _seen(self, images: RenderedImages, time_s: float) -> RenderedImages:
        """Colour and depth of the times at which the sensor looks; `images` are those of the frame's own time.

        The instance ids are those of the depth. Before the first and after the last capture the world stands still.
        """
        timing = self.sensor.timing
        rgb = images.rgb
        if not timing.is_instant:
            rgb = expose(
                lambda at_s, rows: self._renderer.render_colour(self.moment(self._within(at_s)), rows),
                time_s,
                (self.camera.height, self.camera.width),
                timing,
                self._image_speed_px_s(time_s),
            )
        if timing.depth_delay_s != 0:
            moment = self.moment(self._within(time_s + timing.depth_delay_s))
            images = self._renderer.render(moment, normals=self.sensor.model.needs_normals)
        return replace(images, rgb=rgb)

    def _within(self, time_s: float) -> float:
        """The time, or the nearest between the first and the last capture: a recorded path may know no other."""
        return min(max(time_s, 0.0), self._last_s)

    def _image_speed_px_s(self, time_s: float) -> float:
        """How fast the camera's motion shifts the image of what is 1 m away, pixels per second."""
        first_s, last_s = self._within(time_s - _SPEED_STEP_S), self._within(time_s + _SPEED_STEP_S)
        before, after = (on_grid(self._path.pose_at(at_s)) for at_s in (first_s, last_s))
        change = (after - before) / max(last_s - first_s, _SPEED_STEP_S)
        turning = math.sqrt(math.fsum(change[:3, :3].ravel() ** 2) / 2)  # of a rotation: the angular speed
        moving = math.sqrt(math.fsum(change[:3, 3] ** 2))
        return self.camera.fx * (turning + moving)
