"""The engine `ray`: each item is a Ray task, on this machine or on the cluster at `RAY_ADDRESS`.

Ray computes a task again whose process or node is lost, and gives a task up that loses
`MAX_FAILURES` times more.
"""

import contextlib
import logging
import os
import socket
import warnings
from collections.abc import Iterator
from typing import Any

from enhsim_tf.common.errors import InputError, printable
from enhsim_tf.common.parallel.local import MAX_FAILURES, ProcessesDiedError, call

_ANSWER_S = 10


def run_ray(work: bytes, items: Iterator[Any], workers: int | None) -> Iterator[Any]:
    """Implements `engines.run` with Ray tasks, of which `workers` run at a time, or one per CPU of
    the cluster; `work` is pickled.
    """
    first = next(items, None)
    if first is None:
        return
    with _cluster() as ray:
        cpus = max(1, int(ray.cluster_resources().get("CPU", 1)))
        number = workers or cpus
        running = {}
        item = first
        task = ray.remote(call).options(
            num_cpus=min(1, cpus / number), max_retries=MAX_FAILURES, scheduling_strategy="SPREAD"
        )
        lost = tuple(
            getattr(ray.exceptions, f"{name}Error")
            for name in (
                "WorkerCrashed",
                "ObjectLost",
                "NodeDied",
                "OutOfMemory",
                "LocalRayletDied",
            )
        )
        try:
            while True:
                while item is not None and len(running) < 2 * number:
                    running[task.remote(work, item)] = item
                    item = next(items, None)
                if not running:
                    return
                (done,), _ = ray.wait(list(running), num_returns=1)
                try:
                    result = ray.get(done)
                except lost as error:
                    raise ProcessesDiedError([running[done]], _last_line(error)) from None
                except ray.exceptions.RayTaskError as error:
                    raise error.cause from None  # as the work has raised it
                del running[done]
                yield result
        finally:
            for left in running:
                ray.cancel(left, force=True)


@contextlib.contextmanager
def _cluster() -> Iterator[Any]:
    """Yields the connected `ray` module. A connection that existed before is used and left open."""
    # disable usage reports and the warning about accelerators, which are not used here
    os.environ |= {
        name: os.environ.get(name, "0")
        for name in ("RAY_USAGE_STATS_ENABLED", "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO")
    }
    try:
        import ray
    except ModuleNotFoundError:
        raise InputError(
            "Expected the package ray for --engine ray. Received: none. Install it, in a clone: "
            "python -m pip install '.[ray]'."
        ) from None
    if ray.is_initialized():
        yield ray
        return
    logging.getLogger("ray").setLevel(logging.ERROR)
    address = os.environ.get("RAY_ADDRESS")
    # only small objects are exchanged
    local = {} if address else {"object_store_memory": 100_000_000, "include_dashboard": False}
    _check_address(address)
    try:
        try:
            with warnings.catch_warnings():
                # Ray warns of a server that does not answer before it raises
                warnings.simplefilter("ignore", UserWarning)
                ray.init(
                    address or "local", logging_level=logging.ERROR, log_to_driver=False, **local
                )
        # Ray raises plain exceptions, as for a node that does not start in time
        except Exception as error:  # noqa: BLE001
            where = f"at {address}" if address else "that starts here"
            raise InputError(
                f"Expected a Ray cluster {where}. Received: {_last_line(error)}."
            ) from None
        yield ray
    finally:
        ray.shutdown()  # also after a failed start, since Ray would keep trying to reach the server


def _check_address(address: str | None) -> None:
    """Raises an `InputError` at once if nothing answers at the address. Ray itself would retry for
    minutes.
    """
    host, _, port = (address or "").rpartition(":")
    # no address, or a form that only Ray can parse
    if not host or not port.isdecimal() or "/" in host:
        return
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=_ANSWER_S).close()
    except (OSError, OverflowError) as error:
        raise InputError(
            f"Expected a Ray cluster at {address} (RAY_ADDRESS). Received: {_last_line(error)}."
        ) from None


def _last_line(error: Exception) -> str:
    """The last line of an error's message, which is where Ray states the reason."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip(" ^~")]
    return printable((lines or [type(error).__name__])[-1])[:160].rstrip(".")
