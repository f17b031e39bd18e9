"""RTAB-Map behind the `SlamBackend` interface.

Source: Labbé & Michaud 2019, "RTAB-Map as an open-source lidar and visual SLAM library" (BSD-3-Clause).
"""

import mmap
import os
import signal
import subprocess
import tempfile
import weakref
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from dotmask.errors import SlamError
from dotmask.geometry import inverse
from dotmask.records import (
    FloatArray,
    Intrinsics,
    LoopClosure,
    LoopKind,
    MaskedDepth,
    PoseEstimate,
    RgbdFrame,
    SlamResult,
    SlamStatus,
    Trajectory,
    checked_pose,
)
from dotmask.slam.frame_check import check_next_frame
from dotmask.slam.rtabmap.library import find_libraries, worker_command, worker_environment
from dotmask.slam.rtabmap.protocol import (
    COUNTS,
    LINK,
    NODE,
    POSE,
    Answer,
    ClosedError,
    Command,
    LateError,
    Reply,
    Request,
    depth_offset,
    memory_size,
    receive_reply,
    send_request,
)
from dotmask.slam.rtabmap.settings import RtabmapSettings
from dotmask.slam.rtabmap.worker import Job

LINK_KINDS = {1: LoopKind.GLOBAL, 2: LoopKind.PROXIMITY, 3: LoopKind.PROXIMITY}
"""RTAB-Map's types of links that close a loop: global, proximity in space, proximity in time."""

_SHUTDOWN_S = 10.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Tracked:
    """A frame that odometry found, in the frame of the odometry that found it.

    Attributes:
        index: of the frame.
        timestamp_s: of the frame.
        session: how often odometry had started anew.
        T_odometry_camera: (4, 4).
    """

    index: int
    timestamp_s: float
    session: int
    T_odometry_camera: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Graph:
    """RTAB-Map's optimised graph.

    Attributes:
        nodes: `T_map_camera` (4, 4) by id of the node, rising.
        loops: links that close a loop: from, to, kind, T_from_to (4, 4), each pair of nodes once, from the later one.
    """

    nodes: dict[int, FloatArray]
    loops: tuple[tuple[int, int, LoopKind, FloatArray], ...]


