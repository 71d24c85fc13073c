"""Shared configuration and fixtures: TensorFlow settings, and the check of error messages."""

import contextlib
import ctypes
import dataclasses
import functools
import gc
import os
import signal
import sys

import pytest

# background jobs of a shell ignore SIGINT, and so would the processes that tests start
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")  # before anything imports TensorFlow
# as in `common.backend`, also for tests that import Keras directly
os.environ.setdefault("TF_ENABLE_ONEDNN_OPTS", "1")
for threads in (
    "TF_NUM_INTRAOP_THREADS",
    "TF_NUM_INTEROP_THREADS",
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
):
    # two test processes run at a time, and waiting threads would also use CPU time
    os.environ.setdefault(threads, "1")
# on a busy machine Ray's server may need more than its 30 s to start
os.environ.setdefault("RAY_gcs_server_port_wait_time_s", "120")

from enhsim_tf.common.errors import InputError  # noqa: E402

SLOW = "--slow"
LEFT = pytest.StashKey[int]()


def pytest_addoption(parser):
    parser.addoption(SLOW, action="store_true", help="also run the tests that are marked as slow")


def pytest_collection_modifyitems(config, items):
    """Leaves the slow tests out, unless they are asked for."""
    if not config.getoption(SLOW):
        left = {item for item in items if item.get_closest_marker("slow")}
        config.hook.pytest_deselected(items=list(left))
        items[:] = [item for item in items if item not in left]
        config.stash[LEFT] = len(left)
        if hasattr(config, "workeroutput"):  # a process of xdist, which tells the first one
            config.workeroutput["left"] = len(left)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node):
    """Takes the number of tests that a process of xdist left out; all processes have the same."""
    node.config.stash[LEFT] = getattr(node, "workeroutput", {}).get("left", 0)


def pytest_terminal_summary(terminalreporter, config):
    if left := config.stash.get(LEFT, 0):
        terminalreporter.write_line(
            f"{left} slow tests were left out. To run them: python -m pytest {SLOW} -m slow"
        )


@pytest.fixture(scope="module", autouse=True)
def memory_given_back():
    """Frees the networks and graphs of a test file, which are reference cycles, and returns their
    memory to the system.

    The collector does not look again at what was there before the file: the libraries, of which
    TensorFlow alone takes half a second.
    """
    gc.freeze()
    yield
    gc.collect()
    if sys.platform == "linux":
        ctypes.CDLL(None).malloc_trim(0)


@pytest.fixture(scope="module")
def narrow_enhancer():
    """Trains the paper's network with 256 units instead of 3,200.

    Tests with it check what is around a network. After each training of the wide one, TensorFlow
    keeps 130 MB of its weights and moments until the process ends.
    """
    from enhsim_tf.enhancer import candidates

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            candidates, "Settings", functools.partial(candidates.Settings, hidden_units=256)
        )
        yield


@pytest.fixture
def refused():
    """`with refused("word"):` asserts that the block raises an `InputError` of one line with the
    standard form and the words.
    """

    @contextlib.contextmanager
    def refused(*words: str):
        with pytest.raises(InputError) as caught:
            yield caught
        message = str(caught.value)
        assert len(message.splitlines()) == 1
        assert message.startswith("Expected ") and "Received: " in message
        for word in words:
            assert word in message

    return refused


@pytest.fixture
def written(tmp_path):
    """`written(text)` writes a text or a frame to a file, and returns its path."""

    def written(content, name="a.csv"):
        path = tmp_path / name
        text = content if isinstance(content, str) else content.to_csv(index=False)
        path.write_text(text, encoding="utf-8", newline="")
        return path

    return written


@pytest.fixture
def pretended(monkeypatch):
    """Environment variables that name a server of InfluxDB that does not exist."""
    pytest.importorskip("influxdb_client")
    for name, value in {
        "URL": "http://127.0.0.1:9",
        "TOKEN": "token-0123456789abcdef==",
        "ORG": "nobody",
    }.items():
        monkeypatch.setenv(f"INFLUXDB_V2_{name}", value)


@pytest.fixture
def near():
    """`found == near(expected)` compares nested results up to the last digits, which depend on the
    processor.
    """

    def near(value):
        if isinstance(value, dict):
            return {key: near(each) for key, each in value.items()}
        if isinstance(value, list):
            return [near(each) for each in value]
        return pytest.approx(value, rel=1e-9, abs=1e-12) if isinstance(value, float) else value

    return near


# fitted simulators; what takes long to import is imported when one is asked for


@pytest.fixture(scope="session")
def single():
    """A simulator of one channel, whose enhancer and noise were chosen, with its report."""
    from enhsim_tf.fitting.fit import fit
    from enhsim_tf.fitting.options import FitOptions
    from tests.fitted_simulators import WINDOW, series

    return fit(series(), options=FitOptions(window=WINDOW, num_windows=300))


@pytest.fixture(scope="session")
def both():
    """A simulator of two channels with its report."""
    from enhsim_tf.fitting.fit import fit
    from tests.fitted_simulators import QUICK, joint

    return fit(joint(), options=QUICK)


@pytest.fixture(scope="session")
def of_run():
    """A simulator of a recorded run with its report."""
    from enhsim_tf.fitting.fit import fit
    from tests.fitted_simulators import QUICK, coarse_run, series

    return fit(series(), coarse_run(), dataclasses.replace(QUICK, delay_s=0.0))
