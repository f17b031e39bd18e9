"""The maps of a run: the static world that they are held against, what is written, and the picture."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from typer.testing import CliRunner

from dotmask.evaluation.mapping import surface_distances
from dotmask.mapping.tsdf import Mesh
from scenarios.camera import camera_model
from scenarios.cli import app
from scenarios.map_picture import HEIGHT, WIDTH, draw_maps
from scenarios.registry import scenario
from scenarios.report import Report, maps
from scenarios.run import RunSettings, run, run_source
from scenarios.sources import Recorded
from scenarios.spec import with_overrides
from scenarios.static_world import SPACING_M, StaticWorld
from scenarios.world import build_scene, build_simulator

SHORT = with_overrides(scenario("smoke"), {"frames": "20", "sensor.model": "ideal"})


@pytest.fixture(scope="module")
def mapped(tmp_path_factory: pytest.TempPathFactory) -> tuple[Report, Path]:
    out = tmp_path_factory.mktemp("runs") / "mapped"
    return run(SHORT, RunSettings.parse(methods="unmasked,dotmask", with_map=True), out, lambda: None), out


def test_ghosts_are_in_the_map_without_masks_alone(mapped: tuple[Report, Path]) -> None:
    unmasked, masked = (mapped[0].methods[name].map for name in ("unmasked", "dotmask"))
    assert unmasked.ghost_fraction is not None
    assert unmasked.ghost_fraction > 0
    assert masked.ghost_fraction == 0
    assert masked.accuracy_m is not None
    assert masked.accuracy_m < 0.01
    assert masked.completeness is not None
    assert 0.1 < masked.completeness <= 1
    assert masked.views is not None
    assert masked.views >= 2


def test_clouds_and_meshes_are_files_that_lie_on_the_room(mapped: tuple[Report, Path]) -> None:
    report, out = mapped
    samples = StaticWorld(build_scene(SHORT), camera_model(SHORT.camera)).samples()
    cloud = trimesh.load(out / "map_dotmask.ply")
    mesh = trimesh.load(out / "mesh_dotmask.ply")
    assert len(cloud.vertices) == report.methods["dotmask"].map.points
    for points in (np.asarray(cloud.vertices), np.asarray(mesh.vertices)):
        assert np.median(surface_distances(points, samples)) < 0.01
    assert (out / "map_unmasked.ply").stat().st_size > (out / "map_dotmask.ply").stat().st_size


def test_the_line_of_the_maps_names_every_method_and_is_absent_without_maps(mapped: tuple[Report, Path]) -> None:
    line = maps(mapped[0])
    assert line is not None
    assert line.startswith("map of unmasked: ghosts ")
    assert "dotmask: ghosts 0.00 %" in line
    plain = {name: method.model_copy(update={"map": type(method.map)()}) for name, method in mapped[0].methods.items()}
    assert maps(mapped[0].model_copy(update={"methods": plain})) is None


def test_a_map_is_made_when_it_is_asked_for_alone(tmp_path: Path, dotmask) -> None:
    arguments = ("run", "smoke", "--frames", 2, "--methods", "dotmask")
    plain = dotmask(*arguments, "--out", tmp_path / "plain")
    mapped = dotmask(*arguments, "--out", tmp_path / "mapped", "--map", "--expect", "map.ghost_fraction<=0")
    assert (plain.code, mapped.code) == (0, 1), "with two frames nothing is seen in two views"
    made = {path.name for path in (tmp_path / "mapped").iterdir()} - {p.name for p in (tmp_path / "plain").iterdir()}
    assert made == {"map.png", "map_dotmask.ply", "mesh_dotmask.ply"}
    assert "map of dotmask" in mapped.out
    assert "map of" not in plain.out


def test_the_picture_shows_both_maps(mapped: tuple[Report, Path]) -> None:
    picture = cv2.imread(str(mapped[1] / "map.png"))
    assert picture.shape == (HEIGHT, 2 * WIDTH, 3)
    for panel in np.split(picture, 2, axis=1):
        assert 0.02 < (panel[60:] < 240).any(axis=2).mean() < 0.98


def test_the_static_world_is_the_scene_as_rendered_without_its_actors() -> None:
    simulator = build_simulator(SHORT, "numba", 1)
    images, moment = simulator.render(0)
    world = StaticWorld(simulator.scene, simulator.camera)
    static = world.depth_m(moment.T_world_camera)
    actors = [actor.instance_id for actor in simulator.scene.actors]
    is_static = ~np.isin(images.instance_ids, actors)
    assert (static[is_static] == images.depth_m[is_static]).all()
    assert (static[~is_static] > images.depth_m[~is_static]).all()


def test_samples_are_spread_evenly_over_the_area() -> None:
    samples = StaticWorld(build_scene(SHORT), camera_model(SHORT.camera)).samples()
    floor = (np.abs(samples.points_m[:, 2]) < 1e-6) & (samples.normals[:, 2] > 0.99)
    inside = floor & (np.abs(samples.points_m[:, :2]) < 0.5).all(axis=1)
    assert inside.sum() == pytest.approx(1 / SPACING_M**2, rel=0.15)
    assert np.linalg.norm(samples.normals, axis=1) == pytest.approx(1)


def square(z_m: float, colour: tuple[int, int, int]) -> Mesh:
    """Seen from above."""
    return Mesh(
        vertices_m=np.array([[-1.0, -1, z_m], [1, -1, z_m], [1, 1, z_m], [-1, 1, z_m]]),
        faces=np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        colours=np.tile(np.array(colour, np.uint8), (4, 1)),
    )


def test_a_map_is_drawn_in_its_colours_and_from_its_front_alone() -> None:
    """And without its ceiling, even if a part of that is turned up."""
    ahead = np.eye(4)
    ahead[:3, :3] = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
    floor = square(0.0, (200, 40, 40))
    ceiling = square(2.0, (40, 200, 40))
    room = Mesh(
        vertices_m=np.concatenate([floor.vertices_m, ceiling.vertices_m]),
        faces=np.concatenate([floor.faces, ceiling.faces[:1] + 4, ceiling.faces[1:, ::-1] + 4]),
        colours=np.concatenate([floor.colours, ceiling.colours]),
    )
    picture = draw_maps({"room": room}, [ahead]).astype(int)
    red = (picture[..., 0] - picture[..., 1]) > 80
    green = (picture[..., 1] - picture[..., 0]) > 80
    assert red.mean() > 0.1
    assert not green.any()
    nothing = Mesh(vertices_m=np.empty((0, 3)), faces=np.empty((0, 3), np.int32), colours=np.empty((0, 3), np.uint8))
    assert draw_maps({"none": nothing}, []).shape == (HEIGHT, WIDTH, 3)


def test_a_recorded_folder_is_mapped_and_its_map_is_not_scored(tmp_path: Path) -> None:
    out = tmp_path / "rendered"
    command = ["render", "smoke", "--frames", "12", "--out", str(out)]
    assert CliRunner().invoke(app, command).exit_code == 0
    settings = RunSettings.parse(segmenter="none", with_map=True)
    report = run_source(Recorded(out, None, None, None), settings, tmp_path / "run", lambda: None)
    figures = report.methods["unmasked"].map
    assert figures.points is not None
    assert figures.points > 1000
    assert (figures.ghost_fraction, figures.accuracy_m, figures.completeness) == (None, None, None)
    assert maps(report) == f"map of unmasked: {figures.points} points from {figures.views} views"
    assert (tmp_path / "run" / "map.png").is_file()
