"""Tests of progress lines: printed by long runs without a terminal, but not in a terminal, a notebook or calls from Python."""

import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.common import console
from enhsim_tf.common.console import SILENT, Progress
from enhsim_tf.common.stages import Stages, Turns
from enhsim_tf.simulator.fitting import fit
from enhsim_tf.simulator.options import FitOptions
from enhsim_tf.telemetry.series import Telemetry
from tests.paper.conftest import TINY_OPTIONS

ROOT = Path(__file__).parents[2]
SPOKEN = re.compile(r"(.*) ([\d,]+) of ([\d,]+), (\d+) %(, about [\d.]+ (s|min|h) left)?")


class Clock:
    """A clock that the test moves."""

    def __init__(self):
        self.now = 1_000.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def at_once(monkeypatch):
    """Prints a line at every step."""
    monkeypatch.setattr(console, "INTERVAL_S", 0.0)


# -- lines of a loop whose pace is known -----------------------------------------------------------------------------------


def walk(clock, loop, steps, seconds):
    for done in steps:
        clock.now += seconds
        loop(done)


def test_the_lines_of_a_loop_of_known_speed(clock):
    told = []
    loop = Progress(told.append, "noise GAN    ", clock).loop("iteration", 1_200)
    walk(clock, loop, range(1, 1_201), 0.0625)  # 75 s in all; fifteen of them end with 240 iterations
    assert told == [
        "noise GAN    iteration 240 of 1,200, 20 %, about 60 s left",
        "noise GAN    iteration 480 of 1,200, 40 %, about 45 s left",
        "noise GAN    iteration 720 of 1,200, 60 %, about 30 s left",
        "noise GAN    iteration 960 of 1,200, 80 %, about 15 s left",
    ]


def test_a_slow_first_step_is_excluded_from_the_estimate(clock):
    told = []
    loop = Progress(told.append, "", clock).loop("iteration", 1_000)
    walk(clock, loop, [1], 16)  # it builds the graph
    walk(clock, loop, range(2, 152), 0.125)
    assert told == ["iteration 1 of 1,000, 0 %", "iteration 121 of 1,000, 12 %, about 110 s left"]


def test_the_interval_between_lines_spans_several_loops(clock):
    told = []
    progress = Progress(told.append, "second       ", clock)
    clock.now += 12  # before the first loop begins
    walk(clock, progress.loop("enhancer, epoch", 2), [1, 1.5], 4)
    walk(clock, progress.loop("noise GAN, iteration", 10), range(1, 10), 2)
    assert told == ["second       enhancer, epoch 1 of 2, 50 %", "second       noise GAN, iteration 6 of 10, 60 %, about 8 s left"]


def test_a_unit_of_several_steps(clock):
    told = []
    loop = Progress(told.append, "", clock).loop("arm", 5)
    walk(clock, loop.within(2, 3), [1, 2], 15)
    assert told == ["arm 3 of 5, 46 %", "arm 3 of 5, 53 %, about 105 s left"]


def test_silent_progress_prints_nothing(at_once, capsys):
    SILENT.loop("epoch", 3)(1)
    assert capsys.readouterr() == ("", "")


# -- what the loops of the library say of themselves -----------------------------------------------------------------------


def test_the_enhancer_reports_finished_epochs():
    from enhsim_tf.common.training import EpochProgress, dense_stack, fit_windows

    windows, done = np.random.default_rng(0).standard_normal((5, 8)).astype(np.float32), []
    network = dense_stack(8, (4, 8), seed=0, name="narrow")
    fit_windows(network, windows, windows, 2, batch_size=2, seed=0, callbacks=[EpochProgress(done.append)], verbose=0)
    assert done == pytest.approx([1 / 3, 2 / 3, 1, 4 / 3, 5 / 3, 2])


def test_a_fit_names_its_steps_where_it_is_asked_to(capsys):
    rng, told = np.random.default_rng(0), []
    telemetry = Telemetry((np.sin(np.arange(1_500) / 5) + 0.1 * rng.standard_normal(1_500)).astype(np.float32))
    options = FitOptions(window=60, num_windows=60, enhancer="ridge", noise="gaussian")
    for progress in (SILENT, Progress(told.append, "volts: ")):
        fit(telemetry, options=options, progress=progress)
        assert capsys.readouterr() == ("", ""), "its lines go where they were asked for"
    assert told == [f"volts: {step} ..." for step in ("enhancer coarse", "enhancer ridge", "noise", "detectors")]


