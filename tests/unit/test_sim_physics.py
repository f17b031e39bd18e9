"""Physics: still until touched, Newton's and Coulomb's laws, no energy from nowhere, the same in every process."""

import hashlib
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sim.errors import MotionError
from sim.physics.bake import bake, stand
from sim.physics.bodies import Body, Part, box_inertia
from sim.physics.bullet import GRAVITY_M_S2
from sim.physics.events import Bystander, Hit, Pusher, Start
from sim.physics.keyframes import KeyframeMotion
from sim.rooms.room import Obstacle
from sim.things.chairs import BEARING_N_M, CASTER_FRICTION, TOP_INERTIA_KG_M2
from sim.things.movables import KINDS, movable

DESK = Obstacle(centre_m=(0.0, 0.0, 0.725), size_m=(1.5, 0.8, 0.03))
CHAIR, BOX = movable("chair", "blue", 0).body, movable("box", "taped", 0).body
BOTTLE, CUP = movable("bottle", "water", 0).body, movable("cup", "white", 0).body


def hit(impulse, height, *, time_s=0.5, offset=0.0, thing=0):
    return Hit(thing=thing, time_s=time_s, impulse_n_s=impulse, height_m=height, offset_m=offset)


def one(body, *hits, at=(0.0, 0.0, 0.0), yaw_rad=0.0, obstacles=(), duration_s=6.0, **more):
    start = Start(body=body, position_m=at, yaw_rad=yaw_rad)
    return bake([start], obstacles, duration_s, names=["it"], hits=hits, **more)[0]


def yaws(motion):
    q = motion.q_world_xyzw
    return np.unwrap(2 * np.arctan2(q[:, 2], q[:, 3]))


def way(motion):
    return motion.p_world[-1] - motion.p_world[0]


def at_rest(motion):
    return not motion.v_world[-1].any()


@pytest.mark.parametrize("body", [CHAIR, BOX, BOTTLE, CUP])
def test_what_nothing_touches_stands_exactly_still(body):
    motion = one(body, at=(0.4, -0.3, 0.0), yaw_rad=0.7).base
    assert len(motion.times_s) == 1
    assert np.array_equal(motion.pose_at(0.0), motion.pose_at(4.999))
    assert motion.pose_at(0.0)[:3, 3].tolist() == [0.4, -0.3, 0.0]


@pytest.mark.parametrize("body", [BOTTLE, CUP])
def test_what_stands_on_a_desk_stands_exactly_still_while_a_chair_bumps_into_something(body):
    things = [Start(body=CHAIR, position_m=(0, -2, 0)), Start(body=body, position_m=(0, 0, 0.74))]
    _, still = bake(things, [DESK], 3.0, names=["a", "b"], hits=[hit((0, -5, 0), 0.4)])
    assert len(still.base.times_s) == 1


@pytest.mark.parametrize("body", [CHAIR, BOX])
def test_an_impulse_gives_its_speed_at_once(body):
    """v = J / m, less what friction takes within the first keyframe."""
    motion = one(body, hit((7.0, 0, 0), 0.45 if body is CHAIR else BOX.centre_of_mass_m[2])).base
    first = int(np.flatnonzero(motion.v_world[:, 0])[0])
    assert motion.times_s[first] == pytest.approx(0.5, abs=1 / 120 + 1e-9)
    lost = body.friction * GRAVITY_M_S2 / 120
    assert motion.v_world[first, 0] == pytest.approx(7.0 / body.total_mass_kg, abs=lost + 0.002)


@pytest.mark.parametrize(("impulse", "friction"), [(3.0, 0.2), (3.0, 0.5), (6.0, 0.4)])
def test_a_sliding_box_stops_after_v_squared_by_two_mu_g(impulse, friction):
    size, mass = (0.4, 0.3, 0.2), 2.0
    part = Part(kind="box", centre_m=(0, 0, 0.1), size_m=size)
    body = Body(
        mass_kg=mass,
        centre_of_mass_m=(0, 0, 0.1),
        inertia_kg_m2=box_inertia(mass, size),
        parts=(part,),
        friction=friction,
    )
    motion = one(body, hit((impulse, 0, 0), 0.1)).base
    assert way(motion)[0] == pytest.approx((impulse / mass) ** 2 / (2 * friction * GRAVITY_M_S2), rel=0.05)
    assert at_rest(motion)
    assert abs(way(motion)[1]) < 0.02


