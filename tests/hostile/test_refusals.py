"""Refused input of the commands: exit code 2, one line that says what was expected and received, and no files written."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.reproduce import main
from tests.paper.conftest import TINY_OPTIONS

ROOT = Path(__file__).parents[2]


def _wave(num_samples=4_000):
    return np.sin(np.arange(num_samples) / 15) + 0.1 * np.random.default_rng(0).standard_normal(num_samples)


def _table(path):
    pd.DataFrame({"a": _wave(), "t": [*range(3_999), "soon"]}).to_csv(path, index=False)


def _array(values):
    return lambda path: np.save(path, values)


BAD_FILES = {  # what else a file may hold is tried in tests/telemetry and tests/fuzzing
    "missing": ("x.npy", lambda path: None, []),
    "no rows": ("x.csv", lambda path: path.write_text("value\n"), []),
    "constant": ("x.npy", _array(np.full(4_000, 3.0)), []),
    "too short": ("x.npy", _array(_wave(999)), []),
    "which column": ("x.npy", _array(np.zeros((4_000, 2))), []),
    "a word among the times": ("x.csv", _table, ["--column", "a", "--time", "t"]),
}


@pytest.fixture
def told(tmp_path, capfd):
    """Runs the command in this process and returns its exit code, its output and the lines of its errors."""

    def run(*arguments):
        places = ["--out", str(tmp_path / "out"), "--cache", str(tmp_path / "cache")]
        code = main([*places, "--budget", "smoke", *map(str, arguments)])
        out, error = capfd.readouterr()
        return code, out, error.splitlines()

    return run


@pytest.fixture
def refused_line(tmp_path, capfd):
    """Runs the command and checks that it refuses: exit code 2, one line, and no file written. Returns the line."""

    def run(*arguments):
        before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*") if path.is_file()}
        code, out, (line,) = told(*arguments)
        assert (code, out) == (2, "") and line.startswith("error: Expected ") and "Received: " in line
        assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*") if path.is_file()} == before
        return line

    return run


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--seed", "-1"], "-1"),
        (["--seed", str(2**32)], str(2**32)),  # the detectors and the classifier accept no larger seed
        (["--only", "fig99"], "fig99"),
        (["--column", "0"], "--telemetry"),
        (["--seed", "abc"], "'abc'"),
        (["--budget", "tiny"], "'tiny'"),
        (["--sed", "3"], "--sed 3"),
        (["--set", "no_such=1"], "no_such"),
        (["--telemetry"], "--telemetry"),
    ],
)
def test_a_bad_option_is_refused_in_one_line(refused_line, arguments, word):
    assert word in refused_line(*arguments)


@pytest.mark.parametrize("option", ["--out", "--cache"])
@pytest.mark.parametrize("where", ["file", "file/below"])
def test_a_folder_that_cannot_be_written_is_refused(refused_line, tmp_path, option, where):
    (tmp_path / "file").write_text("a file is in the way")
    assert where in refused_line(option, tmp_path / where)
    assert (tmp_path / "file").read_text() == "a file is in the way"


@pytest.mark.parametrize("spelling", ["figures", "figures/", "./figures", "smoke/../figures", "absolute", "link"])
def test_a_smoke_run_is_kept_out_of_figures(refused_line, tmp_path, monkeypatch, spelling):
    for folder in ("figures", "smoke"):
        (tmp_path / folder).mkdir()
    (tmp_path / "link").symlink_to("figures")
    (tmp_path / "figures" / "fig02_source_target.png").write_text("full budget")
    monkeypatch.chdir(tmp_path)
    out = tmp_path / "figures" if spelling == "absolute" else spelling
    assert "smoke" in refused_line("--only", "fig02", "--out", out)
    assert (tmp_path / "figures" / "fig02_source_target.png").read_text() == "full budget"


def test_a_refusal_as_the_shell_sees_it(tmp_path):
    places = ["--out", tmp_path / "out", "--cache", tmp_path / "cache"]
    command = [sys.executable, "-m", "enhsim_tf.reproduce", "--budget", "smoke", *places, "--telemetry", "no/such/file.npy"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1 and done.stderr.startswith("error: Expected ")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("values", [np.arange(3_000.0), np.concatenate([np.ones(2_200), _wave(800)])], ids=["a ramp", "still in training"])
def test_an_unusual_channel_gets_its_figures_or_one_error_line_before_training(told, tmp_path, values):
    np.save(tmp_path / "channel.npy", values)
    code, _, lines = told(*TINY_OPTIONS, "--only", "fig13", "--telemetry", tmp_path / "channel.npy")
    if code == 0:
        assert not lines and any((tmp_path / "out").glob("fig13*.png"))
    else:
        assert code == 2 and len(lines) == 1 and lines[0].startswith("error: Expected ")
        assert not list((tmp_path / "out").glob("*")) and not list((tmp_path / "cache").glob("enhancer-*"))