class RtabmapSlam:
    """A `SlamBackend` that is RTAB-Map 0.21: frame-to-map odometry, a map of nodes, loop closure, a pose graph.

    It runs in a process of its own, which ends with this object. It is not deterministic: two runs on the same frames
    differ. Inliers and covariance are not told.

    Odometry that stays lost starts anew after `settings.restart_after` frames. Where it starts is unknown, so frames
    stay `LOST` until a loop closure has joined the new map to the old one; the next frame is `RELOCALISED`.

    Args:
        intrinsics: of all frames.
        initial_T_world_camera: (4, 4) pose of the camera at the first frame that odometry finds; it ties the map to the
            world.
        settings: RTAB-Map's parameters.
        database: file for RTAB-Map's database, in an existing folder; it must not exist. Its tools read it.
        log: file for what RTAB-Map says.

    Raises:
        SlamError: it cannot run here; the message says why and what to do.
        ValueError: the initial pose is no rigid transform.
    """

    def __init__(
        self,
        intrinsics: Intrinsics,
        initial_T_world_camera: FloatArray,
        settings: RtabmapSettings,
        database: Path,
        log: Path,
    ) -> None:
        start = checked_pose(initial_T_world_camera, "initial_T_world_camera")
        if database.exists():
            raise SlamError(f"{database} exists already; RTAB-Map would go on with that map: remove it")
        self._camera, self._settings = intrinsics, settings
        # The map's frame is that of the first odometry, which starts at the first frame that it finds.
        self._T_world_map = start
        self._T_map_odometry: FloatArray | None = np.eye(4)
        self._worker = _Worker(intrinsics, settings, database, log)
        self._tracked: dict[int, _Tracked] = {}
        self._last: RgbdFrame | None = None
        self._frame_id, self._session, self._lost, self._just_joined = 0, 0, 0, False
        self._mapped_s: float | None = None
        self._has_node = False

    @property
    def cpu_elsewhere_s(self) -> float:
        """CPU time that RTAB-Map's process has spent on what it was asked for, seconds."""
        return self._worker.cpu_s

    def track(self, frame: RgbdFrame, masked: MaskedDepth) -> PoseEstimate:
        """Pose of the camera at `frame`, by RTAB-Map's odometry on MO-MDI.

        `INITIALISING` with the initial pose on the first frame that odometry finds, `TRACKED`, `LOST` without a pose,
        or `RELOCALISED` on the first frame with a pose after a lost one.

        Raises:
            ValueError: the frame has other intrinsics, the masked depth another size, or the time does not rise.
            SlamError: RTAB-Map has failed, ended, or does not answer.
        """
        check_next_frame(frame, masked, self._camera, None if self._last is None else self._last.timestamp_s)
        self._last, self._frame_id = frame, self._frame_id + 1
        # Without a node there is no map to come back to, and the next odometry's would pass for it.
        if self._has_node and 0 < self._settings.restart_after <= self._lost:
            self._worker.ask(Request(command=Command.RESTART))
            self._session, self._lost, self._T_map_odometry = self._session + 1, 0, None
        self._worker.show(frame.rgb, masked.mo_mdi_m)
        reply = self._worker.ask(self._request(Command.TRACK, frame))
        if reply.answer is Answer.NO_POSE:
            self._lost += 1
            return self._estimate(None, SlamStatus.LOST)
        status = self._status()
        self._lost = 0
        T_odometry_camera = _pose(POSE.unpack(reply.payload))
        self._tracked[self._frame_id] = _Tracked(
            index=frame.index,
            timestamp_s=frame.timestamp_s,
            session=self._session,
            T_odometry_camera=T_odometry_camera,
        )
        if self._T_map_odometry is None:
            return self._estimate(None, SlamStatus.LOST)
        self._just_joined = False
        return self._estimate(self._T_world_map @ self._T_map_odometry @ T_odometry_camera, status)

    def _status(self) -> SlamStatus:
        """Of the frame that odometry has just found, if it has a pose in the world."""
        if not self._tracked:
            return SlamStatus.INITIALISING
        return SlamStatus.RELOCALISED if self._lost or self._just_joined else SlamStatus.TRACKED

    def update_map(self, frame: RgbdFrame, masked: MaskedDepth) -> None:
        """Hand MDI to RTAB-Map when a node is due; nothing happens while odometry is lost.

        Raises:
            ValueError: it is not the frame that was tracked last.
            SlamError: RTAB-Map has failed, ended, or does not answer.
        """
        if frame is not self._last:
            raise ValueError(f"frame {frame.index}: only the frame that was tracked last can be mapped")
        tracked = self._tracked.get(self._frame_id)
        if tracked is None or not self._is_due(frame.timestamp_s):
            return
        self._mapped_s = frame.timestamp_s
        self._worker.show(None, masked.mdi_m)
        reply = self._worker.ask(self._request(Command.MAP, frame))
        if reply.answer is Answer.NO_POSE:
            return
        self._has_node = True
        if self._T_map_odometry is None:
            self._T_map_odometry = _pose(POSE.unpack(reply.payload)) @ inverse(tracked.T_odometry_camera)
            self._just_joined = True

    def finish(self) -> SlamResult:
        """The optimised poses of all frames that odometry found and that the map can place, and the loops in it.

        A frame between nodes is placed by odometry from the nearest node. Frames of an odometry that was never joined
        to the map have no pose. The process ends.

        Raises:
            SlamError: RTAB-Map has failed, ended, or does not answer.
        """
        graph = read_graph(self._worker.ask(Request(command=Command.FINISH)).payload)
        self._worker.close()
        return SlamResult(
            trajectory=Trajectory.from_poses(self._placed(graph)),
            loops=tuple(
                LoopClosure(
                    from_index=self._tracked[later].index,
                    to_index=self._tracked[earlier].index,
                    T_from_to=T_from_to,
                    kind=kind,
                )
                for later, earlier, kind, T_from_to in graph.loops
            ),
        )

    def _placed(self, graph: Graph) -> list[tuple[float, FloatArray]]:
        """Stamps and `T_world_camera` of all frames that can be placed, in the order of time."""
        nodes: dict[int, list[int]] = {}
        for node in graph.nodes:
            nodes.setdefault(self._tracked[node].session, []).append(node)
        placed = []
        for frame_id, frame in self._tracked.items():
            if frame.session in nodes:
                node = _nearest(nodes[frame.session], frame_id)
                T_node_frame = inverse(self._tracked[node].T_odometry_camera) @ frame.T_odometry_camera
                placed.append((frame.timestamp_s, self._T_world_map @ graph.nodes[node] @ T_node_frame))
            elif frame.session == 0:  # no node, no correction: the first odometry's frame is the map's
                placed.append((frame.timestamp_s, self._T_world_map @ frame.T_odometry_camera))
        return placed

    def _request(self, command: Command, frame: RgbdFrame) -> Request:
        return Request(command=command, frame_id=self._frame_id, timestamp_s=frame.timestamp_s)

    def _estimate(self, T_world_camera: FloatArray | None, status: SlamStatus) -> PoseEstimate:
        assert self._last is not None
        time_s = self._last.timestamp_s
        return PoseEstimate(timestamp_s=time_s, T_world_camera=T_world_camera, status=status, inliers=None)

    def _is_due(self, time_s: float) -> bool:
        # Stamps are rounded; a node that is a microsecond early is not a frame late.
        return self._mapped_s is None or time_s - self._mapped_s >= self._settings.mapping_period_s - 1e-6


