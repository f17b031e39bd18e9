"""Where the cells of a sweep run: in processes of this machine, or on a Ray cluster.

Both take a function and cells, and give each cell with what the function made of it, in the order in which they are
done. A cell whose process dies is a failed cell. When the consumer stops early, what still runs is stopped.
"""

import _thread
import logging
import multiprocessing
import os
import signal
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import cast

from scenarios.errors import ScenarioError
from scenarios.sweep.cells import Cell, Done, failed

Work = Callable[[Cell], Done]
Executed = Generator[tuple[Cell, Done], None, None]

ONE_THREAD = {
    name: "1"
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS", "TBB_NUM_THREADS")
}
"""For the libraries: runs side by side use the cores better than threads inside of one."""

RETRIES = 3
"""How often Ray starts a cell anew whose machine or process was lost."""

ANSWER_S = 5.0
"""How long a cluster may take to answer."""

GRACE_S = 5.0
"""How long a run may take to clean up when it is stopped."""


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0))


def run_local(work: Work, cells: Sequence[Cell], jobs: int) -> Executed:
    """Every cell in a new process, `jobs` of them at a time; they end when this process does, however it ends."""
    context = multiprocessing.get_context("spawn")
    waiting = deque(cells)
    running: dict[Connection, tuple[Cell, SpawnProcess]] = {}
    try:
        while waiting or running:
            while waiting and len(running) < jobs:
                cell = waiting.popleft()
                answers, answer = context.Pipe(duplex=False)
                process = context.Process(target=_in_process, args=(work, cell, answer), name=cell.name)
                with _environment(ONE_THREAD), _no_interrupt():
                    process.start()
                answer.close()  # the child has its own: when that one is gone, nobody can answer any more
                running[answers] = cell, process
            for ready in wait(list(running)):
                answers = cast(Connection, ready)
                cell, process = running.pop(answers)
                try:
                    done = answers.recv()
                    process.join()
                except EOFError:
                    process.join()
                    done = failed(f"the process of the run ended {_how(process.exitcode)}")
                answers.close()
                yield cell, done
    finally:
        for _, process in running.values():
            if process.pid is not None and process.is_alive():
                os.kill(process.pid, signal.SIGINT)
        deadline = time.monotonic() + GRACE_S
        for _, process in running.values():
            process.join(max(0.0, deadline - time.monotonic()))
            process.kill()


def _how(exit_code: int | None) -> str:
    if exit_code is not None and exit_code < 0:
        return f"by signal {signal.Signals(-exit_code).name}"
    return f"with code {exit_code}"


def _in_process(work: Work, cell: Cell, answer: Connection) -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)
    threading.Thread(target=_end_with_the_parent, daemon=True).start()
    try:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        answer.send(work(cell))
    except KeyboardInterrupt:
        return


def _end_with_the_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    _thread.interrupt_main()  # so that temporary files are removed
    time.sleep(GRACE_S)
    os._exit(1)


@contextmanager
def _environment(variables: dict[str, str]) -> Iterator[None]:
    """For processes that are started inside the block."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextmanager
def _no_interrupt() -> Iterator[None]:
    """An interrupt waits until the block has ended; a process that is started in it begins in the same way."""
    resource_tracker.ensure_running()  # lets interrupts through again when it is started, so that is done before
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _check_answers(address: str) -> None:
    """Refuse a `host:port` where nobody listens: Ray itself gives up after minutes.

    Raises:
        ScenarioError: nobody does.
    """
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not host or not port.isdigit():
        return  # "auto", or what Ray will complain about at once
    try:
        socket.create_connection((host, int(port)), ANSWER_S).close()
    except (OSError, OverflowError) as error:
        raise ScenarioError(
            f"--address {address}: nobody answers there ({error}); start a cluster with: ray start --head"
        ) from error


def run_ray(work: Work, cells: Sequence[Cell], address: str | None) -> Executed:
    """Every cell as a task of one core in a new process of a Ray cluster, which schedules and retries it.

    Args:
        work: what is done with a cell; its module must be installed on every machine of the cluster.
        cells: in the order in which they are submitted.
        address: of an existing cluster, see `ray.init`; None starts one on this machine.

    Raises:
        ScenarioError: Ray is not installed, or there is no cluster at `address`.
    """
    try:
        import ray
    except ImportError:
        raise ScenarioError("--executor ray: Ray is not installed; pip install 'dotmask[ray]'") from None
    if address is not None:
        _check_answers(address)
    try:
        ray.init(
            address=address or "local",
            include_dashboard=None if address else False,
            log_to_driver=False,
            logging_level=logging.ERROR,
            runtime_env={"env_vars": ONE_THREAD},
        )
    except (ConnectionError, ValueError, RuntimeError) as error:
        raise ScenarioError(f"--address {address}: {' '.join(str(error).split())}") from error
    try:
        remote = ray.remote(num_cpus=1, max_retries=RETRIES, max_calls=1)(work)
        submitted = {remote.remote(cell): cell for cell in cells}
        while submitted:
            ready, _ = ray.wait(list(submitted), num_returns=1)
            for reference in ready:
                try:
                    done = ray.get(reference)
                except ray.exceptions.RayError as error:
                    done = failed(f"{type(error).__name__}: {error}")
                yield submitted.pop(reference), done
    finally:
        ray.shutdown()
