"""The engine `local`: a pool of spawned processes; and what all engines share: how a process begins, and when too many die."""

import collections
import concurrent.futures
import contextlib
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

_MAX_FAILURES = 5  # in a row, without anything finished between them

_work: Callable[[Any], Any] | None = None  # of a process of the pool


class ProcessesDiedError(InputError):
    """Processes die without end.

    Args:
        message: What is said of it.
        items: What they were at; the one that ends them is among these.
    """

    def __init__(self, message: str, items: Iterable[Any]):
        super().__init__(message)
        self.items = tuple(items)


class WorkerFailures:
    """Counts processes that died in a row, each in the place of the one before it."""

    def __init__(self):
        self.count = 0

    def add(self, items: Iterable[Any], reason: str = "") -> None:
        """One more, which was at one of these items, for a reason that is known or not."""
        self.count += 1
        if self.count > _MAX_FAILURES:
            raise ProcessesDiedError(
                f"Expected processes that live. Received: {self.count} that died in a row{reason and f' ({reason})'}. "
                "Is there memory enough? Take fewer --workers; what was finished is kept.",
                items,
            )

    def end(self) -> None:
        """Something was finished."""
        self.count = 0


def run_local(initialize: Callable[[], Any], items: Iterator[Any], workers: int | None) -> Iterator[Any]:
    """`engines.run` in processes of this machine.

    Args:
        initialize: What a process does first; returns what is called for each item.
        items: What it is called with.
        workers: Processes; None: one a CPU.

    Raises:
        InputError: That of the work; or if the processes keep dying.
    """
    first = list(itertools.islice(items, workers or num_cpus()))
    num_processes, retry, items, failures = max(1, len(first)), collections.deque(), itertools.chain(first, items), WorkerFailures()
    del first
    while True:
        with _pool(initialize, num_processes) as pool:
            running: dict[concurrent.futures.Future, Any] = {}
            try:
                while True:
                    while len(running) < 2 * num_processes and (item := retry.popleft() if retry else next(items, None)) is not None:
                        running[_submit(pool, item, retry)] = item
                    if not running:
                        return
                    for done in concurrent.futures.wait(running, return_when=concurrent.futures.FIRST_COMPLETED).done:
                        result = done.result()
                        del running[done]
                        failures.end()
                        yield result
            except BrokenProcessPool:
                retry.extend(running.values())
        failures.add(retry)


def num_cpus() -> int:
    """CPUs that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _submit(pool: concurrent.futures.ProcessPoolExecutor, item: Any, again: collections.deque) -> concurrent.futures.Future:
    """Hands an item to the pool; a process that is started with it does not hear the user's interrupt, which is ours."""
    masked = hasattr(signal, "pthread_sigmask")
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if masked else None
    try:
        return pool.submit(_call, item)
    except BrokenProcessPool:
        retry.append(item)
        raise
    finally:
        if masked:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _pool(initialize: Callable[[], Any], workers: int) -> Iterator[concurrent.futures.ProcessPoolExecutor]:
    """A pool of spawned processes (a forked TensorFlow hangs) that ends at once when the block ends in an error."""
    others = set(multiprocessing.active_children())
    pool = concurrent.futures.ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), _initialize_pool_worker, (initialize,))
    is_done = False
    try:
        yield pool
        is_done = True
    finally:
        for process in () if is_done else set(multiprocessing.active_children()) - others:
            process.terminate()
        pool.shutdown(wait=True, cancel_futures=True)


def start_worker(work: bytes, threads: int) -> Callable[[Any], Any]:
    """What a process of any engine does first: its threads are set before the work comes out and imports what reads them.

    Args:
        work: What it is to call for each item, pickled.
        threads: Of TensorFlow.
    """
    one = dict.fromkeys(("TF_NUM_INTEROP_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    os.environ |= one | {"TF_NUM_INTRAOP_THREADS": str(threads), "CUDA_VISIBLE_DEVICES": ""}
    work = pickle.loads(work)
    import threadpoolctl

    threadpoolctl.threadpool_limits(1)  # Ray's own processes have imported NumPy before
    return work


def _initialize_pool_worker(initialize: Callable[[], Any]) -> None:
    global _work
    _work = initialize()
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Ends this process when the one that started it is gone: a killed one cannot say so, and its pool would wait for ever."""
    multiprocessing.connection.wait([multiprocessing.parent_process().sentinel])
    os._exit(1)


def _call(item: Any) -> Any:
    return _work(item)
