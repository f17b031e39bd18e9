import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dotmask.atomic_file import write_atomically
from dotmask.errors import SequenceFolderError, TrajectoryFileError
from dotmask.partial_folder import GrowingFiles, PartialFolder
from dotmask.records import Intrinsics, RgbdFrame, Trajectory
from dotmask.timestamps import nearest_pairs
from dotmask.tum import (
    MAX_DEPTH_M,
    PUBLISHED,
    RecordedCamera,
    TumSequenceWriter,
    find_camera,
    format_trajectory,
    read_camera,
    read_sequence,
    read_trajectory,
    write_trajectory,
)

CAMERA = Intrinsics(width=8, height=6, fx=7.5, fy=7.25, cx=3.5, cy=2.5)


def random_trajectory(seed: int, count: int) -> Trajectory:
    rng = np.random.default_rng(seed)
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, :3] = Rotation.random(count, rng=rng).as_matrix()
    poses[:, :3, 3] = rng.normal(0, 10, (count, 3))
    return Trajectory(timestamps_s=1341846313.6 + np.cumsum(rng.uniform(1e-3, 1, count)), T_world_camera=poses)


def frame(index: int, rng: np.random.Generator) -> RgbdFrame:
    depth = (rng.integers(0, 30000, (6, 8)) / 5000).astype(np.float32)
    return RgbdFrame(
        index=index,
        timestamp_s=1000 + index / 30,
        rgb=rng.integers(0, 256, (6, 8, 3), dtype=np.uint8),
        depth_m=depth,
        intrinsics=CAMERA,
    )


def write_example(folder: Path, count: int = 3) -> list[RgbdFrame]:
    rng = np.random.default_rng(0)
    frames = [frame(k, rng) for k in range(count)]
    poses = random_trajectory(1, count).T_world_camera
    growing = PartialFolder.create(folder, {})
    writer = TumSequenceWriter(growing.files, CAMERA)
    writer.begin()
    for one, pose in zip(frames, poses, strict=True):
        writer.write(one, pose)
    growing.finish()
    return frames


FIRST = "rgb/1000.000000.png"


def flipped(data: bytes) -> bytes:
    """One bit in the middle changed."""
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :]


def lines(text: str) -> str:
    return text.replace("|", "\n")


def test_trajectory_comes_back_as_written(tmp_path):
    trajectory = random_trajectory(0, 50)
    write_trajectory(tmp_path / "t.txt", trajectory)
    back = read_trajectory(tmp_path / "t.txt")
    np.testing.assert_array_equal(back.timestamps_s, trajectory.timestamps_s)
    np.testing.assert_array_equal(back.T_world_camera[:, :3, 3], trajectory.T_world_camera[:, :3, 3])
    np.testing.assert_allclose(back.T_world_camera, trajectory.T_world_camera, atol=1e-14)


def test_columns_are_those_of_the_benchmark(tmp_path):
    # A quarter turn about x: quaternion (sin 45°, 0, 0, cos 45°), w last.
    (tmp_path / "t.txt").write_text("# comment\n\n1.5 1 2 3 0.7071068 0 0 0.7071068\n2.5,4,5,6,0,0,0,2\n")
    back = read_trajectory(tmp_path / "t.txt")
    assert back.timestamps_s.tolist() == [1.5, 2.5]
    assert back.T_world_camera[0, :3, 3].tolist() == [1, 2, 3]
    np.testing.assert_allclose(back.T_world_camera[0, :3, :3] @ [0, 1, 0], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(back.T_world_camera[1, :3, :3], np.eye(3), atol=1e-12)


def test_empty_trajectory_both_ways(tmp_path):
    empty = Trajectory(timestamps_s=np.zeros(0), T_world_camera=np.zeros((0, 4, 4)))
    write_trajectory(tmp_path / "t.txt", empty)
    assert len(read_trajectory(tmp_path / "t.txt")) == 0


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("0 1 2 3 0 0 0 1|# x|1 2 3", "t.txt:3: expected 8 columns"),
        ("0 1 2 3 0 0 0 1 9", "t.txt:1: expected 8 columns"),
        ("0 1 2 three 0 0 0 1", "t.txt:1: 'three' is not a number"),
        ("0 1 2 nan 0 0 0 1", "t.txt:1: 'nan' is not finite"),
        ("0 1 2 inf 0 0 0 1", "t.txt:1: 'inf' is not finite"),
        ("1 1 2 3 0 0 0 1|0.5 1 2 3 0 0 0 1", "t.txt:2: time 0.5 is not later"),
        ("1 1 2 3 0 0 0 1|1 1 2 3 0 0 0 1", "t.txt:2: time 1.0 is not later"),
        ("1 1 2 3 0 0 0 0", "t.txt:1: quaternion of norm 0"),
    ],
)
def test_broken_trajectory_is_named_with_its_line(tmp_path, content, message):
    (tmp_path / "t.txt").write_text(lines(content))
    with pytest.raises(TrajectoryFileError, match=message):
        read_trajectory(tmp_path / "t.txt")


