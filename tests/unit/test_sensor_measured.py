"""Every error of a single image, measured back from rendered frames of the parameter sets.

The numbers that are expected are written out here, so a change of a parameter set must be meant.
"""

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from sim.geometry import FloatArray
from sim.records import CameraModel, Moment, RenderedImages
from sim.renderers.visibility_buffer import VisibilityBufferRenderer
from sim.scene import Placed, Scene, SceneObject, Surface
from sim.sensor.model import SensorModel
from sim.sensor.parameters import SENSORS

CAMERA = CameraModel(width=320, height=240, fx=262.5, fy=260.0, cx=159.5, cy=119.5)
NAMES = ("kinect_v1", "realsense_d435")
FIRST, SECOND = (SENSORS[name].model for name in NAMES)


def quad(corners: npt.ArrayLike, grey: int = 128) -> Surface:
    """Seen from the front, the corners run counter-clockwise; lit by nothing but the ambient light."""
    points = np.asarray(corners, np.float32)
    normal = np.cross(points[1] - points[0], points[2] - points[0])
    return Surface(
        vertices=points,
        normals=np.tile(normal / np.linalg.norm(normal), (4, 1)).astype(np.float32),
        uv=np.zeros((4, 2), np.float32),
        faces=np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        texture=np.full((4, 4, 3), grey, np.uint8),
    )


def wall(z: float, left: float = -40.0, right: float = 40.0) -> Surface:
    return quad([(left, -40, z), (left, 40, z), (right, 40, z), (right, -40, z)])


def tilted(angle_deg: float, z: float) -> Surface:
    """A plane through (0, 0, z), turned about the vertical axis: its right side is farther away."""
    half = 0.9 * z
    x, dz = half * math.cos(math.radians(angle_deg)), half * math.sin(math.radians(angle_deg))
    return quad([(-x, -40, z - dz), (-x, 40, z - dz), (x, 40, z + dz), (x, -40, z + dz)])


def rendered(*surfaces: Surface) -> RenderedImages:
    thing = SceneObject(name="thing", class_name="thing", instance_id=1, surfaces=surfaces, motion=Placed(np.eye(4)))
    renderer = VisibilityBufferRenderer(Scene(objects=(thing,), lights=(), ambient=1.0), CAMERA, shadow_size=0)
    return renderer.render(Moment(T_world_camera=np.eye(4), palettes={}), normals=True)


def only(model: SensorModel, *names: str) -> SensorModel:
    """A sensor with these parameters of `model` alone."""
    return SensorModel(**{name: getattr(model, name) for name in names})


AXIAL = ("axial_sigma_m", "axial_growth_per_m", "axial_origin_m")


def angles_deg(images: RenderedImages) -> FloatArray:
    """Angle of incidence of every pixel, by numpy."""
    assert images.normals_camera is not None
    u, v = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))
    rays = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones(u.shape)], axis=-1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    return np.degrees(np.arccos(np.clip(-(rays * images.normals_camera).sum(-1), -1, 1)))


def errors(model: SensorModel, images: RenderedImages, frames: int = 4) -> FloatArray:
    """(frames, H, W) measured minus true depth, NaN where nothing was measured."""
    measured = np.array([model.measure(images, CAMERA, 0, k)[1] for k in range(frames)], float)
    return np.where(measured > 0, measured - images.depth_m, np.nan)


@pytest.mark.parametrize("z", [0.7, 1.5, 3.0, 5.0])
def test_axial_noise(z: float) -> None:
    laws = (0.0012 + 0.0019 * (z - 0.4) ** 2, 0.001063 + 0.0007278 * z + 0.003949 * z**2)
    for model, sigma in zip((FIRST, SECOND), laws, strict=True):
        error = errors(only(model, *AXIAL), rendered(wall(z)))
        # 4.5 standard deviations of the estimate, and what the cut tails lack
        assert error.std() == pytest.approx(sigma, rel=4.5 / math.sqrt(2 * error.size) + 0.002)


@pytest.mark.parametrize("z", [2.5, 5.0])
def test_axial_noise_of_the_stereo_camera_is_the_error_of_its_disparity(z: float) -> None:
    sigma = errors(only(SECOND, *AXIAL), rendered(wall(z))).std()
    assert sigma == pytest.approx(z**2 * 0.08 / (424 * 0.050), rel=0.25)


