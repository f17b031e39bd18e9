"""The back end with a process in RTAB-Map's place, which speaks its protocol and does what a script says."""

import gc
import json
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dotmask.errors import SlamError
from dotmask.geometry import inverse
from dotmask.interfaces import SlamBackend, WorksElsewhere
from dotmask.records import Intrinsics, LoopKind, MaskedDepth, PoseEstimate, RgbdFrame, SlamStatus
from dotmask.slam.rtabmap import backend
from dotmask.slam.rtabmap.backend import RtabmapSlam, read_graph
from dotmask.slam.rtabmap.protocol import COUNTS, LINK, NODE
from dotmask.slam.rtabmap.settings import BASE, RtabmapSettings
from dotmask.slam.rtabmap.worker import Libraries

CAMERA = Intrinsics(width=8, height=4, fx=10.0, fy=10.0, cx=3.5, cy=1.5)
START = np.eye(4)
START[:3, :3] = Rotation.from_euler("zyx", [0.3, -0.2, 1.1]).as_matrix()
START[:3, 3] = 1.0, -2.0, 0.5

STAND_IN = """
import json, mmap, os, sys, time
from dotmask.slam.rtabmap.protocol import *
job, script = json.loads(sys.argv[1]), json.loads(os.environ["SCRIPT"])
print("the stand-in begins", flush=True)
memory = mmap.mmap(job["memory_fd"], memory_size(job["width"], job["height"]))
offset = depth_offset(job["width"], job["height"])
seen = open(os.environ["SEEN"], "w")
while True:
    request = receive_request(job["requests_fd"])
    said = script[request.command.name].pop(0)
    first = [*memory[:3], *memory[offset:offset + 4]]
    print(json.dumps([request.command.name, request.frame_id, request.timestamp_s, first]), file=seen, flush=True)
    if said == "crash":
        os.kill(os.getpid(), 11)
    if said == "hang":
        time.sleep(600)
    if said == "garbage":
        os.write(job["replies_fd"], bytes(24))
        continue
    if said == "throw":
        answer, payload = Answer.FAILED, "no such thing".encode()
    elif said is None:
        answer, payload = Answer.NO_POSE, b""
    elif said == "done":
        answer, payload = Answer.DONE, b""
    elif request.command is Command.FINISH:
        answer, payload = Answer.GRAPH, bytes.fromhex(said)
    else:
        answer, payload = Answer.POSE, POSE.pack(*said)
    send_reply(job["replies_fd"], Reply(answer=answer, cpu_s=0.25, payload=payload))
"""


def moved(x: float, y: float = 0.0, turn: float = 0.0) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec([0, turn, 0]).as_matrix()
    T[:3, 3] = x, y, 0.0
    return T


def rows(T: np.ndarray) -> list[float]:
    """As RTAB-Map has them: single precision."""
    return [float(v) for v in T[:3].astype(np.float32).ravel()]


def graph(nodes: dict[int, np.ndarray], links: list[tuple[int, int, int, np.ndarray]] = []) -> bytes:  # noqa: B006
    return (
        COUNTS.pack(len(nodes), len(links))
        + b"".join(NODE.pack(node, *rows(T)) for node, T in nodes.items())
        + b"".join(LINK.pack(a, b, kind, *rows(T)) for a, b, kind, T in links)
    )


def frame(index: int, time_s: float | None = None) -> tuple[RgbdFrame, MaskedDepth]:
    rgb = np.zeros((4, 8, 3), np.uint8)
    rgb[..., 0], rgb[..., 2] = 200, index
    depth = np.full((4, 8), 2.0, np.float32)
    seen = RgbdFrame(
        index=index,
        timestamp_s=index / 10 if time_s is None else time_s,
        rgb=rgb,
        depth_m=depth,
        intrinsics=CAMERA,
    )
    return seen, MaskedDepth(mo_mdi_m=depth, mdi_m=np.zeros_like(depth))


