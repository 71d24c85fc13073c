"""Starts TensorFlow, in one place: `from enhsim_tf.keras_tools.backend import keras, tf`.

Every module that holds a network imports both from here, so that commands, worker processes, notebooks and programs which
use the package as a library compute with the same settings (`tensorflow_settings`), and none of TensorFlow's start-up
messages reaches the user. If TensorFlow was imported before, it keeps the settings that it started with.
"""

import contextlib
import gc
import os
import sys
from collections.abc import Iterator

from enhsim_tf.common.errors import InputError
from enhsim_tf.keras_tools.tensorflow_settings import SETTINGS, apply_settings


@contextlib.contextmanager
def _standard_error_silenced() -> Iterator[None]:
    """Turns the file descriptor itself away: TensorFlow writes to it before any of its own log levels counts."""
    sys.stderr.flush()
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


@contextlib.contextmanager
def _garbage_collection_paused() -> Iterator[None]:
    """Rests the garbage collector, which would walk again and again over all that is imported, and that stays."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


def _start() -> None:
    apply_settings()
    _check_backend("Expected KERAS_BACKEND", os.environ["KERAS_BACKEND"])
    with _standard_error_silenced(), _garbage_collection_paused():
        import tensorflow

        tensorflow.config.list_physical_devices()  # the messages about devices come with the first look at them
    tensorflow.get_logger().setLevel("ERROR")  # its warnings are about how often a graph is built, and name no remedy a user has


def _check_backend(expected: str, received: str) -> None:
    if received != SETTINGS["KERAS_BACKEND"]:
        raise InputError(
            f"{expected} tensorflow. Received: {received}. The networks are trained by TensorFlow's operations: choose it, or unset the variable."
        )


if "tensorflow" not in sys.modules:
    _start()

import keras  # noqa: E402  after the settings
import tensorflow as tf  # noqa: E402

_check_backend("Expected Keras with the backend", keras.backend.backend())

__all__ = ["keras", "tf"]
