"""The engine `ray`: one Ray actor a process, on this machine or on the cluster of `RAY_ADDRESS`.

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
_ACTOR_CPUS = 0.4  # of a CPU each: after half of a cluster is lost, its actors still find room on the other half


class _Actor:
    """One process of the cluster."""

    def __init__(self, initialize: Callable[[], Any]):
        self.work = initialize()

    def call(self, item: Any) -> tuple[str, Any]:
        """The result for an item, or why there is none; without an item, that the actor stands."""
        if item is None:
            return "ready", None
        try:
            return "done", self.work(item)
        except InputError as error:  # as itself it would come back inside an error of Ray's
            return "refused", str(error)


def run_ray(initialize: Callable[[], Any], items: Iterator[Any], workers: int | None) -> Iterator[Any]:
    """`engines.run` in actors of Ray.

    Args:
        initialize: What a process does first; returns what is called for each item.
        items: What it is called with.
        workers: Actors; None: one a CPU of the cluster.

    Raises:
        InputError: That of the work; or if there is no such cluster, or the actors keep dying.
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

        every = [WorkerFailures() for _ in first]  # of an actor and those in its place: a node that is lost ends many, each of them once
        for failures in every:
            ask(make(initialize), None, failures)  # an actor that finds no room yet holds no item that another could do
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
                    failures_of_one.end()
            following = retry.popleft() if retry else next(items, None)
            if following is not None:
                ask(actor, following, failures)
            elif not any(each is not None for _, each, _ in waiting.values()):
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
        raise InputError(
            "Expected the package ray for --engine ray. Received: none. Install it, in a clone: python -m pip install '.[ray]'."
        ) from None
    if ray.is_initialized():
        yield ray
        return
    logging.getLogger("ray").setLevel(logging.ERROR)
    address = os.environ.get("RAY_ADDRESS")
    local = {} if address else {"object_store_memory": 100_000_000, "include_dashboard": False}  # nothing large travels
    _check_address(address)
    try:
        starting = _Starting(f"at {address}" if address else "that starts here", (*_REFUSALS, ray.exceptions.RayError))
        with starting, warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of a server that does not answer it warns, and then raises
            ray.init(address or "local", logging_level=logging.ERROR, log_to_driver=False, **local)
        yield ray
    finally:
        ray.shutdown()  # also of what did not start: Ray would go on asking the server that was not there


class _Starting:
    """Makes one line of what Ray raises where there is no cluster; of a node that does not come up in time, an Exception of no kind."""

    def __init__(self, where: str, kinds: tuple[type[Exception], ...]):
        self.where, self.kinds = where, kinds

    def __enter__(self):
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: Any) -> None:
        if kind is Exception or isinstance(error, self.kinds):
            raise InputError(f"Expected a Ray cluster {self.where}. Received: {_last_line(error)}.") from None


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
