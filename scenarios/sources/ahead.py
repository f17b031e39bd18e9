"""Making frames in a second thread, a few ahead of who uses them."""

import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Generic, TypeVar

from sim.records import SimFrame
from sim.simulator import Simulator

FRAMES_AHEAD = 3
"""Frames made ahead of the methods: enough to keep both cores busy, few enough to keep memory flat."""

F = TypeVar("F")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Timed(Generic[F]):
    """A frame and the wall time that making it took."""

    frame: F
    seconds: float


def made_ahead(make: Callable[[int], F], indices: range, frames_ahead: int = FRAMES_AHEAD) -> Iterator[Timed[F]]:
    """What `make` gives for each index, in order, made by a second thread a few frames ahead of the consumer.

    Args:
        make: a frame by its index.
        indices: which.
        frames_ahead: how many; with 0 each is made when it is asked for, and there is no second thread.
    """

    def timed(index: int) -> Timed[F]:
        start = time.perf_counter()
        frame = make(index)
        return Timed(frame=frame, seconds=time.perf_counter() - start)

    if frames_ahead == 0:
        yield from map(timed, indices)
        return
    pending: deque[Future[Timed[F]]] = deque()
    with ThreadPoolExecutor(max_workers=1, thread_name_prefix="frames") as pool:
        try:
            for index in indices:
                pending.append(pool.submit(timed, index))
                if len(pending) > frames_ahead:
                    yield pending.popleft().result()
            while pending:
                yield pending.popleft().result()
        finally:
            for future in pending:
                future.cancel()


def rendered_ahead(simulator: Simulator, first: int = 0) -> Iterator[Timed[SimFrame]]:
    """The simulator's frames from `first` on."""
    return made_ahead(simulator.frame, range(first, len(simulator)))
