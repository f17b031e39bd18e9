"""Checks of the images: depth, poses, flow, ids and normals of two frames explain each other, pixel by pixel."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenarios.check.measure import Measured
from scenarios.check.sample import (
    Sample,
    View,
    camera_points,
    neighbours,
    pixels_of,
    posed_vertices,
    rays,
    world_points,
)
from sim.geometry import FloatArray

BEND_M = 0.0005
"""A pixel is smooth when its four neighbours have its id and the depth bends by less from neighbour to neighbour.
Between smooth pixels the depth can be interpolated: a crease between two of them bends the depth at both, and the
interpolation is off by less than that."""

HIDDEN_M = 0.005
"""A point that lies so far behind the surface seen in its place is hidden."""

SURFACE_M = 0.001
"""A point that lies farther off the surface is wrong."""

FEW_PIXELS = 200
"""Objects with fewer smooth pixels have no share of hidden ones."""

MAX_SLOPE_CHANGE = 0.02
"""A normal is compared where the slope of the depth changes by less from one neighbour to the other."""

NORMAL_DEG = 2.0
"""A normal that is farther off is wrong. A ledge one pixel wide can pass for smooth, so that a few may be."""

BoolImage = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """Where the points of the first frame are in the next one.

    Attributes:
        in_view: (H, W) pixels that hit something and whose point is in the next image.
        is_inside: (H, W) those inside an object: with four neighbours of their id, so that it is no thread that falls
            between the pixels of the next frame; and the four pixels around the point in the next frame show one id.
        is_smooth: (H, W) those of them that are smooth (BEND_M), and the four pixels in the next frame too.
        points_then: (H, W, 3) the point in the next camera, metres.
        corner: (H, W, 2) v, u of the upper left of the four pixels; 0 but where in view.
        behind_m: (H, W) how far the point lies behind the depth interpolated between the four. NaN but where inside.
        ids_then: (H, W) what the four show. 0 but where inside.
    """

    in_view: BoolImage
    is_inside: BoolImage
    is_smooth: BoolImage
    points_then: FloatArray
    corner: npt.NDArray[np.int64]
    behind_m: FloatArray
    ids_then: npt.NDArray[np.uint16]

    @property
    def is_hidden(self) -> BoolImage:
        """(H, W) smooth points that something hides in the next frame."""
        return np.asarray(self.is_smooth & (self.behind_m > HIDDEN_M))


def follow(sample: Sample) -> Followed:
    """Move every surface point by the scene flow and look it up in the next frame.

    The depth there is interpolated between the four pixels around: 1/z, which is linear in the image of a plane. What
    is inside and what is smooth is decided by each image alone, never by the error that is to be found.
    """
    camera, images, then = sample.camera, sample.now.images, sample.then.images
    assert images.flow is not None
    points = camera_points(world_points(sample.now, camera) + images.flow.scene_m, sample.then)
    pixels = pixels_of(points, camera)
    in_view = np.all([images.depth_m > 0, *(pixels >= 0).T.swapaxes(1, 2)], axis=0)
    in_view &= (pixels[..., 0] < camera.width - 1) & (pixels[..., 1] < camera.height - 1)
    u, v = (np.where(in_view, pixels[..., k], 0.0).astype(int) for k in range(2))
    corners = [(v, u), (v, u + 1), (v + 1, u), (v + 1, u + 1)]
    is_inside = in_view & _neighbours_agree(images.instance_ids)
    is_smooth_then, is_smooth = smooth(sample.then), smooth(sample.now)
    for corner in corners:
        is_inside &= (then.instance_ids[corner] == then.instance_ids[v, u]) & (then.depth_m[corner] > 0)
        is_smooth &= is_smooth_then[corner]
    a, b = np.where(in_view, pixels[..., 0] - u, 0.0), np.where(in_view, pixels[..., 1] - v, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / then.depth_m.astype(float)
        one, two, three, four = (inverse[corner] for corner in corners)
        depth = 1.0 / ((1 - b) * ((1 - a) * one + a * two) + b * ((1 - a) * three + a * four))
    return Followed(
        in_view=in_view,
        is_inside=is_inside,
        is_smooth=is_inside & is_smooth,
        points_then=points,
        corner=np.stack([v, u], axis=-1),
        behind_m=np.where(is_inside, points[..., 2] - depth, np.nan),
        ids_then=np.where(is_inside, then.instance_ids[v, u], 0).astype(np.uint16),
    )


def smooth(view: View) -> BoolImage:
    """(H, W) pixels that hit something and are smooth (BEND_M)."""
    depth = view.images.depth_m.astype(float)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / depth
        left, right, upper, lower = neighbours(inverse)
        bend = np.maximum(np.abs(left + right - 2 * inverse), np.abs(upper + lower - 2 * inverse)) * depth**2
    return np.asarray((depth > 0) & (bend <= BEND_M) & _neighbours_agree(view.images.instance_ids))


def _largest(errors: FloatArray) -> float | None:
    """The largest error; NaN is an infinite one. None where there is none."""
    return float(np.where(np.isnan(errors), np.inf, errors).max()) if errors.size else None


def _neighbours_agree(ids: npt.NDArray[np.uint16]) -> BoolImage:
    """(H, W) pixels with four neighbours of the same id."""
    return np.asarray(np.all([other == ids for other in neighbours(ids.astype(float))], axis=0))


def optical_flow_error(sample: Sample) -> Measured:
    """Depth, scene flow and the next pose against the optical flow: pixels, at every pixel that hits something."""
    flow = sample.now.images.flow
    assert flow is not None
    hit = sample.now.images.depth_m > 0
    points = camera_points(world_points(sample.now, sample.camera) + flow.scene_m, sample.then)[hit]
    v, u = np.nonzero(hit)
    error = np.linalg.norm(pixels_of(points, sample.camera) - np.stack([u, v], axis=-1) - flow.optical_px[hit], axis=1)
    # Behind the next camera there is no pixel, and both must say so.
    error[(points[:, 2] <= 0) & np.isnan(flow.optical_px[hit]).all(axis=1)] = 0.0
    return Measured(worst=_largest(error), tested=len(error), total=len(error))


def next_depth_error(sample: Sample) -> Measured:
    """Depth, scene flow and the next pose against the next depth: metres, at smooth pixels that nothing hides."""
    followed = follow(sample)
    error = np.abs(followed.behind_m[followed.is_smooth & ~followed.is_hidden])
    return Measured(worst=_largest(error), tested=len(error), total=int(followed.in_view.sum()))


def next_surface_error(sample: Sample) -> Measured:
    """Share of the points inside objects, smooth or not, that lie more than SURFACE_M off the next frame's surface.

    That surface is, at each of the four pixels around, the plane of the depth and the normal there. A point is tested
    unless it is behind all four by HIDDEN_M. On a small ledge none of the four may see the point's plane, so that a
    few may be off.
    """
    followed, then, camera = follow(sample), sample.then.images, sample.camera
    assert then.normals_camera is not None
    points, corner = followed.points_then[followed.is_inside], followed.corner[followed.is_inside]
    surface = rays(camera) * then.depth_m[..., None].astype(float)
    height = []
    for dv, du in ((0, 0), (0, 1), (1, 0), (1, 1)):
        place = corner[:, 0] + dv, corner[:, 1] + du
        height.append((then.normals_camera[place] * (points - surface[place])).sum(axis=1))
    seen = np.max(height, axis=0) > -HIDDEN_M
    off = np.min(np.abs(height), axis=0)[seen]
    worst = float((off > SURFACE_M).mean()) if len(off) else None
    return Measured(worst=worst, tested=len(off), total=int(followed.in_view.sum()))


def hidden_by_itself(sample: Sample) -> Measured:
    """Largest share of an object's smooth points that the object itself claims to hide in the next frame.

    An object turns little from frame to frame, so that the share is small. It keeps errors of more than HIDDEN_M from
    passing as occlusions in the other checks.
    """
    followed = follow(sample)
    ids = sample.now.images.instance_ids
    there = np.bincount(ids[followed.is_smooth], minlength=2**16)
    hidden = np.bincount(ids[followed.is_hidden & (followed.ids_then == ids)], minlength=2**16)
    many = there >= FEW_PIXELS
    return Measured(worst=_largest(hidden[many] / there[many]), tested=int(there[many].sum()), total=int(there.sum()))


def next_id_error(sample: Sample) -> Measured:
    """Share of the points that nothing hides that have another id in the next frame; at smooth pixels."""
    followed = follow(sample)
    seen = followed.is_smooth & ~followed.is_hidden
    tested = int(seen.sum())
    wrong = int((seen & (followed.ids_then != sample.now.images.instance_ids)).sum())
    return Measured(worst=wrong / tested if tested else None, tested=tested, total=int(followed.in_view.sum()))


def place_error(sample: Sample) -> Measured:
    """How far a pixel's point lies outside the box around the object whose id it has: metres."""
    points, ids = world_points(sample.now, sample.camera), sample.now.images.instance_ids
    hit = sample.now.images.depth_m > 0
    objects = {obj.instance_id: obj for obj in sample.scene if obj.instance_id}
    worst: list[float] = []
    tested = 0
    for number in np.unique(ids[hit & (ids > 0)]).tolist():
        mine = points[hit & (ids == number)]
        tested += len(mine)
        if number not in objects:
            worst.append(float("inf"))
            continue
        obj = objects[number]
        palette = sample.now.palettes[obj.name] if obj.is_actor else obj.motion.palette_at(0.0)
        vertices = posed_vertices(obj, palette)
        outside = np.maximum(mine - vertices.max(axis=0), vertices.min(axis=0) - mine)
        worst.append(max(float(outside.max()), 0.0))
    return Measured(worst=max(worst, default=None), tested=tested, total=int((hit & (ids > 0)).sum()))


