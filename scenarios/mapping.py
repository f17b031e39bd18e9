"""The maps of a run: built from what each method let through, written as files, and held against the static world."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict

import numpy as np
import numpy.typing as npt

from dotmask.evaluation.mapping import map_errors, seen_samples, shows_ghost
from dotmask.mapping.cloud import PointCloud, build_cloud
from dotmask.mapping.ply import write_ply
from dotmask.mapping.settings import MappingSettings
from dotmask.mapping.tsdf import Mesh, extract_mesh, fuse_views
from dotmask.mapping.views import PosedView, ViewKeeper, pose_views
from dotmask.pipeline import FrameResult
from dotmask.records import SlamResult
from scenarios.map_picture import draw_maps
from scenarios.report import MapReport
from scenarios.run_folder import RunFolder
from scenarios.static_world import StaticWorld
from scenarios.video import write_picture
from sim.records import GroundTruth

LOOK_EVERY = 15
"""Frames from one look at what the camera could see of the static world to the next."""


class MapMaker:
    """Follows a run and maps it, once for each method.

    Args:
        methods: their names.
        world: what is there to be mapped.
        settings: of the maps.
    """

    def __init__(self, methods: Sequence[str], world: StaticWorld, settings: MappingSettings) -> None:
        self._world, self._settings = world, settings
        self._samples = world.samples()
        self._is_observable = np.zeros(len(self._samples.points_m), np.bool_)
        self._ghosts: dict[str, dict[int, npt.NDArray[np.uint8]]] = {name: {} for name in methods}
        self._keepers = {name: ViewKeeper(settings, self._ghosts[name].pop) for name in methods}

    def see(self, truth: GroundTruth, results: Mapping[str, FrameResult]) -> None:
        """Look at the next frame: at its truth and at what each method made of it."""
        static_depth_m = None
        frame = next(iter(results.values())).frame
        if frame.index % LOOK_EVERY == 0:
            static_depth_m = self._world.depth_m(truth.T_world_camera)
            self._is_observable |= seen_samples(
                self._samples,
                static_depth_m,
                frame.intrinsics,
                truth.T_world_camera,
                (self._settings.nearest_m, self._settings.farthest_m),
            )
        for name, result in results.items():
            mdi_m, pose = result.front_end.masked.mdi_m, result.pose.T_world_camera
            if not self._keepers[name].offer(frame, mdi_m, pose):
                continue
            if static_depth_m is None:
                static_depth_m = self._world.depth_m(truth.T_world_camera)
            is_actor = np.isin(truth.instance_ids, [actor.instance_id for actor in truth.objects])
            self._ghosts[name][frame.index] = np.packbits(shows_ghost(frame.depth_m, is_actor, static_depth_m))

    def finish(self, slam_results: Mapping[str, SlamResult], folder: RunFolder) -> dict[str, MapReport]:
        """Build and score all maps by the optimised poses; write `map_METHOD.ply`, `mesh_METHOD.ply`, `map.png`."""
        reports: dict[str, MapReport] = {}
        meshes: dict[str, Mesh] = {}
        views: tuple[PosedView, ...] = ()
        for name, slam in slam_results.items():
            views = pose_views(self._keepers[name].views, slam.trajectory)
            cloud, meshes[name] = build_cloud(views, self._settings), extract_mesh(fuse_views(views, self._settings))
            write_ply(folder.path / f"map_{name}.ply", cloud.points_m, cloud.colours)
            mesh = meshes[name]
            write_ply(folder.path / f"mesh_{name}.ply", mesh.vertices_m, mesh.colours, mesh.faces)
            errors = map_errors(cloud.points_m, self._is_ghost(name, cloud, views), self._samples, self._is_observable)
            reports[name] = MapReport(views=len(views), **asdict(errors))
        titles = {f"{name}: {_ghosts(reports[name])}": mesh for name, mesh in meshes.items()}
        write_picture(folder.path / "map.png", draw_maps(titles, [posed.T_world_camera for posed in views]))
        return reports

    def _is_ghost(self, name: str, cloud: PointCloud, views: Sequence[PosedView]) -> npt.NDArray[np.bool_]:
        """(N,) points of which at least half of the measurements showed something that can move."""
        ghosts = np.zeros(len(cloud), np.int64)
        for posed in views:
            point = cloud.point_of_pixel(posed)
            shows = np.unpackbits(self._ghosts[name][posed.view.index], count=point.size).reshape(point.shape)
            ghosts += np.bincount(point[(point >= 0) & (shows > 0)], minlength=len(cloud))
        return np.asarray(2 * ghosts >= cloud.pixels)


def _ghosts(report: MapReport) -> str:
    share = report.ghost_fraction
    return "no points" if share is None else f"{100 * share:.1f} % of the points are ghosts"
