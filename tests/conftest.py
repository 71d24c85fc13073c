"""What all tests share: a quiet TensorFlow, and the one form a user's mistake is answered in."""

import contextlib
import ctypes
import gc
import os
import signal
import sys

import pytest

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a shell's background job; what the tests start would not hear an interrupt
    signal.signal(signal.SIGINT, signal.default_int_handler)

os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")  # before anything imports TensorFlow
for threads in ("TF_NUM_INTRAOP_THREADS", "TF_NUM_INTEROP_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(threads, "1")  # two processes test at a time; threads that wait for each other burn as much as those that work

from enhsim_tf.errors import InputError  # noqa: E402


@pytest.fixture(scope="module", autouse=True)
def memory_given_back():
    """Networks and their graphs are garbage in circles: they go with the file that made them, and their memory to the system."""
    yield
    gc.collect()
    if sys.platform == "linux":
        ctypes.CDLL(None).malloc_trim(0)


@pytest.fixture
def refused():
    """`with refused("word"):` the block raises an `InputError` of one line that names what was expected and received."""

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
    """`found == near(kept)`: the same findings, but for the last digits that another processor computes otherwise."""

    def near(value):
        if isinstance(value, dict):
            return {key: near(each) for key, each in value.items()}
        if isinstance(value, list):
            return [near(each) for each in value]
        return pytest.approx(value, rel=1e-9, abs=1e-12) if isinstance(value, float) else value

    return near
