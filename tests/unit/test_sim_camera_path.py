"""Camera paths: the benchmark's speeds, purity, and replay of recordings."""

import numpy as np
import pytest

from sim.camera_paths.hand_held import HALFSPHERE_RADIUS_M, HalfspherePath, RpyPath, StaticPath, XyzPath
from sim.camera_paths.recorded import RecordedPath, Recording, read_recorded
from sim.errors import CameraPathError
from sim.geometry import look_at, pose, rotation_z

NOMINAL = look_at((0, -2.2, 1.4), (0, 1.2, 0.92))
# metres and degrees per second that the benchmark's page states for fr3/walking_*
TUM = {StaticPath: (0.012, 1.4), XyzPath: (0.208, 5.5), RpyPath: (0.091, 20.9), HalfspherePath: (0.221, 18.3)}
PATHS = list(TUM)


def mean_speeds(path, duration_s=28.0, step_s=1 / 30):
    """Mean m/s and deg/s between frames."""
    poses = np.array([path.pose_at(t) for t in np.arange(0.0, duration_s, step_s)])
    metres = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    turns = np.einsum("nji,njk->nik", poses[:-1, :3, :3], poses[1:, :3, :3])
    # The sine from the antisymmetric part: the trace alone has no precision at small angles.
    sine = np.linalg.norm(
        [turns[:, 2, 1] - turns[:, 1, 2], turns[:, 0, 2] - turns[:, 2, 0], turns[:, 1, 0] - turns[:, 0, 1]], axis=0
    )
    return metres.mean() / step_s, np.rad2deg(np.arcsin(sine / 2)).mean() / step_s


@pytest.mark.parametrize("seed", [0, 1, 7])
@pytest.mark.parametrize("kind", PATHS)
def test_mean_speeds_are_those_of_the_benchmark(kind, seed):
    assert mean_speeds(kind(T_world_camera=NOMINAL, seed=seed)) == pytest.approx(TUM[kind], rel=0.15)


@pytest.mark.parametrize("factor", [0.5, 2.0, 3.7])
@pytest.mark.parametrize("kind", PATHS)
def test_speed_is_the_same_path_in_less_time(kind, factor):
    once, faster = kind(T_world_camera=NOMINAL), kind(T_world_camera=NOMINAL, speed=factor)
    for time_s in (0.0, 0.37, 5.1, 27.9):
        assert np.array_equal(faster.pose_at(time_s), once.pose_at(factor * time_s))


@pytest.mark.parametrize("kind", PATHS)
def test_path_is_smooth(kind):
    """Halving the step quarters the second difference: two derivatives exist everywhere that is looked at."""
    path = kind(T_world_camera=NOMINAL, seed=3)

    def second(t, h):
        return (path.pose_at(t + h) - 2 * path.pose_at(t) + path.pose_at(t - h)) / h**2

    for t in np.linspace(0.1, 20, 60):
        assert second(t, 2e-3) == pytest.approx(second(t, 1e-3), abs=0.02)


@pytest.mark.parametrize("kind", PATHS)
def test_amplitude_zero_is_a_tripod(kind):
    path = kind(T_world_camera=NOMINAL, amplitude=0.0)
    for t in (0.0, 1.3, 9.0):
        assert path.pose_at(t) == pytest.approx(NOMINAL, abs=1e-12)


@pytest.mark.parametrize("kind", PATHS)
def test_path_stays_near_its_nominal_pose(kind):
    path = kind(T_world_camera=NOMINAL)
    for t in np.arange(0.0, 60.0, 0.2):
        T = path.pose_at(t)
        assert np.abs(T[:3, 3] - NOMINAL[:3, 3]).max() < 0.62
        assert T[:3, 2] @ NOMINAL[:3, 2] > 0.5


@pytest.mark.parametrize("kind", PATHS)
def test_seeds_differ_and_repeat(kind):
    first, again, other = (kind(T_world_camera=NOMINAL, seed=s) for s in (0, 0, 1))
    assert np.array_equal(first.pose_at(2.2), again.pose_at(2.2))
    assert not np.array_equal(first.pose_at(2.2), other.pose_at(2.2))


