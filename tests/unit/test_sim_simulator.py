"""The simulator's errors in time, measured back from rendered frames and from its stamps."""

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import pytest

from sim.geometry import FloatArray
from sim.records import CameraModel
from sim.renderers.visibility_buffer import VisibilityBufferRenderer
from sim.scene import Scene, SceneObject, Surface
from sim.sensor.exposure import MAX_SLICES, slices
from sim.sensor.parameters import IDEAL, KINECT_V1, REALSENSE_D435
from sim.sensor.timing import Timing
from sim.simulator import Simulator

CAMERA = CameraModel(width=640, height=60, fx=520.0, fy=520.0, cx=319.3, cy=29.5)
RATE_HZ = 30.0
EXPOSURES = ((KINECT_V1.timing, 0.016), (REALSENSE_D435.timing, 0.0156))
READOUTS = ((KINECT_V1.timing, 0.026), (REALSENSE_D435.timing, 0.020))
DELAYS = ((KINECT_V1.timing, 0.016), (REALSENSE_D435.timing, 0.005))


@dataclass(frozen=True)
class Sliding:
    """Moves at a constant speed along the camera's x axis; a camera path, and a motion."""

    speed_m_s: float = 0.0
    turning_rad_s: float = 0.0

    def pose_at(self, time_s: float) -> FloatArray:
        c, s = math.cos(self.turning_rad_s * time_s), math.sin(self.turning_rad_s * time_s)
        return np.array([[c, 0, s, self.speed_m_s * time_s], [0, 1.0, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1]])

    def palette_at(self, time_s: float) -> FloatArray:
        return self.pose_at(time_s)[None]


def half_plane(z: float, left: float, right: float, grey: int) -> Surface:
    corners = np.array([(left, -9, z), (left, 9, z), (right, 9, z), (right, -9, z)], np.float32)
    return Surface(
        vertices=corners,
        normals=np.tile(np.array([0, 0, -1], np.float32), (4, 1)),
        uv=np.zeros((4, 2), np.float32),
        faces=np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        texture=np.full((4, 4, 3), grey, np.uint8),
    )


def simulator(
    timing: Timing, *, camera: Sliding = Sliding(), board: Sliding = Sliding(), frames: int = 10, seed: int = 0
) -> Simulator:
    """A dark board, 1 m away, that ends at x = 0, before a bright wall at 2 m. No error but those of `timing`."""
    wall = SceneObject(
        name="wall",
        class_name="wall",
        instance_id=0,
        surfaces=(half_plane(2.0, -30, 30, 240),),
        motion=Sliding(),
    )
    moving = SceneObject(
        name="board",
        class_name="thing",
        instance_id=1,
        surfaces=(half_plane(1.0, -30, 0, 20),),
        motion=board,
        is_actor=True,
    )
    scene = Scene(objects=(wall, moving), lights=(), ambient=1.0)
    return Simulator(
        scene=scene,
        camera=CAMERA,
        camera_path=camera,
        sensor=replace(IDEAL, timing=timing),
        renderer=VisibilityBufferRenderer(scene, CAMERA, shadow_size=0),
        seed=seed,
        frames=frames,
        frame_rate_hz=RATE_HZ,
    )


def brightness(rgb: npt.NDArray[np.uint8]) -> FloatArray:
    """(H, W) share of the wall in each pixel, by the two greys of the scene."""
    grey = rgb[..., 0].astype(float)
    return (grey - grey.min()) / (grey.max() - grey.min())


def edge_px(rgb: npt.NDArray[np.uint8]) -> FloatArray:
    """(H,) where the board ends in each row: as many columns as it covers, less the half of the first pixel."""
    return np.asarray((1 - brightness(rgb)).sum(axis=1) - 0.5)


def board_px(time_s: float, speed_m_s: float) -> float:
    """Where the board that started at x = 0 ends."""
    return CAMERA.cx + CAMERA.fx * speed_m_s * time_s


@pytest.mark.parametrize(("timing", "exposure_s"), EXPOSURES)
@pytest.mark.parametrize("who", ["camera", "board"])
def test_exposure_time_by_the_length_of_the_blur(timing: Timing, exposure_s: float, who: str) -> None:
    speed = 4.0
    still = Timing(exposure_s=timing.exposure_s)
    rgb = simulator(still, **{who: Sliding(-speed)}, frames=3).frame(1).rgb
    # Over a linear ramp of length L the integral of 4 p (1 - p) is 2 L / 3.
    share = brightness(rgb)
    length_px = 1.5 * (4 * share * (1 - share)).sum(axis=1).mean()
    assert length_px == pytest.approx(exposure_s * speed * CAMERA.fx, rel=0.06)