class Stand:
    """A back end on a stand-in, and what that was asked."""

    def __init__(self, folder: Path, changes: dict[str, str], timeout_s: float) -> None:
        settings = RtabmapSettings(parameters={**BASE, **changes}, timeout_s=timeout_s)
        self.slam = RtabmapSlam(CAMERA, START, settings, folder / "a.db", folder / "a.log")
        self._seen = folder / "seen"

    def step(self, index: int) -> PoseEstimate:
        seen, masked = frame(index)
        estimate = self.slam.track(seen, masked)
        self.slam.update_map(seen, masked)
        return estimate

    @property
    def asked(self) -> list[list]:
        return [json.loads(line) for line in self._seen.read_text().splitlines()]


@pytest.fixture
def stand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def make(changes: dict[str, str] | None = None, timeout_s: float = 60.0, **script: list) -> Stand:
        monkeypatch.setattr(backend, "find_libraries", lambda: Libraries(core="core", bridge="bridge"))
        monkeypatch.setattr(backend, "worker_command", lambda job: [sys.executable, "-P", "-c", STAND_IN, job])
        monkeypatch.setenv("SCRIPT", json.dumps(script))
        monkeypatch.setenv("SEEN", str(tmp_path / "seen"))
        monkeypatch.setenv("TMPDIR", str(tmp_path))
        monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
        return Stand(tmp_path, changes or {}, timeout_s)

    return make


def test_it_is_a_back_end_that_works_elsewhere(stand) -> None:
    slam: SlamBackend = stand(TRACK=[rows(np.eye(4))]).slam
    assert isinstance(slam, WorksElsewhere)
    slam.track(*frame(0))
    assert slam.cpu_elsewhere_s == 0.25


def test_the_first_found_frame_is_at_the_start_and_the_rest_follow(stand) -> None:
    path = [moved(0), moved(0.1, 0.2, 0.3)]
    run = stand(TRACK=[None, rows(path[0]), rows(path[1])], MAP=[None])
    first, second, third = (run.step(i) for i in range(3))
    assert [e.status for e in (first, second, third)] == [
        SlamStatus.LOST, SlamStatus.INITIALISING, SlamStatus.TRACKED
    ]  # fmt: skip
    assert first.T_world_camera is None
    np.testing.assert_allclose(second.T_world_camera, START, atol=1e-7)
    np.testing.assert_allclose(third.T_world_camera, START @ path[1], atol=1e-6)
    assert third.inliers is None
    assert third.covariance is None


def test_the_process_sees_blue_first_and_the_depth_of_each_command(stand) -> None:
    run = stand(TRACK=[rows(np.eye(4))], MAP=[rows(np.eye(4))])
    run.step(5)
    two, nothing = list(np.float32(2.0).tobytes()), [0, 0, 0, 0]
    assert run.asked == [["TRACK", 1, 0.5, [5, 0, 200, *two]], ["MAP", 1, 0.5, [5, 0, 200, *nothing]]]


def test_the_map_gets_two_frames_a_second_and_none_while_lost(stand) -> None:
    run = stand(TRACK=[rows(np.eye(4))] * 3 + [None] * 3 + [rows(np.eye(4))] * 6, MAP=[rows(np.eye(4))] * 3)
    for index in range(12):
        run.step(index)
    assert [frame_id - 1 for command, frame_id, *_ in run.asked if command == "MAP"] == [0, 6, 11]


def test_found_again_in_the_same_map(stand) -> None:
    run = stand(TRACK=[rows(moved(0)), None, rows(moved(0.3)), rows(moved(0.4))], MAP=[None])
    statuses = [run.step(i).status for i in range(4)]
    assert statuses == [SlamStatus.INITIALISING, SlamStatus.LOST, SlamStatus.RELOCALISED, SlamStatus.TRACKED]


