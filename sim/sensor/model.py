"""What a consumer RGB-D camera does to one pair of perfect images.

Depth, in this order: the borders of objects become ragged (lateral noise); depth is lost at depth edges, in the shadow
of the projector or second imager, and in patches of steep surfaces; it is blurred along the ray (axial noise), rounded
to the steps of the disparity, cut to the range, and rounded to the step of the file format. Colour gets noise.
"""

import math
from dataclasses import dataclass, fields
from functools import lru_cache
from statistics import NormalDist

import cv2
import numpy as np
import numpy.typing as npt

from sim.randomness import child
from sim.records import CameraModel, RenderedImages

_TABLE_GRID = 2.0**-20
_SLANT_ENTRIES = 2048
_SLANT_FROM_DEG = 60.0

_Float32Array = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorModel:
    """The errors of single images. The defaults switch every error off.

    The noise of a pixel is a function of (seed, frame index, pixel). Gaussian noise is drawn from the quantiles of the
    normal distribution at (i + 1/2) / 8192, which end at 3.8 sigma; it is independent from pixel to pixel.

    Attributes:
        axial_sigma_m, axial_growth_per_m, axial_origin_m: the standard deviation of the depth z is
            `axial_sigma_m + axial_growth_per_m (z - axial_origin_m)²`.
        axial_slant_m: at angles of incidence θ above 60 degrees the standard deviation grows by
            `axial_slant_m / √z · θ² / (π/2 - θ)²`, z in metres.
        lateral_sigma_px: at depth edges a pixel takes the depth of a neighbour, at rounded Gaussian offsets in u and v.
        edge_jump: two depths belong to one surface if they differ by no more than this share.
        edge_dropout_px: no depth as near as this to a depth edge, on both sides of it.
        baseline_m: from the imager to the projector or the second imager, which is to its right: points that are
            hidden from there give no depth.
        focal_px: focal length of the depth imager in its own pixels, for the steps of the disparity.
        disparity_step_px: depth is `focal_px baseline_m / d` with d a multiple of the step, so its steps grow with z².
        hole_start_deg, hole_end_deg: patches of 4x4 pixels give no depth, with a probability that grows from 0 to 1
            between these angles of incidence, linear in the cosine; 0 = no holes.
        min_range_m, max_range_m: no depth nearer or farther; max 0 = no limit.
        depth_step_m: depth is a multiple of it.
        rgb_sigma_black, rgb_sigma_white: standard deviation of a channel, grey levels, before rounding. The variance
            is linear in the grey level between the two (photon shot noise over read noise, EMVA standard 1288).
    """

    axial_sigma_m: float = 0.0
    axial_growth_per_m: float = 0.0
    axial_origin_m: float = 0.0
    axial_slant_m: float = 0.0
    lateral_sigma_px: float = 0.0
    edge_jump: float = 0.05
    edge_dropout_px: int = 0
    baseline_m: float = 0.0
    focal_px: float = 0.0
    disparity_step_px: float = 0.0
    hole_start_deg: float = 0.0
    hole_end_deg: float = 0.0
    min_range_m: float = 0.0
    max_range_m: float = 0.0
    depth_step_m: float = 0.0
    rgb_sigma_black: float = 0.0
    rgb_sigma_white: float = 0.0

    def __post_init__(self) -> None:
        """Refuse numbers that describe no camera."""
        for field in fields(self):
            value = getattr(self, field.name)
            if not math.isfinite(value) or (value < 0 and field.name != "axial_origin_m"):
                raise ValueError(f"sensor: {field.name} must be finite and not negative, got {value}")
        if 0 < self.max_range_m <= self.min_range_m:
            raise ValueError(f"sensor: the range {self.min_range_m} to {self.max_range_m} m is empty")
        if self.hole_start_deg and not self.hole_start_deg < self.hole_end_deg <= 90:
            raise ValueError("sensor: holes must end at a larger angle than they start, 90 degrees at most")
        if self.disparity_step_px and not (self.focal_px and self.baseline_m):
            raise ValueError("sensor: steps of the disparity need focal_px and baseline_m")

    @property
    def needs_normals(self) -> bool:
        """Whether an error depends on the angle of incidence."""
        return self.hole_start_deg > 0 or self.axial_slant_m > 0

    def measure(
        self, images: RenderedImages, camera: CameraModel, seed: int, index: int
    ) -> tuple[npt.NDArray[np.uint8], _Float32Array]:
        """Colour (H, W, 3) uint8 and depth (H, W) float32, metres, 0 = no return.

        The result depends on the images, the camera, the seed and the index alone: frames can be measured in any
        order. The arrays are new.

        Args:
            images: perfect ones, with normals where `needs_normals`.
            camera: of both images.
            seed: of the scenario.
            index: number of the exposure, to give every frame its own noise.

        Raises:
            ValueError: the normals are needed and missing.
        """
        if self == SensorModel():
            return images.rgb.copy(), images.depth_m.copy()
        from sim.sensor import kernels  # numba is loaded by those who simulate noise alone

        colour_key, depth_key = child(seed, "sensor", index).integers(2**64, size=2, dtype=np.uint64)
        quantiles = _quantiles(kernels.QUANTILES)
        rgb, depth_m = np.empty_like(images.rgb), np.empty_like(images.depth_m)
        kernels.measure_colour(images.rgb, colour_key, quantiles, self._sigma_of_grey(), rgb)
        kernels.measure_depth(
            images.depth_m,
            self._normals(images),
            self._lost(images.depth_m, camera),
            depth_key,
            (camera.fx, camera.fy, camera.cx, camera.cy),
            quantiles
            if self.axial_sigma_m or self.axial_growth_per_m or self.axial_slant_m
            else np.zeros_like(quantiles),
            np.rint(_quantiles(512) * self.lateral_sigma_px).astype(np.int64),
            _slant_growth(),
            (np.float32(self.axial_sigma_m), np.float32(self.axial_growth_per_m), np.float32(self.axial_origin_m)),
            np.float32(self.axial_slant_m),
            np.float32(self.edge_jump),
            self._hole_cosines(),
            np.float32(self.focal_px * self.baseline_m / self.disparity_step_px if self.disparity_step_px else 0.0),
            (np.float32(self.min_range_m), np.float32(self.max_range_m or np.inf)),
            round(1.0 / self.depth_step_m, 6) if self.depth_step_m else 0.0,
            depth_m,
        )
        return rgb, depth_m

    def _normals(self, images: RenderedImages) -> _Float32Array:
        """The normals where they matter, else an empty array."""
        if not self.needs_normals:
            return np.empty((0, 0, 3), np.float32)
        if images.normals_camera is None:
            raise ValueError("sensor: errors that depend on the angle of incidence need images with normals")
        return images.normals_camera

    def _lost(self, depth_m: _Float32Array, camera: CameraModel) -> npt.NDArray[np.bool_]:
        """(H, W) the pixels next to a jump in depth, or in the shadow."""
        from sim.sensor import kernels

        if self.edge_dropout_px:
            window = np.ones((2 * self.edge_dropout_px + 1,) * 2, np.uint8)
            span = cv2.dilate(depth_m, window)
            np.subtract(span, cv2.erode(depth_m, window), out=span)
            lost = np.asarray(span > np.float32(self.edge_jump) * depth_m)
        else:
            lost = np.zeros(depth_m.shape, np.bool_)
        if self.baseline_m:
            scale = np.float32(camera.fx * self.baseline_m)
            kernels.add_shadow(depth_m, scale, np.float32(self.edge_jump), lost)
        return lost

    def _hole_cosines(self) -> tuple[np.float32, np.float32]:
        """Cosines where holes begin and where nothing is left, rounded so that a last bit does not matter."""
        if not self.hole_start_deg:
            return np.float32(-1), np.float32(-2)  # no cosine is smaller
        first, last = (round(math.cos(math.radians(a)), 9) for a in (self.hole_start_deg, self.hole_end_deg))
        return np.float32(first), np.float32(last)

    def _sigma_of_grey(self) -> _Float32Array:
        """(256,) standard deviation at each grey level."""
        share = np.arange(256) / 255.0
        variance = self.rgb_sigma_black**2 * (1 - share) + self.rgb_sigma_white**2 * share
        return np.asarray(np.sqrt(variance), np.float32)


@lru_cache(maxsize=4)
def _quantiles(count: int) -> _Float32Array:
    """The quantiles (i + 1/2) / count of a Gaussian, on a grid, so that the logarithm's last bit does not matter."""
    normal = NormalDist()
    exact = np.array([normal.inv_cdf((i + 0.5) / count) for i in range(count)])
    return np.asarray(np.round(exact / _TABLE_GRID) * _TABLE_GRID, np.float32)


@lru_cache(maxsize=1)
def _slant_growth() -> _Float32Array:
    """`θ² / (π/2 - θ)²` by the cosine of θ, 0 up to 60 degrees; on a grid."""
    angle = np.arccos((np.arange(_SLANT_ENTRIES) + 0.5) / _SLANT_ENTRIES)
    growth = np.where(angle > math.radians(_SLANT_FROM_DEG), (angle / (np.pi / 2 - angle)) ** 2, 0.0)
    return np.asarray(np.round(growth / _TABLE_GRID) * _TABLE_GRID, np.float32)