def test_a_chair_rolls_as_far_as_its_friction_lets_it():
    motion = one(CHAIR, hit((8.0, 0, 0), 0.45)).base
    expected = (8.0 / CHAIR.total_mass_kg) ** 2 / (2 * CASTER_FRICTION * GRAVITY_M_S2)
    assert way(motion)[0] == pytest.approx(expected, rel=0.05)
    assert at_rest(motion)
    assert 1.0 < motion.times_s[-1] - 0.5 < 3.0


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_couple_turns_the_seat_by_its_energy_over_the_friction_of_the_bearing(sign):
    """Two opposite impulses beside the axis: J d = I w, and I w² / 2 = torque times angle. The star stays."""
    push = 3.0
    pair = [hit((push, 0, 0), 0.45, offset=0.1 * sign), hit((-push, 0, 0), 0.45, offset=0.1 * sign)]
    chair = one(CHAIR, *pair)
    spin = 2 * push * 0.1 / TOP_INERTIA_KG_M2
    expected = TOP_INERTIA_KG_M2 * spin**2 / (2 * BEARING_N_M)
    turned = yaws(chair.top)[-1] - yaws(chair.top)[0]
    assert turned == pytest.approx(-sign * expected, rel=0.03)
    assert abs(yaws(chair.base)[-1]) < 0.1
    assert np.abs(way(chair.base)).max() < 0.01


@pytest.mark.parametrize("offset", [0.05, -0.15])
def test_an_impulse_beside_the_axis_gives_the_seat_its_spin_at_once(offset):
    """w = J d / I about the axis, to the right of the way when hit on the left; less the bearing's friction."""
    chair = one(CHAIR, hit((4.0, 0, 0), 0.45, offset=offset))
    turned = yaws(chair.top)
    first = int(np.flatnonzero(turned)[0])
    rate = (turned[first + 1] - turned[first]) / (chair.top.times_s[first + 1] - chair.top.times_s[first])
    lost = BEARING_N_M / TOP_INERTIA_KG_M2 * 2 / 120
    assert rate == pytest.approx(-4.0 * offset / TOP_INERTIA_KG_M2, abs=lost)


def test_a_push_beside_the_axis_turns_the_chair_that_rolls():
    """Pushed on its left side along its way, it turns to the right, which is clockwise."""
    chair = one(CHAIR, hit((6.0, 0.0, 0), 0.45, offset=0.1))
    assert yaws(chair.top)[-1] < -1.0
    assert way(chair.base)[0] > 0.2


def test_a_hard_push_at_the_top_does_not_tip_a_chair():
    motion = one(CHAIR, hit((15.0, 0, 0), 1.0)).base
    assert (motion.p_world[:, 2] == 0).all()  # what sinks or tips raises instead
    assert way(motion)[0] > 0.8


def tipping_impulse(body, radius, height):
    """Impulse at `height` that just tips an upright body over its edge: angular momentum, then energy."""
    h = body.centre_of_mass_m[2]
    lift = math.hypot(h, radius) - h
    about_edge = body.inertia_kg_m2[0] + body.mass_kg * (h * h + radius * radius)
    return math.sqrt(2 * body.mass_kg * GRAVITY_M_S2 * lift * about_edge) / height


@pytest.mark.parametrize(("factor", "falls"), [(0.5, False), (0.8, False), (1.4, True), (2.5, True)])
@pytest.mark.parametrize("look", ["water", "wine", "flask"])
def test_a_bottle_falls_when_hit_above_the_threshold_and_stands_when_hit_below(look, factor, falls):
    body = movable("bottle", look, 0).body
    radius = body.parts[0].size_m[0] / 2
    impulse = factor * tipping_impulse(body, radius, 0.2)
    motion = one(body, hit((0, impulse, 0), 0.2), at=(0, 0.0, 0.74), obstacles=[DESK]).base
    up = motion.pose_at(99.0)[2, 2]
    assert (up < 0.2) == falls
    assert falls or up > 0.9999
    assert at_rest(motion)


@pytest.fixture(scope="module")
def falling():
    """A bottle, a cup and a box that are pushed off the desk: their motions and bodies, by kind."""
    found = {}
    for kind, impulse, height in (("bottle", 0.5, 0.15), ("cup", 0.5, 0.05), ("box", 6.0, 0.15)):
        made = movable(kind, "default", 0)
        motion = one(made.body, hit((0.02, impulse, 0), height), at=(0, 0.22, 0.74), obstacles=[DESK]).base
        found[kind] = (motion, made)
    return found


