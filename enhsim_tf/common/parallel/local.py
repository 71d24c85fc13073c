"""The engine `local`, a pool of spawned processes, and how a worker of any engine starts."""

import collections
import concurrent.futures
import contextlib
import functools
import itertools
import multiprocessing
import multiprocessing.connection
import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from enhsim_tf.common.errors import InputError

MAX_FAILURES = 5  # consecutive deaths of workers after which work is given up at the next


class ProcessesDiedError(InputError):
    """Raised when too many workers died in a row.

    Args:
        items: Items that were being computed. The item that kills the workers is among them.
        reason: Why they died, if known.
    """

    def __init__(self, items: Iterable[Any], reason: str = ""):
        super().__init__(
            f"Expected worker processes that stay alive. Received: {MAX_FAILURES + 1} that died in "
            f"a row{reason and f' ({reason})'}. "
            "Memory may be too small: use fewer --workers. Finished work is kept."
        )
        self.items = tuple(items)


def run_local(work: bytes, items: Iterator[Any], workers: int | None) -> Iterator[Any]:
    """Implements `engines.run` with processes of this machine; `work` is pickled."""
    num_processes = workers or num_cpus()
    retry = collections.deque()
    failures = 0
    while failures <= MAX_FAILURES:
        # it starts a process when an item is submitted and none is idle
        with _pool(num_processes) as pool:
            running: dict[concurrent.futures.Future, Any] = {}
            try:
                while True:
                    while (
                        len(running) < 2 * num_processes
                        and (item := retry.popleft() if retry else next(items, None)) is not None
                    ):
                        running[_submit(pool, work, item, retry)] = item
                    if not running:
                        return
                    for done in concurrent.futures.wait(
                        running, return_when=concurrent.futures.FIRST_COMPLETED
                    ).done:
                        result = done.result()
                        del running[done]
                        failures = 0
                        yield result
            except BrokenProcessPool:
                # before what was not submitted yet, as the pool had taken it
                retry.extendleft(reversed(running.values()))
        failures += 1
    # the others were still waiting
    raise ProcessesDiedError(itertools.islice(retry, num_processes))


def num_cpus() -> int:
    """Number of CPUs that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _submit(
    pool: concurrent.futures.ProcessPoolExecutor, work: bytes, item: Any, retry: collections.deque
) -> concurrent.futures.Future:
    """Submits an item to the pool. A process started by this call ignores SIGINT, which the parent
    process handles.
    """
    masked = hasattr(signal, "pthread_sigmask")
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if masked else None
    try:
        return pool.submit(call, work, item)
    except BrokenProcessPool:
        retry.appendleft(item)
        raise
    finally:
        if masked:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _pool(workers: int) -> Iterator[concurrent.futures.ProcessPoolExecutor]:
    """A pool of spawned processes that is terminated at once if the block raises. Forking is not
    used, since TensorFlow hangs.
    """
    others = set(multiprocessing.active_children())
    pool = concurrent.futures.ProcessPoolExecutor(
        workers, multiprocessing.get_context("spawn"), _watch_parent
    )
    is_done = False
    try:
        yield pool
        is_done = True
    finally:
        for process in () if is_done else set(multiprocessing.active_children()) - others:
            process.terminate()
        pool.shutdown(wait=True, cancel_futures=True)


@functools.lru_cache(1)
def _start_worker(work: bytes) -> Callable[[Any], Any]:
    """Prepares a process of any engine, and returns the unpickled function.

    The thread counts are set before `work` is unpickled, because unpickling imports the libraries
    that read them.
    """
    numbers = (
        "TF_NUM_INTRAOP_THREADS",
        "TF_NUM_INTEROP_THREADS",
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
    )
    os.environ |= dict.fromkeys(numbers, "1") | {"CUDA_VISIBLE_DEVICES": ""}
    function = pickle.loads(work)
    import threadpoolctl

    threadpoolctl.threadpool_limits(1)  # a Ray process has already imported NumPy
    return function


def call(work: bytes, item: Any) -> Any:
    """Calls the pickled function for an item, in a process of any engine."""
    return _start_worker(work)(item)


def _watch_parent() -> None:
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Ends this process when its parent has ended. A killed parent cannot shut the pool down, so
    its workers would wait forever.
    """
    multiprocessing.connection.wait([multiprocessing.parent_process().sentinel])
    os._exit(1)
