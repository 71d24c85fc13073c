"""Tests of console output: flushed at once, in characters that the terminal can encode, without warnings of Python."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def test_a_line_is_printed_at_once():
    script = "import os\nfrom enhsim_tf.common.console import tell\ntell('a line')\nos._exit(0)"  # os._exit discards unwritten output
    ended = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True)
    assert ended.stdout == "a line\n"


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_characters_outside_the_encoding_are_replaced(encoding):
    script = "from enhsim_tf.common.console import tell\ntell('Größe 漢')"
    ended = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, env=os.environ | {"PYTHONIOENCODING": encoding})
    assert (ended.stdout.decode(encoding), ended.stderr) == (
        {"ascii": "Gr??e ?\n", "latin-1": "Größe ?\n"}.get(encoding, "Größe 漢\n"),
        b"",
    )


def test_a_progress_bar_of_a_terminated_process_causes_no_semaphore_warning():
    script = "import os\nfrom enhsim_tf.common.console import progress\nfor _ in progress(range(3), disable=True): pass\nos._exit(0)"
    ended = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True)
    assert (ended.stdout, ended.stderr) == ("", "")
