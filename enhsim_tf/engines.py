"""Engines: they call a function for many numbers in many processes, and know neither telemetry nor files.

`local` is a pool of spawned processes. `ray` is one Ray actor a process, on this machine or on the cluster of
`RAY_ADDRESS`. Plain actors and not Ray Data: what travels are numbers there and records back, which need no blocks, no
plan and no read tasks that wait for a CPU which the actors hold; and a lost actor is replaced by the same few lines as
a lost process. Each process computes in one thread, so that its results do not depend on how many cores there are.

A process that dies is replaced, and what it was at is done again. An engine gives up when processes die without end.
"""

import collections
import concurrent.futures
import contextlib
import itertools
import logging
import multiprocessing
import multiprocessing.connection
import os
import signal
import socket
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from enhsim_tf.errors import InputError

ENGINES = {"local": 512, "ray": 10_000}  # and their most workers
ONE_THREAD = {"TF_NUM_INTRAOP_THREADS": "1", "TF_NUM_INTEROP_THREADS": "1", "OMP_NUM_THREADS": "1", "CUDA_VISIBLE_DEVICES": ""}
_MOST_DEATHS = 5  # in a row, without anything finished between them
_ANSWER_S = 10
_ACTOR_CPUS = 0.4  # of a CPU each: after half of a cluster is lost, its actors still find room on the other half

_work: Callable[[int], Any] | None = None  # of a process of the pool


def run(engine: str, work: Callable[[int], Any], numbers: Iterable[int], workers: int | None = None) -> Iterator[Any]:
    """Calls `work` for each number and yields what it returns, as it comes; the order is anyone's.

    Args:
        engine: `local` or `ray`.
        work: What is called; it is pickled.
        numbers: What it is called with; drawn as there is room, so that any number of them needs the same memory.
        workers: Processes; None: one a CPU.

    Raises:
        InputError: That of `work`; or if the engine cannot be used, or its processes keep dying.
    """
    if engine not in ENGINES:
        raise InputError(f"Expected an engine, one of: {', '.join(ENGINES)}. Received: {engine!r}.")
    if workers is not None and not 1 <= workers <= ENGINES[engine]:
        raise InputError(f"Expected from 1 to {ENGINES[engine]:,} workers, or auto. Received: {workers}.")
    return {"local": _run_local, "ray": _run_ray}[engine](work, iter(numbers), workers)


class _Deaths:
    """Counts processes that died in a row."""

    def __init__(self):
        self.count = 0

    def add(self, reason: str = "") -> None:
        self.count += 1
        if self.count > _MOST_DEATHS:
            raise InputError(
                f"Expected processes that live. Received: {self.count} that died in a row{reason and f' ({reason})'}. "
                "Is there memory enough? Take fewer --workers; what was finished is kept."
            )

    def end(self) -> None:
        self.count = 0


def _run_local(work: Callable[[int], Any], numbers: Iterator[int], workers: int | None) -> Iterator[Any]:
    first = list(itertools.islice(numbers, workers or _num_cpus()))
    again, numbers, deaths = collections.deque(), itertools.chain(first, numbers), _Deaths()
    while True:
        with _pool(work, max(1, len(first))) as pool:
            running: dict[concurrent.futures.Future, int] = {}
            try:
                while True:
                    while len(running) < 2 * len(first) and (number := again.popleft() if again else next(numbers, None)) is not None:
                        running[_submit(pool, number, again)] = number
                    if not running:
                        return
                    for done in concurrent.futures.wait(running, return_when=concurrent.futures.FIRST_COMPLETED).done:
                        result = done.result()
                        del running[done]
                        deaths.end()
                        yield result
            except BrokenProcessPool:
                again.extend(running.values())
        deaths.add()


def _num_cpus() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _submit(pool: concurrent.futures.ProcessPoolExecutor, number: int, again: collections.deque) -> concurrent.futures.Future:
    """Hands a number to the pool; a process that is started with it does not hear the user's interrupt, which is ours."""
    masked = hasattr(signal, "pthread_sigmask")
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if masked else None
    try:
        return pool.submit(_call, number)
    except BrokenProcessPool:
        again.append(number)
        raise
    finally:
        if masked:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _pool(work: Callable[[int], Any], workers: int) -> Iterator[concurrent.futures.ProcessPoolExecutor]:
    """A pool of spawned processes (a forked TensorFlow hangs) that ends at once when the block ends in an error."""
    others = set(multiprocessing.active_children())
    pool = concurrent.futures.ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), _begin, (work,))
    is_done = False
    try:
        yield pool
        is_done = True
    finally:
        for process in () if is_done else set(multiprocessing.active_children()) - others:
            process.terminate()
        pool.shutdown(wait=True, cancel_futures=True)