def test_a_new_odometry_has_no_pose_until_the_map_has_one_for_it(stand) -> None:
    """It starts at the identity, wherever that is; node 6 of the map says where."""
    every = {"Odom/ResetCountdown": "2", "Rtabmap/DetectionRate": "0"}
    restarted = [moved(0), moved(0.1), moved(0.2), moved(0.3)]
    T_map_odometry = moved(5.0, 1.0, 0.5)
    run = stand(
        every,
        TRACK=[rows(moved(0)), None, None, *map(rows, restarted)],
        MAP=[rows(moved(0)), None, rows(T_map_odometry @ restarted[1]), None, None],
        RESTART=["done"],
        FINISH=[
            graph(
                {1: moved(0), 5: T_map_odometry @ restarted[1], 7: moved(0, 3.0) @ T_map_odometry @ restarted[3]},
                [(5, 1, 1, inverse(T_map_odometry @ restarted[1]))],
            ).hex()
        ],
    )
    estimates = [run.step(i) for i in range(7)]
    assert [e.status.value for e in estimates] == [
        "initialising", "lost", "lost", "lost", "lost", "relocalised", "tracked"
    ]  # fmt: skip
    for estimate, T in zip(estimates[5:], restarted[2:], strict=True):
        np.testing.assert_allclose(estimate.T_world_camera, START @ T_map_odometry @ T, atol=1e-5)
    commands = [command for command, *_ in run.asked]
    assert commands == ["TRACK", "MAP", "TRACK", "TRACK", "RESTART", *["TRACK", "MAP"] * 4]
    result = run.slam.finish()
    np.testing.assert_allclose(result.trajectory.timestamps_s, [0.0, 0.3, 0.4, 0.5, 0.6])
    np.testing.assert_allclose(result.trajectory.T_world_camera[1], START @ T_map_odometry, atol=1e-5)
    # Frame 5 (id 6) is as near to node 5 as to node 7; the earlier one places it, and the corrected one frame 6.
    np.testing.assert_allclose(result.trajectory.T_world_camera[3], START @ T_map_odometry @ restarted[2], atol=1e-5)
    np.testing.assert_allclose(
        result.trajectory.T_world_camera[4], START @ moved(0, 3.0) @ T_map_odometry @ restarted[3], atol=1e-5
    )
    assert [(loop.from_index, loop.to_index, loop.kind) for loop in result.loops] == [(4, 0, LoopKind.GLOBAL)]


def test_a_new_odometry_has_as_many_frames_to_begin_as_the_first(stand) -> None:
    run = stand(
        {"Odom/ResetCountdown": "2"},
        TRACK=[rows(moved(0)), *[None] * 5],
        MAP=[rows(moved(0))],
        RESTART=["done", "done"],
    )
    for index in range(6):
        run.step(index)
    assert [command[0] for command, *_ in run.asked] == list("TMTTRTTRT")


def test_without_a_map_to_come_back_to_odometry_does_not_start_anew(stand) -> None:
    """The first node of a new odometry would be the first of all, and say that the camera is back at the start."""
    run = stand(
        {"Odom/ResetCountdown": "2", "Rtabmap/DetectionRate": "0"},
        TRACK=[rows(moved(0)), *[None] * 5, rows(moved(0.7))],
        MAP=[None, rows(moved(0.7))],
    )
    estimates = [run.step(index) for index in range(7)]
    assert [estimate.status.value for estimate in estimates] == ["initialising", *["lost"] * 5, "relocalised"]
    np.testing.assert_allclose(estimates[-1].T_world_camera, START @ moved(0.7), atol=1e-6)


def test_an_odometry_that_was_never_joined_has_no_optimised_poses(stand) -> None:
    run = stand(
        {"Odom/ResetCountdown": "1"},
        TRACK=[rows(moved(0)), None, rows(moved(0)), rows(moved(0.1))],
        MAP=[rows(moved(0))],
        RESTART=["done"],
        FINISH=[graph({1: moved(0)}).hex()],
    )
    assert [run.step(i).status.value for i in range(4)] == ["initialising", "lost", "lost", "lost"]
    np.testing.assert_array_equal(run.slam.finish().trajectory.timestamps_s, [0.0])


def test_without_a_node_the_odometry_stands(stand) -> None:
    run = stand(TRACK=[rows(moved(0)), rows(moved(0.1))], MAP=[None], FINISH=[graph({}).hex()])
    for index in range(2):
        run.step(index)
    result = run.slam.finish()
    np.testing.assert_allclose(result.trajectory.T_world_camera[1], START @ moved(0.1), atol=1e-6)
    assert result.loops == ()


