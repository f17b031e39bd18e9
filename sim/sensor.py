"""What a consumer RGB-D camera does to perfect images.

Order: depth is taken from a neighbour (lateral noise), lost at depth edges, blurred along the ray (axial noise),
rounded to the steps of the disparity, cut to the range, and rounded to the step of the file format. Colour gets noise.
"""

from dataclasses import dataclass, fields
from functools import lru_cache
from statistics import NormalDist
from typing import Self

import cv2
import numpy as np
import numpy.typing as npt

from sim.randomness import child
from sim.records import CameraModel, RenderedImages

_TABLE_GRID = 2.0**-20


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorModel:
    """Noise of colour and depth; the defaults are those of a first-generation Kinect. 0 switches a part off.

    The noise of a pixel is a function of (seed, frame index, pixel). Gaussian noise is drawn from the quantiles of the
    normal distribution at (i + 1/2) / n: n = 8192 for the axial noise, which so ends at 3.8 sigma.

    Attributes:
        axial_sigma_m, axial_growth_per_m, axial_origin_m: the standard deviation of the depth z is
            `axial_sigma_m + axial_growth_per_m (z - axial_origin_m)²` (Nguyen, Izadi and Lovell, "Modeling Kinect
            sensor noise for improved 3D reconstruction and tracking", 3DIMPVT 2012, eq. 3).
        lateral_sigma_px: each pixel takes the depth of a neighbour, at rounded Gaussian offsets in u and v; the same
            paper gives 0.8 px at 10 to 60 degrees of slant for the width of an edge, half of it to each side.
        edge_jump: no depth where the 3x3 neighbourhood spans more than this share of z.
        baseline_m, disparity_step_px: depth is `fx baseline / d` with d a multiple of the step, so that its steps grow
            with z² (Khoshelham and Elberink, Sensors 2012).
        min_range_m, max_range_m: no depth nearer or farther; max 0 = no limit.
        depth_step_m: depth is a multiple of it; 1/5000 makes the 16-bit files of TUM lossless.
        rgb_sigma: standard deviation of each channel, grey levels, before rounding.
    """

    axial_sigma_m: float = 0.0012
    axial_growth_per_m: float = 0.0019
    axial_origin_m: float = 0.4
    lateral_sigma_px: float = 0.5
    edge_jump: float = 0.05
    baseline_m: float = 0.075
    disparity_step_px: float = 0.125
    min_range_m: float = 0.4
    max_range_m: float = 6.0
    depth_step_m: float = 1.0 / 5000.0
    rgb_sigma: float = 2.5

    def __post_init__(self) -> None:
        """Refuse negative numbers and an empty range."""
        for field in fields(self):
            value = getattr(self, field.name)
            if not 0 <= value < np.inf:
                raise ValueError(f"sensor: {field.name} must be finite and not negative, got {value}")
        if 0 < self.max_range_m <= self.min_range_m:
            raise ValueError(f"sensor: the range {self.min_range_m} to {self.max_range_m} m is empty")

    @classmethod
    def perfect(cls) -> Self:
        """A sensor that measures exactly what was rendered, at any distance."""
        return cls(**{field.name: 0.0 for field in fields(cls)})

    def measure(
        self, images: RenderedImages, camera: CameraModel, seed: int, index: int
    ) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
        """Colour (H, W, 3) uint8 and depth (H, W) float32, metres, 0 = no return, of frame `index`.

        The result depends on the images, the camera's focal length, the seed and the index alone: frames can be
        measured in any order. The arrays are new.
        """
        if self == SensorModel.perfect():
            return images.rgb.copy(), images.depth_m.copy()
        from sim import sensor_kernels  # numba is loaded by those who simulate noise alone

        rgb, depth_m = np.empty_like(images.rgb), np.empty_like(images.depth_m)
        noise = self.axial_sigma_m > 0 or self.axial_growth_per_m > 0
        step = self.disparity_step_px
        sensor_kernels.measure(
            images.rgb,
            images.depth_m,
            self._edges(images.depth_m),
            child(seed, "sensor", index).integers(2**64, dtype=np.uint64),
            _quantiles(8192, 1.0 if noise else 0.0),
            _rounded_quantiles(512, self.lateral_sigma_px),
            _rounded_quantiles(2048, self.rgb_sigma),
            np.float32(self.axial_sigma_m),
            np.float32(self.axial_growth_per_m),
            np.float32(self.axial_origin_m),
            np.float32(camera.fx * self.baseline_m / step if step else 0.0),
            np.float32(self.min_range_m),
            np.float32(self.max_range_m or np.inf),
            round(1.0 / self.depth_step_m, 6) if self.depth_step_m else 0.0,
            rgb,
            depth_m,
        )
        return rgb, depth_m

    def _edges(self, depth_m: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
        """(H, W) the pixels next to a jump in depth."""
        if self.edge_jump == 0:
            return np.zeros(depth_m.shape, np.bool_)
        window = np.ones((3, 3), np.uint8)
        span = cv2.dilate(depth_m, window)
        np.subtract(span, cv2.erode(depth_m, window), out=span)
        return np.asarray(span > np.float32(self.edge_jump) * depth_m)


@lru_cache(maxsize=8)
def _quantiles(count: int, sigma: float) -> npt.NDArray[np.float32]:
    """The quantiles (i + 1/2) / count of a Gaussian, on a grid, so that the logarithm's last bit does not matter."""
    normal = NormalDist()
    exact = np.array([normal.inv_cdf((i + 0.5) / count) for i in range(count)]) * sigma
    return np.asarray(np.round(exact / _TABLE_GRID) * _TABLE_GRID, np.float32)


@lru_cache(maxsize=8)
def _rounded_quantiles(count: int, sigma: float) -> npt.NDArray[np.int64]:
    """The same rounded to whole numbers."""
    return np.rint(_quantiles(count, sigma)).astype(np.int64)
