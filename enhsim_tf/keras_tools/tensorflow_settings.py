"""The settings that TensorFlow is started with where the user has not chosen others. It imports nothing that is slow.

- oneDNN's kernels are switched on. TensorFlow does so itself on processors with AVX-512 and leaves them off on all others,
  where its plain kernels take up to three times as long.
- glibc keeps memory that TensorFlow frees. By default it returns every block above 32 MB to the system, which then clears
  the same pages again for each gradient of the enhancer's widest layer.

A variable that the user has set keeps its value: see `docs/environment.md`.
"""

import os
import sys
from collections.abc import Mapping

SETTINGS = {"TF_ENABLE_ONEDNN_OPTS": "1", "TF_CPP_MIN_LOG_LEVEL": "2", "KERAS_BACKEND": "tensorflow"}
"""Environment variables that are set where the user has not set them."""
ALLOCATOR = ("MALLOC_", "GLIBC_TUNABLES")
"""How the names begin of the variables by which a user tells glibc how to treat memory."""

_M_TRIM_THRESHOLD, _M_MMAP_MAX = -1, -4  # parameters of glibc's mallopt
_LARGEST_INT = 2**31 - 1


def missing_settings(environment: Mapping[str, str]) -> dict[str, str]:
    """The settings of `SETTINGS` that an environment leaves open; an empty value counts as none."""
    return {name: value for name, value in SETTINGS.items() if not environment.get(name)}


def keep_freed_memory() -> bool:
    """Tells glibc to keep memory that was freed; returns whether it does so now.

    It does nothing where the user has set a variable of the allocator, and where the C library is not glibc.
    """
    if not sys.platform.startswith("linux") or any(name.startswith(ALLOCATOR) for name in os.environ):
        return False
    import ctypes

    library = ctypes.CDLL(None)
    if not hasattr(library, "gnu_get_libc_version"):  # musl has no such function, and no such settings
        return False
    return bool(library.mallopt(_M_MMAP_MAX, 0)) and bool(library.mallopt(_M_TRIM_THRESHOLD, _LARGEST_INT))


def apply_settings() -> None:
    """Sets what is missing in this process's environment, from which its child processes inherit it, and the allocator."""
    os.environ |= missing_settings(os.environ)
    keep_freed_memory()
