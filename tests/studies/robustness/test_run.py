"""The experiment on robustness, run for real at smoke budget: one environment, one seed, the whole path."""

import json
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from enhsim_tf.coarse_simulator.degraded import MODES
from enhsim_tf.realism.real_floor import MEASURES
from enhsim_tf.reproduce import __main__ as command
from studies.robustness.degraded_modes import METHODS, SEVERITIES
from studies.robustness.figures import FIGURES
from studies.robustness.findings import KEPT, TABLES
from studies.robustness.negative_controls import NEGATIVE_CONTROLS
from studies.robustness.replicate import ARMS, ENVIRONMENTS, NUM_BLOCKS, QUICK_DETECTORS, VARIATIONS


def run(folder, *options):
    words = ["-m", "enhsim_tf.reproduce", "--experiment", "robustness", "--budget", "smoke", "--environment", "shot", "--seeds", "1"]
    words += ["--out", str(folder / "out"), "--cache", str(folder / "cache"), *options]
    return subprocess.run([sys.executable, *words], capture_output=True, text=True, timeout=900, check=False)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("experiment")
    finished = run(folder)
    assert finished.returncode == 0, finished.stderr
    return folder, finished.stdout


def test_every_table_has_every_row(done):
    tables = KEPT.read(done[0] / "out" / "robustness")
    assert set(tables) == set(TABLES)
    alarms, recall = tables["alarms"], tables["recall"]
    assert list(dict.fromkeys(alarms["arm"])) == list(ARMS) and set(alarms["environment"]) == {"shot"} and set(alarms["seed"]) == {2_000}
    assert len(alarms) == (7 * len(ARMS) + 3) * 10 and len(recall) == (7 * len(ARMS) + 3) * 8 * 5
    assert (alarms.groupby(["arm", "detector"])["windows"].sum() == 59).all()  # disjoint windows of a quarter of 120,000 samples
    assert ((alarms["alarms"] >= 0) & (alarms["alarms"] <= alarms["windows"])).all()
    assert len(tables["variations"]) == len(VARIATIONS) * len(QUICK_DETECTORS)
    noises = 1 + 2 + sum(" + " in arm for arm in ARMS)  # real, what both pipelines extract, and what they make of it
    assert len(tables["realism"]) == noises * len(MEASURES)
    assert len(tables["parameters"]) == noises * 3 * NUM_BLOCKS  # a shot process has three
    assert len(tables["controls"]) == (1 + len(NEGATIVE_CONTROLS)) * len(MEASURES)
    assert len(tables["degraded"]) == len(METHODS) * (1 + len(MODES) * len(SEVERITIES))


def test_properties_that_hold_for_any_training(done):
    tables = KEPT.read(done[0] / "out" / "robustness")
    errors = tables["degraded"].set_index(["method", "mode", "severity"])["nrmse"]
    # of two sines of amplitudes a the square waves miss sqrt(1.5 - 4 / pi) a, each on its own; the signal is a / sqrt(2)
    missed = np.sqrt(1.5 - 4 / np.pi) * np.sqrt(2)
    assert errors["identity", "nominal", 0.0] == pytest.approx(missed, rel=0.03)
    traces = tables["traces"].set_index(["arm", "detector"])["vus_pr"]
    assert traces["real", "oracle"] > 0.95 > traces["real", "random score"]
    realism = tables["realism"].set_index(["noise", "measure"])
    assert realism.loc[("enhanced + Gaussian", "kurtosis difference"), "value"] < -1  # shot noise has the heavier tails
    mixed = tables["variations"].query("arm == 'enhanced'").groupby(["real_share", "real_threshold"])["alarms"].sum()
    assert mixed[0.25, True] < mixed[0.0, True] and mixed[0.25, True] < mixed[0.25, False]  # most is done by the threshold


def test_figures_are_marked_and_findings_are_json(done):
    folder = done[0] / "out" / "robustness"
    found = json.loads((folder / "findings.json").read_text(encoding="utf-8"))
    assert found["budget"] == "smoke" and found["environments"] == ["shot"] and found["seeds"] == [2_000]
    for name in FIGURES:
        assert 'id="watermark"' in (folder / f"{name}.svg").read_text(encoding="utf-8")
        assert Image.open(folder / f"{name}.png").width == 1_440
    assert "C8" in done[1] and "convolutional GAN: against training on real telemetry, false alarms" in done[1]


def test_a_second_run_trains_nothing_and_says_the_same(done):
    folder, first = done
    again = run(folder)
    assert again.returncode == 0 and " ...\n" not in again.stdout and again.stdout.count("(from the cache)") == 10
    assert again.stdout.split("\n\n")[1] == first.split("\n\n")[1]


def test_the_command_names_the_environments():
    assert command.NOISES == ENVIRONMENTS


@pytest.mark.parametrize(
    "options",
    [["--environment", "white"], ["--seeds", "2"], ["--experiment", "robustness", "--seeds", "0"]]
    + [["--experiment", "robustness", *more] for more in (["--only", "fig04"], ["--seed", "3"], ["--spread", "1"], ["--arrays"])],
    ids=" ".join,
)
def test_options_that_do_not_go_together_are_refused(options, capsys, tmp_path):
    assert command.main([*options, "--out", str(tmp_path / "out")]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and lines[0].startswith("error: Expected ") and "Received: " in lines[0]
    assert not (tmp_path / "out").exists()