@pytest.mark.parametrize("angle_deg", [30.0, 65.0, 80.0])
def test_axial_noise_grows_on_steep_surfaces(angle_deg: float) -> None:
    images = rendered(tilted(angle_deg, 1.5))
    theta, z = np.radians(angles_deg(images)), images.depth_m.astype(float)
    shallow = np.minimum(theta, np.radians(88))
    growth = 0.0001 / np.sqrt(np.maximum(z, 0.1)) * (shallow / (np.pi / 2 - shallow)) ** 2 * (theta > np.pi / 3)
    expected = 0.0012 + 0.0019 * (z - 0.4) ** 2 + growth
    seen = (z > 0) & (np.degrees(theta) < 85)
    normalised = (errors(only(FIRST, *AXIAL, "axial_slant_m"), images, 16) / expected)[:, seen]
    assert normalised.std() == pytest.approx(1.0, rel=4.5 / math.sqrt(2 * normalised.size) + 0.005)
    if angle_deg == 80:
        assert growth[seen].mean() > 0.002, "the test must look where the growth matters"


@pytest.mark.parametrize(("model", "sigma_px"), [(FIRST, 0.8), (SECOND, 1.0)])
def test_lateral_noise_by_the_width_of_an_edge(model: SensorModel, sigma_px: float) -> None:
    images = rendered(wall(2.0), wall(1.0, right=0.0))
    edge = int((images.depth_m[120] < 1.5).sum())
    near = np.array([only(model, "lateral_sigma_px").measure(images, CAMERA, 0, k)[1] < 1.5 for k in range(30)])
    # Of a row, as many near pixels end up right of the edge as the positive part of a Gaussian has on average.
    width_px = math.sqrt(2 * math.pi) * near[:, :, edge:].sum(axis=2).mean()
    assert width_px == pytest.approx(sigma_px, rel=0.05)
    assert near[:, :, :edge].mean() == pytest.approx(1 - near[:, :, edge:].sum() / near[:, :, :edge].size, abs=0.002)


@pytest.mark.parametrize(("model", "step_at_1m"), [(FIRST, 0.00284), (SECOND, 0.00147)])
@pytest.mark.parametrize("z", [1.0, 2.5, 4.0])
def test_steps_of_the_disparity(model: SensorModel, step_at_1m: float, z: float) -> None:
    names = ("baseline_m", "focal_px", "disparity_step_px")
    depth_m = only(model, *names).measure(rendered(tilted(10, z)), CAMERA, 0, 0)[1]
    levels = np.unique(depth_m[depth_m > 0].astype(float))
    assert len(levels) > 15
    middle = (levels[1:] + levels[:-1]) / 2
    assert np.median(np.diff(levels) / middle**2) == pytest.approx(step_at_1m, rel=0.01)


def test_steps_of_the_file() -> None:
    for model, per_metre in ((FIRST, 5000), (SECOND, 1000)):
        depth_m = model.measure(rendered(tilted(45, 2.0)), CAMERA, 0, 0)[1]
        units = depth_m[depth_m > 0].astype(float) * per_metre
        assert np.abs(units - np.rint(units)).max() < 1e-3
        assert len(np.unique(np.rint(units) % 10)) == 10, "the step is as small as stated"


@pytest.mark.parametrize(("model", "width_px"), [(FIRST, 2), (SECOND, 4)])
def test_width_of_the_loss_at_an_edge(model: SensorModel, width_px: int) -> None:
    sensor = only(model, "edge_dropout_px", "edge_jump")
    for far, lost in ((2.0, width_px), (1.055, width_px), (1.045, 0)):
        depth_m = sensor.measure(rendered(wall(far), wall(1.0, right=0.0)), CAMERA, 0, 0)[1]
        assert ((depth_m == 0).sum(axis=1) == lost).all()


@pytest.mark.parametrize(("model", "baseline_m"), [(FIRST, 0.075), (SECOND, 0.050)])
@pytest.mark.parametrize(("near", "far"), [(0.6, 2.0), (1.2, 4.0)])
def test_shadow_on_the_left_of_near_objects(model: SensorModel, baseline_m: float, near: float, far: float) -> None:
    images = rendered(wall(far), wall(near, left=-0.1, right=0.15))
    depth_m = only(model, "baseline_m", "edge_jump").measure(images, CAMERA, 0, 0)[1]
    first = int(np.flatnonzero(images.depth_m[120] < near + 0.1)[0])
    width_px = CAMERA.fx * baseline_m * (1 / near - 1 / far)
    lost = depth_m == 0
    assert np.abs(lost.sum(axis=1) - width_px).max() <= 1.0
    assert lost[:, first - 5 : first].all()
    assert not lost[:, first:].any()


