"""Shared configuration and fixtures: TensorFlow settings, the smoke run, and the check of error messages."""

import contextlib
import ctypes
import functools
import gc
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from filelock import FileLock

if (
    signal.getsignal(signal.SIGINT) is signal.SIG_IGN
):  # background jobs of a shell ignore SIGINT, and so would the processes that tests start
    signal.signal(signal.SIGINT, signal.default_int_handler)

os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")  # before anything imports TensorFlow
for threads in ("TF_NUM_INTRAOP_THREADS", "TF_NUM_INTEROP_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(threads, "1")  # two test processes run at a time, and waiting threads would also use CPU time

from enhsim_tf.common.errors import InputError  # noqa: E402
from enhsim_tf.keras_tools.tensorflow_settings import apply_settings  # noqa: E402

apply_settings()  # tests that import Keras directly use the package's settings

ROOT = Path(__file__).parents[1]
SLOW = "--slow"


def pytest_addoption(parser):
    parser.addoption(SLOW, action="store_true", help="also run the tests that are marked as slow")


def pytest_collection_modifyitems(config, items):
    """Leaves the slow tests out, unless they are asked for."""
    if config.getoption(SLOW):
        return
    left = [item for item in items if item.get_closest_marker("slow")]
    if left:
        config.hook.pytest_deselected(items=left)
        items[:] = [item for item in items if item not in set(left)]


def pytest_terminal_summary(terminalreporter, config):
    if not config.getoption(SLOW):
        terminalreporter.write_line(f"The slow tests were left out. All tests: python -m pytest {SLOW}")


@pytest.fixture(scope="module", autouse=True)
def memory_given_back():
    """Frees the networks and graphs of a test file, which are reference cycles, and returns their memory to the system."""
    yield
    gc.collect()
    if sys.platform == "linux":
        ctypes.CDLL(None).malloc_trim(0)


@pytest.fixture(scope="session")
def smoke_run(tmp_path_factory):
    """One undisturbed smoke run of the reproduction, shared by all test processes and made by the first that needs it.

    Returns:
        The folders `out` and `cache`, the output and exit code of the command, `touched`, which says whether it changed
        committed files, and the function `committed`, with which other runs can be checked.
    """
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "smoke-run"
    with FileLock(f"{folder}.lock"):
        if not (folder / "said.json").is_file():
            before = committed()
            options = ["--budget", "smoke", "--out", folder / "out", "--cache", folder / "cache"]
            done = subprocess.run(
                [sys.executable, "-m", "enhsim_tf.reproduce", *options], cwd=ROOT, capture_output=True, text=True, timeout=600
            )
            said = {"returncode": done.returncode, "stdout": done.stdout, "stderr": done.stderr, "touched": before != committed()}
            folder.mkdir(exist_ok=True)
            (folder / "said.json").write_text(json.dumps(said), encoding="utf-8")
    said = json.loads((folder / "said.json").read_text(encoding="utf-8"))
    assert said["returncode"] == 0, said["stderr"]
    return SimpleNamespace(out=folder / "out", cache=folder / "cache", committed=committed, **said)


def committed():
    """Modification times and sizes of the figures and the README, which no smoke run may change."""
    files = [ROOT / "README.md", *sorted((ROOT / "figures").rglob("*"))]
    return [(file, file.stat().st_mtime_ns, file.stat().st_size) for file in files]


@pytest.fixture(scope="module")
def narrow_enhancer():
    """Fits simulators with an enhancer of 256 units instead of 3,200.

    These tests check the path from telemetry to a simulator. The wide network takes far longer, and after each training
    TensorFlow keeps 130 MB of its weights and moments until the process ends.
    """
    from enhsim_tf.enhancer import candidates, network

    plain = network.build_enhancer
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(network, "build_enhancer", functools.partial(plain, hidden_units=256))
        patch.setattr(candidates, "_PAPER_UNITS", 256)
        yield


@pytest.fixture
def refused():
    """`with refused("word"):` asserts that the block raises an `InputError` of one line with the standard form and the words."""

    @contextlib.contextmanager
    def refused(*words: str):
        with pytest.raises(InputError) as caught:
            yield
        message = str(caught.value)
        assert len(message.splitlines()) == 1
        assert message.startswith("Expected ") and "Received: " in message
        for word in words:
            assert word in message

    return refused


@pytest.fixture
def near():
    """`found == near(expected)` compares nested results up to the last digits, which depend on the processor."""

    def near(value):
        if isinstance(value, dict):
            return {key: near(each) for key, each in value.items()}
        if isinstance(value, list):
            return [near(each) for each in value]
        return pytest.approx(value, rel=1e-9, abs=1e-12) if isinstance(value, float) else value

    return near
