"""The map against shapes whose surface is known: planes, a sphere, a cube."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from dotmask.mapping.cloud import build_cloud
from dotmask.mapping.depth_filter import trusted_depth
from dotmask.mapping.ply import write_ply
from dotmask.mapping.settings import MappingSettings
from dotmask.mapping.tsdf import Mesh, extract_mesh, fuse_views
from dotmask.mapping.views import PosedView, View, ViewKeeper, pose_views
from dotmask.records import Intrinsics, RgbdFrame, Trajectory

CAMERA = Intrinsics(width=160, height=120, fx=140.0, fy=140.0, cx=79.5, cy=59.5)
SETTINGS = MappingSettings(least_part_faces=1)
RAYS = np.stack(
    [
        (np.arange(160)[None] - CAMERA.cx) / CAMERA.fx + np.zeros((120, 1)),
        (np.arange(120)[:, None] - CAMERA.cy) / CAMERA.fy + np.zeros((1, 160)),
        np.ones((120, 160)),
    ],
    axis=-1,
)
GREY = np.full((120, 160, 3), 90, np.uint8)


def looking(eye: tuple[float, float, float], target: tuple[float, float, float]) -> np.ndarray:
    forward = np.subtract(target, eye) / np.linalg.norm(np.subtract(target, eye))
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = np.stack([right, np.cross(forward, right), forward], axis=1), eye
    return T


def plane_depth(T: np.ndarray, normal: tuple[float, float, float], offset_m: float) -> np.ndarray:
    """Of the plane of points p with normal . p = offset."""
    rays = RAYS @ T[:3, :3].T
    z = (offset_m - T[:3, 3] @ normal) / (rays @ np.asarray(normal, float))
    return np.where(z > 0, z, 0).astype(np.float32)


def sphere_depth(T: np.ndarray, radius_m: float) -> np.ndarray:
    """Of a sphere around the origin of the world."""
    rays, eye = RAYS @ T[:3, :3].T, T[:3, 3]
    a, b, c = (rays**2).sum(-1), (rays @ eye), eye @ eye - radius_m**2
    inside = b * b - a * c
    return np.where(inside > 0, (-b - np.sqrt(np.maximum(inside, 0))) / a, 0).astype(np.float32)


def posed(T: np.ndarray, depth_m: np.ndarray, rgb: np.ndarray = GREY, index: int = 0) -> PosedView:
    frame = RgbdFrame(index=index, timestamp_s=index / 30, rgb=rgb, depth_m=depth_m, intrinsics=CAMERA)
    return PosedView(view=View.of(frame, depth_m), T_world_camera=T)


def around(distance_m: float, count: int = 8) -> list[np.ndarray]:
    angles = np.arange(count) * 2 * np.pi / count
    return [
        looking((distance_m * np.cos(a), distance_m * np.sin(a), 0.6 * (-1) ** i), (0, 0, 0))
        for i, a in enumerate(angles)
    ]


SPHERE_VIEWS = [posed(T, sphere_depth(T, 0.5)) for T in around(1.6)]


def test_a_sphere_becomes_a_sphere_within_a_quarter_of_a_voxel_with_its_outside_outside() -> None:
    mesh = extract_mesh(fuse_views(SPHERE_VIEWS, SETTINGS))
    radius = np.linalg.norm(mesh.vertices_m, axis=1)
    assert len(mesh.faces) > 5000
    assert np.abs(radius - 0.5).mean() < 0.003
    assert np.abs(radius - 0.5).max() < 0.02
    a, b, c = (mesh.vertices_m[mesh.faces[:, k]] for k in range(3))
    outwards = (np.cross(b - a, c - a) * (a + b + c)).sum(axis=1)
    assert (outwards > 0).mean() > 0.99
    assert (mesh.colours == 90).all()


@pytest.fixture(scope="module")
def floor() -> Mesh:
    poses = [looking((x, y, 1.2), (x + 0.5, y, 0.0)) for x in (-0.4, 0.3) for y in (-0.3, 0.4)]
    views = [posed(T, plane_depth(T, (0, 0, 1), 0.1)) for T in poses]
    return extract_mesh(fuse_views(views, SETTINGS))


def test_a_floor_is_flat_to_what_half_a_pixel_climbs_and_seen_from_above(floor: Mesh) -> None:
    assert np.ptp(floor.vertices_m[:, 0]) > 1.28, "less than a chunk: no seam is tested"
    half_pixel_m = 0.5 * 1.2 / CAMERA.fx  # a voxel takes the depth of the nearest pixel
    assert np.abs(floor.vertices_m[:, 2] - 0.1).max() < half_pixel_m
    a, b, c = (floor.vertices_m[floor.faces[:, k]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


def test_chunks_are_sewn_together(floor: Mesh) -> None:
    edges = np.sort(np.concatenate([floor.faces[:, [0, 1]], floor.faces[:, [1, 2]], floor.faces[:, [2, 0]]]), axis=1)
    unique, uses = np.unique(edges, axis=0, return_counts=True)
    assert uses.max() == 2
    rim = floor.vertices_m[unique[uses == 1].ravel()]
    # The only open edges are at the rim of what was seen; a seam would be open along a whole chunk border at x = 0.
    assert (np.abs(rim[:, 0] - 0.01) < 0.005).sum() < 12


def test_small_loose_parts_are_left_out() -> None:
    depth = SPHERE_VIEWS[0].view.depth_m.copy()
    depth[5:14, 5:14] = 1.0
    views = [posed(SPHERE_VIEWS[0].T_world_camera, depth), *SPHERE_VIEWS[1:]]
    loose = extract_mesh(fuse_views(views, SETTINGS))
    clean = extract_mesh(fuse_views(views, replace(SETTINGS, least_part_faces=400)))
    assert np.linalg.norm(loose.vertices_m, axis=1).max() > 0.6
    assert np.linalg.norm(clean.vertices_m, axis=1).max() < 0.53


def test_what_later_views_see_through_is_carved_away() -> None:
    T = looking((0.0, 0.0, 1.5), (0.01, 0.0, 0.0))
    wall = plane_depth(T, (0, 0, 1), 0.0)
    ghost = np.where((np.abs(RAYS[..., 0]) < 0.2) & (np.abs(RAYS[..., 1]) < 0.2), np.float32(1.2), wall)
    views = [posed(T, ghost), *(posed(T, wall, index=i) for i in range(1, 8))]
    assert np.abs(extract_mesh(fuse_views(views, SETTINGS)).vertices_m[:, 2]).max() < 0.05


def test_without_views_there_is_an_empty_map() -> None:
    assert len(build_cloud([], SETTINGS)) == 0
    assert len(extract_mesh(fuse_views([], SETTINGS)).faces) == 0


def test_memory_of_a_room_of_8_by_8_by_3_metres() -> None:
    """Surface alone: 2 x 64 + 4 x 24 m², three blocks deep, in blocks of 16 cm."""
    T = looking((0.0, 0.0, 2.0), (0.3, 0.0, 0.0))
    field = fuse_views([posed(T, plane_depth(T, (0, 0, 1), 0.0))], SETTINGS)
    area = np.ptp(field.blocks[:, 0]) * np.ptp(field.blocks[:, 1]) * 0.16**2
    assert field.voxel_bytes / area * (2 * 64 + 4 * 24) < 500e6


CUBE_M = 0.6


def cube_view(eye: tuple[float, float, float], index: int, red: int) -> PosedView:
    """Nearest hit of the six planes of a cube around the origin."""
    T = looking(eye, (0, 0, 0))
    rays = RAYS @ T[:3, :3].T
    depth = np.full((120, 160), np.inf)
    for axis in range(3):
        for side in (-1, 1):
            with np.errstate(divide="ignore", invalid="ignore"):
                z = (side * CUBE_M / 2 - T[axis, 3]) / rays[..., axis]
            hit = T[:3, 3] + z[..., None] * rays
            is_on = (np.delete(np.abs(hit), axis, axis=-1) <= CUBE_M / 2).all(axis=-1) & (z > 0)
            depth = np.where(is_on, np.minimum(depth, z), depth)
    rgb = GREY.copy()
    rgb[..., 0] = red
    return posed(T, np.where(np.isfinite(depth), depth, 0).astype(np.float32), rgb, index)


CUBE_VIEWS = [cube_view((1.1, 0.9, 0.8), 0, 10), cube_view((0.9, 1.1, 0.7), 1, 30), cube_view((-1.0, 1.0, -0.9), 2, 50)]


def test_the_cloud_of_a_cube_lies_on_it_and_mixes_colours() -> None:
    cloud = build_cloud(CUBE_VIEWS, replace(SETTINGS, least_views=1))
    off = np.abs(np.abs(cloud.points_m).max(axis=1) - CUBE_M / 2)
    assert len(cloud) > 1000
    assert np.median(off) < 1e-6
    assert off.max() < 0.01, "a mean of two faces in one voxel lies inside of the corner"
    top = cloud.points_m[:, 2] > CUBE_M / 2 - 1e-6
    assert set(cloud.colours[top & (cloud.views == 1), 0]) <= {10, 30}
    both = cloud.colours[top & (cloud.views == 2), 0]
    assert 10 < both.mean() < 30
    assert cloud.points_m[:, 2].min() < -0.25, "the third view sees the bottom"


def test_a_point_needs_enough_views() -> None:
    cloud = build_cloud(CUBE_VIEWS, replace(SETTINGS, least_views=2, support_voxels=1))
    assert len(cloud) > 300
    assert cloud.views.min() == 2
    assert cloud.points_m[:, 2].min() > -CUBE_M / 2 + 0.01, "the bottom was seen once"


def test_views_agree_if_they_measure_in_the_same_cube_of_voxels() -> None:
    T = looking((0.0, 0.0, 1.0), (0.01, 0.0, 0.0))
    views = [posed(T, plane_depth(T, (0, 0, 1), z), index=i) for i, z in enumerate((0.001, 0.021, 0.401))]
    strict = build_cloud(views, replace(SETTINGS, pixel_step=1, support_voxels=1))
    assert len(strict) == 0, "no two of the planes share a voxel"
    heights = build_cloud(views, replace(SETTINGS, pixel_step=1, support_voxels=50)).points_m[:, 2]
    assert {0.001, 0.021} <= set(heights.round(6)) <= {0.001, 0.021, 0.401}
    near = build_cloud(views, replace(SETTINGS, pixel_step=1, support_voxels=3)).points_m[:, 2]
    assert near.max() < 0.03, "nothing confirms the third plane"


def test_pixels_know_their_points() -> None:
    cloud = build_cloud(CUBE_VIEWS, SETTINGS)
    pixels, sums = np.zeros(len(cloud), int), np.zeros((len(cloud), 3))
    for view in CUBE_VIEWS:
        point = cloud.point_of_pixel(view)
        v, u = np.nonzero(point >= 0)
        places = RAYS[v, u] * view.view.depth_m[v, u, None].astype(float)
        np.add.at(sums, point[v, u], places @ view.T_world_camera[:3, :3].T + view.T_world_camera[:3, 3])
        pixels += np.bincount(point[v, u], minlength=len(cloud))
    assert (pixels == cloud.pixels).all()
    assert sums / pixels[:, None] == pytest.approx(cloud.points_m, abs=1e-9)


def test_merging_many_views_is_merging_them_all_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    views = SPHERE_VIEWS + CUBE_VIEWS
    first = build_cloud(views, SETTINGS)
    monkeypatch.setattr("dotmask.mapping.cloud.MERGED_AT_ONCE", 2)
    again = build_cloud(views, SETTINGS)
    assert (again.keys == first.keys).all()
    assert again.points_m == pytest.approx(first.points_m, abs=1e-12)


def test_depth_at_edges_at_holes_and_out_of_range_is_not_trusted() -> None:
    settings = MappingSettings(edge_px=1, hole_px=2, nearest_m=0.5, farthest_m=4.0)
    depth = np.full((60, 640), 2.0, np.float32)
    depth[:, 100:200] = 3.0
    depth[:, 300] = 0.0
    depth[:, 400:420] = 0.4
    depth[:, 500:] = 4.5
    kept = trusted_depth(depth, settings)[30] > 0
    assert kept[:98].all()
    assert not kept[98:102].any()
    assert kept[102:198].all()
    assert not kept[298:303].any()
    assert kept[303:390].all()
    assert not kept[400:420].any()
    assert not kept[500:].any()
    slanted = np.linspace(1.0, 3.0, 640, dtype=np.float32)[None].repeat(60, 0)
    assert (trusted_depth(slanted, settings) > 0).all(), "a slanted surface is no edge"


SMALL = Intrinsics(width=40, height=30, fx=35.0, fy=35.0, cx=19.5, cy=14.5)


def frame(index: int) -> RgbdFrame:
    noise = np.random.default_rng(index)
    depth = noise.uniform(0.5, 5, (30, 40)).astype(np.float32)
    rgb = noise.integers(0, 256, (30, 40, 3), np.uint8)
    return RgbdFrame(index=index, timestamp_s=index / 30, rgb=rgb, depth_m=depth, intrinsics=SMALL)


def shifted(x_m: float) -> np.ndarray:
    T = np.eye(4)
    T[0, 3] = x_m
    return T


def test_a_view_gives_back_every_bit() -> None:
    original = frame(3)
    view = View.of(original, original.depth_m)
    assert view.depth_m.tobytes() == original.depth_m.tobytes()
    assert (view.rgb == original.rgb).all()


def test_a_frame_is_kept_when_the_camera_moved_turned_or_waited() -> None:
    keeper = ViewKeeper(MappingSettings(step_m=0.1, step_rad=0.2, step_s=10 / 30))
    turned = shifted(0.1)
    turned[:3, :3] = [[np.cos(0.21), 0, np.sin(0.21)], [0, 1, 0], [-np.sin(0.21), 0, np.cos(0.21)]]
    poses = [shifted(0.0), shifted(0.09), None, shifted(0.1), shifted(0.15), turned, *[turned] * 12]
    kept = [i for i, T in enumerate(poses) if keeper.offer(frame(i), frame(i).depth_m, T)]
    assert kept == [0, 3, 5, 15]
    assert [view.index for view in keeper.views] == kept


def test_memory_of_the_views_is_bounded_and_the_most_alike_go() -> None:
    dropped: list[int] = []
    keeper = ViewKeeper(MappingSettings(most_views=20, step_m=0.1), dropped.append)
    for i in range(300):  # to and fro on one metre, and once to somewhere else
        keeper.offer(frame(i), frame(i).depth_m, shifted(9.0 if i == 150 else abs((0.2 * i) % 2.0 - 1.0)))
    indices = [view.index for view in keeper.views]
    assert len(indices) == 20
    assert sorted(indices + dropped) == list(range(300))
    assert 150 in indices, "the only view of a place was dropped"
    assert 299 in indices
    assert np.diff(indices).max() < 60, "a time was forgotten"
    whole = keeper.views[0].packed_bytes
    assert sum(view.packed_bytes for view in keeper.views) < 20 * 1.1 * whole


def test_views_are_put_where_the_optimised_trajectory_says() -> None:
    views = tuple(View.of(frame(i), frame(i).depth_m) for i in (0, 5, 9))
    times = np.array([0, 1, 5]) / 30
    trajectory = Trajectory(timestamps_s=times, T_world_camera=np.stack([shifted(x) for x in (1.0, 2.0, 3.0)]))
    found = pose_views(views, trajectory)
    assert [(p.view.index, p.T_world_camera[0, 3]) for p in found] == [(0, 1.0), (5, 3.0)], "frame 9 has no pose"


def test_another_program_reads_the_files(tmp_path: Path) -> None:
    mesh = extract_mesh(fuse_views(SPHERE_VIEWS, SETTINGS))
    write_ply(tmp_path / "mesh.ply", mesh.vertices_m, mesh.colours, mesh.faces)
    read = trimesh.load(tmp_path / "mesh.ply", process=False)
    assert read.vertices == pytest.approx(mesh.vertices_m, abs=1e-6)
    assert (read.faces == mesh.faces).all()
    assert (read.visual.vertex_colors[:, :3] == mesh.colours).all()
    cloud = build_cloud(CUBE_VIEWS, SETTINGS)
    write_ply(tmp_path / "cloud.ply", cloud.points_m, cloud.colours)
    read = trimesh.load(tmp_path / "cloud.ply")
    assert read.vertices == pytest.approx(cloud.points_m, abs=1e-6)
    assert (read.colors[:, :3] == cloud.colours).all()


@pytest.mark.parametrize("change", [{"voxel_m": 0.0}, {"most_views": 1}, {"farthest_m": 0.3}, {"truncation_m": 0.03}])
def test_settings_that_cannot_work_are_refused(change: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="mapping settings: "):
        MappingSettings(**change)
