"""The coloured point cloud: one point for each voxel that was measured, where enough views agree."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dotmask.geometry import back_project, transform
from dotmask.mapping.depth_filter import trusted_depth
from dotmask.mapping.settings import MappingSettings
from dotmask.mapping.views import PosedView
from dotmask.records import FloatArray

Keys = npt.NDArray[np.int64]

_BITS = 21
_HALF = 1 << (_BITS - 1)

MERGED_AT_ONCE = 16
"""Views whose voxels are added to the rest together: merging sorts all voxels, and few views need little memory."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PointCloud:
    """The map as points in the world. Where a point comes from is found by `point_of_pixel`.

    Attributes:
        points_m: (N, 3) float64, mean of the measurements in a voxel, metres.
        colours: (N, 3) uint8, mean of their colours.
        pixels: (N,) number of measurements.
        views: (N,) number of views that measured something around it, see `settings.support_voxels`.
        keys: (N,) increasing, which voxel each point is of.
        settings: that the cloud was made with.
    """

    points_m: FloatArray
    colours: npt.NDArray[np.uint8]
    pixels: npt.NDArray[np.int64]
    views: npt.NDArray[np.int64]
    keys: Keys
    settings: MappingSettings

    def __len__(self) -> int:
        """The number of points."""
        return len(self.points_m)

    def point_of_pixel(self, posed: PosedView) -> npt.NDArray[np.int64]:
        """(H, W) the point that each pixel of a view went into; -1 where it was not used, or its voxel has no point."""
        height, width = posed.view.intrinsics.height, posed.view.intrinsics.width
        points = np.full((height, width), -1, np.int64)
        v, u, measured = _measured(posed, self.settings)
        if not len(self) or not len(measured):
            return points
        keys = _keys(measured, self.settings.voxel_m)
        at = np.minimum(np.searchsorted(self.keys, keys), len(self.keys) - 1)
        points[v, u] = np.where(self.keys[at] == keys, at, -1)
        return points


@dataclass(slots=True, eq=False)
class _Sums:
    """What was added up in each voxel: position (3), colour (3), pixels. Or in each larger cube: views."""

    keys: Keys
    sums: FloatArray


def build_cloud(views: Sequence[PosedView], settings: MappingSettings) -> PointCloud:
    """The cloud of all views.

    Args:
        views: with their poses.
        settings: size of the voxels, and which depth is used.
    """
    voxels, cubes = _Sums(np.empty(0, np.int64), np.empty((0, 7))), _Sums(np.empty(0, np.int64), np.empty((0, 1)))
    for first in range(0, len(views), MERGED_AT_ONCE):
        seen = [_voxels(posed, settings) for posed in views[first : first + MERGED_AT_ONCE]]
        voxels = _merged([voxels, *seen])
        cubes = _merged([cubes, *(_cubes(part.keys, settings.support_voxels) for part in seen)])
    at = np.searchsorted(cubes.keys, _cube_keys(voxels.keys, settings.support_voxels))
    seen_in = cubes.sums[at, 0]
    enough = seen_in >= settings.least_views
    keys, sums = voxels.keys[enough], voxels.sums[enough]
    pixels = sums[:, 6]
    return PointCloud(
        points_m=sums[:, :3] / pixels[:, None],
        colours=np.rint(sums[:, 3:6] / pixels[:, None]).astype(np.uint8),
        pixels=pixels.astype(np.int64),
        views=seen_in[enough].astype(np.int64),
        keys=keys,
        settings=settings,
    )


def _measured(
    posed: PosedView, settings: MappingSettings
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], FloatArray]:
    """Rows, columns and world points (N, 3) of the pixels of a view that the cloud uses."""
    step = settings.at_width(settings.pixel_step, posed.view.intrinsics.width)
    depth_m = trusted_depth(posed.view.depth_m, settings)[::step, ::step]
    v, u = np.nonzero(depth_m)
    pixels = np.stack([step * u, step * v], axis=1).astype(np.float64)
    points_camera = back_project(pixels, depth_m[v, u].astype(np.float64), posed.view.intrinsics)
    return step * v, step * u, transform(posed.T_world_camera, points_camera)


def _keys(points_m: FloatArray, voxel_m: float) -> Keys:
    """(N,) one number for each voxel: three signed numbers of 21 bits, for a world of 20 km at 2 cm."""
    cells = np.floor(points_m / voxel_m).astype(np.int64) + _HALF
    if len(cells) and not (cells.min() >= 0 and cells.max() < 2 * _HALF):
        raise ValueError("cloud: a point lies outside of the world that voxels are numbered in")
    return np.asarray((cells[:, 0] << (2 * _BITS)) | (cells[:, 1] << _BITS) | cells[:, 2])


def _cube_keys(keys: Keys, voxels: int) -> Keys:
    """(N,) the cube of `voxels` along an axis that each voxel lies in."""
    ones = (1 << _BITS) - 1
    x, y, z = (keys >> (2 * _BITS)) // voxels, ((keys >> _BITS) & ones) // voxels, (keys & ones) // voxels
    return np.asarray((x << (2 * _BITS)) | (y << _BITS) | z)


def _voxels(posed: PosedView, settings: MappingSettings) -> _Sums:
    v, u, points = _measured(posed, settings)
    colours = posed.view.rgb[v, u].astype(np.float64)
    rows = np.concatenate([points, colours, np.ones((len(points), 1))], axis=1)
    return _added(_keys(points, settings.voxel_m), rows)


def _cubes(keys: Keys, voxels: int) -> _Sums:
    """The cubes of the voxels of one view, each counted once."""
    cubes = np.unique(_cube_keys(keys, voxels))
    return _Sums(cubes, np.ones((len(cubes), 1)))


def _merged(parts: list[_Sums]) -> _Sums:
    return _added(np.concatenate([p.keys for p in parts]), np.concatenate([p.sums for p in parts]))


def _added(keys: Keys, rows: FloatArray) -> _Sums:
    """The rows of equal keys added up, in the order of the keys."""
    if not len(keys):
        return _Sums(keys, rows)
    order = np.argsort(keys, kind="stable")
    ordered = keys[order]
    first = np.flatnonzero(np.concatenate([[True], ordered[1:] != ordered[:-1]]))
    return _Sums(ordered[first], np.add.reduceat(rows[order], first, axis=0))
