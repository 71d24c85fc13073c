"""Starts TensorFlow for the networks of sections 2.2 and 2.3: `from enhsim_tf.common.backend import keras, tf`.

Every module with a network imports Keras and TensorFlow from here. Commands, worker processes, notebooks and programs that
use the package as a library therefore share the same settings (see `tensorflow_settings`), and TensorFlow's start-up
messages are suppressed. If TensorFlow was imported earlier, it keeps the settings with which it started.
"""

import contextlib
import gc
import os
import sys
from collections.abc import Iterator

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.tensorflow_settings import SETTINGS, apply_settings


@contextlib.contextmanager
def _standard_error_silenced() -> Iterator[None]:
    """Redirects the file descriptor of standard error, because TensorFlow writes to it before its log level takes effect."""
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
    """Pauses the garbage collector, which would repeatedly traverse the imported objects although none of them is garbage."""
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

        tensorflow.config.list_physical_devices()  # the first call prints messages about devices
    tensorflow.get_logger().setLevel("ERROR")  # hides warnings about retraced graphs, which users cannot act on


def _check_backend(expected: str, received: str) -> None:
    if received != SETTINGS["KERAS_BACKEND"]:
        raise InputError(
            f"{expected} tensorflow. Received: {received}. The networks are trained with TensorFlow operations: "
            "set the variable to tensorflow, or unset it."
        )


if "tensorflow" not in sys.modules:
    _start()

import keras  # noqa: E402  after the settings
import tensorflow as tf  # noqa: E402

_check_backend("Expected Keras with the backend", keras.backend.backend())

__all__ = ["keras", "tf"]