def _begin(work: Callable[[int], Any]) -> None:
    """What a process of the pool does first."""
    global _work
    os.environ |= ONE_THREAD
    _work = work
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Ends this process when the one that started it is gone: a killed one cannot say so, and its pool would wait for ever."""
    multiprocessing.connection.wait([multiprocessing.parent_process().sentinel])
    os._exit(1)


def _call(number: int) -> Any:
    return _work(number)


class _Actor:
    """One process of the cluster."""

    def __init__(self, work: Callable[[int], Any]):
        os.environ |= ONE_THREAD
        self.work = work

    def call(self, number: int | None) -> tuple[str, Any]:
        """The result for a number, or why there is none; without a number, that the actor stands."""
        if number is None:
            return "ready", None
        try:
            return "done", self.work(number)
        except InputError as error:  # as itself it would come back inside an error of Ray's
            return "refused", str(error)


def _run_ray(work: Callable[[int], Any], numbers: Iterator[int], workers: int | None) -> Iterator[Any]:
    one = list(itertools.islice(numbers, 1))
    if not one:
        return
    numbers = itertools.chain(one, numbers)
    with _cluster() as ray:
        cpus = max(1.0, ray.cluster_resources().get("CPU", 1.0))
        first = list(itertools.islice(numbers, workers or int(cpus)))
        again, numbers, deaths = collections.deque(), itertools.chain(first, numbers), _Deaths()
        share = round(min(_ACTOR_CPUS, _ACTOR_CPUS * cpus / max(1, len(first))), 4)
        make = ray.remote(_Actor).options(num_cpus=max(share, 1e-4), scheduling_strategy="SPREAD").remote
        lost = tuple(getattr(ray.exceptions, f"{name}Error") for name in ("RayActor", "ObjectLost", "NodeDied", "OutOfMemory"))
        waiting: dict[Any, tuple[Any, int | None]] = {}

        def ask(actor: Any, number: int | None) -> None:
            waiting[actor.call.remote(number)] = actor, number

        for _ in first:
            ask(make(work), None)  # an actor that finds no room yet holds no number that another could do
        while waiting:
            (done,), _ = ray.wait(list(waiting), num_returns=1)
            actor, number = waiting.pop(done)
            try:
                kind, result = ray.get(done)
            except lost as error:
                deaths.add(_last_line(error))
                again.extend([] if number is None else [number])
                ask(make(work), None)
                continue
            if kind == "refused":
                raise InputError(result)
            if kind == "done":
                deaths.end()
            following = again.popleft() if again else next(numbers, None)
            if following is not None:
                ask(actor, following)
            elif not any(each is not None for _, each in waiting.values()):
                waiting.clear()  # what is left are actors that never found room
            if kind == "done":
                yield result


@contextlib.contextmanager
def _cluster() -> Iterator[Any]:
    """Ray, connected; one that was connected before stays so."""
    # no reports on usage to its makers; no word on accelerators, which nothing here uses
    os.environ |= {name: os.environ.get(name, "0") for name in ("RAY_USAGE_STATS_ENABLED", "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO")}
    try:
        import ray
    except ModuleNotFoundError:
        raise InputError("Expected the package ray for --engine ray. Received: none. Install it: pip install 'enhsim_tf[ray]'.") from None
    if ray.is_initialized():
        yield ray
        return
    logging.getLogger("ray").setLevel(logging.ERROR)
    address = os.environ.get("RAY_ADDRESS")
    local = {} if address else {"object_store_memory": 100_000_000, "include_dashboard": False}  # nothing large travels
    _check_address(address)
    try:
        ray.init(address or "local", logging_level=logging.ERROR, log_to_driver=False, **local)
    except (ConnectionError, RuntimeError, OSError, ValueError, ray.exceptions.RayError) as error:
        where = f"at {address}" if address else "that starts here"
        raise InputError(f"Expected a Ray cluster {where}. Received: {_last_line(error)}.") from None
    try:
        yield ray
    finally:
        ray.shutdown()


def _check_address(address: str | None) -> None:
    """Refuses an address where nobody answers, which Ray itself would ask for minutes."""
    host, _, port = (address or "").rpartition(":")
    if not host or not port.isdecimal() or "/" in host:  # none, or a form that Ray alone understands
        return
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=_ANSWER_S).close()
    except (OSError, OverflowError) as error:
        raise InputError(f"Expected a Ray cluster at {address} (RAY_ADDRESS). Received: {_last_line(error)}.") from None


def _last_line(error: Exception) -> str:
    """The end of an error, where Ray says what it was, in characters that a terminal shows as they are."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip(" ^~")]
    return "".join(character for character in (lines or [type(error).__name__])[-1] if character.isprintable())[:160].rstrip(".")
