"""Engines that call a function for many items in several processes.

Each process uses one thread, so that results do not depend on the number of cores. A process that
dies is replaced and its item is computed again. An engine gives up after more than five consecutive
worker failures.
"""

import pickle
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.parallel.local import run_local
from enhsim_tf.common.parallel.ray import run_ray

# with the maximum number of workers
ENGINES = {"local": (run_local, 512), "ray": (run_ray, 10_000)}


def run(
    engine: str, work: Callable[[Any], Any], items: Iterable[Any], workers: int | None = None
) -> Iterator[Any]:
    """Calls `work` for each item and yields the results in the order in which they are finished.

    Args:
        engine: `local` or `ray`.
        work: Function of one item. It is pickled for each process.
        items: Arguments of `work`, none of which may be None. They are drawn and pickled only when
            a worker can take them, so that memory does not grow with their number.
        workers: Number of processes. None: one per CPU.

    Raises:
        InputError: If `work` raises one, if the engine cannot be used, or if its processes keep
            dying (`ProcessesDiedError`).
    """
    return ENGINES[engine][0](pickle.dumps(work), iter(items), workers)


def parse_workers(text: str | None, engine: str | None = None) -> int | None:
    """Parses the option `--workers auto|N`, for the engine `local` if none is given: a number, or
    None for one per CPU.
    """
    if text in (None, "auto"):
        return None
    _, most = ENGINES[engine or "local"]
    if not (text.isdecimal() and 1 <= int(text) <= most):
        raise InputError(
            f"Expected --workers auto, or a number from 1 to {most:,}. Received: {text!r}."
        )
    return int(text)