def test_a_thin_object_casts_a_thin_shadow() -> None:
    images = rendered(wall(3.0), wall(0.6, left=0.0, right=0.02))
    lost = only(FIRST, "baseline_m", "edge_jump").measure(images, CAMERA, 0, 0)[1] == 0
    assert np.abs(lost.sum(axis=1) - 0.02 / 0.6 * CAMERA.fx).max() <= 2
    assert not lost[:, 155:160].any(), "between the object and its shadow the wall is seen"


@pytest.mark.parametrize(("model", "start_deg", "end_deg"), [(FIRST, 75.0, 87.0), (SECOND, 70.0, 87.0)])
def test_holes_by_the_angle(model: SensorModel, start_deg: float, end_deg: float) -> None:
    sensor = only(model, "hole_start_deg", "hole_end_deg")
    for tilt in (60.0, 68.0, 74.0, 78.0, 82.0):
        images = rendered(tilted(tilt, 2.0))
        angle = angles_deg(images)
        lost = np.array([sensor.measure(images, CAMERA, 0, k)[1] == 0 for k in range(40)])
        for low in range(55, 88, 3):
            here = (images.depth_m > 0) & (angle >= low) & (angle < low + 3)
            if here.sum() < 500:
                continue
            first, last = math.cos(math.radians(start_deg)), math.cos(math.radians(end_deg))
            expected = np.clip((first - np.cos(np.radians(angle[here]))) / (first - last), 0, 1).mean()
            patches = 40 * here.sum() / 16
            tolerance = 4.5 * math.sqrt(expected * (1 - expected) / patches) + 1e-9
            assert lost[:, here].mean() == pytest.approx(expected, abs=tolerance)


def test_holes_are_patches() -> None:
    images = rendered(tilted(80.0, 2.0))
    lost = only(FIRST, "hole_start_deg", "hole_end_deg").measure(images, CAMERA, 0, 0)[1] == 0
    seen = (images.depth_m > 0) & (angles_deg(images) > 78) & (angles_deg(images) < 82)
    pair = seen[:, 1:] & seen[:, :-1]
    same = (lost[:, 1:] == lost[:, :-1])[pair].mean()
    assert same > 0.8, "neighbours are lost together"


@pytest.mark.parametrize(("model", "low", "high"), [(FIRST, 0.4, 6.0), (SECOND, 0.195, 10.0)])
def test_range(model: SensorModel, low: float, high: float) -> None:
    distances = (0.98 * low, 1.02 * low, 0.98 * high, 1.02 * high)
    stripes = [
        wall(z, *((u - CAMERA.cx) / CAMERA.fx * z for u in (80 * k - 0.5, 80 * k + 79.5)))
        for k, z in enumerate(distances)
    ]
    depth_m = only(model, "min_range_m", "max_range_m").measure(rendered(*stripes), CAMERA, 0, 0)[1]
    for k, z in enumerate(distances):
        np.testing.assert_allclose(depth_m[:, 80 * k : 80 * k + 80], z if k in (1, 2) else 0.0, rtol=1e-5)


@pytest.mark.parametrize(("model", "black", "white"), [(FIRST, 2.0, 3.0), (SECOND, 1.5, 2.5)])
def test_colour_noise_grows_with_the_signal(model: SensorModel, black: float, white: float) -> None:
    base = rendered(wall(2.0))
    for grey in (30, 128, 230):
        images = replace(base, rgb=np.full_like(base.rgb, grey))
        noisy = only(model, "rgb_sigma_black", "rgb_sigma_white").measure(images, CAMERA, 0, 0)[0].astype(float)
        sigma = math.sqrt(black**2 + (white**2 - black**2) * grey / 255 + 1 / 12)  # 1/12: rounding
        assert noisy.std() == pytest.approx(sigma, rel=4.5 / math.sqrt(2 * noisy.size) + 0.003)
        assert noisy.mean() == pytest.approx(grey, abs=4.5 * sigma / math.sqrt(noisy.size))
