"""The analytic shapes against images of many more pixels, and the episodes against the filter's own models."""

from dataclasses import replace

import numpy as np
import pytest

from dotmask.records import Intrinsics
from dotmask.tracking.motion_model import process_noise, transition
from scenarios.validation.episodes import BALL, FRAME_RATE_HZ, random_states, record
from scenarios.validation.exact import CAMERA, Plate, Sphere, placed, window_around
from sim.sensor.model import SensorModel

PLACE = np.array([0.35, -0.25, 1.6])
SHAPES = [Plate(width_m=0.4, height_m=0.5), Plate(width_m=0.4, height_m=0.5, turn_rad=0.2), Sphere(radius_m=0.15)]
IDS = ["plate", "turned plate", "ball"]


def finer(window: Intrinsics, times: int) -> Intrinsics:
    """The same view with `times` squared as many pixels."""
    shift = 0.5 * (times - 1)
    return Intrinsics(
        width=window.width * times,
        height=window.height * times,
        fx=window.fx * times,
        fy=window.fy * times,
        cx=window.cx * times + shift,
        cy=window.cy * times + shift,
    )


@pytest.mark.parametrize("shape", SHAPES, ids=IDS)
def test_ideal_observations_are_those_of_an_image_of_many_pixels(shape) -> None:
    view = finer(window_around(shape, PLACE), 8)
    depth = shape.render(PLACE, view).depth_m.astype(np.float64)
    v, u = np.nonzero(depth)
    seen = depth[v, u]
    box = 0.5 * (u.min() + u.max()), 0.5 * (v.min() + v.max()), seen.mean()
    mask = u.mean(), v.mean(), np.median(seen)
    for statistic, (x, y, z) in (("box", box), ("mask", mask)):
        expected = [(x - view.cx) / view.fx * z, (y - view.cy) / view.fy * z, z]
        np.testing.assert_allclose(shape.ideal(PLACE, statistic), expected, rtol=0, atol=3e-4)


@pytest.mark.parametrize("statistic", ["box", "mask"])
def test_a_shape_is_placed_so_that_it_is_observed_where_it_should(statistic) -> None:
    sphere = SHAPES[2]
    assert np.linalg.norm(sphere.ideal(PLACE, statistic) - PLACE) > 0.05
    np.testing.assert_allclose(sphere.ideal(placed(sphere, PLACE, statistic), statistic), PLACE, rtol=0, atol=1e-5)


def test_a_windows_pixels_are_those_of_the_whole_image() -> None:
    sphere = SHAPES[2]
    window = window_around(sphere, PLACE)
    whole, part = sphere.render(PLACE, CAMERA).depth_m, sphere.render(PLACE, window).depth_m
    left, top = round(CAMERA.cx - window.cx), round(CAMERA.cy - window.cy)
    np.testing.assert_allclose(whole[top : top + window.height, left : left + window.width], part, rtol=0, atol=1e-6)
    assert np.count_nonzero(whole) == np.count_nonzero(part) > 0


def test_motion_is_drawn_from_the_filters_own_model() -> None:
    dt = 1 / FRAME_RATE_HZ
    states = np.array([random_states(BALL, np.zeros(3), 3, seed) for seed in range(3000)])
    steps = states[:, 1:] - states[:, :-1] @ transition(dt).T
    found = np.cov(steps.reshape(-1, 6).T)
    Q = process_noise(dt, BALL.acceleration_sigma_m_s2 * BALL.axis_shares)
    sigmas = np.sqrt(np.diag(Q))
    np.testing.assert_allclose(found / np.outer(sigmas, sigmas), Q / np.outer(sigmas, sigmas), rtol=0, atol=0.05)
    np.testing.assert_allclose(states[:, 0, 3:].std(axis=0), BALL.prior_speed_sigma_m_s * BALL.axis_shares, rtol=0.05)


def test_an_episode_shows_the_object_where_its_state_says() -> None:
    episode = record(SHAPES[0], "box", replace(BALL, acceleration_sigma_m_s2=2.0), SensorModel(), 5, 3)
    for look, state in zip(episode.looks, episode.states, strict=True):
        T, camera = look.T_world_camera, look.frame.intrinsics
        x, y, z = T[:3, :3].T @ (state[:3] - T[:3, 3])
        box = look.detections.boxes_px[0]
        assert abs(camera.fx * x / z + camera.cx - 0.5 * (box[0] + box[2])) <= 0.5
        assert abs(camera.fy * y / z + camera.cy - 0.5 * (box[1] + box[3])) <= 0.5
        assert look.frame.depth_m[look.detections.masks[0]] == pytest.approx(z, abs=1e-5)


def test_an_uncertain_pose_is_told_to_the_tracker_alone() -> None:
    known = record(SHAPES[0], "box", BALL, SensorModel(), 3, 0)
    told = record(SHAPES[0], "box", BALL, SensorModel(), 3, 0, (0.003, 0.002))
    for a, b in zip(known.looks, told.looks, strict=True):
        np.testing.assert_array_equal(a.frame.depth_m, b.frame.depth_m)
        shift = np.linalg.norm(a.T_world_camera[:3, 3] - b.T_world_camera[:3, 3])
        assert 0 < shift < 0.015
