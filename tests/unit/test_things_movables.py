"""Cups, bottles, boxes and chairs: well-formed, in the sizes of real ones, and with bodies that fit their shapes."""

import numpy as np
import pytest

from sim.geometry import rotation_z
from sim.physics.bake import Baked, stand
from sim.physics.bodies import box_inertia, cylinder_inertia, tube_inertia
from sim.physics.events import Start
from sim.physics.keyframes import KeyframeMotion
from sim.things.chair_motion import chair_motion
from sim.things.chairs import CASTER_TRAIL_M, CASTERS, FIRST_CASTER_BONE, caster_place
from sim.things.movables import KINDS, movable
from sim.things.vessels import CUP_HEIGHT_M, CUP_RADIUS_M

ALL = [(kind, look) for kind, (_, looks) in KINDS.items() for look in looks]
FREE = [(kind, look) for kind, look in ALL if kind != "chair"]


def points(made):
    return np.concatenate([s.vertices for s in made.surfaces]).astype(float)


def corners(part):
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    return np.array(part.centre_m) + signs * np.array(part.size_m) / 2


@pytest.mark.parametrize(("kind", "look"), ALL)
def test_surfaces_are_well_formed(kind, look):
    made = movable(kind, look, 0)
    for surface in made.surfaces:
        assert np.linalg.norm(surface.normals, axis=1) == pytest.approx(1.0, abs=1e-5)
        a, b, c = (surface.vertices[surface.faces[:, k]].astype(float) for k in range(3))
        facing = np.cross(b - a, c - a)
        assert (np.linalg.norm(facing, axis=1) > 1e-10).all()
        mean = sum(surface.normals[surface.faces[:, k]] for k in range(3))
        assert (np.sum(facing * mean, axis=1) > 0).mean() > 0.995
    assert abs(points(made)[:, 2].min()) < 1e-3
    assert sum(len(s.faces) for s in made.surfaces) < 8000


@pytest.mark.parametrize(("kind", "look"), FREE)
def test_the_body_has_the_extents_of_the_shape(kind, look):
    """Within 4 mm; the flaps of an open box and the wall's thickness are the shape's alone."""
    made = movable(kind, look, 0)
    p, q = points(made), np.concatenate([corners(part) for part in made.body.parts])
    if look == "open":
        q_high, p_high = q.max(axis=0), p.max(axis=0)
        assert (p_high >= q_high - 0.004).all()
        return
    assert p.min(axis=0) == pytest.approx(q.min(axis=0), abs=0.004)
    assert p.max(axis=0) == pytest.approx(q.max(axis=0), abs=0.004)


@pytest.mark.parametrize(("kind", "look"), ALL)
def test_the_centre_of_mass_is_inside_and_the_inertia_is_possible(kind, look):
    """Moments of a rigid body obey the triangle inequality."""
    body = movable(kind, look, 0).body
    p = np.concatenate([corners(part) for part in body.parts])
    assert (p.min(axis=0) < body.centre_of_mass_m).all()
    assert (p.max(axis=0) > body.centre_of_mass_m).all()
    x, y, z = body.inertia_kg_m2
    assert x + y >= z * (1 - 1e-9)
    assert x + z >= y * (1 - 1e-9)
    assert y + z >= x * (1 - 1e-9)


def test_inertias_are_those_of_the_integrals():
    """Against sums over points spread evenly in the solids."""
    rng = np.random.default_rng(0)
    p = rng.uniform(-0.5, 0.5, (400_000, 3)) * [0.2, 0.3, 0.5]

    def moments(q, mass):
        xx, yy, zz = mass * (q**2).mean(axis=0)
        return (yy + zz, xx + zz, xx + yy)

    assert box_inertia(2.0, (0.2, 0.3, 0.5)) == pytest.approx(moments(p, 2.0), rel=0.01)
    radius = np.sqrt(rng.uniform(0, 1, 400_000)) * 0.1
    angle = rng.uniform(0, 2 * np.pi, 400_000)
    solid = np.stack([radius * np.cos(angle), radius * np.sin(angle), p[:, 2]], axis=1)
    assert cylinder_inertia(2.0, 0.1, 0.5) == pytest.approx(moments(solid, 2.0), rel=0.01)
    wall = np.stack([0.1 * np.cos(angle), 0.1 * np.sin(angle), p[:, 2]], axis=1)
    assert tube_inertia(2.0, 0.1, 0.5) == pytest.approx(moments(wall, 2.0), rel=0.01)