def read_graph(payload: bytes) -> Graph:
    """The graph in the bytes that follow `Answer.GRAPH`."""
    node_count, link_count = COUNTS.unpack_from(payload)
    begin = COUNTS.size + node_count * NODE.size
    nodes = {int(row[0]): _pose(row[1:]) for row in NODE.iter_unpack(payload[COUNTS.size : begin])}
    loops = {}
    for start, end, kind, *values in LINK.iter_unpack(payload[begin : begin + link_count * LINK.size]):
        if int(kind) not in LINK_KINDS or start == end:
            continue
        T_from_to = _pose(values)
        pair = (int(start), int(end)) if start > end else (int(end), int(start))
        loops[pair] = (*pair, LINK_KINDS[int(kind)], T_from_to if start > end else inverse(T_from_to))
    return Graph(
        nodes=dict(sorted(nodes.items())),
        loops=tuple(loops[pair] for pair in sorted(loops) if pair[0] in nodes and pair[1] in nodes),
    )


def _nearest(nodes: list[int], frame_id: int) -> int:
    """The node nearest to a frame; of two as near, the earlier one."""
    return min(nodes, key=lambda node: (abs(node - frame_id), node))


def _pose(values: tuple[float, ...] | list[float]) -> FloatArray:
    """(4, 4) of the rows of [R | t]; R, of single precision, is made a rotation."""
    T = np.eye(4)
    T[:3] = np.array(values).reshape(3, 4)
    T[:3, :3] = Rotation.from_matrix(T[:3, :3]).as_matrix()
    return T


class _Worker:
    """RTAB-Map's process as the back end sees it: images in, answers out."""

    def __init__(self, camera: Intrinsics, settings: RtabmapSettings, database: Path, log: Path) -> None:
        libraries = find_libraries()
        self._log, self._timeout_s, self.cpu_s = log, settings.timeout_s, 0.0
        size = memory_size(camera.width, camera.height)
        memory_fd = os.memfd_create("dotmask-rtabmap")
        os.ftruncate(memory_fd, size)
        memory = mmap.mmap(memory_fd, size)
        shape = camera.height, camera.width
        self._bgr = np.ndarray((*shape, 3), np.uint8, memory)
        self._depth_m = np.ndarray(shape, np.float32, memory, depth_offset(camera.width, camera.height))
        requests_fd, self._requests_fd = os.pipe()
        self._replies_fd, replies_fd = os.pipe()
        theirs = requests_fd, replies_fd, memory_fd
        job = Job(
            libraries=libraries,
            database=str(database),
            parameters=settings.handed_over,
            width=camera.width,
            height=camera.height,
            fx=camera.fx,
            fy=camera.fy,
            cx=camera.cx,
            cy=camera.cy,
            requests_fd=requests_fd,
            replies_fd=replies_fd,
            memory_fd=memory_fd,
        )
        try:
            with log.open("wb") as output:
                self._process = subprocess.Popen(
                    worker_command(job.to_json()),
                    env=worker_environment(),
                    stdin=subprocess.DEVNULL,
                    stdout=output,
                    stderr=subprocess.STDOUT,
                    pass_fds=theirs,
                    start_new_session=True,  # an interrupt is for us; we end the worker
                )
        finally:
            for fd in theirs:
                os.close(fd)
        self.close = weakref.finalize(self, _end, self._process, self._requests_fd, self._replies_fd)

    def show(self, rgb: np.ndarray | None, depth_m: np.ndarray) -> None:
        """Put an image where the worker sees it; the colour stays as it is with None."""
        if rgb is not None:
            cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR, dst=self._bgr)
        self._depth_m[:] = depth_m

    def ask(self, request: Request) -> Reply:
        """Have a command done."""
        if not self.close.alive:
            raise SlamError("RTAB-Map's process has ended; make another back end")
        doing = f"{request.command.name.lower()} of frame {request.frame_id}" if request.frame_id else "its work"
        try:
            send_request(self._requests_fd, request)
            reply = receive_reply(self._replies_fd, self._timeout_s)
        except LateError:
            raise self._failed(f"has not answered for {self._timeout_s:g} s during {doing}") from None
        except (ClosedError, ValueError):
            raise self._failed(f"ended during {doing} ({self._how_it_ended()})") from None
        if reply.answer is Answer.FAILED:
            raise self._failed(f"failed during {doing}: {reply.payload.decode(errors='replace')}")
        self.cpu_s += reply.cpu_s
        return reply

    def _how_it_ended(self) -> str:
        try:
            code = self._process.wait(_SHUTDOWN_S)
        except subprocess.TimeoutExpired:
            return "its pipe closed"
        return signal.Signals(-code).name if code < 0 else f"exit code {code}"

    def _failed(self, what: str) -> SlamError:
        """The error, with the log kept where it outlives a run folder that is taken back."""
        self.close()
        with tempfile.NamedTemporaryFile(prefix="dotmask-rtabmap-", suffix=".log", delete=False) as kept:
            kept.write(self._log.read_bytes() if self._log.is_file() else b"")
        return SlamError(f"RTAB-Map's process {what}; its log is {kept.name}")


def _end(process: "subprocess.Popen[bytes]", requests_fd: int, replies_fd: int) -> None:
    """End the worker: one that has nothing to do ends by itself when its pipe closes."""
    os.close(requests_fd)
    os.close(replies_fd)
    try:
        process.wait(0.0 if process.poll() is not None else 1.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait(_SHUTDOWN_S)
