"""What is true about an actor in a frame: where it is, how fast, how much of it is seen."""

from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np
from scipy.sparse import csr_array

from sim.geometry import FloatArray
from sim.people.keypoints import keypoints_truth
from sim.records import CameraModel, ObjectTruth, RenderedImages
from sim.scene import SceneObject

MOVING_SPEED_M_S = 0.02
"""An actor moves when its surface speed is above this."""

HALF_STEP_S = 0.002
"""Velocities are central differences over `time ± HALF_STEP_S`."""

SURFACE_POINTS = 300
"""Points per actor of which the surface speed is the 95th percentile."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SurfaceMoments:
    """An object's surface reduced to what its centre and its surface speed need. Both are linear in the palette.

    Skinning moves a vertex x with weights w_b to sum_b w_b M_b [x; 1]. With `a` the vertices' shares of the surface
    area, the mean of the posed surface is sum_b M_b m_b with m_b = sum_vertices a w_b [x; 1]. The shares are those of
    the rest pose: exact for a rigid body, and within millimetres for a person, whose skin stretches little.

    Attributes:
        first: (B, 4) m_b; its last column sums to 1.
        of_points: (P, 4 B) the same of each sample point, bone after bone; few bones move a point.
    """

    first: FloatArray
    of_points: csr_array

    @classmethod
    def of(cls, obj: SceneObject) -> Self:
        """The moments of an object's surfaces, with SURFACE_POINTS points spread evenly over the area.

        Raises:
            ValueError: the object has no surface area.
        """
        bones_total = len(obj.motion.palette_at(0.0))
        corners, skins, areas = [], [], []
        for surface in obj.surfaces:
            rest = np.concatenate([surface.vertices.astype(float), np.ones((len(surface.vertices), 1))], axis=1)
            skin = np.zeros((len(rest), bones_total))
            if surface.bones is None or surface.weights is None:
                skin[:, 0] = 1.0
            else:
                for k in range(surface.bones.shape[1]):
                    np.add.at(skin, (np.arange(len(rest)), surface.bones[:, k]), surface.weights[:, k])
                skin /= skin.sum(axis=1, keepdims=True)
            a, b, c = (rest[surface.faces[:, k], :3] for k in range(3))
            areas.append(0.5 * np.sqrt((np.cross(b - a, c - a) ** 2).sum(axis=1)))
            corners.append(rest[surface.faces])
            skins.append((skin, surface.faces))
        area = np.concatenate(areas) if areas else np.zeros(0)
        if not area.sum() > 0:
            raise ValueError(f"{obj.name}: an actor needs a surface with an area")
        first = np.zeros((bones_total, 4))
        for (skin, faces), points, face_area in zip(skins, corners, areas, strict=True):
            for k in range(3):  # a third of a face's area belongs to each corner
                first += np.einsum("f,fb,fx->bx", face_area / 3.0, skin[faces[:, k]], points[:, k])
        first /= area.sum()

        # One point in each of P equal portions of the area; inside its face by an additive recurrence (Roberts 2018).
        number = np.arange(SURFACE_POINTS)
        chosen = np.searchsorted(np.cumsum(area), (number + 0.5) / SURFACE_POINTS * area.sum())
        chosen = np.minimum(chosen, len(area) - 1)
        s, t = (0.5 + 0.7548776662466927 * number) % 1.0, (0.5 + 0.5698402909980532 * number) % 1.0
        outside = s + t > 1.0
        s, t = np.where(outside, 1.0 - s, s), np.where(outside, 1.0 - t, t)
        barycentric = np.stack([1.0 - s - t, s, t], axis=1)
        moments = np.zeros((SURFACE_POINTS, bones_total, 4))
        start = 0
        for (skin, faces), points in zip(skins, corners, strict=True):
            mine = np.flatnonzero((chosen >= start) & (chosen < start + len(faces)))
            face = chosen[mine] - start
            for k in range(3):
                weighted = barycentric[mine, k, None] * points[face, k]
                moments[mine] += skin[faces[face, k]][:, :, None] * weighted[:, None, :]
            start += len(faces)
        return cls(first=first, of_points=csr_array(moments.reshape(SURFACE_POINTS, -1)))

    def centre(self, palette: FloatArray) -> FloatArray:
        """(3,) mean of the surface posed by `palette` (B, 4, 4); of a palette's rate of change, the mean's velocity."""
        return np.asarray((palette[:, :3, :] * self.first[:, None, :]).sum(axis=(0, 2)))

    def points(self, palette: FloatArray) -> FloatArray:
        """(P, 3) the sample points posed by `palette` (B, 4, 4); of a rate of change, their velocities."""
        return np.asarray(self.of_points @ palette[:, :3].transpose(0, 2, 1).reshape(-1, 3))


def object_truth(
    obj: SceneObject,
    moments: SurfaceMoments,
    time_s: float,
    palette_now: FloatArray,
    images: RenderedImages,
    camera: CameraModel,
    T_world_camera: FloatArray,
    unoccluded: int,
) -> ObjectTruth:
    """State the truth about one actor in one frame.

    Args:
        obj: the actor.
        moments: `SurfaceMoments.of(obj)`.
        time_s: of the frame.
        palette_now: (B, 4, 4) as rendered.
        images: the perfect images.
        camera: of the images.
        T_world_camera: (4, 4) as rendered.
        unoccluded: pixels that the actor would cover if it were alone.
    """
    before, after = (obj.motion.palette_at(time_s + step) for step in (-HALF_STEP_S, HALF_STEP_S))
    rate = (after - before) / (2.0 * HALF_STEP_S)
    velocities = moments.points(rate)
    speed = float(np.percentile(np.sqrt((velocities**2).sum(axis=1)), 95.0))

    mask = images.instance_ids == obj.instance_id
    left, top, width, height = cv2.boundingRect(mask.view(np.uint8))
    inside = mask[top : top + height, left : left + width]
    visible = int(np.count_nonzero(inside))
    ideal = None
    if visible:
        # Exact in any order: the sum of so few float32 numbers of like size fits into a float64.
        depth = float(images.depth_m[top : top + height, left : left + width][inside].sum(dtype=np.float64)) / visible
        u, v = left + (width - 1) / 2.0, top + (height - 1) / 2.0
        ideal = _to_world(
            (u - camera.cx) / camera.fx * depth, (v - camera.cy) / camera.fy * depth, depth, T_world_camera
        )
    border = left == 0 or top == 0 or left + width == camera.width or top + height == camera.height
    return ObjectTruth(
        name=obj.name,
        class_name=obj.class_name,
        instance_id=obj.instance_id,
        T_world_object=obj.motion.pose_at(time_s),
        centre_world=moments.centre(palette_now),
        velocity_world=moments.centre(rate),
        surface_speed_m_s=speed,
        is_moving=speed > MOVING_SPEED_M_S,
        visible_pixels=visible,
        occlusion=1.0 - min(visible / unoccluded, 1.0) if unoccluded else 0.0,
        is_truncated=visible > 0 and border,
        ideal_world=ideal,
        keypoints=None
        if obj.keypoints is None
        else keypoints_truth(obj.keypoints, palette_now, obj.instance_id, images, camera, T_world_camera),
    )


def _to_world(x: float, y: float, z: float, T_world_camera: FloatArray) -> FloatArray:
    """(3,) world position of a camera-frame point."""
    R, t = T_world_camera[:3, :3], T_world_camera[:3, 3]
    return np.asarray(R[:, 0] * x + R[:, 1] * y + R[:, 2] * z + t)
