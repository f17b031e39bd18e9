"""Meshes: closed, outward, and with the volume of the shape they stand for."""

import numpy as np
import pytest

from sim.things.meshes import Mesh, box, lathe, merged, panel, rounded_box, tube


def volume(mesh: Mesh) -> float:
    """Of a closed mesh, positive when its faces are counter-clockwise seen from outside."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.sum(a * np.cross(b, c)) / 6)


def open_edges(mesh: Mesh) -> int:
    """Edges that no second triangle uses in the other direction, places taken as equal within a micrometre."""
    _, place = np.unique(np.round(mesh.vertices * 1e6).astype(int), axis=0, return_inverse=True)
    faces = place.reshape(-1)[mesh.faces]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).tolist()
    there = {tuple(e) for e in edges}
    return sum((b, a) not in there for a, b in there)


SHAPES = {
    "box": (box((1, 2, 3), (1, 2, 3)), 6.0, 1e-12),
    "rounded box": (rounded_box((0, 0, 1), (1, 2, 3), 0.5, segments=12), 4.7124 - 0.0, 2.0),
    "cylinder": (lathe([(0, 0), (1, 0), (1, 2), (0, 2)], segments=200), 2 * np.pi, 0.002),
    "sphere": (
        lathe([(np.sin(t), -np.cos(t)) for t in np.linspace(0, np.pi, 60)][1:-1], segments=100),
        4 / 3 * np.pi,
        0.02,
    ),
    "bar": (tube([[0, 0, 0], [0, 0, 1], [0, 0, 3]], 0.5, segments=100), 0.25 * np.pi * 3, 0.01),
}


@pytest.mark.parametrize("name", ["box", "cylinder", "bar"])
def test_volume_is_that_of_the_shape(name):
    mesh, expected, tolerance = SHAPES[name]
    assert volume(mesh) == pytest.approx(expected, abs=tolerance)
    assert open_edges(mesh) == 0


def test_rounded_box_has_the_volume_of_the_steiner_formula():
    """Inner box + slabs + quarter cylinders + ball; the facets make it a little smaller."""
    size, radius = np.array([1.0, 2.0, 3.0]), 0.3
    a, b, c = size - 2 * radius
    exact = (
        a * b * c + 2 * radius * (a * b + b * c + c * a) + np.pi * radius**2 * (a + b + c) + 4 / 3 * np.pi * radius**3
    )
    mesh = rounded_box((5, 0, 0), size, radius, segments=10)
    assert volume(mesh) == pytest.approx(exact, rel=2e-3)
    assert volume(mesh) < exact
    assert open_edges(mesh) == 0


def test_rounded_box_refuses_a_radius_that_does_not_fit():
    with pytest.raises(ValueError, match=r"at most 0\.05"):
        rounded_box((0, 0, 0), (1, 1, 0.1), 0.06)


@pytest.mark.parametrize("name", SHAPES)
def test_normals_have_unit_length_and_point_outwards(name):
    mesh = SHAPES[name][0]
    assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1.0)
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    facing = np.cross(b - a, c - a)
    assert (np.linalg.norm(facing, axis=1) > 0).all()
    for k in range(3):
        assert (np.sum(facing * mesh.normals[mesh.faces[:, k]], axis=1) > 0).all()


def test_smooth_parts_of_a_turned_shape_have_the_normals_of_the_exact_surface():
    sphere = SHAPES["sphere"][0]
    inner = np.abs(sphere.vertices[:, 2]) < 0.95
    assert sphere.normals[inner] == pytest.approx(sphere.vertices[inner], abs=0.01)


def test_panel_faces_its_viewer_and_is_not_mirrored():
    """Seen from -y: the texture's first row is above, its first column to the left (-x)."""
    mesh = panel((0, 0, 0), (2, 0, 0), (0, 0, 1))
    assert mesh.normals == pytest.approx(np.tile([0, -1, 0], (4, 1)))
    for vertex, uv in zip(mesh.vertices, mesh.uv, strict=True):
        assert uv == pytest.approx([0.5 + vertex[0] / 4, 0.5 - vertex[2] / 2])


def test_turned_print_reads_from_left_to_right():
    """On the outside of a cup, u grows to the right for who looks at it."""
    cup = lathe([(1, 0), (1, 1)], segments=8)
    uv = cup.uv[cup.faces[0]]
    handedness = np.linalg.det(np.stack([uv[1] - uv[0], uv[2] - uv[0]]))
    assert handedness < 0  # counter-clockwise in space, clockwise in (u, v down): not mirrored


def test_moving_bending_and_merging_keep_the_volume():
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    first = box((0, 0, 0), (1, 2, 3))
    moved = first.moved([5, 6, 7], turn)
    assert volume(moved) == pytest.approx(6.0)
    sheared = first.bent(lambda p: p + p[:, [2, 2, 2]] * [0.5, 0, 0])
    assert volume(sheared) == pytest.approx(6.0)
    assert volume(merged(first, moved)) == pytest.approx(12.0)


def test_two_sided_has_both_sides():
    mesh = panel((0, 0, 0), (1, 0, 0), (0, 0, 1)).two_sided()
    assert volume(mesh) == pytest.approx(0.0)
    assert open_edges(mesh) == 0
    assert mesh.normals.sum(axis=0) == pytest.approx([0, 0, 0])


def test_texture_offset_shows_another_place_of_the_same_size():
    first, second = (
        box((0, 0, 0), (1, 1, 1), texture_m=2.0),
        box((0, 0, 0), (1, 1, 1), texture_m=2.0, texture_offset=(0.3, 0.1)),
    )
    assert second.uv - first.uv == pytest.approx(np.tile([0.3, 0.1], (24, 1)))
    assert np.ptp(first.uv[:4], axis=0) == pytest.approx([0.5, 0.5])


def test_surface_lies_on_the_pose_grid():
    surface = tube([[0, 0, 0], [0.1, 0.2, 0.3]], 0.05).surface(np.zeros((4, 4, 3), np.uint8))
    scaled = surface.vertices.astype(float) * 2**22
    assert np.array_equal(scaled, np.round(scaled))
