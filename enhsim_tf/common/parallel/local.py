"""The engine `local`, a pool of spawned processes, and what all engines share: worker start-up and the count of failures."""

import collections
import concurrent.futures
import contextlib
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

_MAX_FAILURES = 5  # consecutive, without a finished item between them

_work: Callable[[Any], Any] | None = None  # the function that a pool process calls for each item


class ProcessesDiedError(InputError):
    """Raised when too many workers died in a row.

    Args:
        message: Description of the problem.
        items: Items that were being computed. The item that kills the workers is among them.
    """

    def __init__(self, message: str, items: Iterable[Any]):
        super().__init__(message)
        self.items = tuple(items)


class WorkerFailures:
    """Counts consecutive worker failures."""

    def __init__(self):
        self.count = 0

    def add(self, items: Iterable[Any], reason: str = "") -> None:
        """Counts one more failure.

        Args:
            items: Items that were being computed when the worker died.
            reason: Why it died, if known.

        Raises:
            ProcessesDiedError: If there were too many failures in a row.
        """
        self.count += 1
        if self.count > _MAX_FAILURES:
            raise ProcessesDiedError(
                f"Expected worker processes that stay alive. Received: {self.count} that died in a row{reason and f' ({reason})'}. "
                "Memory may be too small: use fewer --workers. Finished work is kept.",
                items,
            )

    def reset(self) -> None:
        """Sets the count to zero, because an item was finished."""
        self.count = 0


def run_local(initialize: Callable[[], Any], items: Iterator[Any], workers: int | None) -> Iterator[Any]:
    """Implements `engines.run` with processes of this machine.

    Args:
        initialize: Called once in each process. Returns the function that is then called for each item.
        items: Arguments of that function.
        workers: Number of processes. None: one per CPU.

    Yields:
        The result for each item.

    Raises:
        InputError: If the function raises one, or if the processes keep dying.
    """
    num_processes, retry, failures = workers or num_cpus(), collections.deque(), WorkerFailures()
    while True:
        with _pool(initialize, num_processes) as pool:  # it starts a process when an item is submitted and none is idle
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
                        failures.reset()
                        yield result
            except BrokenProcessPool:
                retry.extend(running.values())
        failures.add(retry)


def num_cpus() -> int:
    """Number of CPUs that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _submit(pool: concurrent.futures.ProcessPoolExecutor, item: Any, retry: collections.deque) -> concurrent.futures.Future:
    """Submits an item to the pool. A process started by this call ignores SIGINT, which the parent process handles."""
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
    """A pool of spawned processes that is terminated at once if the block raises. Forking is not used, since TensorFlow hangs."""
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
    """Initializes a process of any engine.

    The thread counts are set before `work` is unpickled, because unpickling imports the libraries that read them.

    Args:
        work: The pickled function to be called for each item.
        threads: Number of TensorFlow threads.

    Returns:
        The unpickled function.
    """
    one = dict.fromkeys(("TF_NUM_INTEROP_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    os.environ |= one | {"TF_NUM_INTRAOP_THREADS": str(threads), "CUDA_VISIBLE_DEVICES": ""}
    work = pickle.loads(work)
    import threadpoolctl

    threadpoolctl.threadpool_limits(1)  # a Ray process has already imported NumPy
    return work


def _initialize_pool_worker(initialize: Callable[[], Any]) -> None:
    global _work
    _work = initialize()
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Ends this process when its parent has ended. A killed parent cannot shut the pool down, so its workers would wait forever."""
    multiprocessing.connection.wait([multiprocessing.parent_process().sentinel])
    os._exit(1)


def _call(item: Any) -> Any:
    return _work(item)
