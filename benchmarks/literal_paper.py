"""What a careful reader would write from section III of Vincent et al. 2020 with NumPy and SciPy: the peer in speed.

No tricks and no deliberate slowness: one 6x6 filter per object, masks as whole images. Names are the paper's.

| here | in the paper (section III) |
|---|---|
| `measured` | Update: z from the centre of the bounding box and the average depth of the masked region |
| `predict` | eq. 1 to 3: F, P, and Q of the random acceleration model |
| `observation_function` | eq. 5: h, the (x, y, z) Tait-Bryan terms written out, and its Jacobian H |
| `update` | eq. 4 and 6 to 9: innovation, S, K, state and covariance, the latter as printed, `(I - K H) P` |
| `LiteralDotMask.track` | Tracking Using EKF: a filter for each new object, dropped after e frames without it |
| `LiteralDotMask.classify` | Moving Object Classification: speed, or the IoU of the masks of a non-rigid object |
| `LiteralDotMask.mask` | the MDI without all objects, the MO-MDI without those that move |

The misprints are corrected as `dotmask.profiles.PAPER` lists them. For (d) the printed h is kept, with the angles and
the position of the inverse of the camera's pose. What the paper leaves open: objects and observations of one class are
paired at the least sum of distances, of at most `GATE_M` each; pixels without depth do not count in the average; a new
filter is as uncertain as R in position, and at rest; masks grow by one pixel.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import binary_dilation
from scipy.optimize import linear_sum_assignment
from scipy.spatial.transform import Rotation

from dotmask.profiles import ClassModel, Profile
from dotmask.records import DepthImage, Detections, FloatArray, Intrinsics, MaskedDepth, MaskImage, RgbdFrame

GATE_M = 0.5
"""An object is not looked for farther than this from where it is predicted."""
_TOO_FAR_M = 1e6


@dataclass(slots=True)
class TrackedObject:
    """An extended Kalman filter and the last mask of its object.

    Attributes:
        class_model: what is known of its class.
        x: (6,) position and velocity in the world, metres and metres per second.
        P: (6, 6) their covariance.
        mask: (H, W) at time k.
        previous_mask: (H, W) at time k - 1; None in the first frame, and where it was not seen in one of the two.
        detection: the detection of this frame that it was updated with; None where there was none.
        missed: frames since the last observation.
        is_moving: verdict of the classification.
    """

    class_model: ClassModel
    x: FloatArray
    P: FloatArray
    mask: MaskImage
    detection: int | None
    previous_mask: MaskImage | None = None
    missed: int = 0
    is_moving: bool = False


def measured(box_px: FloatArray, mask: MaskImage, depth_m: DepthImage, camera: Intrinsics) -> FloatArray | None:
    """`z` (3,) of an object in the camera frame, metres; None where the mask has no depth."""
    depths = depth_m[mask & (depth_m > 0)]
    if depths.size == 0:
        return None
    z_z = depths.mean(dtype=np.float64)
    mu_x, mu_y = (box_px[0] + box_px[2]) / 2, (box_px[1] + box_px[3]) / 2
    return np.array([(mu_x - camera.cx) * z_z / camera.fx, (mu_y - camera.cy) * z_z / camera.fy, z_z])


def measurement_noise(z: FloatArray, camera: Intrinsics, profile: Profile) -> FloatArray:
    """`R` (3, 3), diagonal: "the imprecision of the RGB-D camera"."""
    noise = profile.noise
    sigma_x, sigma_y = noise.pixel_sigma_px * z[2] / camera.fx, noise.pixel_sigma_px * z[2] / camera.fy
    sigma_z = noise.depth_sigma_m + noise.depth_sigma_per_m * (z[2] - 0.4) ** 2
    return np.diag([sigma_x**2, sigma_y**2, sigma_z**2])


def predict(x: FloatArray, P: FloatArray, dt_s: float, class_model: ClassModel) -> tuple[FloatArray, FloatArray]:
    """State and covariance `dt_s` seconds later."""
    I3, O3 = np.eye(3), np.zeros((3, 3))
    F = np.block([[I3, dt_s * I3], [O3, I3]])
    Gamma = np.vstack([dt_s**2 / 2 * I3, dt_s * I3])
    Sigma = np.diag((class_model.acceleration_sigma_m_s2 * class_model.axis_shares) ** 2)
    Q = Gamma @ Sigma @ Gamma.T
    return F @ x, F @ P @ F.T + Q


def observation_function(x: FloatArray, T_world_camera: FloatArray) -> tuple[FloatArray, FloatArray]:
    """`h(x)` (3,) in the camera frame, metres, and its Jacobian `H` (3, 6)."""
    T_camera_world = np.linalg.inv(T_world_camera)
    phi, theta, psi = Rotation.from_matrix(T_camera_world[:3, :3]).as_euler("ZYX")
    c_x, c_y, c_z = T_camera_world[:3, 3]
    s_phi, s_theta, s_psi = np.sin(phi), np.sin(theta), np.sin(psi)
    c_phi, c_theta, c_psi = np.cos(phi), np.cos(theta), np.cos(psi)
    H = np.zeros((3, 6))
    H[0, 0] = c_phi * c_theta
    H[0, 1] = c_phi * s_theta * s_psi - c_psi * s_phi
    H[0, 2] = s_phi * s_psi + c_phi * c_psi * s_theta
    H[1, 0] = c_theta * s_phi
    H[1, 1] = c_phi * c_psi + s_phi * s_theta * s_psi
    H[1, 2] = c_psi * s_phi * s_theta - c_phi * s_psi
    H[2, 0] = -s_theta
    H[2, 1] = c_theta * s_psi
    H[2, 2] = c_theta * c_psi
    h_phi = H[0, 0] * x[0] + H[0, 1] * x[1] + H[0, 2] * x[2] + c_x
    h_theta = H[1, 0] * x[0] + H[1, 1] * x[1] + H[1, 2] * x[2] + c_y
    h_psi = H[2, 0] * x[0] + H[2, 1] * x[1] + H[2, 2] * x[2] + c_z
    return np.array([h_phi, h_theta, h_psi]), H


def update(
    x: FloatArray, P: FloatArray, z: FloatArray, R: FloatArray, T_world_camera: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """State and covariance after the observation `z`."""
    h, H = observation_function(x, T_world_camera)
    y = z - h
    S = H @ P @ H.T + R
    K = P @ H.T @ np.linalg.inv(S)
    return x + K @ y, (np.eye(6) - K @ H) @ P


def intersection_over_union(M_before: MaskImage, M: MaskImage) -> float:
    """IoU of two masks (H, W)."""
    return float((M & M_before).sum() / (M | M_before).sum())


class LiteralDotMask:
    """The method, one frame after the other: `track`, `classify`, `mask`.

    Args:
        profile: gives the parameters that the paper has as well.
    """

    def __init__(self, profile: Profile) -> None:
        self._profile = profile
        self._timestamp_s = 0.0
        self.objects: list[TrackedObject] = []

    def track(self, frame: RgbdFrame, detections: Detections, T_world_camera: FloatArray) -> None:
        """Predict all filters, update those that are observed, begin and end others."""
        found = [
            measured(box, mask, frame.depth_m, frame.intrinsics)
            for box, mask in zip(detections.boxes_px, detections.masks, strict=True)
        ]
        for known in self.objects:
            known.x, known.P = predict(known.x, known.P, frame.timestamp_s - self._timestamp_s, known.class_model)
            known.missed += 1
            known.detection = None
        self._timestamp_s = frame.timestamp_s

        observed = {i: z for i, z in enumerate(found) if z is not None}
        pairs = self._pair(observed, detections.class_names, T_world_camera)
        for i, z in observed.items():
            mask = detections.masks[i]
            R = measurement_noise(z, frame.intrinsics, self._profile)
            if i in pairs:
                known = pairs[i]
                known.x, known.P = update(known.x, known.P, z, R, T_world_camera)
                known.previous_mask = known.mask if known.missed == 1 else None
                known.mask, known.missed, known.detection = mask, 0, i
            else:
                self.objects.append(self._begin(z, R, mask, i, detections.class_names[i], T_world_camera))
        self.objects = [known for known in self.objects if known.missed < self._profile.max_misses]

    def _pair(
        self, observed: dict[int, FloatArray], class_names: Sequence[str], T_world_camera: FloatArray
    ) -> dict[int, TrackedObject]:
        """The object that each observed detection belongs to, where there is one."""
        distance_m = np.full((len(self.objects), len(observed)), _TOO_FAR_M)
        for row, known in enumerate(self.objects):
            h, _ = observation_function(known.x, T_world_camera)
            for column, (i, z) in enumerate(observed.items()):
                distance = np.linalg.norm(z - h)
                if known.class_model.name == class_names[i] and distance <= GATE_M:
                    distance_m[row, column] = distance
        rows, columns = linear_sum_assignment(distance_m)
        detection = list(observed)
        return {
            detection[column]: self.objects[row]
            for row, column in zip(rows, columns, strict=True)
            if distance_m[row, column] <= GATE_M
        }

    def _begin(
        self, z: FloatArray, R: FloatArray, mask: MaskImage, detection: int, class_name: str, T_world_camera: FloatArray
    ) -> TrackedObject:
        class_model = self._profile.class_model(class_name)
        R_world_camera = T_world_camera[:3, :3]
        x, P = np.zeros(6), np.zeros((6, 6))
        x[:3] = R_world_camera @ z + T_world_camera[:3, 3]
        P[:3, :3] = R_world_camera @ R @ R_world_camera.T
        P[3:, 3:] = class_model.prior_speed_sigma_m_s**2 * np.eye(3)
        return TrackedObject(class_model=class_model, x=x, P=P, mask=mask, detection=detection)

    def classify(self) -> None:
        """Call each object that was seen in this frame moving or idle; others keep what they were called."""
        for known in self.objects:
            if known.missed > 0:
                continue
            is_fast = np.linalg.norm(known.x[3:]) > known.class_model.speed_threshold_m_s
            is_deformed = (
                known.class_model.is_non_rigid
                and known.previous_mask is not None
                and intersection_over_union(known.previous_mask, known.mask) < self._profile.deformation_iou
            )
            known.is_moving = bool(is_fast or is_deformed)

    def mask(self, depth_m: DepthImage, detections: Detections) -> MaskedDepth:
        """MDI and MO-MDI of this frame; a detection without a filter counts as moving."""
        idle = {known.detection for known in self.objects if not known.is_moving}
        every: npt.NDArray[np.bool_] = np.zeros(depth_m.shape, bool)
        moving = every.copy()
        for i, mask in enumerate(detections.masks):
            grown = binary_dilation(mask)
            every |= grown
            if i not in idle:
                moving |= grown
        nothing = np.float32(0.0)
        return MaskedDepth(
            mo_mdi_m=np.where(moving, nothing, depth_m),
            mdi_m=np.where(every, nothing, depth_m),
        )