def test_missing_or_binary_trajectory(tmp_path):
    with pytest.raises(TrajectoryFileError, match="no such file"):
        read_trajectory(tmp_path / "none.txt")
    (tmp_path / "t.txt").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(TrajectoryFileError, match="cannot be read as text"):
        read_trajectory(tmp_path / "t.txt")
    with pytest.raises(TrajectoryFileError, match="cannot be read as text"):
        read_trajectory(tmp_path)


def test_atomic_write_keeps_the_old_file_when_it_fails(tmp_path, monkeypatch):
    target = tmp_path / "a.txt"
    write_atomically(target, "old ü\n")
    assert target.read_bytes() == "old ü\n".encode()

    def no_space(path: Path, data: bytes) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", no_space)
    with pytest.raises(OSError, match="No space"):
        write_atomically(target, b"new")
    monkeypatch.undo()
    assert target.read_text() == "old ü\n"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]
    write_atomically(target, b"new")
    assert target.read_bytes() == b"new"


def test_sequence_comes_back_as_written(tmp_path):
    frames = write_example(tmp_path / "seq")
    back = list(read_sequence(tmp_path / "seq"))
    assert len(back) == len(frames)
    for one, other in zip(frames, back, strict=True):
        assert other.index == one.index
        assert other.timestamp_s == pytest.approx(one.timestamp_s, abs=5e-7)
        assert other.intrinsics == CAMERA
        np.testing.assert_array_equal(other.rgb, one.rgb)
        np.testing.assert_allclose(other.depth_m, one.depth_m, atol=1e-6)
    truth = read_trajectory(tmp_path / "seq" / "groundtruth.txt")
    assert truth.timestamps_s.tolist() == [one.timestamp_s for one in frames]
    np.testing.assert_allclose(truth.T_world_camera, random_trajectory(1, 3).T_world_camera, atol=1e-14)


def test_sequence_files_are_those_of_the_benchmark(tmp_path):
    frames = write_example(tmp_path / "seq", 1)
    root = tmp_path / "seq"
    assert sorted(p.relative_to(root).as_posix() for p in root.rglob("*") if p.is_file()) == [
        "associations.txt",
        "camera.json",
        "depth.txt",
        "depth/1000.000000.png",
        "groundtruth.txt",
        "rgb.txt",
        "rgb/1000.000000.png",
    ]
    assert (root / "rgb.txt").read_text().splitlines()[-1] == "1000.000000 rgb/1000.000000.png"
    associated = "1000.000000 rgb/1000.000000.png 1000.000000 depth/1000.000000.png\n"
    assert (root / "associations.txt").read_text() == associated
    stored = cv2.imread(str(root / "depth/1000.000000.png"), cv2.IMREAD_UNCHANGED)
    assert stored.dtype == np.uint16
    np.testing.assert_array_equal(stored, np.rint(frames[0].depth_m.astype(np.float64) * 5000))
    bgr = cv2.imread(str(root / "rgb/1000.000000.png"))
    np.testing.assert_array_equal(bgr[..., ::-1], frames[0].rgb)


