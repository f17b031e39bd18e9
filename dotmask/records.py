"""The values that flow through the method: frozen, checked once, with shape, unit and frame.

Conventions (docs/conventions.md): `T_a_b` maps points of b into a. Camera axes are OpenCV's (x right,
y down, z forward); the world is right-handed with z up. Depth is z in metres, 0 = no return. Images are
indexed `[v, u]` and pixel centres lie at integers.

Arrays are kept as read-only views: no copy is made, and the caller's own array stays writable.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from math import isfinite
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
DepthImage = npt.NDArray[np.float32]
ColourImage = npt.NDArray[np.uint8]
MaskImage = npt.NDArray[np.bool_]

_ORTHONORMAL = 1e-6
"""By how much the products of a rotation's rows may be off."""


def checked(array: Any, name: str, shape: tuple[int | None, ...], dtype: type) -> npt.NDArray[Any]:
    """A read-only view of `array` after a check of its shape and type.

    Args:
        array: the array, or a nested sequence of numbers.
        name: what to call it in the error message.
        shape: the wanted shape; None stands for any length.
        dtype: the wanted element type. Numbers are converted only where nothing can be lost.

    Raises:
        ValueError: the shape or the type is another one, or a float array is not finite.
    """
    if type(array) is np.ndarray and array.dtype.type is dtype and array.dtype.isnative and _fits(array.shape, shape):
        given: npt.NDArray[Any] = array
        if not given.flags.writeable:
            return given
    else:
        given = _converted(array, name, shape, dtype)
    view = given.view()
    view.flags.writeable = False
    return view


def _converted(array: Any, name: str, shape: tuple[int | None, ...], dtype: type) -> npt.NDArray[Any]:
    given = np.asarray(array)
    if given.dtype != np.dtype(dtype):
        if given.dtype.kind not in "iufb" or not np.can_cast(given.dtype, dtype, "safe"):
            raise ValueError(f"{name}: expected {np.dtype(dtype)}, got {given.dtype}")
        given = given.astype(dtype)
    if not _fits(given.shape, shape):
        wanted = "(" + ", ".join("any" if n is None else str(n) for n in shape) + ")"
        raise ValueError(f"{name}: expected shape {wanted}, got {given.shape}")
    return given


def _fits(have: tuple[int, ...], want: tuple[int | None, ...]) -> bool:
    """Whether a shape is the wanted one, where None stands for any length."""
    return have == want or (
        len(have) == len(want) and all(w is None or h == w for h, w in zip(have, want, strict=True))
    )


def check_finite(array: npt.NDArray[Any], name: str) -> None:
    """Raise ValueError unless every element of `array` is a finite number."""
    # The sum of squares is finite only if all elements are; it may overflow where they are.
    if not isfinite(np.vdot(array, array)) and not np.isfinite(array).all():
        raise ValueError(f"{name}: holds a number that is not finite")


def checked_pose(T_a_b: Any, name: str) -> FloatArray:
    """A read-only view of a rigid transform (4, 4).

    Raises:
        ValueError: the shape or the type is another one, a number is not finite, or it is not a rotation (to 1e-6) and
            a translation over the row 0, 0, 0, 1.
    """
    T = checked(T_a_b, name, (4, 4), np.float64)
    check_finite(T, name)
    (a, b, c, _), (d, e, f, _), (g, h, i, _), bottom = T.tolist()
    if bottom != [0.0, 0.0, 0.0, 1.0]:
        raise ValueError(f"{name}: the last row must be 0, 0, 0, 1")
    off_unit = max(abs(a * a + b * b + c * c - 1), abs(d * d + e * e + f * f - 1), abs(g * g + h * h + i * i - 1))
    off_right = max(abs(a * d + b * e + c * f), abs(a * g + b * h + c * i), abs(d * g + e * h + f * i))
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    if off_unit > _ORTHONORMAL or off_right > _ORTHONORMAL or determinant < 0:
        raise ValueError(f"{name}: the upper left 3x3 block is no rotation")
    return T


