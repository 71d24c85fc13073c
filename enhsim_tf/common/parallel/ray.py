"""The engine `ray`: each worker is a Ray actor, on this machine or on the cluster at `RAY_ADDRESS`.

Plain actors and not Ray Data: what travels are items there and records back, which need no blocks, no plan and no read
tasks that wait for a CPU which the actors hold; and a lost actor is replaced by the same few lines as a lost process.
Nor Ray's own restarts, which count all deaths of an actor and not those in a row: measured with 2.60, `max_restarts=5` gives up after six
deaths with work finished between all of them, and `max_restarts=-1` starts what dies as it begins without end (24 times in 45 s).
"""

import collections
import contextlib
import itertools
import logging
import os
import socket
import warnings
from collections.abc import Callable, Iterator
from typing import Any

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.parallel.local import WorkerFailures

_ANSWER_S = 10
_REFUSALS = (ConnectionError, RuntimeError, OSError, ValueError)
_ACTOR_CPUS = 0.4  # CPUs requested by each actor: if half of a cluster is lost, all actors still fit on the other half


class _Actor:
    """A worker process of the cluster."""

    def __init__(self, initialize: Callable[[], Any]):
        self.work = initialize()

    def call(self, item: Any) -> tuple[str, Any]:
        """Returns `("done", result)`, `("refused", message)` after an `InputError`, or, if `item` is None, `("ready", None)`."""
        if item is None:
            return "ready", None
        try:
            return "done", self.work(item)
        except InputError as error:  # if it were raised, Ray would wrap it in an error of its own
            return "refused", str(error)


def run_ray(initialize: Callable[[], Any], items: Iterator[Any], workers: int | None) -> Iterator[Any]:
    """Implements `engines.run` with Ray actors.

    Args:
        initialize: Called once in each actor. Returns the function that is then called for each item.
        items: Arguments of that function.
        workers: Number of actors. None: one per CPU of the cluster.

    Yields:
        The result for each item.

    Raises:
        InputError: If the function raises one, if there is no such cluster, or if the actors keep dying.
    """
    one = list(itertools.islice(items, 1))
    if not one:
        return
    items = itertools.chain(one, items)
    with _cluster() as ray:
        cpus = max(1.0, ray.cluster_resources().get("CPU", 1.0))
        first = list(itertools.islice(items, workers or int(cpus)))
        retry, items = collections.deque(), itertools.chain(first, items)
        share = round(min(_ACTOR_CPUS, _ACTOR_CPUS * cpus / max(1, len(first))), 4)
        make = ray.remote(_Actor).options(num_cpus=max(share, 1e-4), scheduling_strategy="SPREAD").remote
        lost = tuple(getattr(ray.exceptions, f"{name}Error") for name in ("RayActor", "ObjectLost", "NodeDied", "OutOfMemory"))
        waiting: dict[Any, tuple[Any, Any, WorkerFailures]] = {}

        def ask(actor: Any, item: Any, failures: WorkerFailures) -> None:
            waiting[actor.call.remote(item)] = actor, item, failures

        every = [WorkerFailures() for _ in first]  # one count per actor and its replacements: a lost node ends many actors once each
        for failures in every:
            ask(make(initialize), None, failures)  # an actor that is not scheduled yet gets no item, so that another actor can take it
        while waiting:
            (done,), _ = ray.wait(list(waiting), num_returns=1)
            actor, item, failures = waiting.pop(done)
            try:
                kind, result = ray.get(done)
            except lost as error:
                failures.add([] if item is None else [item], _last_line(error))
                retry.extend([] if item is None else [item])
                ask(make(initialize), None, failures)
                continue
            if kind == "refused":
                raise InputError(result)
            if kind == "done":
                for failures_of_one in every:
                    failures_of_one.reset()
            following = retry.popleft() if retry else next(items, None)
            if following is not None:
                ask(actor, following, failures)
            elif not any(each is not None for _, each, _ in waiting.values()):
                waiting.clear()  # only actors that were never scheduled are left
            if kind == "done":
                yield result


@contextlib.contextmanager
def _cluster() -> Iterator[Any]:
    """Yields the connected `ray` module. A connection that existed before is used and left open."""
    # disable usage reports and the warning about accelerators, which are not used here
    os.environ |= {name: os.environ.get(name, "0") for name in ("RAY_USAGE_STATS_ENABLED", "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO")}
    try:
        import ray
    except ModuleNotFoundError:
        raise InputError(
            "Expected the package ray for --engine ray. Received: none. Install it, in a clone: python -m pip install '.[ray]'."
        ) from None
    if ray.is_initialized():
        yield ray
        return
    logging.getLogger("ray").setLevel(logging.ERROR)
    address = os.environ.get("RAY_ADDRESS")
    local = {} if address else {"object_store_memory": 100_000_000, "include_dashboard": False}  # only small objects are exchanged
    _check_address(address)
    try:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # Ray warns of a server that does not answer before it raises
                ray.init(address or "local", logging_level=logging.ERROR, log_to_driver=False, **local)
        except Exception as error:
            # for a node that does not start in time, Ray raises a plain Exception
            if type(error) is not Exception and not isinstance(error, (*_REFUSALS, ray.exceptions.RayError)):
                raise
            where = f"at {address}" if address else "that starts here"
            raise InputError(f"Expected a Ray cluster {where}. Received: {_last_line(error)}.") from None
        yield ray
    finally:
        ray.shutdown()  # also after a failed start, since Ray would keep trying to reach the server


def _check_address(address: str | None) -> None:
    """Raises an `InputError` at once if nothing answers at the address. Ray itself would retry for minutes."""
    host, _, port = (address or "").rpartition(":")
    if not host or not port.isdecimal() or "/" in host:  # no address, or a form that only Ray can parse
        return
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=_ANSWER_S).close()
    except (OSError, OverflowError) as error:
        raise InputError(f"Expected a Ray cluster at {address} (RAY_ADDRESS). Received: {_last_line(error)}.") from None


def _last_line(error: Exception) -> str:
    """The printable part of the last line of an error's message, which is where Ray states the reason."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip(" ^~")]
    return "".join(character for character in (lines or [type(error).__name__])[-1] if character.isprintable())[:160].rstrip(".")
