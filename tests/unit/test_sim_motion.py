"""Walking, standing and sitting of the real people: speed, contact with the floor, joint angles, purity."""

import numpy as np
import pytest

from sim.body import Soles, rotation
from sim.errors import MotionError
from sim.humans import load_character, skin
from sim.motion import Pause, Sitter, Stander, Walker

CONTACT_M = 0.002
STEP_S = 1 / 120
RECTANGLE = [[0, 0], [3, 0], [3, 2], [0, 2]]


def person(name):
    character = load_character(name)
    chosen = [(s, i) for s, i in zip(character.surfaces, character.soles, strict=True) if len(i)]
    soles = Soles(
        points=np.vstack([s.vertices[i] for s, i in chosen]).astype(float),
        bones=np.vstack([s.bones[i] for s, i in chosen]).astype(np.int64),
        weights=np.vstack([s.weights[i] for s, i in chosen]).astype(float),
    )
    return character, soles


@pytest.fixture(scope="module")
def people():
    return {name: person(name) for name in ("man", "woman")}


@pytest.fixture(scope="module")
def walker(people):
    character, soles = people["man"]
    return Walker(character.skeleton, soles, [[0, 0], [6, 0]], 1.25)


@pytest.fixture(scope="module")
def pausing(people):
    character, soles = people["woman"]
    return Walker(character.skeleton, soles, RECTANGLE, 1.0, closed=True, pauses=(Pause(waypoint=1, seconds=3.0),))


def sole_paths(motion, soles, times):
    """(times, points, 3) of every third sole point."""
    points, bones, weights = soles.points[::3], soles.bones[::3], soles.weights[::3]
    return np.array([skin(points, bones, weights, motion.palette_at(t)) for t in times])


def worst_slide(paths):
    """Largest distance between two places of one sole point during one unbroken contact with the floor."""
    worst = 0.0
    contact = paths[:, :, 2] < CONTACT_M
    for k in range(paths.shape[1]):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], contact[:, k], [0]]).astype(int)))
        for start, end in zip(edges[::2], edges[1::2], strict=True):
            places = paths[start:end, k, :2]
            worst = max(worst, float(np.linalg.norm(np.ptp(places, axis=0))))
    return worst


def extension(motion, t):
    """Distance from hip to ankle over the length of the leg, of both legs."""
    posture, body = motion.posture_at(t), motion.body
    hips = posture.hips + body.hip_offset @ rotation(*posture.pelvis).T
    return np.linalg.norm(posture.ankles - hips, axis=1) / (body.thigh_m + body.shin_m)


@pytest.mark.parametrize("speed", [0.6, 1.25, 1.8])
def test_speed_on_the_straight_is_the_asked_one(people, speed):
    character, soles = people["man"]
    walker = Walker(character.skeleton, soles, [[0, 0], [7, 0]], speed)
    at = np.array([walker.pose_at(t)[:2, 3] for t in np.arange(0, walker.period_s / 2, 0.02)])
    straight = at[(at[:, 0] > 2.0) & (at[:, 0] < 5.0)]
    assert np.linalg.norm(straight[-1] - straight[0]) / (0.02 * (len(straight) - 1)) == pytest.approx(speed, rel=0.01)


@pytest.mark.parametrize(("name", "speed"), [("man", 0.6), ("man", 1.25), ("woman", 1.8)])
def test_planted_feet_do_not_slide_nor_sink(people, name, speed):
    character, soles = people[name]
    walker = Walker(character.skeleton, soles, [[0, 0], [4, 0]], speed)
    paths = sole_paths(walker, soles, np.arange(0, 4, STEP_S))
    assert paths[:, :, 2].min() > -0.001
    assert worst_slide(paths) < 0.005
    left = soles.points[::3, 0] > 0
    lowest = np.stack([paths[:, left, 2].min(1), paths[:, ~left, 2].min(1)])
    assert (lowest.min(0) < CONTACT_M).all()  # one foot carries at any time
    assert 0.02 < lowest.max() < 0.06  # and a swinging foot clears the floor


def test_feet_hold_on_turns_and_while_standing(people, pausing):
    paths = sole_paths(pausing, people["woman"][1], np.arange(0, pausing.period_s, 2 * STEP_S))
    assert paths[:, :, 2].min() > -0.001
    assert worst_slide(paths) < 0.008


