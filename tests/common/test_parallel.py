"""Tests of the engines: every item is computed once even if workers die, in single-threaded
processes; errors are one line.
"""

import contextlib
import functools
import importlib.util
import itertools
import multiprocessing
import os
import signal
import sys

import pytest

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.parallel import engines
from enhsim_tf.common.parallel.local import ProcessesDiedError
from tests.clone import ROOT
from tests.ray_servers import starts_ray
from tests.small_data_set import (
    PlainMaker,
    die_at_thirteen,
    meet,
    plan,
    refuse,
    threads_and_square,
    threads_of,
)

with_ray = pytest.mark.skipif(
    importlib.util.find_spec("ray") is None, reason="the optional extra ray is not installed"
)


@contextlib.contextmanager
def skipped_without_a_server():
    """Skips if a server of Ray does not start here, which is no answer about this project."""
    try:
        yield
    except (InputError, RuntimeError, TimeoutError, OSError) as error:
        pytest.skip(f"no server of Ray starts here: {error}")


def test_every_item_is_computed_once_in_single_threaded_processes():
    found = list(engines.run("local", threads_and_square, range(20), 2))
    assert sorted(square for square, *_ in found) == [number**2 for number in range(20)]
    assert {(threads, tensorflow) for *_, threads, tensorflow in found} == {("1", False)}
    assert os.getpid() not in {process for _, process, *_ in found}


def test_threads_are_set_before_the_work_imports_anything():
    assert list(engines.run("local", threads_of, [1], 1)) == [("1", {1})]


def test_items_are_drawn_only_when_workers_can_take_them():
    drawn = []
    endless = (drawn.append(number) or number for number in itertools.count())
    running = engines.run("local", threads_and_square, endless, 1)
    for done in range(1, 6):
        next(running)
        assert len(drawn) <= done + 2
    running.close()
    assert not multiprocessing.active_children()


def test_a_killed_process_is_replaced_and_no_item_is_lost_or_repeated():
    running, found, killed = engines.run("local", threads_and_square, range(60), 2), [], 0
    for done in running:
        found.append(done[0])
        if len(found) in (10, 40):
            os.kill(done[1], signal.SIGKILL)
            killed += 1
    assert killed == 2 and sorted(found) == [number**2 for number in range(60)]


def test_repeated_worker_failures_end_the_run(refused):
    with refused("died in a row", "--workers") as caught:
        list(engines.run("local", die_at_thirteen, [13], 1))
    assert isinstance(caught.value, ProcessesDiedError) and caught.value.items == (13,)


def test_an_input_error_of_the_work_is_raised_unchanged(refused):
    with refused("another number"):
        list(engines.run("local", refuse, range(5), 1))
    assert not multiprocessing.active_children()


def test_numbers_of_workers_are_parsed(refused):
    for text, number in ((None, None), ("auto", None), ("1", 1), ("512", 512)):
        assert engines.parse_workers(text) == number
    for text, engine in (
        ("0", None),
        ("513", "local"),
        ("many", None),
        ("-1", "ray"),
        ("1000000", "ray"),
    ):
        with refused("--workers"):
            engines.parse_workers(text, engine)


def test_without_items_no_process_is_started(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    for engine in ("local", "ray"):
        assert list(engines.run(engine, refuse, [], 2)) == []
    assert not multiprocessing.active_children()


@pytest.fixture
def machines(monkeypatch):
    """A Ray cluster of two machines, of which the second one may be lost."""
    cluster_utils = pytest.importorskip(
        "ray.cluster_utils", reason="the optional extra ray is not installed"
    )
    # so that processes can import the work
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    cluster = cluster_utils.Cluster()
    try:
        with skipped_without_a_server():
            cluster.add_node(wait=False, num_cpus=1, include_dashboard=False)
            second = cluster.add_node(wait=False, num_cpus=1)
            cluster.wait_for_nodes(120)  # Ray itself waits 30 s, too short on a busy machine
        monkeypatch.setenv("RAY_ADDRESS", cluster.address)
        yield cluster, second
    finally:
        cluster.shutdown()


@pytest.mark.slow
@starts_ray
def test_ray_gives_the_same_results_and_replaces_killed_processes(machines, tmp_path, refused):
    import ray

    from enhsim_tf.common.parallel.ray import _cluster

    with _cluster():  # one connection for all checks
        found = []
        for square, process, *how in engines.run("ray", threads_and_square, range(30), 2):
            found.append(square)
            assert how == ["1", False]
            if len(found) == 10:
                os.kill(process, signal.SIGKILL)
        assert sorted(found) == [number**2 for number in range(30)]
        assert list(engines.run("ray", threads_of, [1], 1)) == [("1", {1})]
        with refused("another number"):
            list(engines.run("ray", refuse, range(5), 1))
        with refused("died in a row"):
            list(engines.run("ray", die_at_thirteen, [13], 1))
        asked, here = plan(150, 50), tmp_path / "here"
        here.mkdir()
        # on two processors: more processes than CPUs
        records = list(engines.run("ray", PlainMaker(asked, tmp_path), range(3), 3))
        assert sorted(records) == [PlainMaker(asked, here)(shard) for shard in range(3)]
        met, found = tmp_path / "met", []
        met.mkdir()
        for done in engines.run("ray", functools.partial(meet, met, 4), range(30), 4):
            found.append(done)
            if len(found) == 1:  # a machine is lost with both of its processes
                cluster, second = machines
                cluster.remove_node(second, allow_graceful=False)
        assert sorted(found) == list(range(30))
    assert not ray.is_initialized()


@with_ray
@pytest.mark.parametrize(
    "error", [Exception("The current node\ntimed out"), OSError(28, "timed out")]
)
def test_a_cluster_that_does_not_start_raises_one_line(error, monkeypatch, refused):
    import ray

    def init(*arguments, **options):
        raise error

    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.setattr(ray, "init", init)
    with refused("that starts here", "timed out"):
        list(engines.run("ray", refuse, [1], 1))


@pytest.mark.slow
@starts_ray
def test_a_missing_cluster_raises_one_line_and_a_local_one_starts_after_it(monkeypatch, refused):
    for address in ("127.0.0.1:1", "ray://127.0.0.1:9"):
        monkeypatch.setenv("RAY_ADDRESS", address)
        with refused(address):
            list(engines.run("ray", threads_and_square, [1], 1))
    monkeypatch.delenv("RAY_ADDRESS")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    with skipped_without_a_server():
        found = list(engines.run("ray", threads_and_square, [3], 1))
    assert [square for square, *_ in found] == [9]