def test_depth_beyond_sixteen_bits_is_no_return(tmp_path):
    depth = np.full((6, 8), 13.2, np.float32)
    depth[0, 0] = MAX_DEPTH_M - 0.001
    far = RgbdFrame(index=0, timestamp_s=0.0, rgb=np.zeros((6, 8, 3), np.uint8), depth_m=depth, intrinsics=CAMERA)
    folder = PartialFolder.create(tmp_path / "seq", {})
    writer = TumSequenceWriter(folder.files, CAMERA)
    writer.begin()
    writer.write(far)
    folder.finish()
    (back,) = read_sequence(tmp_path / "seq")
    assert back.depth_m[0, 0] == pytest.approx(13.106, abs=1e-4)
    assert np.count_nonzero(back.depth_m) == 1
    assert len(read_trajectory(tmp_path / "seq" / "groundtruth.txt")) == 0


def test_writer_refuses_frames_that_do_not_fit(tmp_path):
    rng = np.random.default_rng(0)
    writer = TumSequenceWriter(GrowingFiles(tmp_path), CAMERA)
    writer.write(frame(1, rng))
    with pytest.raises(ValueError, match="not later"):
        writer.write(frame(1, rng))
    with pytest.raises(ValueError, match="not finite"):
        writer.write(frame(2, rng), np.full((4, 4), np.nan))
    other = Intrinsics(width=8, height=6, fx=1.0, fy=1.0, cx=0.0, cy=0.0)
    with pytest.raises(ValueError, match="intrinsics are not those"):
        TumSequenceWriter(GrowingFiles(tmp_path), other).write(frame(2, rng))


def test_reader_pairs_the_nearest_stamps(tmp_path):
    write_example(tmp_path / "seq")
    root = tmp_path / "seq"
    names = [line.split() for line in (root / "depth.txt").read_text().splitlines()[1:]]
    # Depth 10 ms late; the last one 30 ms, so that its colour image has no partner.
    late = [f"{float(t) + (0.03 if k == 2 else 0.01):.6f} {name}" for k, (t, name) in enumerate(names)]
    (root / "depth.txt").write_text("\n".join(late))
    assert [round(one.timestamp_s - 1000, 3) for one in read_sequence(root)] == [0.0, 0.033]


def test_reader_takes_intrinsics_where_the_folder_has_none(tmp_path):
    write_example(tmp_path / "seq")
    assert read_camera(tmp_path / "seq" / "camera.json").intrinsics == CAMERA
    (tmp_path / "seq" / "camera.json").unlink()
    with pytest.raises(SequenceFolderError, match="give --camera fr1, fr2, fr3 or --intrinsics FILE"):
        read_sequence(tmp_path / "seq")
    other = Intrinsics(width=8, height=6, fx=1.0, fy=1.0, cx=0.0, cy=0.0)
    given = RecordedCamera(intrinsics=other, source="mine")
    assert read_sequence(tmp_path / "seq", given).frame(0).intrinsics == other
    with pytest.raises(SequenceFolderError, match=r"8 x 6 pixels, camera fr3 has 640 x 480"):
        read_sequence(tmp_path / "seq", PUBLISHED["fr3"]).frame(0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda root: (root / "rgb.txt").unlink(), "rgb.txt: no such file"),
        (lambda root: (root / "rgb.txt").write_text("1.0\n"), "rgb.txt:1: expected 2 columns"),
        (lambda root: (root / "rgb.txt").write_text(f"5.0 {FIRST}\n"), "no colour and depth image within 0.02 s"),
        (lambda root: (root / "rgb.txt").write_text("# empty\n"), "rgb.txt: lists no image"),
        (lambda root: (root / FIRST).unlink(), f"rgb.txt:2: .*{FIRST} does not exist"),
        (
            lambda root: (root / "rgb.txt").write_text(f"2 {FIRST}\n1 {FIRST}\n"),
            "rgb.txt:2: time 1 is before 2.0+; sort",
        ),
        (lambda root: (root / "rgb.txt").write_text(f"2 {FIRST}\n2 {FIRST}\n"), "rgb.txt:2: time 2 stands there twice"),
        (lambda root: (root / "depth.txt").write_text("2 ../seq/depth.txt\n"), "depth.txt:1: ../seq.* leads out of"),
        (
            lambda root: (root / "depth.txt").write_text(f"2 {root}/{FIRST}\n"),
            "depth.txt:1: .* leads out of the folder",
        ),
        (lambda root: (root / FIRST).write_bytes(b""), f"{FIRST}: is not a PNG image"),
        (lambda root: (root / FIRST).write_bytes((root / FIRST).read_bytes()[:-20]), f"{FIRST}: is cut off"),
        (lambda root: (root / FIRST).write_bytes(flipped((root / FIRST).read_bytes())), f"{FIRST}: is damaged"),
        (
            lambda root: cv2.imwrite(str(root / FIRST), np.zeros((5, 8, 3), np.uint8)),
            "depth/.* is 8 x 6 pixels, .* is 8 x 5",
        ),
        (lambda root: (root / "groundtruth.txt").write_text("7 0 0 0 0 0 0 1\n"), "groundtruth.txt: no pose within"),
        (lambda root: (root / "depth/1000.000000.png").write_bytes(b"no"), "is not a PNG image"),
        (lambda root: cv2.imwrite(str(root / "depth/1000.000000.png"), np.zeros((6, 8), np.uint8)), "16 bits"),
        (lambda root: cv2.imwrite(str(root / "rgb/1000.000000.png"), np.zeros((6, 8), np.uint8)), "8 bits"),
        (lambda root: (root / "camera.json").write_text("[]"), "camera.json: cannot be read"),
        (lambda root: (root / "camera.json").write_text("{}"), "camera.json: cannot be read"),
    ],
)
def test_broken_sequence_is_named(tmp_path, change, message):
    write_example(tmp_path / "seq")
    change(tmp_path / "seq")
    with pytest.raises(SequenceFolderError, match=message):
        read_sequence(tmp_path / "seq").frame(0)