@pytest.mark.parametrize("kind", ["bottle", "cup", "box"])
def test_what_is_pushed_off_the_desk_falls_to_the_floor_and_comes_to_rest(falling, kind):
    motion, made = falling[kind]
    assert at_rest(motion)
    assert motion.times_s[-1] < 5.5
    assert made.body.centre_of_mass_m[2] * 2.5 > centre(motion, made.body, len(motion.times_s) - 1)[2]
    flying = [k for k in range(len(motion.times_s)) if 0.4 < centre(motion, made.body, k)[2] < 0.66]
    heights = [centre(motion, made.body, k)[2] for k in flying]
    drop = np.diff(heights, 2) / np.diff(motion.times_s[flying])[1:] ** 2
    assert np.median(drop) == pytest.approx(-GRAVITY_M_S2, rel=0.05)


def centre(motion, body, k):
    return pose_of(motion, k) @ np.array([*body.centre_of_mass_m, 1.0])


def pose_of(motion, k):
    return motion.pose_at(float(motion.times_s[k]))[:3]


@pytest.mark.parametrize("kind", ["bottle", "cup", "box"])
def test_no_vertex_sinks_into_the_floor_at_the_keyframes_or_between_them(falling, kind):
    motion, made = falling[kind]
    vertices = np.concatenate([s.vertices for s in made.surfaces]).astype(float)
    lowest = 0.0
    for time_s in np.arange(0.5, motion.times_s[-1], 1 / 960):
        T = motion.pose_at(float(time_s))
        lowest = min(lowest, float((vertices @ T[2, :3]).min() + T[2, 3]))
    assert lowest > -0.005


def energies(motion, body):
    """Kinetic and potential energy in the middle between the keyframes, joules, from poses alone."""
    times = motion.times_s
    T = np.stack([pose_of(motion, k) for k in range(len(times))])
    c = T @ np.array([*body.centre_of_mass_m, 1.0])
    v = np.diff(c, axis=0) / np.diff(times)[:, None]
    found = []
    for k in range(len(times) - 1):
        turn = T[k, :, :3].T @ T[k + 1, :, :3]  # in the body's frame
        w = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
        size = np.linalg.norm(w) / 2
        if size > 1e-12:
            w = w / (2 * size) * math.asin(min(size, 1.0)) / (times[k + 1] - times[k])
        kinetic = 0.5 * body.mass_kg * np.sum(v[k] ** 2) + 0.5 * np.sum(np.array(body.inertia_kg_m2) * w**2)
        found.append(kinetic + body.mass_kg * GRAVITY_M_S2 * (c[k, 2] + c[k + 1, 2]) / 2)
    return np.array(found)


@pytest.mark.parametrize("kind", ["bottle", "cup", "box"])
def test_energy_never_grows_after_the_hit(falling, kind):
    """Within 2 % of the energy of the fall: what a step of 1/480 s of a semi-implicit integrator may show."""
    motion, made = falling[kind]
    energy = energies(motion, made.body)[2:]
    fall = made.body.mass_kg * GRAVITY_M_S2 * 0.74
    assert (energy[1:] - np.minimum.accumulate(energy)[:-1]).max() < 0.02 * fall
    assert energy[0] - energy[-1] > 0.8 * fall


def test_a_falling_bottle_rolls_on_the_floor():
    """Knocked over, then hit from its side as it lies: it rolls by half a turn or more, and stops."""
    over, aside = hit((0, 0.4, 0), 0.18), hit((0.25, 0, 0), BOTTLE.centre_of_mass_m[2], time_s=3.0)
    motion = one(BOTTLE, over, aside, at=(0, 0.0, 0.0)).base
    rolling = motion.times_s > 2.9
    T = np.stack([pose_of(motion, k) for k in np.flatnonzero(rolling)])
    assert np.abs(T[:, 2, 2]).max() < 0.1
    turned = np.unwrap(np.arctan2(T[:, 2, 0], T[:, 2, 1]))
    moved = centre(motion, BOTTLE, len(motion.times_s) - 1)[0] - centre(motion, BOTTLE, np.flatnonzero(rolling)[0])[0]
    radius = BOTTLE.parts[0].size_m[0] / 2
    assert abs(turned[-1] - turned[0]) > math.pi
    assert abs(turned[-1] - turned[0]) * radius == pytest.approx(abs(moved), rel=0.25)
    assert at_rest(motion)


