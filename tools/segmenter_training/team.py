"""Processes that learn together: each from its share of a batch, all with the mean of their gradients.

The network is small: much of a step is spent between its layers, on one core. Two processes with one thread each learn
nearly twice as fast as one process with two threads.
"""

import os
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import parent_process
from multiprocessing.synchronize import Barrier
from typing import Any

import torch
from torch import Tensor

from tools.segmenter_training.errors import TrainingError

LONGEST_WAIT_S = 120.0
"""A process that waits longer for the others gives up: one of them is gone."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Team:
    """One of the processes.

    Attributes:
        rank: 0 is the one that was started by the user.
        shared: (processes, values) float32, in memory that all of them see.
        barrier: passed by all at once.
    """

    rank: int
    shared: Tensor
    barrier: Barrier

    def __len__(self) -> int:
        """How many processes there are."""
        return len(self.shared)

    def wait(self) -> None:
        """Until all are here.

        Raises:
            TrainingError: another one has failed.
        """
        try:
            self.barrier.wait(LONGEST_WAIT_S)
        except threading.BrokenBarrierError as error:
            raise TrainingError("a process of the training has ended; run the same command again") from error

    def average(self, tensors: Sequence[Tensor]) -> None:
        """Replace the tensors by their mean over all processes; to the last bit the same in each of them."""
        if len(self) == 1:
            return
        flat = torch.cat([tensor.reshape(-1) for tensor in tensors])
        self.shared[self.rank, : len(flat)] = flat
        self.wait()
        mean = self.shared[:, : len(flat)].mean(dim=0)
        self.wait()
        for tensor, part in zip(tensors, mean.split([tensor.numel() for tensor in tensors]), strict=True):
            tensor.copy_(part.view(tensor.shape))


@contextmanager
def team(count: int, values: int, help_out: Callable[..., None], *args: Any) -> Iterator[Team]:
    """The team of this process, with rank 0, while the others call `help_out(team, *args)`.

    Args:
        count: of processes.
        values: that are averaged at most.
        help_out: what the others do, a function of a module.
        args: of it.
    """
    context = torch.multiprocessing.get_context("spawn")
    shared = torch.zeros((count, values if count > 1 else 0)).share_memory_()
    barrier = context.Barrier(count)
    helpers = [
        context.Process(target=_helping, args=(Team(rank=rank, shared=shared, barrier=barrier), help_out, args))
        for rank in range(1, count)
    ]
    for helper in helpers:
        helper.daemon = True
        helper.start()
    try:
        yield Team(rank=0, shared=shared, barrier=barrier)
    except BaseException:
        barrier.abort()
        raise
    finally:
        for helper in helpers:
            helper.join()


def _helping(mine: Team, help_out: Callable[..., None], args: tuple[Any, ...]) -> None:
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with suppress(KeyboardInterrupt, TrainingError):  # the first process says so
        try:
            help_out(mine, *args)
        except BaseException:
            mine.barrier.abort()
            raise


def _end_with_parent() -> None:
    """A first process that was killed cannot say that there is nothing left to do."""
    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