@dataclass(frozen=True, slots=True, kw_only=True)
class Intrinsics:
    """Pinhole camera without distortion: `u = fx x / z + cx`, `v = fy y / z + cy` (pixels)."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        """Refuse an empty image and a focal length that is not positive."""
        if self.width < 1 or self.height < 1:
            raise ValueError(f"intrinsics: image of {self.width} x {self.height} pixels is empty")
        if not (self.fx > 0 and self.fy > 0):
            raise ValueError("intrinsics: focal lengths must be positive")

    @property
    def matrix(self) -> FloatArray:
        """The 3x3 camera matrix K (pixels)."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1.0]])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RgbdFrame:
    """One image pair of the sensor, as the method sees it.

    Attributes:
        index: number of the frame, from 0.
        timestamp_s: time stamp of both images, seconds.
        rgb: (H, W, 3) uint8.
        depth_m: (H, W) float32, z in metres, 0 = no return. What says NaN where there is none (ROS: 32FC1) is
            converted before.
        intrinsics: of both images (depth is registered to colour).
    """

    index: int
    timestamp_s: float
    rgb: ColourImage
    depth_m: DepthImage
    intrinsics: Intrinsics

    def __post_init__(self) -> None:
        """Check both images against the intrinsics, and that every depth is a number of metres."""
        size = (self.intrinsics.height, self.intrinsics.width)
        object.__setattr__(self, "rgb", checked(self.rgb, "rgb", (*size, 3), np.uint8))
        object.__setattr__(self, "depth_m", checked(self.depth_m, "depth_m", size, np.float32))
        if not isfinite(self.timestamp_s):
            raise ValueError("timestamp_s: not finite")
        if not (self.depth_m.min() >= 0 and self.depth_m.max() < np.inf):
            raise ValueError(
                "depth_m: holds NaN, infinite or negative values; 0 means no return: "
                "use np.where((depth_m > 0) & (depth_m < np.inf), depth_m, 0)"
            )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Detections:
    """What a segmenter found in one image: the paper's dynamic object state, N instances.

    Attributes:
        masks: (N, H, W) bool, the pixels of each instance.
        boxes_px: (N, 4) float64, `u_min, v_min, u_max, v_max`, the outermost pixel centres (inclusive).
        class_names: N COCO class names.
        scores: (N,) float64 in 0..1.
    """

    masks: npt.NDArray[np.bool_]
    boxes_px: FloatArray
    class_names: tuple[str, ...]
    scores: FloatArray

    def __post_init__(self) -> None:
        """Check that all columns speak of the same number of instances, and hold boxes and scores."""
        count = len(self.class_names)
        object.__setattr__(self, "masks", checked(self.masks, "masks", (count, None, None), np.bool_))
        object.__setattr__(self, "boxes_px", checked(self.boxes_px, "boxes_px", (count, 4), np.float64))
        object.__setattr__(self, "scores", checked(self.scores, "scores", (count,), np.float64))
        check_finite(self.boxes_px, "boxes_px")
        check_finite(self.scores, "scores")
        u_min, v_min, u_max, v_max = self.boxes_px.T
        if (u_min > u_max).any() or (v_min > v_max).any():
            raise ValueError("boxes_px: expected u_min, v_min, u_max, v_max, got a box that ends before it begins")
        if (self.scores < 0).any() or (self.scores > 1).any():
            raise ValueError("scores: expected 0 to 1")

    def __len__(self) -> int:
        """The number of instances."""
        return len(self.class_names)

    def check_size(self, intrinsics: Intrinsics) -> None:
        """Raise ValueError unless the masks are of the size of the camera's images."""
        have, want = self.masks.shape[1:], (intrinsics.height, intrinsics.width)
        if len(self) and have != want:
            raise ValueError(f"masks: expected the size of the frame, {want}, got {have}")

    def select(self, indices: npt.ArrayLike) -> "Detections":
        """The instances `indices`, in that order."""
        chosen = np.asarray(indices, dtype=np.intp)
        return Detections(
            masks=self.masks[chosen],
            boxes_px=self.boxes_px[chosen],
            class_names=tuple(self.class_names[i] for i in chosen),
            scores=self.scores[chosen],
        )


