import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dotmask.evaluation.filter import (
    BeliefSample,
    FilterErrors,
    chi_square_mean_bounds,
    filter_errors,
    innovation_whiteness,
)
from dotmask.records import Innovation

I3 = np.eye(3)


def sample(error, *, frame=0, track=1, instance=1, centre=(0, 0, 5), ideal=None, P=None, y=None, S=I3, pose=None):
    truth = np.array([*centre, 0.5, 0, 0], np.float64)
    return BeliefSample(
        frame=frame,
        track_id=track,
        instance_id=instance,
        mean=truth + error,
        covariance=np.eye(6) if P is None else P,
        innovation=None if y is None else Innovation(residual=np.asarray(y, np.float64), covariance=S),
        centre_world=truth[:3],
        velocity_world=truth[3:],
        ideal_world=None if ideal is None else truth[:3] + ideal,
        T_world_camera=np.eye(4) if pose is None else pose,
    )


def test_chi_square_bounds_hold_95_percent_of_the_means() -> None:
    low, high = chi_square_mean_bounds(3, 50)
    means = np.random.default_rng(0).chisquare(3, (4000, 50)).mean(axis=1)
    assert np.mean((means > low) & (means < high)) == pytest.approx(0.95, abs=0.012)


def test_errors_of_a_consistent_filter() -> None:
    rng = np.random.default_rng(1)
    count = 3000
    root = rng.normal(size=(6, 6))
    P = 0.01 * root @ root.T + 1e-4 * np.eye(6)
    S = P[:3, :3]
    errors = rng.multivariate_normal(np.zeros(6), P, count)
    innovations = rng.multivariate_normal(np.zeros(3), S, count)
    result = filter_errors(
        [
            sample(e, P=P, S=S, y=y if k else None, ideal=[0.1, 0, 0] if k > 10 else None)
            for k, (e, y) in enumerate(zip(errors, innovations, strict=True))
        ]
    )
    assert result.samples == count
    assert result.position_rmse_m == pytest.approx(np.sqrt(np.trace(P[:3, :3])), rel=0.05)
    assert result.velocity_rmse_m_s == pytest.approx(np.sqrt(np.trace(P[3:, 3:])), rel=0.05)
    assert result.position_rmse_ideal_m == pytest.approx(np.sqrt(np.trace(P[:3, :3]) + 0.01), rel=0.05)
    assert result.position_bias_ideal_m == pytest.approx(0.1, abs=0.02)
    assert result.nees_bounds == pytest.approx(chi_square_mean_bounds(6, count))
    assert result.nis_bounds == pytest.approx(chi_square_mean_bounds(3, count - 1))
    assert result.nees_bounds[0] < result.nees < result.nees_bounds[1]
    assert result.nis_bounds[0] < result.nis < result.nis_bounds[1]


def test_the_bias_towards_the_camera_stays_one_while_the_camera_walks_around() -> None:
    samples = []
    for k in range(36):
        # The camera looks at (0, 0, 5) from 2 m, each time from another side; the belief is 0.3 m nearer to it.
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_euler("y", 10 * k, degrees=True).as_matrix()
        pose[:3, 3] = np.array([0, 0, 5]) - 2.0 * pose[:3, 2]
        samples.append(sample([*(-0.3 * pose[:3, 2]), 0, 0, 0], pose=pose))
    result = filter_errors(samples)
    assert result.position_bias_m == pytest.approx(0.3)
    assert result.position_bias_ray_m == pytest.approx(-0.3)
    assert result.position_rmse_m == pytest.approx(0.3), "no spread"


def test_bias_is_of_each_instance_and_spread_is_the_rest() -> None:
    rng = np.random.default_rng(3)
    noise = rng.normal(0, 0.2, (300, 6))
    noise -= noise.mean(axis=0)
    offset = np.array([0.4, 0, 0, 0, 0, 0.1])
    one = [sample(e + offset, instance=1) for e in noise]
    other = [sample(e - offset, instance=2) for e in noise]
    result = filter_errors(one + other)
    assert result.position_bias_m == pytest.approx(0.4)
    assert result.velocity_bias_m_s == pytest.approx(0.1)
    spread = np.sqrt((noise[:, :3] ** 2).sum(axis=1).mean())
    assert result.position_rmse_m == pytest.approx(np.hypot(0.4, spread))


def test_the_ideal_leaves_the_bias_of_the_surface_out() -> None:
    result = filter_errors([sample([0.1, -0.2, 0, 0, 0, 0.3], ideal=[0.1, -0.2, 0])] * 5)
    assert (result.position_rmse_ideal_m, result.position_bias_ideal_m, result.nees_ideal) == (0, 0, 0)
    assert result.nees == pytest.approx(0.14)
    assert result.position_bias_m == pytest.approx(np.hypot(0.1, 0.2))


def test_no_samples_give_none_and_not_zero() -> None:
    assert filter_errors([]) == FilterErrors()
    born = filter_errors([sample(np.zeros(6))])
    assert born.nis is born.nis_bounds is born.nees_ideal is born.position_rmse_ideal_m is None
    assert born.position_bias_ideal_m is None
    assert innovation_whiteness([]) is None
    assert innovation_whiteness([sample(np.zeros(6), y=[1, 0, 0])]) is None


def sequence(innovations, *, track=1, start=0, S=I3):
    return [sample(np.zeros(6), track=track, frame=start + k, y=y, S=S) for k, y in enumerate(innovations)]


def test_white_innovations_stay_inside_the_bound_in_95_percent_of_the_runs() -> None:
    rng = np.random.default_rng(4)
    root = rng.normal(size=(3, 3))
    S = root @ root.T + 0.1 * I3
    inside = 0
    for _ in range(300):
        result = innovation_whiteness(sequence(rng.multivariate_normal(np.zeros(3), S, 40), S=S))
        assert result is not None
        assert result.bound == pytest.approx(1.96 / np.sqrt(3 * 39), rel=1e-4)
        inside += abs(result.correlation) < result.bound
    assert inside / 300 == pytest.approx(0.95, abs=0.03)


def test_correlation_of_a_first_order_process_is_its_coefficient() -> None:
    rng = np.random.default_rng(5)
    for coefficient in (0.6, -0.4):
        values = [rng.normal(size=3)]
        for _ in range(4000):
            values.append(coefficient * values[-1] + np.sqrt(1 - coefficient**2) * rng.normal(size=3))
        result = innovation_whiteness(sequence(values))
        assert result is not None
        assert result.correlation == pytest.approx(coefficient, abs=0.03)


def test_innovations_are_normalised_before_they_are_compared() -> None:
    # Along x the noise is large and white; along y it is small and constant, which S makes count as much.
    S = np.diag([100.0, 0.01, 1.0])
    values = [[10 * (-1) ** (k // 2), 0.1, 0] for k in range(401)]
    result = innovation_whiteness(sequence(values, S=S))
    assert result is not None
    assert result.correlation == pytest.approx(0.5)


def test_pairs_neither_cross_a_gap_nor_go_from_one_track_to_another() -> None:
    one = [1.0, 0, 0]
    apart = sequence([one], start=0) + sequence([one], start=2) + sequence([one], track=2, start=1)
    assert innovation_whiteness(apart) is None
    joined = innovation_whiteness(apart + sequence([[-1.0, 0, 0]], start=1))
    assert joined is not None
    assert joined.correlation == pytest.approx(-1)
