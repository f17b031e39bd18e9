import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from dotmask.profiles import PAPER
from dotmask.records import Intrinsics, Observation, Track, TrackPhase
from dotmask.tracking.association import associate, chi_square_quantile, squared_mahalanobis
from dotmask.tracking.measurement_model import CAMERA_POINT

SIGMA = 0.1
CAMERA = Intrinsics(width=160, height=120, fx=100.0, fy=100.0, cx=79.5, cy=59.5)
MASKS = replace(PAPER, least_mask_likelihood=0.02)
"""Masks have a say."""


def rectangle(u0=0, v0=0, width=10, height=20):
    mask = np.zeros((CAMERA.height, CAMERA.width), bool)
    mask[v0 : v0 + height, u0 : u0 + width] = True
    return mask


def track(position, class_name="chair", mask=None, mask_position=None) -> Track:
    return Track(
        track_id=1,
        class_name=class_name,
        timestamp_s=0.0,
        mean=np.array([*position, 0, 0, 0], float),
        covariance=SIGMA**2 * np.eye(6),
        hits=2,
        misses=1,
        phase=TrackPhase.COASTING,
        detection_index=None,
        mask=rectangle() if mask is None else mask,
        mask_timestamp_s=0.0,
        mask_position_camera=np.asarray(position if mask_position is None else mask_position, float),
        is_partial=False,
    )