def test_joint_angles_have_the_characteristic_values_of_normal_gait(walker):
    """Perry and Burnfield (2010), see sim.gait; tolerances of ±10° as the knots are not copied from tables."""
    bones = walker.body.skeleton
    right = [bones.index("Right" + b) for b in ("UpLeg", "Leg", "Foot")]
    t = np.arange(0, walker.period_s / 2, 0.005)
    phase = walker.plan.phase_at(t)
    x = np.array([walker.pose_at(s)[0, 3] for s in t])
    first = 2 * np.ceil(phase[np.argmax(x > 2.0)] / 2)
    hip, knee, ankle = [], [], []
    for percent in np.arange(0, 100, 2):
        now = float(np.interp(first + percent / 50, phase, t))
        posture = walker.posture_at(now)
        M = walker.body.palette(posture)
        h, k, a = (M[i, :3, :3] @ bones.heads[i] + M[i, :3, 3] for i in right)
        thigh = np.degrees(np.arctan2(h[1] - k[1], h[2] - k[2]))
        shin = np.degrees(np.arctan2(k[1] - a[1], k[2] - a[2]))
        hip.append(thigh)
        knee.append(thigh - shin)
        ankle.append(np.degrees(posture.foot_pitch[1]) - shin)
    hip, knee, ankle = np.array(hip), np.array(knee), np.array(ankle)
    assert max(hip) == pytest.approx(30, abs=10)
    assert min(hip) == pytest.approx(-10, abs=10)
    assert np.argmin(hip) * 2 == pytest.approx(52, abs=12)
    assert max(knee[:13]) == pytest.approx(18, abs=6)  # loading response
    assert max(knee) == pytest.approx(60, abs=10)
    assert np.argmax(knee) * 2 == pytest.approx(73, abs=8)
    assert knee.min() > 0  # never bent backwards
    assert max(ankle) == pytest.approx(12, abs=10)
    assert min(ankle) == pytest.approx(-17, abs=10)


@pytest.mark.parametrize("which", ["walker", "pausing"])
def test_legs_are_never_stretched_beyond_their_length(which, request):
    motion = request.getfixturevalue(which)
    most = max(extension(motion, t).max() for t in np.arange(0, motion.period_s, 0.02))
    assert most < 0.9995


@pytest.mark.parametrize("which", ["walker", "pausing"])
def test_no_vertex_jumps(which, request, people):
    motion = request.getfixturevalue(which)
    character, _ = people["man" if which == "walker" else "woman"]
    pick = [(s, np.arange(0, len(s.vertices), 200)) for s in character.surfaces]
    points, bones, weights = (
        np.vstack([getattr(s, field)[i] for s, i in pick]) for field in ("vertices", "bones", "weights")
    )
    times = np.arange(-1.0, 7.5, STEP_S)  # a turn or a pause, and the straight
    before = skin(points, bones, weights, motion.palette_at(times[0]))
    for t in times[1:]:
        now = skin(points, bones, weights, motion.palette_at(t))
        assert np.linalg.norm(now - before, axis=1).max() < 8.0 * STEP_S
        before = now


def test_root_velocity_is_continuous(walker):
    t = np.arange(0, walker.period_s, 0.01)
    at = np.array([walker.pose_at(s)[:3, 3] for s in t])
    acceleration = np.diff(at, 2, axis=0) / 0.01**2
    assert np.linalg.norm(acceleration, axis=1).max() < 3.0
    assert not at[:, 2].any()


def test_a_loop_repeats_itself_for_ever(walker):
    for t in (0.0, 1.234, 7.7):
        for laps in (-1, 1, 100):
            later = walker.palette_at(t + laps * walker.period_s)
            np.testing.assert_allclose(later, walker.palette_at(t), atol=1e-8)


def test_a_time_gives_the_same_bytes_in_any_order_and_in_a_second_walker(people, walker):
    character, soles = people["man"]
    times = [3.3, -0.7, 11.1, 0.0, 3.3, 250.25]
    first = [walker.palette_at(t).tobytes() for t in times]
    again = Walker(character.skeleton, soles, [[0, 0], [6, 0]], 1.25)
    assert [again.palette_at(t).tobytes() for t in reversed(times)] == first[::-1]


def test_the_body_faces_where_it_walks(walker):
    for t in np.arange(0, walker.period_s, 0.3):
        T, later = walker.pose_at(t), walker.pose_at(t + 1e-3)
        forward = -T[:3, 1]
        step = later[:3, 3] - T[:3, 3]
        assert step @ forward / np.linalg.norm(step) > 0.999


def test_a_walker_starts_where_it_is_told(people):
    character, soles = people["man"]
    walker = Walker(character.skeleton, soles, [[0, 0], [6, 0]], 1.0, start_m=2.5)
    np.testing.assert_allclose(walker.pose_at(0.0)[:2, 3], walker.path.position_at(np.array(2.5)), atol=1e-3)