# -- stages, replicates and channels ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("speaks", [False, True])
def test_a_stage_reports_progress_under_its_name_if_asked_to(tmp_path, at_once, speaks):
    told = []
    stages = Stages(tmp_path, tell=told.append, speaks=speaks)

    def make(folder):
        stages.progress.loop("epoch", 4)(1)

    stages.run("enhancer", make, (), ())
    assert told[1:-1] == ["enhancer     epoch 1 of 4, 25 %"] * speaks
    assert stages.progress is SILENT, "nothing speaks in the name of a stage that is done"


def test_a_failed_stage_stops_reporting(tmp_path):
    stages = Stages(tmp_path, tell=lambda line: None, speaks=True)

    def fails(folder):
        assert stages.progress is not SILENT
        raise RuntimeError

    with pytest.raises(RuntimeError):
        stages.run("work", fails, (), ())
    assert stages.progress is SILENT


def stages_of(*found_done):
    return SimpleNamespace(cached=dict(enumerate(found_done)))


def test_consecutive_replicates_report_the_remaining_time(clock):
    told = []
    turns = Turns("replicate", 4, told.append, clock)
    for name, seconds, found_done in (("a", 2, True), ("b", 600, False), ("c", 200, False), ("d", 400, False)):
        turns.begin(name)
        clock.now += seconds
        turns.end(stages_of(True, found_done))
    assert told == [
        "replicate 1 of 4: a",
        "1 of 4 replicates in 2 s; about 6 s left",
        "replicate 2 of 4: b",
        "2 of 4 replicates in 602 s; about 20 min left",  # cached replicates took no time and are excluded from the estimate
        "replicate 3 of 4: c",
        "3 of 4 replicates in 802 s; about 7 min left",
        "replicate 4 of 4: d",
        "4 of 4 replicates in 1202 s",
    ]


# -- the commands, for real ------------------------------------------------------------------------------------------------


@pytest.fixture
def environment(tmp_path):
    """Environment in which a process and its children print a line at every step."""
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "sitecustomize.py").write_text("from enhsim_tf.common import console\nconsole.INTERVAL_S = 0.0\n")
    return os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path / "site"), str(ROOT)]), "TF_CPP_MIN_LOG_LEVEL": "3"}


def spoken_in(text):
    """For each counted unit in the progress lines, with the name of its work: the largest number and the total."""
    found = {}
    for line in text.splitlines():
        if match := SPOKEN.fullmatch(line):
            what, number, total = match.groups()[:3]
            found[what] = int(number.replace(",", "")), int(total.replace(",", ""))
    return found


@pytest.mark.slow
def test_a_log_has_lines_of_every_stage_that_trains(tmp_path, environment):
    command = [sys.executable, "-m", "enhsim_tf.reproduce", "--budget", "smoke", *TINY_OPTIONS, "--only", "fig13"]
    command += ["--out", tmp_path / "out", "--cache", tmp_path / "cache"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=environment, timeout=600)
    assert done.returncode == 0, done.stderr
    # the last epoch and the last records are reported by the end of the stage
    assert spoken_in(done.stdout) == {"enhancer     epoch": (1, 2), "noise GAN    iteration": (35, 40)}


def table(folder):
    values = np.sin(2 * np.pi * np.arange(1_200) / 40) + 0.1 * np.random.default_rng(0).standard_normal((2, 1_200))
    pd.DataFrame({"t": np.arange(1_200), "volts": values[0], "amperes": values[1]}).to_csv(folder / "x.csv", index=False)
    return folder / "x.csv"


FIT = ("--num-windows", "60", "--noise", "gaussian", "--enhancer", "ridge")


@pytest.mark.slow
def test_fitting_processes_name_their_channel(tmp_path, environment):
    command = [
        sys.executable,
        "-m",
        "enhsim_tf",
        "fit",
        table(tmp_path),
        "--out",
        tmp_path / "models",
        "--separately",
        "--workers",
        "2",
        *FIT,
    ]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=600)
    assert (done.returncode, done.stderr) == (0, "")
    assert {f"{name}: enhancer ridge ..." for name in ("volts", "amperes")} <= set(done.stdout.splitlines())


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="exit code 141 is POSIX")
def test_a_closed_output_pipe_does_not_stop_the_fits(tmp_path, environment):
    command = [sys.executable, "-m", "enhsim_tf", "fit", table(tmp_path), "--column", "volts", "--out", tmp_path / "models", *FIT]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment, text=True)
    assert process.stdout.readline() == "reading ...\n"
    process.stdout.close()
    error = process.stderr.read()
    assert (process.wait(), error) == (141, "")
    assert (tmp_path / "models" / "volts" / "manifest.json").is_file()