@pytest.mark.parametrize("look", KINDS["cup"][1])
def test_a_cup_is_open_at_the_top_holds_a_drink_and_has_a_handle(look):
    made = movable("cup", look, 0)
    p = points(made)
    inside = p[np.linalg.norm(p[:, :2], axis=1) < 0.8 * CUP_RADIUS_M]
    assert 0.5 * CUP_HEIGHT_M < inside[:, 2].max() < 0.9 * CUP_HEIGHT_M
    assert p[:, 0].max() > CUP_RADIUS_M + 0.025  # a finger fits in
    assert -p[:, 0].min() == pytest.approx(CUP_RADIUS_M, abs=1e-3)
    grip = p[p[:, 0] > CUP_RADIUS_M + 0.02]
    assert np.ptp(grip[:, 1]) < 0.016
    assert 0.02 < grip[:, 2].min() < grip[:, 2].max() < CUP_HEIGHT_M


@pytest.mark.parametrize(("kind", "look"), ALL)
def test_same_seed_same_bytes_and_another_seed_another_thing(kind, look):
    def data(seed):
        return [a.tobytes() for s in movable(kind, look, seed).surfaces for a in (s.vertices, s.uv, s.texture)]

    assert data(0) == data(0)
    assert data(0) != data(1)


@pytest.mark.parametrize("kind", KINDS)
def test_looks_differ_and_the_default_is_the_first(kind):
    looks = KINDS[kind][1]

    def texture(look):
        return b"".join(s.texture.tobytes() + s.vertices.tobytes() for s in movable(kind, look, 0).surfaces)

    assert len({texture(look) for look in looks}) == len(looks)
    assert texture("default") == texture(looks[0])


def test_a_box_has_the_size_that_is_asked_for():
    made = movable("box", "taped", 0, (0.5, 0.4, 0.2))
    assert np.ptp(points(made), axis=0) == pytest.approx([0.5, 0.4, 0.2], abs=0.002)
    assert made.body.parts[0].size_m == (0.5, 0.4, 0.2)


def test_a_jointed_chair_at_rest_is_the_rigid_one_but_for_its_casters():
    made = movable("chair", "blue", 0)
    motion = made.motion(stand(Start(body=made.body, position_m=(0, 0, 0), yaw_rad=0.0)))
    palette = motion.palette_at(0.0)
    assert palette.shape == (7, 4, 4)
    assert np.array_equal(palette[0], np.eye(4))
    assert np.array_equal(palette[1], np.eye(4))
    for number in range(CASTERS):
        pin = np.array([*caster_place(number), 1.0])
        assert palette[FIRST_CASTER_BONE + number] @ pin == pytest.approx(pin)
    used = {int(b) for s in made.surfaces for b in np.unique(s.bones[:, 0])}
    assert used == set(range(7))


def test_the_contact_of_a_caster_does_not_slip_sideways():
    """A star that moves on a circle: every contact's velocity stays along its wheel, within what 240 Hz shows."""
    times = np.arange(0, 6, 1 / 240)
    turn = 0.5 * times
    p = np.stack([np.sin(turn), 1 - np.cos(turn), 0 * turn], axis=1)
    v = 0.5 * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    q = np.stack([0 * turn, 0 * turn, np.sin(turn / 2), np.cos(turn / 2)], axis=1)
    track = KeyframeMotion(times_s=times, p_world=p, v_world=v, q_world_xyzw=q)
    motion = chair_motion(track, track, np.zeros(CASTERS))
    for number in range(CASTERS):
        contact = np.append(caster_place(number) + np.array([CASTER_TRAIL_M, 0, 0]), 1.0)

        def place(t, bone=FIRST_CASTER_BONE + number, contact=contact):
            return (motion.palette_at(t)[bone] @ contact)[:2]

        t = 5.0
        speed = (place(t + 0.01) - place(t - 0.01)) / 0.02
        axle = (motion.palette_at(t)[FIRST_CASTER_BONE + number, :3, :3] @ [0, 1, 0])[:2]
        assert abs(float(speed @ axle)) < 0.02 * np.linalg.norm(speed)


def test_the_seat_turns_on_the_star():
    made = movable("chair", "blue", 0)

    def still(yaw):
        q = np.array([[0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)]])
        return KeyframeMotion(times_s=np.zeros(1), p_world=np.zeros((1, 3)), v_world=np.zeros((1, 3)), q_world_xyzw=q)

    motion = made.motion(Baked(base=still(0.2), top=still(1.4)))
    assert motion.palette_at(0.0)[0, :3, :3] == pytest.approx(rotation_z(0.2))
    assert motion.palette_at(0.0)[1, :3, :3] == pytest.approx(rotation_z(1.4))
    assert np.array_equal(motion.pose_at(0.0), motion.palette_at(0.0)[1])


def test_an_unknown_look_is_refused():
    with pytest.raises(KeyError, match="pink"):
        movable("cup", "pink", 0)
