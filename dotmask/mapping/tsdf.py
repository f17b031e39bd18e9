"""A mesh from truncated signed distances (Curless and Levoy 1996) in sparse blocks (Niessner et al. 2013).

Space is divided into voxels, and voxels into cubic blocks, of which only those near a measured surface exist: memory
grows with the surface, not with the volume. The poses are known before the first view is fused, so all blocks are laid
out first, and each view then also says of the blocks of the others what is empty.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dotmask.geometry import back_project, inverse, transform
from dotmask.mapping.depth_filter import trusted_depth
from dotmask.mapping.settings import MappingSettings
from dotmask.mapping.views import PosedView
from dotmask.records import FloatArray

Float32Array = npt.NDArray[np.float32]

SIDE = 8
"""Voxels of a block along an axis."""

CHUNK = 8
"""Blocks along an axis that are meshed at once."""

LAYOUT_STEP_PX = 4
"""Every so many-th pixel says which blocks are needed; up to the farthest depth its neighbours lie in the same ones."""

SAME_VERTEX = 1e-4
"""Vertices of neighbouring chunks are one if they are nearer than about this, in voxels."""

NO_COLOUR = 128.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mesh:
    """Triangles with coloured vertices; counter-clockwise seen from where the camera was.

    Attributes:
        vertices_m: (N, 3) float64, world, metres.
        faces: (M, 3) int32.
        colours: (N, 3) uint8.
    """

    vertices_m: FloatArray
    faces: npt.NDArray[np.int32]
    colours: npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DistanceField:
    """Signed distances of all voxels in the blocks near the surface.

    Attributes:
        blocks: (B, 3) int64 place of each block, in blocks from the world's origin.
        distance: (B, SIDE, SIDE, SIDE) float32, -1..1 in units of the truncation; positive in free space.
        weight: (B, SIDE, SIDE, SIDE) float32; 0 = never seen.
        colour: (B, SIDE, SIDE, SIDE, 4) float32: red, green, blue (0..255) and the weight of these.
        settings: that it was made with.
    """

    blocks: npt.NDArray[np.int64]
    distance: Float32Array
    weight: Float32Array
    colour: Float32Array
    settings: MappingSettings

    @property
    def voxel_bytes(self) -> int:
        """Memory of all voxels."""
        return self.distance.nbytes + self.weight.nbytes + self.colour.nbytes


def fuse_views(views: Sequence[PosedView], settings: MappingSettings) -> DistanceField:
    """The signed distances that all views agree on.

    Args:
        views: with their poses.
        settings: size of the voxels, truncation, and which depth is used.
    """
    from dotmask.mapping import kernels  # numba is loaded by those who build a mesh alone

    needed = [_blocks_of(posed, settings) for posed in views]
    blocks = np.unique(np.concatenate([np.empty((0, 3), np.int64), *needed]), axis=0)
    voxels = SIDE**3
    distance = np.zeros((len(blocks), voxels), np.float32)
    weight = np.zeros((len(blocks), voxels), np.float32)
    colour = np.zeros((len(blocks), voxels, 4), np.float32)
    origins = ((blocks * SIDE + 0.5) * settings.voxel_m).astype(np.float32)
    for posed in views:
        camera, T_camera_world = posed.view.intrinsics, inverse(posed.T_world_camera).astype(np.float32)
        kernels.fuse(
            trusted_depth(posed.view.depth_m, settings),
            posed.view.rgb,
            np.ascontiguousarray(T_camera_world[:3, :3]),
            np.ascontiguousarray(T_camera_world[:3, 3]),
            (np.float32(camera.fx), np.float32(camera.fy), np.float32(camera.cx), np.float32(camera.cy)),
            origins,
            SIDE,
            np.float32(settings.voxel_m),
            np.float32(settings.truncation_m),
            distance,
            weight,
            colour,
        )
    shape = (len(blocks), SIDE, SIDE, SIDE)
    return DistanceField(
        blocks=blocks,
        distance=distance.reshape(shape),
        weight=weight.reshape(shape),
        colour=colour.reshape(*shape, 4),
        settings=settings,
    )


def extract_mesh(field: DistanceField) -> Mesh:
    """The surface where the signed distance is 0, by marching cubes, without its small loose parts.

    A cube of eight voxel centres makes triangles only where all eight were seen.
    """
    vertices, faces, colours, count = [], [], [], 0
    for corner, distance, weight, colour in _chunks(field):
        found = _surface(distance, weight > 0)
        if found is None:
            continue
        places, triangles = found
        vertices.append(places + corner)
        faces.append(triangles + count)
        colours.append(_colours_at(places, colour))
        count += len(places)
    if not vertices:
        return Mesh(vertices_m=np.empty((0, 3)), faces=np.empty((0, 3), np.int32), colours=np.empty((0, 3), np.uint8))
    places = np.concatenate(vertices)
    # The cells of the merging grid are centred on whole voxels, where the seams of the chunks lie.
    _, first, welded = np.unique(
        np.rint(places / SAME_VERTEX).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    triangles = welded.ravel()[np.concatenate(faces)]
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    return _large_parts(
        (places[first] + 0.5) * field.settings.voxel_m,
        triangles,
        np.concatenate(colours)[first],
        field.settings.least_part_faces,
    )


def _blocks_of(posed: PosedView, settings: MappingSettings) -> npt.NDArray[np.int64]:
    """(N, 3) the blocks within the truncation of what a view measured, along its rays."""
    step = settings.at_width(LAYOUT_STEP_PX, posed.view.intrinsics.width)
    depth_m = trusted_depth(posed.view.depth_m, settings)[::step, ::step]
    v, u = np.nonzero(depth_m)
    pixels, depth = np.stack([step * u, step * v], axis=1).astype(np.float64), depth_m[v, u].astype(np.float64)
    found = [np.empty((0, 3), np.int64)]
    for off_m in (-settings.truncation_m, 0.0, settings.truncation_m):
        points = transform(posed.T_world_camera, back_project(pixels, depth + off_m, posed.view.intrinsics))
        found.append(np.floor(points / (SIDE * settings.voxel_m)).astype(np.int64))
    return np.unique(np.concatenate(found), axis=0)


def _chunks(field: DistanceField) -> Iterator[tuple[FloatArray, Float32Array, Float32Array, Float32Array]]:
    """Dense cubes of CHUNK blocks and one layer of voxels beyond, so that neighbouring cubes share their border.

    Yields:
        (3,) place of the first voxel, in voxels; distance, weight and colour of the cube.
    """
    rows = {tuple(block): row for row, block in enumerate(field.blocks.tolist())}
    size = CHUNK * SIDE + 1
    for chunk in np.unique(field.blocks // CHUNK, axis=0):
        distance, weight = np.zeros((2, size, size, size), np.float32)
        colour = np.zeros((size, size, size, 4), np.float32)
        first = chunk * CHUNK
        for offset in np.ndindex(CHUNK + 1, CHUNK + 1, CHUNK + 1):
            row = rows.get((int(first[0]) + offset[0], int(first[1]) + offset[1], int(first[2]) + offset[2]))
            if row is None:
                continue
            x, y, z = (slice(SIDE * o, min(SIDE * o + SIDE, size)) for o in offset)
            for dense, sparse in ((distance, field.distance), (weight, field.weight), (colour, field.colour)):
                target = dense[x, y, z]
                target[...] = sparse[row][: len(target), : target.shape[1], : target.shape[2]]
        yield (first * SIDE).astype(np.float64), distance, weight, colour


def _surface(distance: Float32Array, is_seen: npt.NDArray[np.bool_]) -> tuple[FloatArray, npt.NDArray[np.int64]] | None:
    """Vertices (N, 3) in voxels and faces (M, 3) of the zero level of a dense cube, None where there is none."""
    from skimage import measure

    march: Any = measure.marching_cubes

    whole = is_seen[1:] & is_seen[:-1]
    whole = whole[:, 1:] & whole[:, :-1]
    whole = whole[:, :, 1:] & whole[:, :, :-1]
    if not whole.any() or not distance.min() < 0 < distance.max():
        return None
    mask = np.zeros(distance.shape, np.bool_)
    mask[1:, 1:, 1:] = whole
    try:
        found = march(distance, 0.0, gradient_direction="descent", mask=mask)
    except RuntimeError:  # the library's way to say that no cube crosses the level
        return None
    vertices, faces = found[:2]
    return vertices.astype(np.float64), faces.astype(np.int64)


def _colours_at(places: FloatArray, colour: Float32Array) -> npt.NDArray[np.uint8]:
    """(N, 3) colour of vertices, which lie between two voxels: of both, by their nearness, as far as they have one."""
    low = np.floor(places).astype(np.int64)
    high = np.ceil(places).astype(np.int64)
    share = (places - low).max(axis=1)
    low_colour, high_colour = colour[tuple(low.T)], colour[tuple(high.T)]
    low_weight = (1.0 - share) * (low_colour[:, 3] > 0)
    high_weight = share * (high_colour[:, 3] > 0)
    total = low_weight + high_weight
    mixed = low_weight[:, None] * low_colour[:, :3] + high_weight[:, None] * high_colour[:, :3]
    known = total > 0
    result = np.where(known[:, None], mixed / np.where(known, total, 1.0)[:, None], NO_COLOUR)
    return np.asarray(np.rint(np.clip(result, 0, 255)), np.uint8)


def _large_parts(
    vertices: FloatArray, faces: npt.NDArray[np.int64], colours: npt.NDArray[np.uint8], least_faces: int
) -> Mesh:
    """The mesh without connected parts of fewer faces, and without vertices of no face."""
    edges = np.concatenate([faces[:, :2], faces[:, 1:]])
    graph = coo_array((np.ones(len(edges), np.bool_), (edges[:, 0], edges[:, 1])), shape=(len(vertices),) * 2)
    parts, part_of = connected_components(graph, directed=False)
    size = np.bincount(part_of[faces[:, 0]], minlength=parts)
    faces = faces[size[part_of[faces[:, 0]]] >= least_faces]
    used, renumbered = np.unique(faces, return_inverse=True)
    return Mesh(
        vertices_m=vertices[used],
        faces=renumbered.reshape(-1, 3).astype(np.int32),
        colours=colours[used],
    )
