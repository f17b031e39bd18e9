"""What the simulator hands out: the sensor's images and, apart from them, the truth."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sim.geometry import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraModel:
    """Pinhole camera: `u = fx x / z + cx`, `v = fy y / z + cy`; the centre of pixel (0, 0) is u = v = 0."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RenderedImages:
    """Perfect images of one moment, made in one pass: they can never disagree.

    Attributes:
        rgb: (H, W, 3) uint8.
        depth_m: (H, W) float32, z in metres, 0 = nothing hit.
        instance_ids: (H, W) uint16, 0 = background.
    """

    rgb: npt.NDArray[np.uint8]
    depth_m: npt.NDArray[np.float32]
    instance_ids: npt.NDArray[np.uint16]


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
        index: from 0.
        timestamp_s: seconds, `index / frame_rate_hz`.
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