def test_a_wall_stops_a_chair():
    wall = Obstacle(centre_m=(1.3, 0, 0.5), size_m=(0.2, 3.0, 1.0))
    motion = one(CHAIR, hit((14.0, 0, 0), 0.45), obstacles=[wall]).base
    assert 1.2 - 0.36 < motion.p_world[:, 0].max() < 1.2 - 0.2


def test_a_chair_hits_a_chair_and_momentum_is_kept():
    starts = [Start(body=CHAIR, position_m=(x, y, 0)) for x, y in ((0, 0), (0.9, 0.0), (0, 3))]
    first, second, third = bake(starts, [], 4.0, names="abc", hits=[hit((14.0, 0, 0), 0.1)])
    speed = [np.interp(np.arange(0, 4, 0.01), m.base.times_s, m.base.v_world[:, 0]) for m in (first, second)]
    at = int(np.flatnonzero(speed[1] > 0.05)[0])
    assert (speed[0] + speed[1])[at + 3] == pytest.approx(speed[0][at - 3], abs=0.06)
    assert second.base.p_world[-1, 0] > 1.0
    assert len(third.base.times_s) == 1


def test_hands_push_a_chair_and_let_it_roll():
    """Hands at the back of the back, at 0.8 m/s: the chair takes their speed, turns little, and coasts."""

    def hands(time_s):
        y = 0.32 - 0.8 * (time_s - 1.0)
        return np.array([[-0.15, y, 0.85], [0.15, y, 0.85]])

    chair = one(CHAIR, pushers=[Pusher(thing=0, start_s=1.0, end_s=2.5, points_at=hands)])
    speed = -chair.base.v_world[:, 1]
    pushed = (chair.base.times_s > 1.4) & (chair.base.times_s < 2.4)
    assert speed[pushed] == pytest.approx(0.8, abs=0.08)
    assert speed.max() < 0.95
    coast = 0.8**2 / (2 * CASTER_FRICTION * GRAVITY_M_S2)
    assert -way(chair.base)[1] == pytest.approx(0.8 * 1.5 + coast, rel=0.1)
    assert abs(yaws(chair.top)[-1]) < 0.3
    assert at_rest(chair.base)


def test_a_chair_does_not_roll_through_a_person():
    person = Bystander(place_at=lambda _: np.array([1.0, 0.0]))
    motion = one(CHAIR, hit((14.0, 0, 0), 0.45), bystanders=[person]).base
    assert 0.4 < motion.p_world[:, 0].max() < 0.6
    ghost = Bystander(place_at=lambda _: np.array([1.0, 0.0]), ignores=(0,))
    assert one(CHAIR, hit((14.0, 0, 0), 0.45), bystanders=[ghost]).base.p_world[-1, 0] > 1.0


def test_a_walking_person_pushes_a_chair_aside():
    person = Bystander(place_at=lambda t: np.array([-2.0 + t, 0.05]))
    motion = one(CHAIR, bystanders=[person]).base
    assert 1.0 < motion.times_s[1] < 2.0
    assert np.abs(way(motion)).max() > 0.3


def test_a_held_chair_stays_whatever_hits_it():
    starts = [
        Start(body=CHAIR, position_m=(0, 0, 0)),
        Start(body=CHAIR, position_m=(0.9, 0, 0), held=True),
    ]
    first, second = bake(starts, [], 3.0, names="ab", hits=[hit((14.0, 0, 0), 0.45)])
    assert len(second.base.times_s) == 1
    assert first.base.p_world[-1, 0] < 0.4


