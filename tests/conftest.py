"""What all tests share: a quiet TensorFlow, and the one form a user's mistake is answered in."""

import contextlib
import os
import signal

import pytest

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a shell's background job; what the tests start would not hear an interrupt
    signal.signal(signal.SIGINT, signal.default_int_handler)

os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")  # before anything imports TensorFlow

from enhsim_tf.errors import InputError  # noqa: E402
from enhsim_tf.tensorflow_settings import apply_settings  # noqa: E402

apply_settings()  # a test that imports Keras itself computes as the package does


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
