"""Starts TensorFlow for the networks of sections 2.2 and 2.3: `from enhsim_tf.common.backend import
keras, tf`.

Every module with a network imports Keras and TensorFlow from here. Commands, worker processes,
notebooks and programs that use the package as a library therefore share the same settings, and
TensorFlow's start-up messages are suppressed. If TensorFlow was imported earlier, it keeps the
settings with which it started. Variables that the user has set keep their values, see
`docs/speed.md`.
"""

import contextlib
import os
import sys
from collections.abc import Iterator

from enhsim_tf.common.errors import InputError

SETTINGS = {
    # without AVX-512, TensorFlow's default is its own kernels, which take up to three times as long
    "TF_ENABLE_ONEDNN_OPTS": "1",
    "TF_CPP_MIN_LOG_LEVEL": "2",
    "KERAS_BACKEND": "tensorflow",
}
"""Environment variables, and the values that they receive if the user has not set them. Child
processes inherit them.
"""
# prefixes of the variables that configure the memory allocator of glibc
_ALLOCATOR = ("MALLOC_", "GLIBC_TUNABLES")
# parameters of glibc's mallopt
_M_TRIM_THRESHOLD = -1
_M_MMAP_MAX = -4


@contextlib.contextmanager
def _standard_error_silenced() -> Iterator[None]:
    """Redirects the file descriptor of standard error, because TensorFlow writes to it before its
    log level takes effect.
    """
    sys.stderr.flush()
    kept = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def _keep_freed_memory() -> None:
    """Configures glibc to keep memory that was freed, unless the user has configured it.

    By default, it returns every block above 32 MB to the operating system, which then has to clear
    the same pages again for each gradient of the enhancer's widest layer.
    """
    if not sys.platform.startswith("linux") or any(
        name.startswith(_ALLOCATOR) for name in os.environ
    ):
        return
    import ctypes

    library = ctypes.CDLL(None)
    # another C library, such as musl, lacks these settings
    if hasattr(library, "gnu_get_libc_version"):
        library.mallopt(_M_MMAP_MAX, 0)
        library.mallopt(_M_TRIM_THRESHOLD, 2**31 - 1)


def _start() -> None:
    os.environ |= {name: value for name, value in SETTINGS.items() if not os.environ.get(name)}
    _keep_freed_memory()
    with _standard_error_silenced():
        import tensorflow

        tensorflow.config.list_physical_devices()  # the first call prints messages about devices
    # hides warnings about retraced graphs, which users cannot act on
    tensorflow.get_logger().setLevel("ERROR")


if (os.environ.get("KERAS_BACKEND") or "tensorflow") != "tensorflow":
    raise InputError(
        f"Expected KERAS_BACKEND tensorflow. Received: {os.environ['KERAS_BACKEND']}. The networks "
        "are trained with TensorFlow operations: "
        "set the variable to tensorflow, or unset it."
    )
if "tensorflow" not in sys.modules:
    _start()

import keras  # noqa: E402  after the settings
import tensorflow as tf  # noqa: E402

__all__ = ["keras", "tf"]
