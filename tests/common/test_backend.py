"""The start of TensorFlow: default settings, settings of the user, and the output on the
terminal.
"""

import os
import sys

import pytest

from tests.clone import python

START = "from enhsim_tf.common.backend import keras, tf\n"
# whether oneDNN's kernels are on, as TensorFlow itself says
STATE = (
    "from tensorflow.python.util import _pywrap_util_port as port\nprint(port.IsMklEnabled(), "
    "keras.backend.backend(), sep=',')\n"
)


def run(code, **environment):
    """Runs code in a separate process, whose environment contains only the given settings."""
    ours = ("TF_", "ONEDNN_", "DNNL_", "KERAS_", "MALLOC_", "GLIBC_TUNABLES")
    clean = {name: value for name, value in os.environ.items() if not name.startswith(ours)}
    return python(code, env=clean | environment)


def test_it_starts_without_a_message_and_gives_standard_error_back():
    code = "import os, sys\nprint('heard', file=sys.stderr)\nos.write(2, b'again')"
    done = run(START + STATE + code)
    assert (done.returncode, done.stdout) == (0, "True,tensorflow\n")
    assert done.stderr == "heard\nagain"


@pytest.mark.slow
@pytest.mark.parametrize(("value", "is_on"), [("0", "False"), ("1", "True"), ("", "True")])
def test_the_users_choice_of_kernels_wins(value, is_on):
    assert run(START + STATE, TF_ENABLE_ONEDNN_OPTS=value).stdout == f"{is_on},tensorflow\n"


REFUSED = (
    "from enhsim_tf.common.errors import InputError\ntry:\n    import "
    "enhsim_tf.common.backend\nexcept InputError as error:\n    print(error)"
)


def test_another_backend_of_keras_is_refused():
    assert run(REFUSED, KERAS_BACKEND="jax").stdout.startswith(
        "Expected KERAS_BACKEND tensorflow. Received: jax."
    )


@pytest.mark.slow
def test_tensorflow_that_runs_already_keeps_its_settings():
    code = (
        "import tensorflow\nimport os\nbefore = dict(os.environ)\n"
        + START
        + "print(dict(os.environ) == before)\n"
        + STATE
    )
    assert run(code, TF_ENABLE_ONEDNN_OPTS="0").stdout == "True\nFalse,tensorflow\n"


# Allocates and frees 40 MB as TensorFlow does for the gradient of the widest layer, and counts the
# pages that came anew.
FAULTS = """
import ctypes, resource
import enhsim_tf.common.backend
library = ctypes.CDLL(None)
library.malloc.restype, library.malloc.argtypes, library.free.argtypes = ctypes.c_void_p, [ctypes.c_size_t], [ctypes.c_void_p]
def touch():
    block = library.malloc(40 << 20)
    ctypes.memset(block, 1, 40 << 20)
    library.free(block)
touch()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(5):
    touch()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before < 5 * 100)
"""


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the allocator of glibc")
@pytest.mark.parametrize(
    ("environment", "kept"), [({}, "True"), ({"MALLOC_MMAP_MAX_": "65536"}, "False")]
)
def test_freed_memory_is_kept_unless_the_user_says_otherwise(environment, kept):
    assert run(FAULTS, **environment).stdout == f"{kept}\n"
