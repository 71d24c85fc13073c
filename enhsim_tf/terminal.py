"""What the commands keep off the terminal."""

import os
import sys


def start_tensorflow() -> None:
    """Imports TensorFlow without the notes about drivers and kernels that it writes to standard error.

    They are written before any of its own log levels counts, so the file descriptor itself is turned away meanwhile. An
    import that fails still raises.
    """
    if "tensorflow" in sys.modules:
        return
    os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "2")
    sys.stderr.flush()
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        import tensorflow as tf

        tf.config.list_physical_devices()  # the notes about devices come with the first look at them
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
