"""What the back end and RTAB-Map's process say to each other, over real pipes."""

import os
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest

from dotmask.slam.rtabmap.protocol import (
    ANSWER,
    MAGIC,
    REQUEST,
    Answer,
    ClosedError,
    Command,
    LateError,
    Reply,
    Request,
    depth_offset,
    memory_size,
    receive_reply,
    receive_request,
    send_reply,
    send_request,
)


@pytest.fixture
def pipe() -> Iterator[list[int]]:
    ends = list(os.pipe())
    yield ends
    for fd in ends:
        if fd >= 0:
            os.close(fd)


def test_a_request_arrives_as_it_was_sent(pipe: list[int]) -> None:
    for command in Command:
        sent = Request(command=command, frame_id=7, timestamp_s=1341846314.694)
        send_request(pipe[1], sent)
        assert receive_request(pipe[0]) == sent


def test_the_layout_is_fixed() -> None:
    assert (REQUEST.size, ANSWER.size) == (24, 24)
    packed = REQUEST.pack(MAGIC, Command.TRACK, 258, 0.5)
    assert packed == b"DMT1" + b"\1\0\0\0" + b"\2\1\0\0\0\0\0\0" + b"\0\0\0\0\0\0\xe0\x3f"


def test_an_answer_larger_than_a_pipe_arrives_whole(pipe: list[int]) -> None:
    sent = Reply(answer=Answer.GRAPH, cpu_s=0.25, payload=np.arange(200_000, dtype="<u4").tobytes())
    sender = threading.Thread(target=send_reply, args=(pipe[1], sent))
    sender.start()
    assert receive_reply(pipe[0], 10.0) == sent
    sender.join()


def test_half_an_answer_and_the_end_is_the_end(pipe: list[int]) -> None:
    os.write(pipe[1], ANSWER.pack(MAGIC, Answer.POSE, 0.0, 96) + b"half of it")
    os.close(pipe[1])
    pipe[1] = -1
    with pytest.raises(ClosedError):
        receive_reply(pipe[0], 10.0)


def test_nobody_reads(pipe: list[int]) -> None:
    os.close(pipe[0])
    pipe[0] = -1
    with pytest.raises(ClosedError):
        send_request(pipe[1], Request(command=Command.FINISH))


@pytest.mark.parametrize("beginning", [b"", ANSWER.pack(MAGIC, Answer.POSE, 0.0, 96)], ids=["nothing", "a header"])
def test_a_late_answer_is_not_waited_for(pipe: list[int], beginning: bytes) -> None:
    os.write(pipe[1], beginning)
    start = time.monotonic()
    with pytest.raises(LateError):
        receive_reply(pipe[0], 0.05)
    assert time.monotonic() - start < 5


def test_other_bytes_are_neither_request_nor_answer(pipe: list[int]) -> None:
    os.write(pipe[1], bytes(REQUEST.size))
    with pytest.raises(ValueError, match="not a request"):
        receive_request(pipe[0])
    os.write(pipe[1], bytes(ANSWER.size))
    with pytest.raises(ValueError, match="not an answer"):
        receive_reply(pipe[0], 1.0)
    os.write(pipe[1], REQUEST.pack(MAGIC, 99, 0, 0.0))
    with pytest.raises(ValueError, match="99"):
        receive_request(pipe[0])


def test_colour_and_depth_do_not_overlap_and_fill_the_memory() -> None:
    for width, height in ((640, 480), (321, 7), (1, 1)):
        begin = depth_offset(width, height)
        assert 3 * width * height <= begin < 3 * width * height + 64
        assert begin % 64 == 0
        assert memory_size(width, height) == begin + 4 * width * height
