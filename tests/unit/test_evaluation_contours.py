import cv2
import numpy as np
import pytest

from dotmask.evaluation.contours import boundary_f

SHAPE = (120, 160)  # a diagonal of 200 pixels: contours may be 1.6, rounded up 2 pixels apart


def box(top: int, left: int, bottom: int, right: int) -> np.ndarray:
    mask = np.zeros(SHAPE, bool)
    mask[top:bottom, left:right] = True
    return mask


def naive_contour(mask: np.ndarray) -> np.ndarray:
    height, width = mask.shape
    return np.array(
        [
            (v, u)
            for v in range(height)
            for u in range(width)
            if any(
                mask[v, u] != mask[v + dv, u + du]
                for dv, du in ((0, 1), (1, 0), (1, 1))
                if v + dv < height and u + du < width
            )
        ]
    ).reshape(-1, 2)


def naive_boundary_f(mask: np.ndarray, truth: np.ndarray) -> float:
    found, wanted = naive_contour(mask), naive_contour(truth)
    radius = np.ceil(0.008 * np.hypot(*mask.shape))
    distances = np.hypot(*(found[:, None] - wanted[None]).transpose(2, 0, 1))
    precision, recall = (distances.min(axis=1) <= radius).mean(), (distances.min(axis=0) <= radius).mean()
    return 2 * precision * recall / (precision + recall) if precision + recall else 0.0


def blob(rng: np.random.Generator) -> np.ndarray:
    mask = np.zeros(SHAPE, np.uint8)
    for _ in range(3):
        centre, axes = rng.integers([40, 20], [120, 100], 2), rng.integers(8, 45, 2)
        cv2.ellipse(mask, [int(c) for c in centre], [int(a) for a in axes], rng.uniform(0, 180), 0, 360, 1, -1)
    return mask.astype(bool)


@pytest.mark.parametrize("seed", range(8))
def test_it_is_what_all_pairs_of_contour_pixels_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth = blob(rng)
    ragged = truth ^ (cv2.GaussianBlur(rng.normal(size=SHAPE), (0, 0), 3) > 0.12)
    for mask in (ragged, np.roll(truth, 3, axis=1), np.roll(truth, -40, axis=0), blob(rng)):
        assert boundary_f(mask, truth) == pytest.approx(naive_boundary_f(mask, truth), abs=1e-12)


def test_a_contour_within_the_tolerance_is_right_and_one_beyond_it_is_not() -> None:
    truth = box(30, 40, 90, 120)
    assert boundary_f(truth, truth) == 1.0
    assert boundary_f(box(30, 42, 90, 122), truth) == 1.0
    assert boundary_f(box(36, 46, 84, 114), truth) == 0.0


def test_a_hole_costs_precision_only() -> None:
    truth = box(30, 40, 90, 120)
    holed = truth & ~box(50, 60, 70, 80)
    around, hole = 2 * (60 + 80), 2 * (20 + 20)
    precision = around / (around + hole)
    assert boundary_f(holed, truth) == pytest.approx(2 * precision / (precision + 1))
    assert boundary_f(truth, holed) == pytest.approx(2 * precision / (precision + 1))


def test_the_border_of_the_image_is_no_contour() -> None:
    # Half of the image against a strip of it: one edge each, far apart, though both share three sides of the image.
    assert boundary_f(box(0, 0, 120, 80), box(0, 0, 120, 30)) == 0.0
    assert boundary_f(box(0, 0, 120, 80), box(0, 0, 120, 81)) == 1.0


def test_masks_without_a_contour() -> None:
    empty, full = box(0, 0, 0, 0), box(0, 0, *SHAPE)
    assert boundary_f(empty, empty) == boundary_f(full, full) == boundary_f(full, empty) == 1.0
    assert boundary_f(empty, box(30, 40, 90, 120)) == boundary_f(box(30, 40, 90, 120), full) == 0.0