def test_other_depth_scale_is_refused(tmp_path):
    write_example(tmp_path / "seq")
    path = tmp_path / "seq" / "camera.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "depth_per_metre": 1000}))
    with pytest.raises(SequenceFolderError, match="depth_per_metre is 1000"):
        read_sequence(tmp_path / "seq")
    with pytest.raises(SequenceFolderError, match="no such folder"):
        read_sequence(tmp_path / "none")


def test_camera_is_known_by_name_by_file_and_by_the_folder(tmp_path):
    for name, wanted in (
        ("rgbd_dataset_freiburg3_walking_xyz", "fr3"),
        ("rgbd_dataset_freiburg1_desk2", "fr1"),
        ("fr2_desk", "fr2"),
        ("my-FR3", "fr3"),
    ):
        assert find_camera(tmp_path / name) == PUBLISHED[wanted]
    for name in ("fr30", "walking", "afr3", "freiburg4_xyz"):
        with pytest.raises(SequenceFolderError, match=r"neither camera\.json nor the name of the folder"):
            find_camera(tmp_path / name)
    assert find_camera(tmp_path / "fr1_desk", "fr2") == PUBLISHED["fr2"]
    with pytest.raises(SequenceFolderError, match="unknown camera 'fr4'; known: fr1, fr2, fr3"):
        find_camera(tmp_path, "fr4")
    with pytest.raises(SequenceFolderError, match="not both"):
        find_camera(tmp_path, "fr3", tmp_path / "camera.json")
    (tmp_path / "mine.json").write_text('{"width": 8, "height": 6, "fx": 1, "fy": 2, "cx": 3, "cy": 4}')
    assert find_camera(tmp_path / "fr1_desk", file=tmp_path / "mine.json").intrinsics.fy == 2.0
    with pytest.raises(SequenceFolderError, match=r"none\.json: no such file"):
        read_camera(tmp_path / "none.json")
    (tmp_path / "mine.json").write_text('{"width": 8, "height": 6, "fx": 1, "fy": 2, "cx": 3, "cy": NaN}')
    with pytest.raises(SequenceFolderError, match="not finite"):
        read_camera(tmp_path / "mine.json")