def normal_error(sample: Sample) -> Measured:
    """Share of the normals more than NORMAL_DEG off the slope of the depth, where it is steady (MAX_SLOPE_CHANGE).

    The image of a plane n . P = d has 1/z = (n . r) / d with r the ray at depth 1: linear in the pixel.
    """
    camera, images = sample.camera, sample.now.images
    normals = images.normals_camera
    assert normals is not None
    depth = images.depth_m.astype(float)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / depth
        left, right, upper, lower = neighbours(inverse)
        # Relative to the width of a pixel, depth / focal length.
        turn = (
            np.fmax(np.abs(left + right - 2 * inverse) * camera.fx, np.abs(upper + lower - 2 * inverse) * camera.fy)
            * depth
        )
        steady = (depth > 0) & (turn < MAX_SLOPE_CHANGE) & _neighbours_agree(images.instance_ids)
        a, b = (right - left) / 2 * camera.fx, (lower - upper) / 2 * camera.fy
        ray = rays(camera)
        plane = np.stack([a, b, inverse - a * ray[..., 0] - b * ray[..., 1]], axis=-1)
    wanted = -plane[steady] / np.linalg.norm(plane[steady], axis=-1, keepdims=True)
    stated = normals[steady].astype(float)
    # The chord, and not the cosine, which knows no small angles.
    angle = 2 * np.arcsin(np.clip(np.linalg.norm(stated - wanted, axis=-1) / 2, 0, 1))
    worst = float((angle > np.radians(NORMAL_DEG)).mean()) if angle.size else None
    return Measured(worst=worst, tested=int(angle.size), total=int((depth > 0).sum()))
