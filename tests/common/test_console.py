"""Lines of the commands: printed at once, in characters that the terminal can encode; progress only where it was asked for."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from enhsim_tf.common.console import SILENT, Progress
from enhsim_tf.simulator.fitting import fit
from enhsim_tf.simulator.options import FitOptions
from enhsim_tf.telemetry.series import Telemetry
from tests.paper.conftest import TINY_OPTIONS

ROOT = Path(__file__).parents[2]
SPOKEN = re.compile(r"(.*) ([\d,]+) of ([\d,]+), (\d+) %(, about [\d.]+ (s|min|h) left)?")


@pytest.mark.parametrize(("encoding", "printed"), [("ascii", "Gr??e ?\n"), ("latin-1", "Größe ?\n"), ("utf-8", "Größe 漢\n")])
def test_a_line_is_printed_at_once_in_the_characters_of_the_encoding(encoding, printed):
    script = "import os\nfrom enhsim_tf.common.console import tell\ntell('Größe 漢')\nos._exit(0)"  # os._exit discards unwritten output
    ended = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, env=os.environ | {"PYTHONIOENCODING": encoding})
    assert (ended.stdout.decode(encoding), ended.stderr) == (printed, b"")


# -- progress --------------------------------------------------------------------------------------------------------------


class Clock:
    """A clock that the test moves."""

    now = 1_000.0

    def __call__(self):
        return self.now

    def walk(self, loop, steps, seconds):
        for done in steps:
            self.now += seconds
            loop(done)


def test_a_slow_first_step_is_excluded_from_the_estimate():
    told, clock = [], Clock()
    loop = Progress(told.append, "", clock).loop("iteration", 1_000)
    clock.walk(loop, [1], 16)  # it builds the graph
    clock.walk(loop, range(2, 152), 0.125)
    assert told == ["iteration 1 of 1,000, 0 %", "iteration 121 of 1,000, 12 %, about 110 s left"]


def test_the_interval_between_lines_spans_several_loops_and_units_may_be_fractions():
    told, clock = [], Clock()
    progress = Progress(told.append, "second       ", clock)
    clock.now += 12  # before the first loop begins
    clock.walk(progress.loop("enhancer, epoch", 2), [1, 1.5], 4)
    clock.walk(progress.loop("noise GAN, iteration", 10), range(1, 10), 2)
    assert told == ["second       enhancer, epoch 1 of 2, 50 %", "second       noise GAN, iteration 6 of 10, 60 %, about 8 s left"]


def test_a_fit_names_its_steps_where_it_is_asked_to(capsys):
    rng, told = np.random.default_rng(0), []
    telemetry = Telemetry((np.sin(np.arange(1_500) / 5) + 0.1 * rng.standard_normal(1_500)).astype(np.float32))
    options = FitOptions(window=60, num_windows=60, enhancer="ridge", noise="gaussian")
    for progress in (SILENT, Progress(told.append, "volts: ")):
        fit(telemetry, options=options, progress=progress)
        assert capsys.readouterr() == ("", ""), "its lines go where they were asked for"
    assert told == [f"volts: {step} ..." for step in ("enhancer coarse", "enhancer ridge", "noise", "detectors")]


# -- the commands, for real ------------------------------------------------------------------------------------------------


@pytest.fixture
def environment(tmp_path):
    """Environment in which a process and its children print a line at every step."""
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "sitecustomize.py").write_text("from enhsim_tf.common import console\nconsole.INTERVAL_S = 0.0\n")
    return os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path / "site"), str(ROOT)]), "TF_CPP_MIN_LOG_LEVEL": "3"}


@pytest.mark.slow
def test_a_log_has_lines_of_every_stage_that_trains(tmp_path, environment):
    command = [sys.executable, "-m", "enhsim_tf.reproduce", "--budget", "smoke", *TINY_OPTIONS, "--only", "fig13"]
    command += ["--out", tmp_path / "out", "--cache", tmp_path / "cache"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=environment, timeout=600)
    assert done.returncode == 0, done.stderr
    last = {match[1]: match.group(2, 3) for line in done.stdout.splitlines() if (match := SPOKEN.fullmatch(line))}
    # the last epoch and the last records are reported by the end of the stage
    assert last == {"enhancer     epoch": ("1", "2"), "noise GAN    iteration": ("35", "40")}