def test_xyz_uses_all_three_axes_and_keeps_its_orientation():
    path = XyzPath(T_world_camera=NOMINAL)
    poses = np.array([path.pose_at(t) for t in np.arange(0.0, 28.0, 0.1)])
    local = (poses[:, :3, 3] - NOMINAL[:3, 3]) @ NOMINAL[:3, :3]
    assert (np.ptp(local, axis=0) > 0.5).all()
    assert (poses[:, :3, 2] @ NOMINAL[:3, 2]).min() > np.cos(np.deg2rad(14))


def test_rpy_turns_about_all_three_axes():
    path = RpyPath(T_world_camera=NOMINAL)
    turns = np.array([NOMINAL[:3, :3].T @ path.pose_at(t)[:3, :3] for t in np.arange(0.0, 28.0, 0.1)])
    assert np.rad2deg(np.ptp(turns[:, 0, 2])) > 30  # to the sides
    assert np.rad2deg(np.ptp(turns[:, 1, 2])) > 20  # up and down
    assert np.rad2deg(np.ptp(turns[:, 1, 0])) > 30  # about the viewing direction


def test_halfsphere_is_on_a_half_sphere_and_looks_inside():
    path = HalfspherePath(T_world_camera=NOMINAL)
    centre = NOMINAL[:3, 3] + HALFSPHERE_RADIUS_M * NOMINAL[:3, 2]
    for t in np.arange(0.0, 60.0, 0.3):
        T = path.pose_at(t)
        to_centre = centre - T[:3, 3]
        assert np.linalg.norm(to_centre) == pytest.approx(HALFSPHERE_RADIUS_M, abs=0.045)
        assert to_centre @ NOMINAL[:3, 2] > 0  # the half before the centre
        assert to_centre / np.linalg.norm(to_centre) @ T[:3, 2] > 0.9


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"speed": 0.0}, "speed factor must be above 0"),
        ({"speed": float("nan")}, "speed factor must be above 0"),
        ({"amplitude": -1.0}, "amplitude must be 0 or more"),
        ({"T_world_camera": np.eye(3)}, "4x4"),
        ({"T_world_camera": 2 * np.eye(4)}, "rotation"),
    ],
)
def test_synthetic_path_refuses_nonsense(change, message):
    with pytest.raises(CameraPathError, match=message):
        XyzPath(**({"T_world_camera": NOMINAL} | change))


GOOD = "# comment\n10.0 1 2 3 0 0 0 1\n\n10.5 2 2 3 0 0 0 2 # half\n11.5 2 4 3 0 0 0 -1\n"


@pytest.fixture
def trajectory(tmp_path):
    def write(text):
        path = tmp_path / "t.txt"
        path.write_text(text)
        return path

    return write


def test_reads_the_tum_format(trajectory):
    recording = read_recorded(trajectory(GOOD))
    assert recording.times_s.tolist() == [10.0, 10.5, 11.5]
    assert recording.p_world.tolist() == [[1, 2, 3], [2, 2, 3], [2, 4, 3]]
    assert recording.q_world_xyzw.tolist() == [[0, 0, 0, 1], [0, 0, 0, 1], [0, 0, 0, -1]]
    assert recording.duration_s == 1.5


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 2 3\n", r"t\.txt, line 1: expected 8 columns .* got 3"),
        (GOOD + "12 0 0 0 0 0 0 1 9\n", r"line 6: expected 8 columns .* got 9"),
        (GOOD + "12 0 nan 0 0 0 0 1\n", "line 6: a value is not finite"),
        (GOOD + "inf 0 0 0 0 0 0 1\n", "line 6: a value is not finite"),
        (GOOD + "12 0 zero 0 0 0 0 1\n", "line 6: could not convert"),
        (GOOD + "11 0 0 0 0 0 0 1\n", r"line 6: time 11\.0 does not come after 11\.5"),
        (GOOD + "11.5 0 0 0 0 0 0 1\n", r"line 6: time 11\.5 does not come after 11\.5"),
        (GOOD + "12 0 0 0 0 0 0 0\n", "line 6: the quaternion is zero"),
        ("# nothing\n", r"t\.txt: a trajectory needs at least 2 poses, got 0"),
        ("1 0 0 0 0 0 0 1\n", "at least 2 poses, got 1"),
    ],
)
def test_bad_lines_are_named(trajectory, text, message):
    with pytest.raises(CameraPathError, match=message):
        read_recorded(trajectory(text))


def test_missing_and_unreadable_files_are_named(tmp_path):
    with pytest.raises(CameraPathError, match=r"none\.txt: cannot be read"):
        read_recorded(tmp_path / "none.txt")
    (tmp_path / "b.txt").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(CameraPathError, match=r"b\.txt: cannot be read"):
        read_recorded(tmp_path / "b.txt")


