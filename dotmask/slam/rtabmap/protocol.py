"""What the back end and its worker say to each other: messages of fixed layout over two pipes, images in shared memory.

The back end writes a request and waits for the answer. A request is `REQUEST`: magic, command, id of the frame, stamp.
An answer is `ANSWER`: magic, kind, CPU seconds that the command took, size of what follows; then that many bytes. All
numbers are little-endian. What `Answer` says of the bytes is all that they can be.

The shared memory holds one image: colour (H, W, 3) uint8, blue first, and from `depth_offset` on depth (H, W)
float32 in metres. Whose turn it is to touch it follows from the messages.
"""

import os
import select
import struct
import time
from dataclasses import dataclass
from enum import IntEnum

MAGIC = 0x31544D44
REQUEST = struct.Struct("<IIqd")
ANSWER = struct.Struct("<IIdQ")
POSE = struct.Struct("<12d")
COUNTS = struct.Struct("<II")
NODE = struct.Struct("<13d")
LINK = struct.Struct("<15d")
_ALIGNMENT = 64


class Command(IntEnum):
    """What the worker is asked for."""

    TRACK = 1
    """Odometry with the image in the shared memory."""
    MAP = 2
    """A node of the map from the image tracked last, with the depth in the shared memory."""
    RESTART = 3
    """Start odometry anew, anywhere."""
    FINISH = 4
    """Close the database and tell the graph; the worker ends."""


class Answer(IntEnum):
    """What the worker answers, and the bytes that follow."""

    POSE = 1
    """`POSE`: the rows of [R | t], points of the camera into the odometry's or the map's frame."""
    NO_POSE = 2
    """Lost, or not a node of the map. Nothing follows."""
    DONE = 3
    """Nothing follows."""
    GRAPH = 4
    """`COUNTS`: numbers of nodes and links; a `NODE` each: id, pose; a `LINK` each: from, to, type, pose."""
    FAILED = 5
    """RTAB-Map threw. What it said, in UTF-8."""


class ClosedError(Exception):
    """The other side has closed its pipe."""


class LateError(Exception):
    """The other side has not answered in time."""


def depth_offset(width: int, height: int) -> int:
    """Where depth begins in the shared memory, bytes."""
    return -(-3 * width * height // _ALIGNMENT) * _ALIGNMENT


def memory_size(width: int, height: int) -> int:
    """Bytes of shared memory for one image."""
    return depth_offset(width, height) + 4 * width * height


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """A command and the frame that it is about (0 where none is)."""

    command: Command
    frame_id: int = 0
    timestamp_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """An answer.

    Attributes:
        answer: its kind.
        cpu_s: CPU time that the command took.
        payload: the bytes that `Answer` describes.
    """

    answer: Answer
    cpu_s: float
    payload: bytes


def send_request(fd: int, request: Request) -> None:
    """Write a request.

    Raises:
        ClosedError: nobody reads.
    """
    _write(fd, REQUEST.pack(MAGIC, request.command, request.frame_id, request.timestamp_s))


def receive_request(fd: int) -> Request:
    """Wait for a request.

    Raises:
        ClosedError: the other side has ended.
        ValueError: these bytes are no request.
    """
    magic, command, frame_id, timestamp_s = REQUEST.unpack(_read(fd, REQUEST.size, None))
    if magic != MAGIC:
        raise ValueError("not a request")
    return Request(command=Command(command), frame_id=frame_id, timestamp_s=timestamp_s)


def send_reply(fd: int, reply: Reply) -> None:
    """Write an answer.

    Raises:
        ClosedError: nobody reads.
    """
    _write(fd, ANSWER.pack(MAGIC, reply.answer, reply.cpu_s, len(reply.payload)) + reply.payload)


def receive_reply(fd: int, timeout_s: float) -> Reply:
    """Wait for an answer.

    Raises:
        ClosedError: the other side has ended.
        LateError: it has not answered after `timeout_s`.
        ValueError: these bytes are no answer.
    """
    deadline = time.monotonic() + timeout_s
    magic, answer, cpu_s, size = ANSWER.unpack(_read(fd, ANSWER.size, deadline))
    if magic != MAGIC:
        raise ValueError("not an answer")
    return Reply(answer=Answer(answer), cpu_s=cpu_s, payload=_read(fd, size, deadline))


def _write(fd: int, data: bytes) -> None:
    view = memoryview(data)
    try:
        while view:
            view = view[os.write(fd, view) :]
    except BrokenPipeError as error:
        raise ClosedError from error


def _read(fd: int, size: int, deadline: float | None) -> bytes:
    """Exactly `size` bytes. `deadline` is in the time of `time.monotonic`; None waits for ever."""
    parts = bytearray()
    while len(parts) < size:
        if deadline is not None:
            left_s = max(0.0, deadline - time.monotonic())
            if not select.select([fd], [], [], left_s)[0]:
                raise LateError
        part = os.read(fd, size - len(parts))
        if not part:
            raise ClosedError
        parts += part
    return bytes(parts)
