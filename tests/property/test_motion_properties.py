"""What holds for any walkable path, speed and time."""

import functools

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.body import Soles, rotation
from sim.humans import load_character, skin
from sim.motion import Walker


@functools.cache
def woman():
    character = load_character("woman")
    chosen = [(s, i) for s, i in zip(character.surfaces, character.soles, strict=True) if len(i)]
    soles = Soles(
        points=np.vstack([s.vertices[i] for s, i in chosen]).astype(float),
        bones=np.vstack([s.bones[i] for s, i in chosen]).astype(np.int64),
        weights=np.vstack([s.weights[i] for s, i in chosen]).astype(float),
    )
    return character.skeleton, soles


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
    skeleton, soles = woman()
    walker = Walker(skeleton, soles, ring, speed, closed=True)
    assert walker.plan.steps % 2 == 0
    times = time + 0.6 * np.arange(4)
    for t in times:
        palette, posture = walker.palette_at(t), walker.posture_at(t)
        hips = posture.hips + walker.body.hip_offset @ rotation(*posture.pelvis).T
        stretch = np.linalg.norm(posture.ankles - hips, axis=1) / (walker.body.thigh_m + walker.body.shin_m)
        assert stretch.max() < 0.9995
        under = skin(soles.points, soles.bones, soles.weights, palette)[:, 2]
        assert -0.001 < under.min() < 0.002
        later = skin(soles.points, soles.bones, soles.weights, walker.palette_at(t + 1 / 120))
        moved = np.linalg.norm(later - skin(soles.points, soles.bones, soles.weights, palette), axis=1)
        assert moved.max() < 8.0 / 120
        np.testing.assert_allclose(walker.palette_at(t + walker.period_s), palette, atol=1e-8)
    root = np.array([walker.pose_at(t)[:2, 3] for t in np.arange(0, 2, 1 / 120)])
    assert np.linalg.norm(np.diff(root, axis=0), axis=1).max() * 120 < 1.01 * speed
