"""The process that owns RTAB-Map: it loads the wheel's library and the bridge, and does what the pipe says.

A crash in there ends this process and not the one that runs the method. Started by `backend` and `library` as
`python -m dotmask.slam.rtabmap.worker JSON`; it imports nothing heavy. Output and errors go where the starter wants.
"""

import ctypes
import json
import mmap
import sys
import time
from dataclasses import asdict, dataclass
from typing import Any

from dotmask.slam.rtabmap.protocol import (
    COUNTS,
    LINK,
    NODE,
    POSE,
    Answer,
    ClosedError,
    Command,
    Reply,
    Request,
    depth_offset,
    memory_size,
    receive_request,
    send_reply,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Libraries:
    """Paths of the wheel's core library and of the compiled bridge."""

    core: str
    bridge: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """All that a worker has to know.

    Attributes:
        libraries: see Libraries.
        database: path of the map's database, which does not exist yet.
        parameters: RTAB-Map's, by name.
        width: of the images.
        height: of the images.
        fx: focal length, pixels, as the next three.
        fy: focal length.
        cx: principal point.
        cy: principal point.
        requests_fd: pipe to read requests from.
        replies_fd: pipe to write answers to.
        memory_fd: the shared memory.
    """

    libraries: Libraries
    database: str
    parameters: dict[str, str]
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    requests_fd: int
    replies_fd: int
    memory_fd: int

    def to_json(self) -> str:
        """The argument that the worker is started with."""
        return json.dumps(asdict(self))


def _load(libraries: Libraries) -> ctypes.CDLL:
    """The bridge, its symbols resolved by the wheel's library."""
    ctypes.CDLL(libraries.core, mode=ctypes.RTLD_GLOBAL)
    bridge = ctypes.CDLL(libraries.bridge)
    pointer, text, integer, double = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_double
    signatures: dict[str, tuple[Any, list[Any]]] = {
        "bridge_failure": (text, []),
        "bridge_parameters": (text, []),
        "bridge_open": (pointer, [pointer, text, integer, integer, *[double] * 4]),
        "bridge_track": (integer, [pointer, integer, double, *[pointer] * 3]),
        "bridge_map": (integer, [pointer, integer, double, *[pointer] * 3]),
        "bridge_restart": (integer, [pointer]),
        "bridge_finish": (integer, [pointer, pointer, pointer]),
        "bridge_graph": (None, [pointer, pointer, pointer]),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(bridge, name)
        function.restype, function.argtypes = result, arguments
    return bridge


class _FailedError(Exception):
    """RTAB-Map threw."""


class _Engine:
    """The bridge behind Python values."""

    def __init__(self, job: Job) -> None:
        self._bridge = _load(job.libraries)
        self._memory = mmap.mmap(job.memory_fd, memory_size(job.width, job.height))
        self._colour = ctypes.addressof(ctypes.c_char.from_buffer(self._memory))
        self._depth = self._colour + depth_offset(job.width, job.height)
        words = [word.encode() for item in job.parameters.items() for word in item]
        self._handle = self._bridge.bridge_open(
            (ctypes.c_char_p * (len(words) + 1))(*words, None),
            job.database.encode(),
            job.width,
            job.height,
            job.fx,
            job.fy,
            job.cx,
            job.cy,
        )
        if not self._handle:
            raise _FailedError(self._said())

    def do(self, request: Request) -> tuple[Answer, bytes]:
        """Carry out a request."""
        match request.command:
            case Command.TRACK:
                return self._pose(self._bridge.bridge_track, request)
            case Command.MAP:
                return self._pose(self._bridge.bridge_map, request)
            case Command.RESTART:
                self._checked(self._bridge.bridge_restart(self._handle))
                return Answer.DONE, b""
            case Command.FINISH:
                return Answer.GRAPH, self._graph()

    def _pose(self, function: Any, request: Request) -> tuple[Answer, bytes]:
        pose = ctypes.create_string_buffer(POSE.size)
        status = function(self._handle, request.frame_id, request.timestamp_s, self._colour, self._depth, pose)
        return (Answer.POSE, pose.raw) if self._checked(status) else (Answer.NO_POSE, b"")

    def _graph(self) -> bytes:
        nodes, links = ctypes.c_int(), ctypes.c_int()
        self._checked(self._bridge.bridge_finish(self._handle, ctypes.byref(nodes), ctypes.byref(links)))
        node_rows = ctypes.create_string_buffer(NODE.size * nodes.value)
        link_rows = ctypes.create_string_buffer(LINK.size * links.value)
        self._bridge.bridge_graph(self._handle, node_rows, link_rows)
        return COUNTS.pack(nodes.value, links.value) + node_rows.raw + link_rows.raw

    def _checked(self, status: int) -> int:
        if status < 0:
            raise _FailedError(self._said())
        return status

    def _said(self) -> str:
        return str(self._bridge.bridge_failure().decode(errors="replace"))


def serve(job: Job) -> None:
    """Do what the requests say until the graph was told, something failed, or nobody asks any more."""
    try:
        engine, request = None, None
        while request is None or request.command is not Command.FINISH:
            request = receive_request(job.requests_fd)
            start = time.process_time()
            try:
                engine = engine or _Engine(job)
                answer, payload = engine.do(request)
            except (_FailedError, OSError, AttributeError) as error:  # the last two: a library that cannot be loaded
                send_reply(job.replies_fd, Reply(answer=Answer.FAILED, cpu_s=0.0, payload=str(error).encode()))
                return
            reply = Reply(answer=answer, cpu_s=time.process_time() - start, payload=payload)
            send_reply(job.replies_fd, reply)
    except ClosedError:
        return


def main() -> None:
    """Serve a Job, or list RTAB-Map's parameters where only Libraries are given."""
    words = json.loads(sys.argv[1])
    if "core" in words:
        sys.stdout.write(_load(Libraries(**words)).bridge_parameters().decode())
    else:
        serve(Job(**{**words, "libraries": Libraries(**words["libraries"])}))


if __name__ == "__main__":
    main()
