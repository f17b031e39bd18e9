"""The sensor's noise against the laws that it states."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from sim.records import CameraModel, RenderedImages
from sim.sensor.model import SensorModel
from sim.sensor.parameters import SENSORS

CAMERA = CameraModel(width=640, height=480, fx=525.0, fy=520.0, cx=319.5, cy=239.5)
PERFECT = SensorModel()
KINECT = SENSORS["kinect_v1"].model
AXIAL = replace(PERFECT, axial_sigma_m=0.0012, axial_growth_per_m=0.0019, axial_origin_m=0.4)


def images(depth_m: npt.ArrayLike, grey: int = 120) -> RenderedImages:
    depth = np.broadcast_to(np.asarray(depth_m, np.float32), (480, 640)).copy()
    return RenderedImages(
        rgb=np.full((480, 640, 3), grey, np.uint8),
        depth_m=depth,
        instance_ids=np.zeros((480, 640), np.uint16),
        normals_camera=np.broadcast_to(np.array([0, 0, -1], np.float32), (480, 640, 3)),
    )


def measured_depth(
    sensor: SensorModel, depth_m: npt.ArrayLike, seed: int = 0, index: int = 0
) -> npt.NDArray[np.float64]:
    return sensor.measure(images(depth_m), CAMERA, seed, index)[1].astype(float)


@pytest.mark.parametrize("z", [0.5, 1.0, 2.0, 3.5, 5.5])
def test_axial_noise_follows_its_law(z: float) -> None:
    error = measured_depth(AXIAL, z) - z
    sigma = 0.0012 + 0.0019 * (z - 0.4) ** 2
    assert error.std() == pytest.approx(sigma, rel=0.01)
    assert abs(error.mean()) < 5 * sigma / np.sqrt(error.size)
    normalised = error / error.std()
    assert (normalised**4).mean() == pytest.approx(3.0, abs=0.05)
    assert (normalised**3).mean() == pytest.approx(0.0, abs=0.02)
    # neighbours are independent
    assert abs((normalised[:, 1:] * normalised[:, :-1]).mean()) < 0.01
    assert abs((normalised[1:] * normalised[:-1]).mean()) < 0.01


def test_frames_and_seeds_are_independent() -> None:
    fields = [measured_depth(AXIAL, 2.0, seed, index) for seed, index in ((0, 0), (0, 1), (1, 0), (7, 3))]
    for i, a in enumerate(fields):
        for b in fields[:i]:
            assert abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) < 0.01


def test_a_frame_is_a_function_of_seed_and_index_alone() -> None:
    sensor, scene = KINECT, images(np.linspace(0.3, 7, 640))
    forth = [sensor.measure(scene, CAMERA, 3, index) for index in (0, 1, 2)]
    back = [sensor.measure(scene, CAMERA, 3, index) for index in (2, 1, 0)][::-1]
    for (rgb, depth_m), (rgb_again, depth_again) in zip(forth, back, strict=True):
        np.testing.assert_array_equal(rgb, rgb_again)
        np.testing.assert_array_equal(depth_m, depth_again)
    assert not np.array_equal(forth[0][0], forth[1][0])
    assert not np.array_equal(forth[0][1], sensor.measure(scene, CAMERA, 4, 0)[1])


def test_colour_noise_has_the_stated_sigma_in_every_channel() -> None:
    rgb = (
        replace(PERFECT, rgb_sigma_black=2.5, rgb_sigma_white=2.5).measure(images(1.0), CAMERA, 0, 0)[0].astype(float)
        - 120
    )
    assert rgb.std(axis=(0, 1)) == pytest.approx([np.sqrt(2.5**2 + 1 / 12)] * 3, rel=0.01)
    assert np.abs(rgb.mean(axis=(0, 1))).max() < 0.02
    correlation = np.corrcoef(rgb.reshape(-1, 3).T)
    assert np.abs(correlation - np.eye(3)).max() < 0.01


@pytest.mark.parametrize("grey", [0, 255])
def test_colour_saturates(grey: int) -> None:
    rgb = KINECT.measure(images(1.0, grey), CAMERA, 0, 0)[0].astype(int)
    assert np.abs(rgb - grey).max() < 20


def test_colour_and_depth_noise_are_independent() -> None:
    rgb, depth_m = replace(AXIAL, rgb_sigma_black=2.5, rgb_sigma_white=2.5).measure(images(2.0), CAMERA, 0, 0)
    for channel in range(3):
        assert abs(np.corrcoef(rgb[..., channel].ravel(), depth_m.ravel())[0, 1]) < 0.01


@pytest.mark.parametrize("z", [0.8, 2.0, 4.0])
def test_depth_lies_on_the_steps_of_the_disparity(z: float) -> None:
    sensor = replace(PERFECT, baseline_m=0.075, focal_px=586.0, disparity_step_px=0.125)
    near = z * np.linspace(1, 1.05, 640)
    depth_m = measured_depth(sensor, near)
    steps = 586 * 0.075 / depth_m / 0.125
    np.testing.assert_allclose(steps, np.rint(steps), atol=2e-3)
    size_m = z**2 * 0.125 / (586 * 0.075)  # derivative of depth by disparity times the step
    assert np.abs(depth_m - near).max() < 0.6 * size_m * 1.05**2
    spacing = np.diff(np.unique(depth_m))
    np.testing.assert_allclose(spacing, size_m, rtol=0.15)


def test_depth_survives_the_file_format() -> None:
    depth_m = KINECT.measure(images(np.linspace(0.3, 7, 640)), CAMERA, 0, 0)[1]
    stored = np.rint(depth_m.astype(float) * 5000).astype(np.uint16)
    np.testing.assert_array_equal((stored / 5000.0).astype(np.float32), depth_m)


def test_range() -> None:
    sensor = replace(PERFECT, min_range_m=0.4, max_range_m=6.0)
    z = np.array([0.0, 0.39, 0.41, 3.0, 5.99, 6.01, 9.0])
    depth_m = measured_depth(sensor, np.repeat(z, 100)[np.minimum(np.arange(640), 699)])
    np.testing.assert_allclose(depth_m[0, 50::100], [0, 0, 0.41, 3.0, 5.99, 0], atol=1e-6)
    assert measured_depth(PERFECT, 9.0).max() == 9.0


def test_lateral_noise_swaps_the_stated_share_at_an_edge() -> None:
    step = np.where(np.arange(640) < 300, 1.0, 2.0)
    depth_m = measured_depth(replace(PERFECT, lateral_sigma_px=0.5), step)
    # an offset of at least one pixel to one side: the Gaussian above one sigma
    assert (depth_m[:, 299] == 2.0).mean() == pytest.approx(0.1587, abs=0.05)
    assert (depth_m[:, 300] == 1.0).mean() == pytest.approx(0.1587, abs=0.05)
    assert (depth_m[:, :297] == 1.0).all()
    assert set(np.unique(depth_m)) == {1.0, 2.0}


def test_depth_is_lost_at_edges_alone() -> None:
    step = np.where(np.arange(640) < 300, 1.0, 1.2)
    depth_m = measured_depth(replace(PERFECT, edge_jump=0.05, edge_dropout_px=1), step)
    assert (depth_m[:, 299:301] == 0).all()
    assert (depth_m[:, :299] > 0).all()
    assert (depth_m[:, 301:] > 0).all()
    small = measured_depth(
        replace(PERFECT, edge_jump=0.05, edge_dropout_px=1), np.where(np.arange(640) < 300, 1.0, 1.04)
    )
    assert (small > 0).all()


def test_nothing_seen_stays_nothing() -> None:
    assert not measured_depth(KINECT, 0.0).any()


def test_a_perfect_sensor_changes_nothing() -> None:
    scene = images(np.linspace(0.01, 30, 640))
    rgb, depth_m = PERFECT.measure(scene, CAMERA, 0, 0)
    np.testing.assert_array_equal(rgb, scene.rgb)
    np.testing.assert_array_equal(depth_m, scene.depth_m)
    assert not np.shares_memory(rgb, scene.rgb)
    assert not np.shares_memory(depth_m, scene.depth_m)


def test_the_perfect_images_are_left_alone() -> None:
    scene = images(np.linspace(0.3, 7, 640))
    before = scene.rgb.copy(), scene.depth_m.copy()
    rgb, depth_m = KINECT.measure(scene, CAMERA, 0, 0)
    np.testing.assert_array_equal(scene.rgb, before[0])
    np.testing.assert_array_equal(scene.depth_m, before[1])
    assert rgb.dtype == np.uint8
    assert depth_m.dtype == np.float32


def test_lateral_noise_leaves_smooth_surfaces_alone() -> None:
    slope = 2.0 + 0.01 * np.arange(640)
    np.testing.assert_array_equal(
        measured_depth(replace(PERFECT, lateral_sigma_px=0.8), slope)[0], slope.astype(np.float32)
    )


def test_errors_that_depend_on_the_angle_need_normals() -> None:
    with pytest.raises(ValueError, match="need images with normals"):
        KINECT.measure(replace(images(1.0), normals_camera=None), CAMERA, 0, 0)
    PERFECT.measure(replace(images(1.0), normals_camera=None), CAMERA, 0, 0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rgb_sigma_black": -1.0}, "rgb_sigma_black"),
        ({"edge_jump": np.nan}, "edge_jump"),
        ({"max_range_m": 0.3}, "range"),
        ({"hole_end_deg": 70.0}, "holes must end"),
        ({"focal_px": 0.0}, "need focal_px"),
    ],
)
def test_impossible_parameters_are_refused(change: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(KINECT, **change)