@pytest.mark.parametrize(("timing", "readout_s"), READOUTS)
def test_read_out_time_by_the_skew_of_an_edge(timing: Timing, readout_s: float) -> None:
    speed = 3.0
    rolling = Timing(exposure_s=timing.exposure_s, readout_s=timing.readout_s)
    frame = simulator(rolling, board=Sliding(-speed), frames=3)
    rows = edge_px(frame.frame(1).rgb)
    slope, middle = np.polyfit(np.arange(CAMERA.height) - (CAMERA.height - 1) / 2, rows, 1)
    assert -slope * CAMERA.height / (speed * CAMERA.fx) == pytest.approx(readout_s, rel=0.02)
    assert middle == pytest.approx(board_px(1 / RATE_HZ, -speed), abs=0.3), "the middle row has the frame's time"
    straight = rows - np.polyval([slope, middle], np.arange(CAMERA.height) - (CAMERA.height - 1) / 2)
    assert np.abs(straight).max() < 0.6, "the edge is a line, not a stair"


def test_a_rolling_shutter_without_exposure_time_is_sharp() -> None:
    timing = Timing(readout_s=0.02)
    rgb = simulator(timing, board=Sliding(-3.0), frames=3).frame(1).rgb
    share = brightness(rgb)
    assert ((share > 0.02) & (share < 0.98)).sum(axis=1).max() <= 2
    # a stair: it lacks its last step
    skew_px = 0.02 * 3.0 * CAMERA.fx * (1 - 1 / slices(0.02, 0.0))
    assert np.ptp(edge_px(rgb)) == pytest.approx(skew_px, abs=1.1)


def test_what_stands_still_is_exposed_as_it_is() -> None:
    timing = Timing(exposure_s=0.02, readout_s=0.03)
    sharp, exposed = simulator(Timing()).frame(2), simulator(timing).frame(2)
    np.testing.assert_array_equal(sharp.rgb, exposed.rgb)


@pytest.mark.parametrize(("timing", "delay_s"), DELAYS)
def test_delay_between_colour_and_depth_by_the_shift_of_an_edge(timing: Timing, delay_s: float) -> None:
    speed = 4.0
    simulated = simulator(Timing(depth_delay_s=timing.depth_delay_s), board=Sliding(speed))
    shifts_px = []
    for index in (1, 2, 3):
        frame = simulated.frame(index)
        shifts_px.append(float(((frame.depth_m < 1.5).sum(axis=1) - 0.5 - edge_px(frame.rgb)).mean()))
        assert frame.truth.depth_m is not frame.depth_m
        in_truth = (frame.truth.depth_m < 1.5).sum(axis=1) - 0.5
        np.testing.assert_allclose(in_truth, edge_px(frame.rgb), atol=0.6, err_msg="the truth is of the colour's time")
        np.testing.assert_array_equal(frame.truth.instance_ids == 1, frame.truth.depth_m < 1.5)
    assert np.mean(shifts_px) == pytest.approx(delay_s * speed * CAMERA.fx, abs=0.6)


def test_depth_may_be_earlier_than_colour() -> None:
    frame = simulator(Timing(depth_delay_s=-0.02), board=Sliding(2.0), frames=9).frame(5)
    shift_px = ((frame.depth_m < 1.5).sum(axis=1) - 0.5 - edge_px(frame.rgb)).mean()
    assert shift_px == pytest.approx(-0.02 * 2.0 * CAMERA.fx, abs=0.6)


@pytest.mark.parametrize(("timing", "share"), [(KINECT_V1.timing, 0.01), (REALSENSE_D435.timing, 0.02)])
def test_share_of_dropped_frames(timing: Timing, share: float) -> None:
    captured = 400_000
    simulated = simulator(Timing(dropped_share=timing.dropped_share), frames=captured)
    spread = math.sqrt(share * (1 - share) / captured)
    assert 1 - len(simulated) / captured == pytest.approx(share, abs=4.5 * spread)
    # Stamps show the gaps. Frames are lost one by one: two in a row are as rare as chance has it.
    gaps = np.diff([simulated.time_s(index) for index in range(len(simulated))]) * RATE_HZ
    np.testing.assert_allclose(gaps, np.rint(gaps), atol=1e-6)
    assert gaps.min() > 0.5
    pairs = captured * share**2
    assert (gaps > 2.5).sum() == pytest.approx(pairs, abs=4.5 * math.sqrt(pairs))


def test_another_seed_drops_other_frames_and_a_longer_sequence_begins_the_same() -> None:
    timing = Timing(dropped_share=0.3, stamp_sigma_s=0.002)
    kept = timing.delivered(100, 0)
    assert not np.array_equal(kept, timing.delivered(100, 1)[: len(kept)])
    longer = timing.delivered(300, 0)
    np.testing.assert_array_equal(longer[: len(kept)], kept)
    stamps = timing.stamps_s(kept, RATE_HZ, 0)
    np.testing.assert_array_equal(timing.stamps_s(longer, RATE_HZ, 0)[: len(kept)], stamps)