def test_a_pause_lasts_as_long_as_asked_and_the_person_stands_upright(pausing):
    t = np.arange(0, pausing.period_s, 0.01)
    at = np.array([pausing.pose_at(s)[:2, 3] for s in t])
    speed = np.linalg.norm(np.diff(at, axis=0), axis=1) / 0.01
    still = t[:-1][speed < 0.01]
    assert len(still) * 0.01 == pytest.approx(3.0, abs=0.4)
    posture = pausing.posture_at(still.mean() + 0.3)
    np.testing.assert_allclose(posture.foot_pitch, 0.0, atol=0.01)
    assert abs(posture.ankles[0, 1] - posture.ankles[1, 1]) < 0.15  # feet side by side
    assert posture.hips[2] > 0.98 * max(pausing.posture_at(s).hips[2] for s in t[::10])


@pytest.mark.parametrize("motion_class", [Stander, Sitter])
def test_amplitude_0_is_frozen_and_1_is_alive(people, motion_class):
    character, soles = people["man"]
    frozen = motion_class(character.skeleton, soles, [1.0, 2.0], 0.5, amplitude=0.0)
    alive = motion_class(character.skeleton, soles, [1.0, 2.0], 0.5, amplitude=1.0)
    assert frozen.palette_at(0.0).tobytes() == frozen.palette_at(17.3).tobytes()
    assert np.abs(alive.palette_at(0.0) - alive.palette_at(3.0)).max() > 0.01
    assert alive.palette_at(2.0).tobytes() == alive.palette_at(2.0).tobytes()
    for motion in (frozen, alive):
        assert extension(motion, 1.0).max() < 1.0
        paths = sole_paths(motion, soles, np.arange(0, 10, 0.5))
        np.testing.assert_allclose(paths - paths[:1], 0.0, atol=1e-5)
        assert abs(paths[..., 2].min()) < 0.001
    np.testing.assert_allclose(-alive.pose_at(0.0)[:3, 1], [np.cos(0.5), np.sin(0.5), 0.0], atol=1e-12)
    np.testing.assert_allclose(alive.pose_at(9.0)[:3, 3], [1.0, 2.0, 0.0])


@pytest.mark.parametrize("name", ["man", "woman"])
def test_a_sitter_touches_the_seat_with_bent_knees(people, name):
    character, soles = people[name]
    sitter = Sitter(character.skeleton, soles, [0.0, 0.0], 0.0, seat_height_m=0.46, amplitude=0.0)
    trousers = character.surface("trousers")
    v = skin(trousers.vertices, trousers.bones, trousers.weights, sitter.palette_at(0.0))
    over_seat = v[(np.abs(v[:, 0]) < 0.12) & (v[:, 2] > 0.3)]
    assert over_seat[:, 2].min() == pytest.approx(0.46, abs=0.04)
    share = extension(sitter, 0.0)
    assert np.degrees(2 * np.arccos(share)).min() > 60  # thigh and shin are about as long as each other


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"speed_m_s": 3.0}, "people walk at"),
        ({"waypoints_world": [[0, 0]]}, "at least 2 waypoints"),
        ({"waypoints_world": [[0, 0], [0, 0], [1, 1]]}, "same"),
        ({"waypoints_world": [[0, 0], [3, 0], [0.5, 0]]}, "turns the path back"),
        ({"waypoints_world": [[0, 0], [1, 0]]}, "too short"),
        ({"turn_radius_m": 0.1}, "too tight"),
        ({"pauses": (Pause(waypoint=7, seconds=2.0),)}, "waypoints"),
        ({"pauses": (Pause(waypoint=0, seconds=0.1),)}, "1.5 s or more"),
    ],
)
def test_what_cannot_be_walked_is_refused(people, change, message):
    character, soles = people["man"]
    arguments = {"waypoints_world": [[0, 0], [4, 0]], "speed_m_s": 1.0} | change
    with pytest.raises(MotionError, match=message):
        Walker(character.skeleton, soles, **arguments)


def test_a_wild_amplitude_or_seat_is_refused(people):
    character, soles = people["man"]
    with pytest.raises(MotionError, match="amplitude"):
        Stander(character.skeleton, soles, [0, 0], 0.0, amplitude=-1.0)
    with pytest.raises(MotionError, match="seat_height_m"):
        Sitter(character.skeleton, soles, [0, 0], 0.0, seat_height_m=1.2)
