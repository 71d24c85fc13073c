"""Refused input of the commands: exit code 2, one line that says what was expected and received, and no files written."""

import subprocess
import sys
from pathlib import Path

import pytest

from enhsim_tf.reproduce import main

ROOT = Path(__file__).parents[2]


@pytest.fixture
def told(tmp_path, capfd):
    """Runs the command in this process and returns its exit code, its output and the lines of its errors."""

    def run(*arguments):
        code = main(["--out", str(tmp_path / "out"), "--cache", str(tmp_path / "cache"), *map(str, arguments)])
        out, error = capfd.readouterr()
        return code, out, error.splitlines()

    return run


@pytest.fixture
def refused_line(told, tmp_path):
    """Runs the command and checks that it refuses: exit code 2, one line, and no file written. Returns the line."""

    def files():
        return {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*") if path.is_file()}

    def run(*arguments):
        before = files()
        code, out, lines = told("--budget", "smoke", *arguments)
        assert (code, out, len(lines)) == (2, "", 1), lines
        assert lines[0].startswith("error: Expected ") and "Received: " in lines[0]
        assert files() == before
        return lines[0]

    return run


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--seed", "-1"], "-1"),
        (["--seed", str(2**32)], str(2**32)),  # the detectors and the classifier accept no larger seed
        (["--only", "fig99"], "fig99"),
        (["--only", "fig0"], "fig0"),
        (["--only", ""], "--only"),
        (["--seed", "abc"], "'abc'"),
        (["--budget", "tiny"], "'tiny'"),
        (["--seed"], "--seed"),
        (["--sed", "3"], "--sed 3"),
        (["--set", "dropout"], "dropout"),
        (["--set", "no_such=1"], "no_such"),
        (["--experiment", "robustness"], "--experiment"),
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


@pytest.mark.parametrize(
    "arguments",
    [
        ["--set", "no_such=1"],
        ["--out", "README.md/below"],
    ],
)
def test_a_refusal_as_the_shell_sees_it(tmp_path, arguments):
    defaults = [] if "--out" in arguments else ["--out", tmp_path / "out"]
    command = [sys.executable, "-m", "enhsim_tf.reproduce", "--budget", "smoke", *defaults, "--cache", tmp_path / "cache", *arguments]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1 and done.stderr.startswith("error: Expected ")
    assert not list(tmp_path.iterdir())
