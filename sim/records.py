"""What the simulator hands out: the sensor's images and, apart from them, the truth."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sim.geometry import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraModel:
    """Pinhole camera: `u = fx x / z + cx`, `v = fy y / z + cy`; the centre of pixel (0, 0) is u = v = 0.

    Attributes:
        width: pixels.
        height: pixels.
        fx, fy, cx, cy: pixels.
        exposure_ev: in stops: one more makes the image twice as bright, up to the soft limit near white.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    exposure_ev: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Moment:
    """Where everything is at one time.

    Attributes:
        T_world_camera: (4, 4).
        palettes: (B, 4, 4) rest-to-world matrices of every actor, by name.
    """

    T_world_camera: FloatArray
    palettes: Mapping[str, FloatArray]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Flow:
    """How the visible surface points move from the moment of an image to another moment. 0 where nothing was hit.

    Attributes:
        optical_px: (H, W, 2) float32: du, dv of the point in the image; NaN where it then lies behind the camera.
        scene_m: (H, W, 3) float32: displacement of the point in the world.
    """

    optical_px: npt.NDArray[np.float32]
    scene_m: npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RenderedImages:
    """Perfect images of one moment, made in one pass: they can never disagree.

    Attributes:
        rgb: (H, W, 3) uint8, edges anti-aliased.
        depth_m: (H, W) float32, z in metres of the surface at the centre of the pixel, 0 = nothing hit.
        instance_ids: (H, W) uint16 of that surface, 0 = background.
        normals_camera: (H, W, 3) float32, unit normals of that surface in the camera frame, 0 where nothing was hit;
            None unless asked for.
        flow: to another moment; None unless asked for.
    """

    rgb: npt.NDArray[np.uint8]
    depth_m: npt.NDArray[np.float32]
    instance_ids: npt.NDArray[np.uint16]
    normals_camera: npt.NDArray[np.float32] | None = None
    flow: Flow | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class KeypointsTruth:
    """The 17 COCO keypoints of a person in one frame, in COCO's order.

    Attributes:
        world_m: (17, 3).
        pixels: (17, 2) u, v; outside the image as they come, NaN behind the camera.
        visibility: (17,) uint8: 0 = outside the image, 1 = in the image but hidden, 2 = visible.
    """

    world_m: FloatArray
    pixels: FloatArray
    visibility: npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ObjectTruth:
    """The truth about one actor in one frame.

    Attributes:
        name, class_name, instance_id: as in the scene.
        T_world_object: (4, 4) root frame.
        centre_world: (3,) metres, area-weighted mean of the posed surface.
        velocity_world: (3,) metres per second, of the centre.
        surface_speed_m_s: 95th percentile of the speed of its surface points in the world.
        is_moving: surface speed above 0.02 m/s.
        visible_pixels: its pixels in the image.
        occlusion: share of its pixels inside the image that something else hides, 0..1; 0 when out of view.
        is_truncated: whether it touches the border of the image.
        ideal_world: (3,) what the paper's estimator (bounding-box centre and mean depth of the mask) gives on the
            perfect images, in the world; None when not visible.
        keypoints: of a person; None for things.
    """

    name: str
    class_name: str
    instance_id: int
    T_world_object: FloatArray
    centre_world: FloatArray
    velocity_world: FloatArray
    surface_speed_m_s: float
    is_moving: bool
    visible_pixels: int
    occlusion: float
    is_truncated: bool
    ideal_world: FloatArray | None
    keypoints: KeypointsTruth | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GroundTruth:
    """What the method must never see.

    Attributes:
        T_world_camera: (4, 4).
        depth_m: (H, W) float32 without noise.
        instance_ids: (H, W) uint16.
        objects: the truth about every actor, in the order of the scene.
    """

    T_world_camera: FloatArray
    depth_m: npt.NDArray[np.float32]
    instance_ids: npt.NDArray[np.uint16]
    objects: tuple[ObjectTruth, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SimFrame:
    """One frame: what the sensor measured, and the truth.

    Attributes:
        index: from 0, counts delivered frames.
        timestamp_s: seconds: the middle of the exposure of the middle row of the colour image, the time of the truth,
            but for the jitter of the sensor's stamps.
        camera: of both images.
        rgb: (H, W, 3) uint8 after sensor noise.
        depth_m: (H, W) float32 after sensor noise, z in metres, 0 = no return.
        truth: see GroundTruth.
    """

    index: int
    timestamp_s: float
    camera: CameraModel
    rgb: npt.NDArray[np.uint8]
    depth_m: npt.NDArray[np.float32]
    truth: GroundTruth
