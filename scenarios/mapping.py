"""The maps of a run: built from what each method let through, written as files, and held against the static world."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

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
from scenarios.sources import TruePose
from scenarios.video import write_picture
from sim.records import GroundTruth

if TYPE_CHECKING:
    from scenarios.static_world import StaticWorld

LOOK_EVERY = 15
"""Frames from one look at what the camera could see of the static world to the next."""


class MapMaker:
    """Follows a run and maps it, once for each method.

    Args:
        methods: their names.
        world: what is there to be mapped; None where it is not known, and no map is scored.
        settings: of the maps.
    """

    def __init__(self, methods: Sequence[str], world: "StaticWorld | None", settings: MappingSettings) -> None:
        self._world, self._settings = world, settings
        self._samples = None if world is None else world.samples()
        self._is_observable = np.zeros(0 if self._samples is None else len(self._samples.points_m), np.bool_)
        self._ghosts: dict[str, dict[int, npt.NDArray[np.uint8]]] = {name: {} for name in methods}
        self._keepers = {name: ViewKeeper(settings, self._ghosts[name].pop) for name in methods}

    def see(self, truth: GroundTruth | TruePose, results: Mapping[str, FrameResult]) -> None:
        """Look at the next frame: at its truth and at what each method made of it."""
        frame = next(iter(results.values())).frame
        kept = [
            name
            for name, result in results.items()
            if self._keepers[name].offer(frame, result.front_end.masked.mdi_m, result.pose.T_world_camera)
        ]
        looks = frame.index % LOOK_EVERY == 0
        if self._world is None or self._samples is None or isinstance(truth, TruePose) or not (kept or looks):
            return
        static_depth_m = self._world.depth_m(truth.T_world_camera)
        if looks:
            self._is_observable |= seen_samples(
                self._samples,
                static_depth_m,
                frame.intrinsics,
                truth.T_world_camera,
                (self._settings.nearest_m, self._settings.farthest_m),
            )
        is_actor = np.isin(truth.instance_ids, [actor.instance_id for actor in truth.objects])
        for name in kept:
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
            reports[name] = self._report(name, cloud, views)
        titles = {f"{name}: {_caption(reports[name])}": mesh for name, mesh in meshes.items()}
        write_picture(folder.path / "map.png", draw_maps(titles, [posed.T_world_camera for posed in views]))
        return reports

    def _report(self, name: str, cloud: PointCloud, views: Sequence[PosedView]) -> MapReport:
        if self._samples is None:
            return MapReport(points=len(cloud), views=len(views))
        errors = map_errors(cloud.points_m, self._is_ghost(name, cloud, views), self._samples, self._is_observable)
        return MapReport(views=len(views), **asdict(errors))

    def _is_ghost(self, name: str, cloud: PointCloud, views: Sequence[PosedView]) -> npt.NDArray[np.bool_]:
        """(N,) points of which at least half of the measurements showed something that can move."""
        ghosts = np.zeros(len(cloud), np.int64)
        for posed in views:
            point = cloud.point_of_pixel(posed)
            shows = np.unpackbits(self._ghosts[name][posed.view.index], count=point.size).reshape(point.shape)
            ghosts += np.bincount(point[(point >= 0) & (shows > 0)], minlength=len(cloud))
        return np.asarray(2 * ghosts >= cloud.pixels)


def _caption(report: MapReport) -> str:
    if report.ghost_fraction is None:
        return f"{report.points} points"
    return f"{100 * report.ghost_fraction:.1f} % of the points are ghosts"
