"""Refused input of the commands: exit code 2, one line that says what was expected and received,
and no files written.
"""

import pytest

from enhsim_tf.reproduce import main


@pytest.fixture
def refused_line(tmp_path, capfd):
    """Runs the command and checks that it refuses: exit code 2, one line, and no file or folder
    written. Returns the line.
    """

    def files():
        return {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}

    def run(words):
        before = files()
        given = f"--out {tmp_path}/out --cache {tmp_path}/cache --budget smoke {words}"
        code = main(given.split())
        out, error = capfd.readouterr()
        assert (code, out, error.count("\n")) == (2, "", 1)
        assert error.startswith("error: Expected ") and "Received: " in error
        assert files() == before
        return error

    return run


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--seed -1", "-1"),
        # the detectors and the classifier accept no larger seed
        (f"--seed {2**32}", str(2**32)),
        ("--only fig99", "fig99"),
        ("--seed abc", "'abc'"),
        ("--budget tiny", "'tiny'"),
        ("--sed 3", "--sed 3"),
        ("--set dropout", "dropout"),
        ("--set no_such=1", "no_such"),
        ("--set seed=1", "--seed"),
        ("--set budget=full", "--budget"),
        ("--column 0", "--telemetry"),
        ("--telemetry no/such/file.npy", "no/such/file.npy"),
    ],
)
def test_a_bad_option_is_refused_in_one_line(refused_line, words, said):
    assert said in refused_line(words)


@pytest.mark.parametrize(
    "spelling", ["figures", "figures/", "./figures", "smoke/../figures", "absolute", "link"]
)
def test_a_smoke_run_is_kept_out_of_figures(refused_line, tmp_path, monkeypatch, spelling):
    for folder in ("figures", "smoke"):
        (tmp_path / folder).mkdir()
    (tmp_path / "link").symlink_to("figures")
    (tmp_path / "figures" / "fig02_source_target.png").write_text("full budget")
    monkeypatch.chdir(tmp_path)
    out = tmp_path / "figures" if spelling == "absolute" else spelling
    assert "smoke" in refused_line(f"--only fig02 --out {out}")
    assert (tmp_path / "figures" / "fig02_source_target.png").read_text() == "full budget"