def recording_of(poses, times):
    """A recording of (n, 4, 4) poses through an independent quaternion conversion (scipy)."""
    from scipy.spatial.transform import Rotation

    poses = np.asarray(poses)
    return Recording(
        times_s=np.asarray(times, float),
        p_world=poses[:, :3, 3],
        q_world_xyzw=Rotation.from_matrix(poses[:, :3, :3]).as_quat(),
    )


def test_replay_gives_the_recorded_poses_and_the_middle_between_them():
    poses = [look_at((0, 0, 1), (1, 0, 1)), look_at((1, 0, 2), (1, 1, 2))]
    path = RecordedPath(recording=recording_of(poses, [5.0, 7.0]), T_world_recording=np.eye(4))
    assert path.duration_s == 2.0
    assert path.pose_at(0.0) == pytest.approx(poses[0])
    assert path.pose_at(2.0) == pytest.approx(poses[1])
    assert path.pose_at(1.0) == pytest.approx(look_at((0.5, 0, 1.5), (1.5, 1, 1.5)))  # 45 degrees between


def test_replay_is_placed_by_a_turn_about_the_vertical_and_a_shift():
    poses = [
        look_at((3, 4, 1), (3.3, 5, 0.9)),
        look_at((3.5, 4, 1.4), (3.6, 5, 1.2)),
        look_at((4, 4.1, 1.2), (3.8, 5, 1.3)),
    ]
    recording = recording_of(poses, [0.0, 1.0, 2.0])
    path = RecordedPath.placed(recording, position_world=(0, -2.2, 1.4), heading_rad=np.deg2rad(30))
    placed = np.array([path.pose_at(t) for t in (0.0, 1.0, 2.0)])
    assert placed[:, :3, 3].mean(axis=0) == pytest.approx([0, -2.2, 1.4])
    look = placed[:, :3, 2].mean(axis=0)
    assert np.rad2deg(np.arctan2(look[1], look[0])) == pytest.approx(30)
    T = path.T_world_recording
    assert T[:3, :3] @ [0, 0, 1] == pytest.approx([0, 0, 1])
    assert np.linalg.inv(placed[0]) @ placed[2] == pytest.approx(np.linalg.inv(poses[0]) @ poses[2])


def test_replay_at_another_speed_and_its_end():
    recording = recording_of([look_at((0, 0, 1), (1, 0, 1)), look_at((1, 0, 1), (2, 0, 1))], [0.0, 3.0])
    path = RecordedPath.placed(recording, position_world=(0, 0, 1), heading_rad=0.0, speed=2.0)
    assert path.duration_s == 1.5
    assert path.pose_at(0.75)[:3, 3] == pytest.approx([0, 0, 1])
    for time_s in (-0.1, 1.6):
        with pytest.raises(CameraPathError, match=r"outside the recording of 1\.500 s at speed 2"):
            path.pose_at(time_s)


def test_replay_without_a_heading_is_refused():
    down = pose(np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]]), (0, 0, 2))
    with pytest.raises(CameraPathError, match="straight up or down"):
        RecordedPath.placed(recording_of([down, down], [0, 1]), position_world=(0, 0, 1), heading_rad=0.0)


def test_smoothing_takes_noise_and_leaves_motion():
    rng = np.random.default_rng(0)
    times = np.arange(0, 10, 0.01)
    clean = np.stack([0.4 * np.sin(0.6 * times), 0.3 * np.cos(0.5 * times), 1.4 + 0 * times], axis=1)
    poses = [pose(rotation_z(0.3 * np.sin(t)), p) for t, p in zip(times, clean, strict=True)]
    exact = recording_of(poses, times)
    noisy = Recording(
        times_s=times, p_world=clean + 0.001 * rng.normal(size=clean.shape), q_world_xyzw=exact.q_world_xyzw
    )
    smooth = noisy.smoothed(0.05)
    inner = slice(50, -50)
    assert np.abs(smooth.p_world - clean)[inner].std() < 0.35 * np.abs(noisy.p_world - clean)[inner].std()
    assert np.abs(smooth.q_world_xyzw - exact.q_world_xyzw)[inner].max() < 1e-3
    with pytest.raises(CameraPathError, match="smoothing must be above 0"):
        noisy.smoothed(0.0)
