import itertools

import numpy as np
import pytest
from scipy.stats import chi2

from dotmask.profiles import PAPER
from dotmask.records import Observation, Track
from dotmask.tracking.association import associate, chi_square_quantile, squared_mahalanobis
from dotmask.tracking.measurement_model import CAMERA_POINT

SIGMA = 0.1


def track(position, class_name="chair", track_id=1) -> Track:
    return Track(
        track_id=track_id,
        class_name=class_name,
        timestamp_s=0.0,
        mean=np.array([*position, 0, 0, 0], float),
        covariance=SIGMA**2 * np.eye(6),
        age_frames=2,
        misses=1,
        detection_index=None,
        mask=np.zeros((2, 2), bool),
        mask_timestamp_s=0.0,
        partial_timestamp_s=0.0,
    )


def seen(position, class_name="chair", index=0) -> Observation:
    return Observation(
        position_camera=np.asarray(position, float),
        covariance=SIGMA**2 * np.eye(3),
        class_name=class_name,
        detection_index=index,
        model=CAMERA_POINT,
    )


@pytest.mark.parametrize("probability", [0.5, 0.95, 0.9999])
@pytest.mark.parametrize("degrees", [1, 3, 6])
def test_quantile_is_scipys(probability, degrees) -> None:
    assert chi_square_quantile(probability, degrees) == pytest.approx(chi2.ppf(probability, degrees), rel=1e-10)


def test_distance_in_a_turned_camera_equals_the_one_in_the_world() -> None:
    c, s = np.cos(0.7), np.sin(0.7)
    T = np.array([[c, -s, 0, 1], [s, c, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1.0]])
    p = np.array([0.3, 0.2, 0.1, 1])
    there = seen((np.linalg.inv(T) @ p)[:3])
    expected = (0.3**2 + 0.2**2 + 0.1**2) / (2 * SIGMA**2)
    assert squared_mahalanobis([track([0, 0, 0])], [there], T)[0, 0] == pytest.approx(expected)


def test_the_gate_is_the_chi_square_quantile() -> None:
    radius = SIGMA * np.sqrt(2 * chi2.ppf(PAPER.gate_probability, 3))
    inside, outside = seen([0.999 * radius, 0, 0]), seen([1.001 * radius, 0, 0])
    assert associate([track([0, 0, 0])], [inside], np.eye(4), PAPER).pairs == ((0, 0),)
    answer = associate([track([0, 0, 0])], [outside], np.eye(4), PAPER)
    assert (answer.pairs, answer.unmatched_tracks, answer.unmatched_observations) == ((), (0,), (0,))


def test_classes_do_not_mix() -> None:
    tracks = [track([0, 0, 0], "person"), track([0.3, 0, 0], "chair")]
    answer = associate(tracks, [seen([0, 0, 0], "chair"), seen([0.3, 0, 0], "person")], np.eye(4), PAPER)
    assert answer.pairs == ((0, 1), (1, 0))


def test_the_nearest_pair_gives_way_where_the_whole_is_better() -> None:
    # A greedy choice takes (0, 0) at 0.05 m first and leaves track 1 with the far observation.
    tracks = [track([0, 0, 0]), track([0.2, 0, 0])]
    observations = [seen([0.05, 0, 0]), seen([-0.3, 0, 0])]
    answer = associate(tracks, observations, np.eye(4), PAPER)
    assert answer.pairs == ((0, 1), (1, 0))


def test_total_distance_is_the_least_of_all_permutations() -> None:
    rng = np.random.default_rng(5)
    for _ in range(30):
        tracks = [track(rng.uniform(-0.2, 0.2, 3)) for _ in range(4)]
        observations = [seen(rng.uniform(-0.2, 0.2, 3)) for _ in range(4)]
        cost = squared_mahalanobis(tracks, observations, np.eye(4))
        best = min(sum(cost[i, j] for i, j in enumerate(p)) for p in itertools.permutations(range(4)))
        pairs = associate(tracks, observations, np.eye(4), PAPER).pairs
        assert sum(cost[i, j] for i, j in pairs) == pytest.approx(best)


def test_as_many_pairs_as_possible_before_the_least_distance() -> None:
    far = SIGMA * np.sqrt(2 * chi2.ppf(PAPER.gate_probability, 3)) * 0.95
    tracks = [track([0, 0, 0]), track([far, 0, 0])]
    answer = associate(tracks, [seen([0, 0, 0]), seen([-far, 0, 0])], np.eye(4), PAPER)
    assert len(answer.pairs) == 2


def test_order_of_observations_only_renames_the_pairs() -> None:
    rng = np.random.default_rng(6)
    tracks = [track(rng.uniform(-1, 1, 3)) for _ in range(5)]
    observations = [seen(t.position_world + rng.normal(0, 0.05, 3)) for t in tracks]
    straight = associate(tracks, observations, np.eye(4), PAPER).pairs
    turned = associate(tracks, observations[::-1], np.eye(4), PAPER).pairs
    assert straight == tuple((i, 4 - j) for i, j in turned)


def test_empty_sides() -> None:
    assert associate([], [], np.eye(4), PAPER).pairs == ()
    assert associate([track([0, 0, 0])], [], np.eye(4), PAPER).unmatched_tracks == (0,)
    assert associate([], [seen([0, 0, 0])], np.eye(4), PAPER).unmatched_observations == (0,)
