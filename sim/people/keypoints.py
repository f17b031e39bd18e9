"""The 17 keypoints of COCO: their names, their skeleton, and what is true about them in a frame."""

import numpy as np

from sim.geometry import FloatArray
from sim.records import CameraModel, KeypointsTruth, RenderedImages
from sim.scene import KeypointRig

KEYPOINT_NAMES = (
    "nose",
    "left_eye",
    "right_eye",
    "left_ear",
    "right_ear",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
    "left_hip",
    "right_hip",
    "left_knee",
    "right_knee",
    "left_ankle",
    "right_ankle",
)
"""In the order of the COCO data set (Lin et al., Microsoft COCO: Common Objects in Context, 2014)."""

SKELETON_LINKS = (
    (15, 13),
    (13, 11),
    (16, 14),
    (14, 12),
    (11, 12),
    (5, 11),
    (6, 12),
    (5, 6),
    (5, 7),
    (6, 8),
    (7, 9),
    (8, 10),
    (1, 2),
    (0, 1),
    (0, 2),
    (1, 3),
    (2, 4),
    (3, 5),
    (4, 6),
)
"""Pairs of indices (from 0) that COCO's annotations draw as lines."""

COVER_M = np.array(
    [0.03, 0.03, 0.03, 0.06, 0.06, 0.13, 0.13, 0.08, 0.08, 0.07, 0.07, 0.20, 0.20, 0.11, 0.11, 0.10, 0.10]
)
"""(17,) how thick the body is over a keypoint: a surface of the person that is at most so far before it is its own
skin or cloth; one that is farther before it is another part of the body, which hides it."""


def keypoint_positions(rig: KeypointRig, palette: FloatArray) -> FloatArray:
    """(17, 3) metres in the world, by linear blend skinning with `palette` (B, 4, 4)."""
    rest = np.concatenate([rig.points, np.ones((len(rig.points), 1))], axis=1)
    posed = np.einsum("nkij,nj->nki", palette[rig.bones, :3], rest)
    return np.asarray(np.sum(rig.weights[:, :, None] * posed, axis=1))


def keypoints_truth(
    rig: KeypointRig,
    palette: FloatArray,
    instance_id: int,
    images: RenderedImages,
    camera: CameraModel,
    T_world_camera: FloatArray,
) -> KeypointsTruth:
    """State the truth about a person's keypoints in one frame.

    A keypoint inside the image is visible if one of the 3 x 3 pixels about it shows the person, not more than COVER_M
    before the keypoint: joints lie inside the body. Else another object hides it, or another part of the body.

    Args:
        rig: of the person.
        palette: (B, 4, 4) as rendered.
        instance_id: of the person.
        images: the perfect images.
        camera: of the images.
        T_world_camera: (4, 4) as rendered.
    """
    world = keypoint_positions(rig, palette)
    R, eye = T_world_camera[:3, :3], T_world_camera[:3, 3]
    x, y, z = np.sum((world - eye)[:, :, None] * R, axis=1).T
    pixels = np.full((len(world), 2), np.nan)
    ahead = z > 1e-6
    pixels[ahead, 0] = camera.fx * x[ahead] / z[ahead] + camera.cx
    pixels[ahead, 1] = camera.fy * y[ahead] / z[ahead] + camera.cy
    visibility = np.zeros(len(world), np.uint8)
    column, row = np.floor(np.clip(pixels[ahead], -2.0, 1e6) + 0.5).astype(np.int64).T
    is_inside = (column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height)
    inside, about = np.flatnonzero(ahead)[is_inside], np.arange(-1, 2)
    # At the image's border a pixel stands for the one beside it that is missing.
    rows = (row[is_inside, None] + about).clip(0, camera.height - 1)[:, :, None]
    columns = (column[is_inside, None] + about).clip(0, camera.width - 1)[:, None, :]
    own = images.instance_ids[rows, columns] == instance_id
    near = images.depth_m[rows, columns] >= (z - COVER_M)[inside, None, None]
    visibility[inside] = np.where((own & near).any(axis=(1, 2)), 2, 1)
    return KeypointsTruth(world_m=world, pixels=pixels, visibility=visibility)
