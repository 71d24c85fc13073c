"""Engines: they call a function for many items in many processes, and know neither telemetry nor files.

Each process computes in a fixed number of threads, so that its results do not depend on how many cores there are. A process
that dies is replaced, and what it was at is done again. An engine gives up when processes die without end.
"""

import functools
import pickle
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.parallel.local import run_local, start_worker
from enhsim_tf.common.parallel.ray import run_ray

ENGINES = {"local": 512, "ray": 10_000}  # and their most workers


def run(engine: str, work: Callable[[Any], Any], items: Iterable[Any], workers: int | None = None, threads: int = 1) -> Iterator[Any]:
    """Calls `work` for each item and yields what it returns, as it comes; the order is anyone's.

    Args:
        engine: `local` or `ray`.
        work: What is called; it is pickled for each process.
        items: What it is called with, not None; drawn and pickled as there is room, so that any number of them needs the same
            memory.
        workers: Processes; None: one a CPU.
        threads: Of TensorFlow in each process; linear algebra beside it has one.

    Raises:
        InputError: That of `work`; or if the engine cannot be used, or its processes keep dying (`ProcessesDiedError`).
    """
    if engine not in ENGINES:
        raise InputError(f"Expected an engine, one of: {', '.join(ENGINES)}. Received: {engine!r}.")
    if workers is not None and not 1 <= workers <= ENGINES[engine]:
        raise InputError(f"Expected from 1 to {ENGINES[engine]:,} workers, or auto. Received: {workers}.")
    first = functools.partial(start_worker, pickle.dumps(work), threads)
    return {"local": run_local, "ray": run_ray}[engine](first, iter(items), workers)


def parse_workers(text: str | None) -> int | None:
    """The number of `--workers auto|N`; None is one a CPU.

    Raises:
        InputError: If it is neither.
    """
    if text in (None, "auto"):
        return None
    if not (text.isascii() and text.isdecimal() and 1 <= len(text) <= 9 and int(text)):
        raise InputError(f"Expected --workers auto, or a number of them. Received: {text!r}.")
    return int(text)