def seen(position, class_name="chair", mask=None) -> Observation:
    return Observation(
        position_camera=np.asarray(position, float),
        covariance=SIGMA**2 * np.eye(3),
        class_name=class_name,
        detection_index=0,
        mask=rectangle() if mask is None else mask,
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
    assert associate([track([0, 0, 0])], [inside], np.eye(4), CAMERA, PAPER).pairs == ((0, 0),)
    answer = associate([track([0, 0, 0])], [outside], np.eye(4), CAMERA, PAPER)
    assert (answer.pairs, answer.unmatched_tracks, answer.unmatched_observations) == ((), (0,), (0,))


def test_classes_do_not_mix() -> None:
    tracks = [track([0, 0, 0], "person"), track([0.3, 0, 0], "chair")]
    answer = associate(tracks, [seen([0, 0, 0], "chair"), seen([0.3, 0, 0], "person")], np.eye(4), CAMERA, PAPER)
    assert answer.pairs == ((0, 1), (1, 0))


def test_the_nearest_pair_gives_way_where_the_whole_is_better() -> None:
    # A greedy choice takes (0, 0) at 0.05 m first and leaves track 1 with the far observation.
    tracks = [track([0, 0, 0]), track([0.2, 0, 0])]
    observations = [seen([0.05, 0, 0]), seen([-0.3, 0, 0])]
    answer = associate(tracks, observations, np.eye(4), CAMERA, PAPER)
    assert answer.pairs == ((0, 1), (1, 0))


def test_total_distance_is_the_least_of_all_permutations() -> None:
    rng = np.random.default_rng(5)
    for _ in range(30):
        tracks = [track(rng.uniform(-0.2, 0.2, 3)) for _ in range(4)]
        observations = [seen(rng.uniform(-0.2, 0.2, 3)) for _ in range(4)]
        cost = squared_mahalanobis(tracks, observations, np.eye(4))
        best = min(sum(cost[i, j] for i, j in enumerate(p)) for p in itertools.permutations(range(4)))
        pairs = associate(tracks, observations, np.eye(4), CAMERA, PAPER).pairs
        assert sum(cost[i, j] for i, j in pairs) == pytest.approx(best)


def test_as_many_pairs_as_possible_before_the_least_distance() -> None:
    far = SIGMA * np.sqrt(2 * chi2.ppf(PAPER.gate_probability, 3)) * 0.95
    tracks = [track([0, 0, 0]), track([far, 0, 0])]
    answer = associate(tracks, [seen([0, 0, 0]), seen([-far, 0, 0])], np.eye(4), CAMERA, PAPER)
    assert len(answer.pairs) == 2


def test_order_of_observations_only_renames_the_pairs() -> None:
    rng = np.random.default_rng(6)
    tracks = [track(rng.uniform(-1, 1, 3)) for _ in range(5)]
    observations = [seen(t.position_world + rng.normal(0, 0.05, 3)) for t in tracks]
    straight = associate(tracks, observations, np.eye(4), CAMERA, PAPER).pairs
    turned = associate(tracks, observations[::-1], np.eye(4), CAMERA, PAPER).pairs
    assert straight == tuple((i, 4 - j) for i, j in turned)


def test_empty_sides() -> None:
    assert associate([], [], np.eye(4), CAMERA, PAPER).pairs == ()
    assert associate([track([0, 0, 0])], [], np.eye(4), CAMERA, PAPER).unmatched_tracks == (0,)
    assert associate([], [seen([0, 0, 0])], np.eye(4), CAMERA, PAPER).unmatched_observations == (0,)


@pytest.mark.parametrize("crossed", [False, True])
def test_a_tie_of_distances_is_resolved_by_the_masks(crossed) -> None:
    """Two tracks on one spot, two observations on another: every pairing has the same distance."""
    tall, wide = rectangle(70, 40, 20, 40), rectangle(60, 50, 40, 20)
    tracks = [track([0, 0, 2], mask=tall), track([0, 0, 2], mask=wide)]
    observations = [seen([0.02, 0, 2], mask=m) for m in ((wide, tall) if crossed else (tall, wide))]
    cost = squared_mahalanobis(tracks, observations, np.eye(4))
    assert np.ptp(cost) < 1e-12, "the distances say nothing"
    expected = ((0, 1), (1, 0)) if crossed else ((0, 0), (1, 1))
    assert associate(tracks, observations, np.eye(4), CAMERA, MASKS).pairs == expected
    assert associate(tracks, observations, np.eye(4), CAMERA, PAPER).pairs == ((0, 0), (1, 1)), "without their say"


def test_the_masks_are_compared_where_the_tracks_are_predicted() -> None:
    """Both tracks have moved on by 0.4 m at 2 m, 20 pixels: their old masks lie under the wrong observations."""
    tracks = [
        track([0.4, 0, 2], mask=rectangle(40, 40), mask_position=[0, 0, 2]),
        track([0.4, 0, 2], mask=rectangle(60, 40), mask_position=[0, 0, 2]),
    ]
    observations = [seen([0.4, 0, 2], mask=rectangle(80, 40)), seen([0.4, 0, 2], mask=rectangle(60, 40))]
    assert associate(tracks, observations, np.eye(4), CAMERA, MASKS).pairs == ((0, 1), (1, 0))


def test_a_camera_that_moves_moves_the_masks_of_tracks_that_stand() -> None:
    """It looks along the world's x and has gone 0.4 m to its left: what it saw lies 20 pixels further to the right."""
    T = np.eye(4)
    T[:3, :3] = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
    T[:3, 3] = [3.0, 5.4, 1.0]
    tracks = [
        track([5.0, 5.0, 1.0], mask=rectangle(40, 40), mask_position=[0, 0, 2]),
        track([5.0, 5.0, 1.0], mask=rectangle(60, 40), mask_position=[0, 0, 2]),
    ]
    observations = [seen([0.4, 0, 2], mask=rectangle(80, 40)), seen([0.4, 0, 2], mask=rectangle(60, 40))]
    assert associate(tracks, observations, T, CAMERA, MASKS).pairs == ((0, 1), (1, 0))


def test_the_overlap_counts_as_a_likelihood_beside_the_distance() -> None:
    """Minus twice the logarithm of the IoU adds to the squared distance: below its price masks win, above, distance."""
    one, other = rectangle(70, 40, 20, 20), rectangle(80, 40, 20, 20)  # IoU 1/3
    price = -2 * np.log(1 / 3)
    tracks = [track([0, 0, 2], mask=one)]
    for factor, winner in ((0.99, 1), (1.01, 0)):
        # The near observation has the wrong mask; the far one, farther by `factor` times the price, the right one.
        far = SIGMA * np.sqrt(2 * factor * price)
        observations = [seen([0, 0, 2], mask=other), seen([far, 0, 2], mask=one)]
        assert associate(tracks, observations, np.eye(4), CAMERA, MASKS).pairs == ((0, winner),)


def test_the_likelihood_of_a_mask_is_never_less_than_the_profiles() -> None:
    price = -2 * np.log(MASKS.least_mask_likelihood)
    tracks = [track([0, 0, 2], mask=rectangle(70, 40))]
    for factor, winner in ((0.99, 1), (1.01, 0)):
        far = SIGMA * np.sqrt(2 * factor * price)
        observations = [seen([0, 0, 2], mask=rectangle(0, 0)), seen([far, 0, 2], mask=rectangle(70, 40))]
        assert associate(tracks, observations, np.eye(4), CAMERA, MASKS).pairs == ((0, winner),)


def test_without_rivals_a_mask_elsewhere_does_not_part_a_pair() -> None:
    edge = 0.999 * SIGMA * np.sqrt(2 * chi2.ppf(MASKS.gate_probability, 3))
    observations = [seen([edge, 0, 2], mask=rectangle(0, 0))]
    tracks = [track([0, 0, 2], mask=rectangle(100, 80))]
    assert associate(tracks, observations, np.eye(4), CAMERA, MASKS).pairs == ((0, 0),)


def test_the_gate_is_the_distances_alone() -> None:
    """A perfect overlap does not let in what lies outside."""
    outside = 1.001 * SIGMA * np.sqrt(2 * chi2.ppf(MASKS.gate_probability, 3))
    tracks = [track([0, 0, 2])]
    observations = [seen([outside, 0, 2]), seen([outside, 0, 2])]
    assert associate(tracks, observations, np.eye(4), CAMERA, MASKS).pairs == ()