def test_a_straight_line_in_the_world_is_straight_after_the_lens(tmp_path):
    # Where the lens of fr1 shows each point of a plane, by the formula of Brown and Conrady, not by OpenCV.
    camera = PUBLISHED["fr1"]
    k1, k2, p1, p2, k3 = camera.distortion
    K = camera.intrinsics
    v, u = np.mgrid[0:480, 0:640].astype(float)
    # The plane is dark left of x = x_line and bright right of it; the lens is inverted by iteration.
    xd, yd = (u - K.cx) / K.fx, (v - K.cy) / K.fy
    x, y = xd.copy(), yd.copy()
    for _ in range(50):
        r2 = x * x + y * y
        radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
        x = (xd - 2 * p1 * x * y - p2 * (r2 + 2 * x * x)) / radial
        y = (yd - p1 * (r2 + 2 * y * y) - 2 * p2 * x * y) / radial
    x_line = 0.42
    bright = x > x_line
    rgb = np.repeat((255 * bright).astype(np.uint8)[..., None], 3, axis=2)
    depth_m = np.where(bright, 2.0, 1.0).astype(np.float32)
    folder = PartialFolder.create(tmp_path / "fr1", {})
    writer = TumSequenceWriter(folder.files, K)
    writer.begin()
    writer.write(RgbdFrame(index=0, timestamp_s=0.0, rgb=rgb, depth_m=depth_m, intrinsics=K))
    folder.finish()
    straight = read_sequence(tmp_path / "fr1", camera).frame(0)
    wanted = K.fx * x_line + K.cx
    rows = slice(60, 420)
    edges = np.argmax(straight.rgb[rows, :, 0] > 127, axis=1)
    assert np.abs(edges - wanted).max() < 1.5
    bent = np.argmax(rgb[rows, :, 0] > 127, axis=1)
    assert np.abs(bent - wanted).max() > 3, "without the correction the line is bent"
    assert set(np.unique(straight.depth_m)) <= {0.0, 1.0, 2.0}, "depths are not mixed"


def test_a_sequence_begins_with_its_first_true_pose_and_notes_what_is_odd(tmp_path):
    write_example(tmp_path / "seq", 6)
    root = tmp_path / "seq"
    truth = (root / "groundtruth.txt").read_text().splitlines()
    (root / "groundtruth.txt").write_text("\n".join([truth[0], *truth[3:5], truth[6]]))
    sequence = read_sequence(root)
    assert len(sequence) == 4
    assert sequence.frame(0).index == 0
    assert sequence.frame(0).timestamp_s == pytest.approx(1000 + 2 / 30, abs=1e-6)
    assert [pose is None for pose in sequence.true_poses] == [False, False, True, False]
    np.testing.assert_allclose(sequence.true_poses[0], random_trajectory(1, 6).T_world_camera[2], atol=1e-14)
    assert "the first 2 frames are left out" in sequence.notes[0]
    assert "1 of 4 frames have no true pose" in sequence.notes[1]
    (root / "groundtruth.txt").unlink()
    assert read_sequence(root).true_poses == (None,) * 6
    assert read_sequence(root).notes == ()


def test_long_gaps_are_noted(tmp_path):
    write_example(tmp_path / "seq", 4)
    root = tmp_path / "seq"
    (root / "groundtruth.txt").unlink()
    for name in ("rgb", "depth"):
        rows = [line.split() for line in (root / f"{name}.txt").read_text().splitlines()[1:]]
        shifted = [f"{float(t) + (k >= 1) * 2 + (k >= 3) * 1.5:.6f} {file}" for k, (t, file) in enumerate(rows)]
        (root / f"{name}.txt").write_text("\n".join(shifted))
    (note,) = read_sequence(root).notes
    assert "no frame for 2.0 s after 1000.000000, and 1 more gaps over 1 s" in note


def test_file_has_a_header_and_positive_w():
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec([0, 0, -3.0]).as_matrix()
    text = format_trajectory(Trajectory(timestamps_s=np.array([0.0]), T_world_camera=T[None]))
    header, line = text.splitlines()
    assert header == "# timestamp tx ty tz qx qy qz qw"
    assert float(line.split()[-1]) > 0


@pytest.mark.parametrize(
    ("a", "b", "wanted"),
    [
        ([0.0, 1.0, 2.0], [0.01, 1.99], [(0, 0), (2, 1)]),
        ([0.0], [-0.015, 0.01], [(0, 1)]),
        ([0.0, 0.03], [0.013], [(0, 0)]),
        # 0.005 takes 0.006; then 0.015 could only have 0.0, which would cross.
        ([0.005, 0.015], [0.0, 0.006], [(0, 1)]),
        ([], [1.0], []),
        ([0.0], [0.03], []),
    ],
)
def test_nearest_pairs(a, b, wanted):
    assert [tuple(pair) for pair in nearest_pairs(np.array(a), np.array(b), 0.02).tolist()] == wanted