@pytest.mark.parametrize(("timing", "sigma_s"), [(KINECT_V1.timing, 0.002), (REALSENSE_D435.timing, 0.0005)])
def test_jitter_of_the_stamps(timing: Timing, sigma_s: float) -> None:
    captured = timing.delivered(40_000, 5)
    error = timing.stamps_s(captured, RATE_HZ, 5) - captured / RATE_HZ
    assert error.std() == pytest.approx(sigma_s, rel=4.5 / math.sqrt(2 * error.size))
    assert abs(error.mean()) < 4.5 * sigma_s / math.sqrt(error.size)
    assert abs(np.corrcoef(error[1:], error[:-1])[0, 1]) < 4.5 / math.sqrt(error.size)


@pytest.mark.parametrize("sigma_s", [0.0, 0.002, 1.0])
def test_stamps_increase_however_much_they_jitter(sigma_s: float) -> None:
    timing = Timing(stamp_sigma_s=sigma_s, dropped_share=0.2)
    assert np.diff(timing.stamps_s(timing.delivered(20_000, 0), RATE_HZ, 0)).min() > 1e-4


def test_frames_have_the_stamps_and_the_truth_has_the_times() -> None:
    timing = Timing(stamp_sigma_s=0.004, dropped_share=0.4)
    simulated = simulator(timing, board=Sliding(1.5), frames=12, seed=3)
    frames = list(simulated)
    assert [f.index for f in frames] == list(range(len(simulated)))
    assert 3 < len(frames) < 12
    captured = timing.delivered(12, 3)
    assert [f.timestamp_s for f in frames] == list(timing.stamps_s(captured, RATE_HZ, 3))
    for frame, number in zip(frames, captured, strict=True):
        assert simulated.time_s(frame.index) == number / RATE_HZ
        x = frame.truth.objects[0].T_world_object[0, 3]
        assert x == pytest.approx(1.5 * number / RATE_HZ, abs=1e-6)
        assert edge_px(frame.rgb).mean() == pytest.approx(board_px(number / RATE_HZ, 1.5), abs=0.6)
    images, moment = simulated.render(1, flow=True)
    assert images.flow is not None
    step_px = (captured[2] - captured[1]) / RATE_HZ * 1.5 * CAMERA.fx
    on_board = images.instance_ids == 1
    np.testing.assert_allclose(images.flow.optical_px[on_board, 0], step_px, atol=1e-2)
    np.testing.assert_array_equal(moment.palettes["board"], simulated.moment(simulated.time_s(1)).palettes["board"])


def test_a_frame_does_not_depend_on_the_others() -> None:
    timing = replace(KINECT_V1.timing, dropped_share=0.3)

    def fresh() -> Simulator:
        return simulator(timing, board=Sliding(1.5), camera=Sliding(0.3, 0.4), frames=8)

    forth = list(fresh())
    for index in reversed(range(len(forth))):
        alone = fresh().frame(index)
        np.testing.assert_array_equal(alone.rgb, forth[index].rgb)
        np.testing.assert_array_equal(alone.depth_m, forth[index].depth_m)
        assert alone.timestamp_s == forth[index].timestamp_s
        assert alone.truth.objects[0].occlusion == forth[index].truth.objects[0].occlusion


def test_no_moment_outside_the_sequence_is_asked_for() -> None:
    @dataclass(frozen=True)
    class Recorded(Sliding):
        def pose_at(self, time_s: float) -> FloatArray:
            assert 0 <= time_s <= 2 / RATE_HZ
            return super().pose_at(time_s)

    frames = list(simulator(replace(KINECT_V1.timing, dropped_share=0.0), camera=Recorded(1.0), frames=3))
    assert len(frames) == 3


def test_without_errors_in_time_frames_are_periodic() -> None:
    frames = list(simulator(Timing(), frames=4))
    assert [f.timestamp_s for f in frames] == [0, 1 / 30, 2 / 30, 3 / 30]
    with pytest.raises(IndexError, match="frame 4 of a sequence of 4"):
        simulator(Timing(), frames=4).frame(4)


def test_time_is_cut_finely_enough() -> None:
    assert slices(0.0, 100.0) == 1
    assert slices(0.042, 0.0) == 14
    assert slices(0.042, 2000.0) == 42
    assert slices(0.042, 1e9) == MAX_SLICES


@pytest.mark.parametrize(
    ("change", "message"),
    [({"exposure_s": -0.01}, "exposure_s"), ({"dropped_share": 1.0}, "nothing"), ({"readout_s": math.nan}, "readout")],
)
def test_impossible_timing_is_refused(change: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Timing(**change)