def test_links_become_loops_from_the_later_node_each_pair_once() -> None:
    T_1_4 = moved(0.5, 0.1, 0.2)
    nodes = {node: moved(node) for node in (1, 2, 3, 4)}
    links = [
        (1, 2, 0, moved(1)),  # neighbours
        (1, 4, 1, T_1_4), (4, 1, 1, inverse(T_1_4)),
        (2, 3, 3, moved(1)), (4, 2, 2, moved(-2)),
        (3, 3, 1, moved(0)), (9, 1, 1, moved(0)), (3, 1, 4, moved(0)),  # itself, no node, a link that a user made
    ]  # fmt: skip
    loops = read_graph(graph(nodes, links)).loops
    assert [loop[:3] for loop in loops] == [
        (3, 2, LoopKind.PROXIMITY), (4, 1, LoopKind.GLOBAL), (4, 2, LoopKind.PROXIMITY)
    ]  # fmt: skip
    np.testing.assert_allclose(loops[1][3], inverse(T_1_4), atol=1e-6)
    np.testing.assert_allclose(loops[0][3], moved(-1), atol=1e-6)


def failure(run: Stand, index: int = 1) -> str:
    with pytest.raises(SlamError) as caught:
        run.step(index)
    text = str(caught.value)
    assert "\n" not in text
    log = Path(text.rpartition(" ")[2])
    assert log.read_text().startswith("the stand-in begins"), "the log is kept"
    return text


@pytest.mark.parametrize(
    ("said", "says"),
    [
        ("crash", "ended during track of frame 2 (SIGSEGV)"),
        ("garbage", "ended during track of frame 2 (its pipe closed)"),
        ("throw", "failed during track of frame 2: no such thing"),
    ],
)
def test_a_process_that_fails_is_an_error_in_one_line(
    stand, said: str, says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(backend, "_SHUTDOWN_S", 0.2)
    run = stand(TRACK=[rows(moved(0)), said], MAP=[None])
    run.step(0)
    assert f"RTAB-Map's process {says}" in failure(run)


def test_a_process_that_hangs_is_ended(stand) -> None:
    run = stand(TRACK=[rows(moved(0)), "hang"], MAP=[None], timeout_s=0.5)
    run.slam._worker._timeout_s = 60.0  # to start takes its time
    run.step(0)
    run.slam._worker._timeout_s = 0.5
    pid = run.slam._worker._process.pid
    assert "has not answered for 0.5 s during track of frame 2" in failure(run)
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


def test_after_the_end_nothing_is_sent(stand) -> None:
    """The numbers of its pipes may be somebody else's files by now."""
    run = stand(TRACK=[rows(moved(0))], MAP=[None], FINISH=[graph({}).hex()])
    run.step(0)
    run.slam.finish()
    for again in (run.slam.finish, lambda: run.step(1)):
        with pytest.raises(SlamError, match="has ended"):
            again()


def test_a_process_that_was_killed_between_frames(stand) -> None:
    run = stand(TRACK=[rows(moved(0))], MAP=[None])
    run.step(0)
    os.kill(run.slam._worker._process.pid, signal.SIGKILL)
    assert "ended during track of frame 2 (SIGKILL)" in failure(run)


def test_the_process_ends_with_the_back_end(stand) -> None:
    run = stand(TRACK=[rows(moved(0))], MAP=[None])
    run.step(0)
    pid = run.slam._worker._process.pid
    del run.slam
    gc.collect()
    deadline = time.monotonic() + 30
    while Path(f"/proc/{pid}").exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not Path(f"/proc/{pid}").exists()


def test_wrong_frames_are_refused_before_they_are_sent(stand) -> None:
    run = stand(TRACK=[rows(moved(0))], MAP=[None])
    run.step(3)
    seen, masked = frame(4, time_s=0.3)
    with pytest.raises(ValueError, match=r"frame 4: time 0\.3 is not after 0\.3"):
        run.slam.track(seen, masked)
    with pytest.raises(ValueError, match="only the frame that was tracked last"):
        run.slam.update_map(*frame(3))
    small = MaskedDepth(mo_mdi_m=np.zeros((2, 2), np.float32), mdi_m=np.zeros((2, 2), np.float32))
    with pytest.raises(ValueError, match="masked depth"):
        run.slam.track(frame(4)[0], small)
    assert len(run.asked) == 2


def test_a_database_that_exists_is_not_gone_on_with(stand, tmp_path: Path) -> None:
    (tmp_path / "a.db").touch()
    with pytest.raises(SlamError, match=r"a\.db exists already"):
        stand()