class MeasurementModel(Protocol):
    """What is measured of a point in the camera frame (metres): h without the camera's pose."""

    def measured(self, points_camera: FloatArray) -> FloatArray:
        """`h`: (..., 3) what is measured of points (..., 3)."""
        ...

    def jacobian(self, points_camera: FloatArray) -> FloatArray:
        """`dh/dp` (..., 3, 3) at points (..., 3)."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Observation:
    """Position of one detected object as measured in the camera frame.

    Attributes:
        position_camera: (3,) where the object is seen, metres, camera frame.
        covariance: (3, 3) R of the paper, of what `model` says is measured, in the units of that.
        class_name: COCO class name.
        detection_index: which of the frame's detections this is.
        mask: (H, W) bool, of that detection.
        model: what is measured; `model.measured(position_camera)` is z of the paper.
        is_partial: whether something nearer, or the image border, hides a side of it.
    """

    position_camera: FloatArray
    covariance: FloatArray
    class_name: str
    detection_index: int
    mask: MaskImage
    model: MeasurementModel
    is_partial: bool = False

    def __post_init__(self) -> None:
        """Check shapes and that the numbers are finite."""
        for name, shape in (("position_camera", (3,)), ("covariance", (3, 3))):
            array = checked(getattr(self, name), name, shape, np.float64)
            check_finite(array, name)
            object.__setattr__(self, name, array)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Innovation:
    """What an update learned: `y = z - h(x)` and its covariance S (camera frame, metres).

    Attributes:
        residual: (3,) y.
        covariance: (3, 3) S.
    """

    residual: FloatArray
    covariance: FloatArray

    @property
    def nis(self) -> float:
        """Normalised innovation squared `yᵀ S⁻¹ y`; chi-square with 3 degrees of freedom if consistent."""
        return float(self.residual @ np.linalg.solve(self.covariance, self.residual))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SurfaceMotion:
    """How points on the surface of one object moved over the last frames, the camera's own motion taken out.

    Attributes:
        points: how many were followed.
        moving_points: how many of them are not where they would be if they stood still.
        velocity_world: (3,) their median velocity, metres per second.
        covariance: (3, 3) of it as a measure of the object's velocity.
    """

    points: int
    moving_points: int
    velocity_world: FloatArray
    covariance: FloatArray

    @property
    def moving_share(self) -> float:
        """Share of the points that move."""
        return self.moving_points / self.points


class TrackPhase(Enum):
    """Where a track is in its life; what has ended is no longer reported."""

    TENTATIVE = "tentative"
    CONFIRMED = "confirmed"
    COASTING = "coasting"


class Reason(Enum):
    """Why the moving object classification (MOC) answered as it did."""

    SPEED = "speed"
    SURFACE = "surface"
    DEFORMATION = "deformation"
    NEW = "new"
    IDLE = "idle"


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """Answer of the moving object classification for one track in one frame.

    Attributes:
        is_moving: whether the object is removed from the odometry depth (MO-MDI).
        reason: what decided.
        speed_m_s: norm of the estimated velocity.
        mask_iou: IoU of the two last masks, aligned as the profile says; None with fewer than two masks.
        calm_frames: consecutive frames whose evidence said idle, for the hysteresis.
    """

    is_moving: bool
    reason: Reason
    speed_m_s: float
    mask_iou: float | None
    calm_frames: int = 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Track:
    """Belief about one object after the last processed frame.

    Attributes:
        track_id: never used again after the track ends.
        class_name: COCO class name.
        timestamp_s: time of the belief, seconds.
        mean: (6,) position and velocity in the world, metres and metres per second.
        covariance: (6, 6) P.
        hits: frames in which it was seen.
        misses: consecutive frames without an observation; 0 = seen in this frame.
        phase: tentative until it was seen often enough, then confirmed, or coasting while it is not seen.
        detection_index: the detection of this frame that it was updated with; None when not seen.
        mask: (H, W) bool, the last mask seen.
        mask_timestamp_s: when it was seen.
        mask_position_camera: (3,) where the track was then in the camera frame, metres.
        is_partial: whether something hid a part of it when it was last seen.
        innovation: of this frame's update; None at birth and when not seen.
        surface: how its surface moved; None when not seen, or with too few points.
        verdict: moving or idle; None until the classification has run.
    """

    track_id: int
    class_name: str
    timestamp_s: float
    mean: FloatArray
    covariance: FloatArray
    hits: int
    misses: int
    phase: TrackPhase
    detection_index: int | None
    mask: MaskImage
    mask_timestamp_s: float
    mask_position_camera: FloatArray
    is_partial: bool
    innovation: Innovation | None = None
    surface: SurfaceMotion | None = None
    verdict: Verdict | None = None

    def __post_init__(self) -> None:
        """Check shapes and that the belief is finite."""
        for name, shape in (("mean", (6,)), ("covariance", (6, 6))):
            array = checked(getattr(self, name), name, shape, np.float64)
            check_finite(array, name)
            object.__setattr__(self, name, array)
        object.__setattr__(self, "mask", checked(self.mask, "mask", (None, None), np.bool_))

    @property
    def position_world(self) -> FloatArray:
        """(3,) metres."""
        return self.mean[:3]

    @property
    def velocity_world(self) -> FloatArray:
        """(3,) metres per second."""
        return self.mean[3:]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MaskedDepth:
    """The two depth images that the SLAM back end is given, metres, 0 = no return or masked.

    Attributes:
        mo_mdi_m: (H, W) float32, moving objects removed: for odometry.
        mdi_m: (H, W) float32, all objects of interest removed: for mapping and loop closure.
    """

    mo_mdi_m: DepthImage
    mdi_m: DepthImage

    def __post_init__(self) -> None:
        """Check that both are depth images of one size."""
        object.__setattr__(self, "mo_mdi_m", checked(self.mo_mdi_m, "mo_mdi_m", (None, None), np.float32))
        object.__setattr__(self, "mdi_m", checked(self.mdi_m, "mdi_m", self.mo_mdi_m.shape, np.float32))


class SlamStatus(Enum):
    """State of the SLAM back end after a frame."""

    INITIALISING = "initialising"
    """The map begins with this frame, at the pose that the back end was given."""
    TRACKED = "tracked"
    LOST = "lost"
    """There is no pose: too little is seen, or nothing of it is known."""
    RELOCALISED = "relocalised"
    """Found again: the first pose after a loss, or one found by looks alone when the motion before led nowhere."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PoseEstimate:
    """Answer of the SLAM back end for one frame.

    Attributes:
        timestamp_s: of the frame, seconds.
        T_world_camera: (4, 4) the estimated pose, or None when lost: no pose is ever made up.
        status: see SlamStatus.
        inliers: features that agree with the pose, or None when the back end does not tell.
        covariance: (6, 6) of the pose's error as a twist in the camera's frame (rotation in radians, then translation
            in metres: `T_true = T_estimated exp(twist)`), or None when the back end does not tell.
    """

    timestamp_s: float
    T_world_camera: FloatArray | None
    status: SlamStatus
    inliers: int | None
    covariance: FloatArray | None = None

    def __post_init__(self) -> None:
        """Check that there is a pose unless lost."""
        if (self.T_world_camera is None) != (self.status is SlamStatus.LOST):
            raise ValueError("a pose estimate has a pose exactly when it is not lost")
        if self.T_world_camera is not None:
            object.__setattr__(self, "T_world_camera", checked_pose(self.T_world_camera, "T_world_camera"))
        if self.covariance is not None:
            object.__setattr__(self, "covariance", checked(self.covariance, "covariance", (6, 6), np.float64))
            check_finite(self.covariance, "covariance")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trajectory:
    """Camera poses over time.

    Attributes:
        timestamps_s: (N,) strictly increasing, seconds.
        T_world_camera: (N, 4, 4).
    """

    timestamps_s: FloatArray
    T_world_camera: FloatArray

    def __post_init__(self) -> None:
        """Check lengths, finiteness and the order of the times."""
        times = checked(self.timestamps_s, "timestamps_s", (None,), np.float64)
        poses = checked(self.T_world_camera, "T_world_camera", (len(times), 4, 4), np.float64)
        check_finite(times, "timestamps_s")
        check_finite(poses, "T_world_camera")
        if len(times) > 1 and not (np.diff(times) > 0).all():
            raise ValueError("timestamps_s: not strictly increasing")
        object.__setattr__(self, "timestamps_s", times)
        object.__setattr__(self, "T_world_camera", poses)

    @classmethod
    def from_poses(cls, poses: Iterable[tuple[float, FloatArray]]) -> "Trajectory":
        """The trajectory of stamped poses: seconds and `T_world_camera` (4, 4), in the order of time."""
        stamped = tuple(poses)
        return cls(
            timestamps_s=np.array([time_s for time_s, _ in stamped], np.float64),
            T_world_camera=np.array([T for _, T in stamped], np.float64).reshape(-1, 4, 4),
        )

    def __len__(self) -> int:
        """The number of poses."""
        return len(self.timestamps_s)


class LoopKind(Enum):
    """How a loop was found."""

    GLOBAL = "global"
    """By what the place looks like, from anywhere."""
    PROXIMITY = "proximity"
    """By poses that say that the camera is near."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopClosure:
    """Two frames that were found to show the same place, and that the optimised map was tied together by.

    Attributes:
        from_index: index of the later frame.
        to_index: index of the earlier frame.
        T_from_to: (4, 4) the measured relative pose.
        kind: see LoopKind.
    """

    from_index: int
    to_index: int
    T_from_to: FloatArray
    kind: LoopKind

    def __post_init__(self) -> None:
        """Check the order and the pose."""
        if not self.from_index > self.to_index >= 0:
            raise ValueError(f"a loop closure leads back in time: from {self.from_index} to {self.to_index}")
        object.__setattr__(self, "T_from_to", checked_pose(self.T_from_to, "T_from_to"))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SlamResult:
    """What a SLAM back end knows when all frames were seen.

    Attributes:
        trajectory: the optimised poses, of every frame that has one.
        loops: the accepted loop closures in the order of their discovery.
    """

    trajectory: Trajectory
    loops: tuple[LoopClosure, ...]
