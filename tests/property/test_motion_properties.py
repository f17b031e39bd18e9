"""What holds for any walkable path, speed and time, and for any row of acts."""

import functools

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.people.body import Body, Soles
from sim.people.characters import load_character, skin
from sim.people.kernels import rotation
from sim.people.script import Script


@functools.cache
def woman():
    character = load_character("woman")
    soles = Soles.of(character)
    return Body(character.skeleton, soles), soles


def stretch(body, posture):
    hips = posture.hips + body.hip_offset @ rotation(*posture.pelvis).T
    return (np.linalg.norm(posture.ankles - hips, axis=1) / (body.thigh_m + body.shin_m)).max()


@st.composite
def rings(draw):
    """Corners of a star-shaped closed path around the origin, no sharper than a person can turn."""
    count = draw(st.integers(3, 6))
    radii = draw(st.lists(st.floats(1.5, 2.5), min_size=count, max_size=count))
    angle = 2 * np.pi * np.arange(count) / count + draw(st.floats(0, 6.3))
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1) * np.array(radii)[:, None]
    return ring if draw(st.booleans()) else ring[::-1]


@settings(max_examples=8, deadline=None, derandomize=True)
@given(ring=rings(), speed=st.floats(0.6, 1.8), time=st.floats(-1.0, 500.0))
def test_any_walk_keeps_its_feet_on_the_floor_and_its_legs_whole(ring, speed, time):
    body, soles = woman()
    script = Script(body)
    script.walk_loop(ring, speed, closed=True, start_m=0.0)
    walker = script.motion()
    period = walker.stretches[0].duration_s
    for t in time + 0.6 * np.arange(4):
        palette, posture = walker.palette_at(t), walker.posture_at(t)
        assert stretch(body, posture) < 0.9995
        under = skin(soles.points, soles.bones, soles.weights, palette)[:, 2]
        assert -0.001 < under.min() < 0.002
        later = skin(soles.points, soles.bones, soles.weights, walker.palette_at(t + 1 / 120))
        moved = np.linalg.norm(later - skin(soles.points, soles.bones, soles.weights, palette), axis=1)
        assert moved.max() < 8.0 / 120
        np.testing.assert_allclose(walker.palette_at(t + period), palette, atol=1e-8)
    root = np.array([walker.pose_at(t)[:2, 3] for t in np.arange(0, 2, 1 / 120)])
    assert np.linalg.norm(np.diff(root, axis=0), axis=1).max() * 120 < 1.01 * speed


@settings(max_examples=12, deadline=None, derandomize=True)
@given(
    start=st.floats(-7.0, 7.0),
    places=st.lists(st.tuples(st.floats(0.7, 3.0), st.floats(-2.9, 2.9)), min_size=1, max_size=3),
    speed=st.floats(0.6, 1.8),
    heading=st.floats(-7.0, 7.0),
)
def test_any_row_of_walks_and_turns_joins_without_a_jump(start, places, speed, heading):
    """Every act begins where the last one has ended, with both feet where they were."""
    body, soles = woman()
    script = Script(body, (0.5, -0.5), start)
    script.stand(0.3)
    at, direction = np.array([0.5, -0.5]), start
    for length, turn in places:
        direction += turn
        at = at + length * np.array([np.cos(direction), np.sin(direction)])
        script.walk([at], speed)
    script.turn(heading)
    script.stand(0.5)
    motion = script.motion()
    joints = [s.start_s for s in motion.stretches if s.start_s > 0]
    for t in joints:
        before, after = (
            skin(soles.points, soles.bones, soles.weights, motion.palette_at(t + d)) for d in (-1e-3, 1e-3)
        )
        np.testing.assert_allclose(after, before, atol=1e-4)
    end = motion.acts[-1].end_s
    np.testing.assert_allclose(motion.pose_at(end)[:2, 3], at, atol=1e-6)
    np.testing.assert_allclose(-motion.pose_at(end)[:2, 1], [np.cos(heading), np.sin(heading)], atol=1e-6)
    for t in np.linspace(0.0, end, 12):
        palette = motion.palette_at(t)
        assert stretch(body, motion.posture_at(t)) < 1.0
        assert -0.001 < skin(soles.points, soles.bones, soles.weights, palette)[:, 2].min() < 0.002
