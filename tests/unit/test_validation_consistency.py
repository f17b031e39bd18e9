"""The filter is as certain as it should be; one with a wrong R or Q is not; another implementation agrees."""

from dataclasses import replace

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from dotmask.evaluation.filter import chi_square_mean_bounds
from dotmask.records import Observation
from dotmask.tracking.measurement import observe
from dotmask.tracking.motion_model import process_noise, transition
from scenarios.validation.consistency import CASES, as_observed, consistency
from scenarios.validation.episodes import BALL, FRAME_RATE_HZ, follow, record

EPISODES, FRAMES = 120, 13
EXACT = {case.name: case for case in CASES if case.is_exact}


def scaled(factor):
    def adjust(observation: Observation) -> Observation:
        return replace(observation, covariance=factor * observation.covariance)

    return adjust


@pytest.mark.parametrize("name", ["plate, bbox_centre, uncertain pose", "ball, mask_centroid"])
def test_the_filter_is_consistent_and_a_wrong_one_is_not(name) -> None:
    case = EXACT[name]
    fast = replace(BALL, acceleration_sigma_m_s2=3 * BALL.acceleration_sigma_m_s2)
    slow = replace(BALL, acceleration_sigma_m_s2=BALL.acceleration_sigma_m_s2 / 3)
    wrong = [
        replace(case, name="R x 2", adjust=scaled(2.0)),
        replace(case, name="R x 0.5", adjust=scaled(0.5)),
        replace(case, name="Q x 9", profile=replace(case.profile, classes=(fast,))),
        replace(case, name="Q / 9", profile=replace(case.profile, classes=(slow,))),
    ]
    found = consistency(case.scene, [case, *wrong], EPISODES, lambda: None, FRAMES)
    right = found.pop(name)
    low, high = right.nis_bounds
    assert low < right.nis_mean < high
    nees = chi_square_mean_bounds(6, EPISODES)
    assert nees[0] < right.nees[-1] < nees[1]
    assert right.share_inside(3, right.nis) >= 0.8
    assert abs(right.whiteness.correlation) < 1.5 * right.whiteness.bound
    assert abs(right.velocity_bias_m_s) < 1.5 * right.velocity_bias_bound_m_s
    assert right.is_consistent
    for name_of_wrong, other in found.items():
        assert not low < other.nis_mean < high, name_of_wrong
        assert not other.is_consistent, name_of_wrong


def test_filterpy_finds_the_same_innovations_and_beliefs() -> None:
    case, dt = EXACT["plate, bbox_centre"], 1 / FRAME_RATE_HZ
    for seed in range(3):
        episode = record(case.scene.shape, "box", BALL, case.scene.sensor, 12, seed)
        ours = follow(episode, case.profile, as_observed)
        witness = KalmanFilter(dim_x=6, dim_z=3)
        witness.F = transition(dt)
        witness.Q = process_noise(dt, BALL.acceleration_sigma_m_s2 * BALL.axis_shares)
        nis = []
        for k, look in enumerate(episode.looks):
            [seen] = observe(look.detections, look.frame, case.profile)
            R_world_camera, eye = look.T_world_camera[:3, :3], look.T_world_camera[:3, 3]
            if k == 0:
                witness.x = np.concatenate([R_world_camera @ seen.position_camera + eye, np.zeros(3)])[:, None]
                prior = (BALL.prior_speed_sigma_m_s * BALL.axis_shares) ** 2
                witness.P = np.diag([0.0, 0.0, 0.0, *prior])
                witness.P[:3, :3] = R_world_camera @ seen.covariance @ R_world_camera.T
                continue
            witness.predict()
            witness.H = np.hstack([R_world_camera.T, np.zeros((3, 3))])
            witness.update((seen.position_camera + R_world_camera.T @ eye)[:, None], R=seen.covariance)
            nis.append(float(witness.y[:, 0] @ np.linalg.inv(witness.S) @ witness.y[:, 0]))
            np.testing.assert_allclose(ours[k - 1].mean, witness.x[:, 0], rtol=0, atol=1e-9)
            np.testing.assert_allclose(ours[k - 1].covariance, witness.P, rtol=1e-6, atol=1e-12)
        np.testing.assert_allclose([s.innovation.nis for s in ours], nis, rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("name", EXACT)
def test_every_exact_case_is_consistent(name) -> None:
    found = consistency(EXACT[name].scene, [EXACT[name]], 100, lambda: None)
    assert found[name].is_consistent
