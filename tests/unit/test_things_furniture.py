"""Furniture, chairs and clutter: standing on the floor, in human sizes, well-formed."""

import numpy as np
import pytest

from sim.randomness import child
from sim.things import clutter, furniture
from sim.things.chairs import BACK_TOP_M, CASTER_CIRCLE_M, CHAIR_COLOURS, SEAT_HEIGHT_M, office_chair_surfaces

STANDING = {
    # what it is: (maker, width, depth, height) in metres, within 15 %
    "desk": (furniture.desk, (1.5, 0.8, 0.74)),
    "monitor": (furniture.monitor, (0.6, 0.18, 0.51)),
    "shelf": (lambda rng: furniture.shelf(rng, (1.1, 0.34, 1.9), 4), (1.1, 0.34, 1.9)),
    "cabinet": (lambda rng: furniture.cabinet(rng, (0.46, 0.5, 0.74), (150, 150, 160), 3), (0.46, 0.54, 0.74)),
    "radiator": (lambda rng: furniture.radiator(rng, 1.2), (1.2, 0.09, 0.71)),
    "cup": (clutter.cup, None),
    "bottle": (clutter.bottle, None),
    "keyboard": (clutter.keyboard, (0.45, 0.15, 0.0225)),
    "mouse": (clutter.mouse, (0.22, 0.18, 0.036)),
    "laptop": (clutter.laptop, (0.33, 0.3, 0.22)),
    "backpack": (clutter.backpack, (0.3, 0.29, 0.45)),
    "books": (lambda rng: clutter.book_stack(rng, 5), None),
    "book row": (lambda rng: furniture.book_row(rng, 0.9, 0.3), None),
    "plant": (lambda rng: clutter.plant(rng, 1.2), None),
    "lamp": (clutter.desk_lamp, None),
    "carton": (lambda rng: clutter.carton(rng, (0.5, 0.4, 0.3)), (0.5, 0.4, 0.3)),
    "bin": (clutter.bin_with_paper, (0.296, 0.296, 0.305)),
    "door": (furniture.door, None),
}
HANGING = {
    "picture": lambda rng: furniture.hung(np.zeros((4, 4, 3), np.uint8), 1.0, 0.5, rng, (9, 9, 9)),
    "window": lambda rng: furniture.window(rng, 1.5, 1.0),
    "clock": furniture.clock,
}


def points(surfaces):
    return np.concatenate([s.vertices for s in surfaces])


def check_surfaces(surfaces):
    for surface in surfaces:
        assert np.linalg.norm(surface.normals, axis=1) == pytest.approx(1.0, abs=1e-5)
        a, b, c = (surface.vertices[surface.faces[:, k]].astype(float) for k in range(3))
        facing = np.cross(b - a, c - a)
        assert (np.linalg.norm(facing, axis=1) > 1e-9).all()
        mean = sum(surface.normals[surface.faces[:, k]] for k in range(3))
        assert (np.sum(facing * mean, axis=1) > 0).mean() > 0.995


@pytest.mark.parametrize("name", [*STANDING, *HANGING])
def test_surfaces_are_well_formed(name):
    maker = STANDING[name][0] if name in STANDING else HANGING[name]
    check_surfaces(maker(child(0, name)))


@pytest.mark.parametrize("name", STANDING)
def test_stands_on_the_floor_in_its_size(name):
    maker, size = STANDING[name]
    p = points(maker(child(0, name)))
    if name != "radiator":
        assert 0 <= p[:, 2].min() < 0.081
    if size is not None:
        assert np.ptp(p, axis=0)[:2] == pytest.approx(size[:2], rel=0.15)
        assert p[:, 2].max() == pytest.approx(size[2], rel=0.15)


@pytest.mark.parametrize("name", HANGING)
def test_hangs_before_the_wall(name):
    p = points(HANGING[name](child(0, name)))
    assert p[:, 1].max() <= 1e-6
    assert p[:, 1].min() < -0.01


@pytest.mark.parametrize("name", STANDING)
def test_same_seed_same_bytes(name):
    def data(seed):
        return [a.tobytes() for s in STANDING[name][0](child(seed, name)) for a in (s.vertices, s.uv, s.texture)]

    assert data(0) == data(0)
    assert data(0) != data(1)


@pytest.mark.parametrize("colour", CHAIR_COLOURS)
def test_chair_is_an_office_chair(colour):
    surfaces = office_chair_surfaces(0, colour)
    check_surfaces(surfaces)
    p = points(surfaces)
    assert p[:, 2].min() == pytest.approx(0.0, abs=1e-3)  # the wheels touch the floor
    assert p[:, 2].max() == pytest.approx(BACK_TOP_M, abs=0.03)
    low = p[p[:, 2] < 0.02]
    assert np.linalg.norm(low[:, :2], axis=1) == pytest.approx(CASTER_CIRCLE_M, abs=0.05)
    directions = np.sort(np.unwrap(np.arctan2(low[:, 1], low[:, 0]) * 5) % (2 * np.pi))
    assert np.abs(np.exp(1j * directions).mean()) > 0.7  # five times the angle is one angle: a five-pointed star
    seat = p[(np.abs(p[:, 0]) < 0.2) & (p[:, 1] < -0.05) & (p[:, 2] > 0.4) & (p[:, 2] < 0.6)]
    assert seat[:, 2].max() == pytest.approx(SEAT_HEIGHT_M, abs=0.02)
    back = p[p[:, 2] > 0.8]
    assert back[:, 1].min() > 0.1  # behind the sitter, who faces -y
    assert sum(len(s.faces) for s in surfaces) < 8000


def test_chair_refuses_an_unknown_colour():
    with pytest.raises(ValueError, match="expected one of blue, black, red, green, grey"):
        office_chair_surfaces(0, "mauve")


def test_chair_without_arms_is_narrower():
    def width(arms):
        p = points(office_chair_surfaces(0, arms=arms))
        return np.ptp(p[p[:, 2] > 0.3][:, 0])

    assert width(True) > 0.55
    assert width(False) < 0.52


def test_books_of_a_row_stand_side_by_side():
    """Every book is 20 vertices; their extents along x do not overlap and stay within the width."""
    (surface,) = furniture.book_row(child(0, "row"), 0.9, 0.3)
    books = surface.vertices.reshape(-1, 20, 3)[..., 0]
    assert len(books) > 10
    assert (books.min(axis=1)[1:] >= books.max(axis=1)[:-1] - 1e-6).all()
    assert books.min() >= -0.451
    assert books.max() <= 0.451