CODE = """
import hashlib
import numpy as np
from sim.physics.bake import bake
from sim.physics.events import *
from sim.rooms.room import Obstacle
from sim.things.movables import movable
desk = Obstacle(centre_m=(0, 2, 0.725), size_m=(1.5, 0.8, 0.03))
places = [("chair", (0, 0, 0)), ("chair", (-1.0, 0.1, 0)), ("bottle", (0, 1.7, 0.74)), ("cup", (0.1, 1.66, 0.74))]
places.append(("box", (2, 0, 0)))
starts = [Start(body=movable(kind, "default", 0).body, position_m=p, yaw_rad=0.3) for kind, p in places]
def hit(thing, j, h): return Hit(thing=thing, time_s=0.5, impulse_n_s=j, height_m=h, offset_m=0.01)
hits = [hit(0, (-12, 1, 0), 0.4), hit(2, (0, -0.4, 0), 0.15), hit(4, (1, 4, 0), 0.2)]
person = Bystander(place_at=lambda t: np.array([3 - t, 0.1]))
tracks = bake(starts, [desk], 4.0, names="abcde", hits=hits, bystanders=[person])
arrays = [a.tobytes() for t in tracks for a in (t.base.times_s, t.base.p_world, t.base.v_world, t.base.q_world_xyzw)]
print(hashlib.sha256(b"".join(arrays)).hexdigest(), sum(len(t.base.times_s) for t in tracks) > 500)
"""


def test_same_bytes_in_two_processes():
    outputs = {
        subprocess.run(
            [sys.executable, "-c", CODE], check=True, capture_output=True, text=True, env={"PYTHONHASHSEED": h}
        ).stdout
        for h in ("1", "2")
    }
    assert len(outputs) == 1
    assert outputs.pop().endswith(" True\n")


def test_same_bytes_after_another_bake():
    def digest():
        m = one(CHAIR, hit((8.0, 1.0, 0), 0.45, offset=0.05), duration_s=3.0).base
        return hashlib.sha256(m.p_world.tobytes() + m.q_world_xyzw.tobytes()).hexdigest()

    first = digest()
    one(BOTTLE, hit((0.3, 1.0, 0), 0.1), duration_s=1.0)
    assert digest() == first


def test_a_longer_bake_begins_like_a_shorter_one():
    short, long = (one(CHAIR, hit((8.0, 1.0, 0), 0.45, offset=0.05), duration_s=d).base for d in (1.0, 3.0))
    count = len(short.times_s)
    assert np.array_equal(short.p_world, long.p_world[:count])
    assert np.array_equal(short.q_world_xyzw, long.q_world_xyzw[:count])


def test_bullet_is_imported_at_the_first_bake_and_by_one_module():
    code = "import sys, scenarios.world; assert 'pybullet' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
    root = Path(__file__).parents[2]
    users = [
        f
        for package in ("sim", "scenarios")
        for f in (root / package).rglob("*.py")
        if "import pybullet" in f.read_text()
    ]
    assert [f.name for f in users] == ["bullet.py"]


def test_a_bake_prints_nothing(capfd):
    one(CHAIR, duration_s=0.1)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: one(CHAIR, duration_s=0.0), "duration must be above 0"),
        (lambda: one(CHAIR, hit((1, 0, 0), 0.1, thing=1)), "hit 0 is for thing 1, but there are 1"),
        (lambda: one(CHAIR, hit((1, 0, 0), 0.1, time_s=9)), r"hit 0 at 9 s is outside the 6\.0 s"),
        (lambda: one(CHAIR, hit((math.nan, 0, 0), 0.1)), "hit 0 has a value"),
        (lambda: one(CHAIR, yaw_rad=math.inf), "thing 0 has a start"),
        (
            lambda: one(BOTTLE, at=(0, 0, 0.7), obstacles=[DESK]),
            r"it: stands \d+ mm deep in the obstacle of 1\.50 x 0\.80 x 0\.03 m at",
        ),
    ],
)
def test_refuses_nonsense(make, message):
    with pytest.raises(MotionError, match=message):
        make()


@pytest.mark.parametrize("kind", KINDS)
def test_every_look_stands_where_it_is_put(kind):
    for look in KINDS[kind][1]:
        made = movable(kind, look, 0)
        start = Start(body=made.body, position_m=(1.0, 2.0, 0.5), yaw_rad=0.4)
        T = made.motion(stand(start)).pose_at(3.0)
        assert T[:3, 3].tolist() == [1.0, 2.0, 0.5]
        assert math.atan2(T[1, 0], T[0, 0]) == pytest.approx(0.4)


def test_keyframes_must_fit_together():
    zeros = np.zeros((2, 3))
    with pytest.raises(MotionError, match="times must increase"):
        KeyframeMotion(times_s=np.zeros(2), p_world=zeros, v_world=zeros, q_world_xyzw=np.eye(4)[:2])
    with pytest.raises(MotionError, match="need times"):
        KeyframeMotion(times_s=np.zeros(2), p_world=zeros[:1], v_world=zeros, q_world_xyzw=np.eye(4)[:2])
