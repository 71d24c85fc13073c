"""Default settings for TensorFlow, which trains the networks of sections 2.2 and 2.3. This module imports nothing slow.

- The kernels of oneDNN are enabled. By default, TensorFlow enables them only on processors with AVX-512. On other
  processors, its own kernels take up to three times as long.
- The C library glibc keeps the memory that TensorFlow frees. By default, it returns every block above 32 MB to the operating
  system, which then has to clear the same pages again for each gradient of the enhancer's widest layer.

Variables that the user has set keep their values, see `docs/speed.md`.
"""

import os
import sys
from collections.abc import Mapping

SETTINGS = {"TF_ENABLE_ONEDNN_OPTS": "1", "TF_CPP_MIN_LOG_LEVEL": "2", "KERAS_BACKEND": "tensorflow"}
"""Environment variables, and the values that they receive if the user has not set them."""
ALLOCATOR = ("MALLOC_", "GLIBC_TUNABLES")
"""Prefixes of the environment variables that configure the memory allocator of glibc."""

_M_TRIM_THRESHOLD, _M_MMAP_MAX = -1, -4  # parameters of glibc's mallopt
_LARGEST_INT = 2**31 - 1


def missing_settings(environment: Mapping[str, str]) -> dict[str, str]:
    """Returns the items of `SETTINGS` that are not set in an environment. An empty value counts as not set."""
    return {name: value for name, value in SETTINGS.items() if not environment.get(name)}


def keep_freed_memory() -> bool:
    """Configures glibc to keep memory that was freed.

    The function has no effect if the user has set a variable that configures the allocator, or if the C library is not glibc.

    Returns:
        Whether the setting was changed.
    """
    if not sys.platform.startswith("linux") or any(name.startswith(ALLOCATOR) for name in os.environ):
        return False
    import ctypes

    library = ctypes.CDLL(None)
    if not hasattr(library, "gnu_get_libc_version"):  # the C library is another one, such as musl, which lacks these settings
        return False
    return bool(library.mallopt(_M_MMAP_MAX, 0)) and bool(library.mallopt(_M_TRIM_THRESHOLD, _LARGEST_INT))


def apply_settings() -> None:
    """Sets the missing environment variables, which child processes inherit, and configures the memory allocator."""
    os.environ |= missing_settings(os.environ)
    keep_freed_memory()
