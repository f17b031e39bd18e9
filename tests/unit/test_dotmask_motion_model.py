import numpy as np
import pytest

from dotmask.profiles import CALIBRATED, PAPER
from dotmask.records import Innovation, SurfaceMotion, Track, TrackPhase
from dotmask.tracking.motion_model import predict, process_noise, slide_variance, transition


def track_at(mean, covariance=None, class_name="chair", *, is_partial=False, phase=TrackPhase.CONFIRMED) -> Track:
    return Track(
        track_id=1,
        class_name=class_name,
        timestamp_s=2.0,
        mean=np.asarray(mean, float),
        covariance=0.01 * np.eye(6) if covariance is None else covariance,
        hits=4,
        misses=0,
        phase=phase,
        detection_index=0,
        mask=np.zeros((4, 4), bool),
        mask_timestamp_s=2.0,
        mask_position_camera=np.array([0, 0, 1.0]),
        is_partial=is_partial,
        innovation=Innovation(residual=np.zeros(3), covariance=np.eye(3)),
        surface=SurfaceMotion(points=9, moving_points=4, velocity_world=np.ones(3), covariance=np.eye(3)),
    )


def test_prediction_moves_with_the_velocity_and_counts_a_miss() -> None:
    after = predict(track_at([1, 2, 3, 0.5, -1, 0.25]), 2.5, PAPER)
    np.testing.assert_allclose(after.mean, [1.25, 1.5, 3.125, 0.5, -1, 0.25], rtol=0, atol=1e-15)
    assert (after.timestamp_s, after.hits, after.misses, after.detection_index) == (2.5, 4, 1, None)
    assert (after.innovation, after.surface) == (None, None), "they are of a frame, and this frame was not looked at"
    assert (after.mask_timestamp_s, after.is_partial) == (2.0, False)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (TrackPhase.TENTATIVE, TrackPhase.TENTATIVE),
        (TrackPhase.CONFIRMED, TrackPhase.COASTING),
        (TrackPhase.COASTING, TrackPhase.COASTING),
    ],
)
def test_a_track_coasts_until_it_is_seen_and_a_tentative_one_stays_tentative(before, after) -> None:
    assert predict(track_at(np.zeros(6), phase=before), 2.1, PAPER).phase is after


@pytest.mark.parametrize("class_name", ["chair", "person", "cup"])
def test_the_measured_point_of_a_half_hidden_object_may_slide_over_it(class_name) -> None:
    sigma = CALIBRATED.class_model(class_name).slide_sigma_m
    whole, hidden = (track_at(np.zeros(6), class_name=class_name, is_partial=p) for p in (False, True))
    added = predict(hidden, 2.25, CALIBRATED).covariance - predict(whole, 2.25, CALIBRATED).covariance
    # sigma metres per root second: the position alone, so that the velocity is not dragged along.
    np.testing.assert_allclose(added, np.diag([sigma**2 * 0.25] * 3 + [0.0] * 3), rtol=0, atol=1e-15)
    assert slide_variance(class_name, 0.25, CALIBRATED) == pytest.approx(sigma**2 * 0.25)
    np.testing.assert_array_equal(predict(hidden, 2.25, PAPER).covariance, predict(whole, 2.25, PAPER).covariance)


def test_covariance_is_f_p_ft_plus_q() -> None:
    rng = np.random.default_rng(0)
    root = rng.normal(size=(6, 6))
    P = root @ root.T
    after = predict(track_at(np.zeros(6), P), 2.1, PAPER)
    F = np.block([[np.eye(3), 0.1 * np.eye(3)], [np.zeros((3, 3)), np.eye(3)]])
    Q = np.block(
        [[0.1**4 / 4 * np.eye(3), 0.1**3 / 2 * np.eye(3)], [0.1**3 / 2 * np.eye(3), 0.1**2 * np.eye(3)]]
    )  # sigma = 1 m/s² for a chair
    np.testing.assert_allclose(after.covariance, F @ P @ F.T + Q, rtol=0, atol=1e-12)


@pytest.mark.parametrize("later_s", [2.0, 1.9])
def test_time_must_go_on(later_s) -> None:
    with pytest.raises(ValueError, match="is not later than"):
        predict(track_at(np.zeros(6)), later_s, PAPER)


def test_misprint_a_random_acceleration_changes_the_velocity_by_dt_and_not_by_dt_squared() -> None:
    dt, sigma = 1 / 30, 0.62
    a = np.random.default_rng(1).normal(0, sigma, 200_000)
    samples = np.cov(np.stack([0.5 * a * dt**2, a * dt]))
    Q = process_noise(dt, np.full(3, sigma))
    np.testing.assert_allclose(Q[[0, 0, 3], [0, 3, 3]], samples[[0, 0, 1], [0, 1, 1]], rtol=0.02)
    printed = np.array([dt**2 / 2, dt**2])
    assert (sigma * printed[1]) ** 2 < samples[1, 1] / 800  # 30 Hz: 900 times too small


def test_misprint_b_cross_terms_must_scale_like_a_covariance() -> None:
    # In millimetres every entry of a covariance of positions and velocities is 1e6 times that in metres.
    dt, sigma = 0.1, 0.62
    metres, millimetres = process_noise(dt, np.full(3, sigma)), process_noise(dt, np.full(3, 1e3 * sigma))
    np.testing.assert_allclose(millimetres, 1e6 * metres, rtol=1e-12)
    printed = [dt**4 / 4 * s**3 for s in (sigma, 1e3 * sigma)]
    assert printed[1] / printed[0] == pytest.approx(1e9)
    # One acceleration makes both errors, so they are fully correlated; the printed cross term denies it.
    assert metres[0, 3] / np.sqrt(metres[0, 0] * metres[3, 3]) == pytest.approx(1.0)
    assert printed[0] / np.sqrt(metres[0, 0] * metres[3, 3]) < 0.05


@pytest.mark.parametrize("seed", range(5))
def test_process_noise_is_gamma_sigma_gamma_transposed(seed) -> None:
    rng = np.random.default_rng(seed)
    dt, sigmas = rng.uniform(1e-3, 2.0), rng.uniform(0.01, 3.0, 3)
    Gamma = np.vstack([0.5 * dt**2 * np.eye(3), dt * np.eye(3)])
    expected = Gamma @ np.diag(sigmas**2) @ Gamma.T
    np.testing.assert_allclose(process_noise(dt, sigmas), expected, rtol=1e-12, atol=0)


def test_calibrated_objects_on_the_floor_hardly_accelerate_upwards() -> None:
    P = np.diag(predict(track_at(np.zeros(6), np.zeros((6, 6)) + 1e-12 * np.eye(6)), 2.1, CALIBRATED).covariance)
    assert P[5] == pytest.approx(0.04 * P[4], rel=1e-3)
    assert P[3] == pytest.approx(P[4])


def test_transition_is_a_group() -> None:
    np.testing.assert_allclose(transition(0.2) @ transition(0.3), transition(0.5), rtol=0, atol=1e-15)
