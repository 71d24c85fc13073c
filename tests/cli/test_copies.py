"""The option `--coarse` from end to end, and the line of text for each kind of bad input."""

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.__main__ import main
from enhsim_tf.simulator.fit_many import CoarseRun, fit_channels
from enhsim_tf.simulator.options import FitOptions
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.cleaning.clean import Cleaning
from enhsim_tf.telemetry.sources import read_source


def coarse(num_samples=1_500, seed=0):
    rng = np.random.default_rng(seed)
    volts, watts = (np.convolve(each, np.hanning(12), "same") for each in rng.standard_normal((2, num_samples)))
    times = pd.date_range("2024-01-01", periods=num_samples, freq="10s")
    return pd.DataFrame({"utc": times, "volts": volts.round(4), "watts": (100 * watts).round(2)})


def telemetry(run, seed=1):
    noise = 0.1 * np.random.default_rng(seed).standard_normal(len(run))
    celsius = 20 + 2 * run["volts"] + 0.01 * np.roll(run["watts"], 1) + noise
    return pd.DataFrame({"utc": run["utc"], "celsius": celsius.round(4)})


def fault(num_samples=300):
    run = coarse(num_samples, seed=5)
    late = np.arange(num_samples) >= 100
    run.loc[late, "watts"] *= 0.5
    return run.assign(scenario=np.where(late, "weak", "nominal"), severity=0.5 * late, mask=late)


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    """A read-only folder with telemetry, coarse runs and a fitted simulator of recorded runs."""
    folder = tmp_path_factory.mktemp("world")
    run = coarse()
    frames = {
        "simulator": run,
        "telemetry": telemetry(run),
        "fault": fault(),
        "new": telemetry(fault(), seed=9),
        "later": run.assign(utc=run["utc"] + pd.Timedelta("400D")),
        "short": run.iloc[:20],
    }
    for name, frame in frames.items():
        frame.to_csv(folder / f"{name}.csv", index=False)
    said = []
    _, failed = fit_channels(
        read_source(folder / "telemetry.csv"),
        folder / "models",
        FitOptions(window=32, num_windows=300, noise="residual windows"),
        Cleaning(),
        said.append,
        run=CoarseRun(str(folder / "simulator.csv")),
    )
    assert not failed
    (folder / "said.txt").write_text("\n".join(said))
    return folder


def run_command(arguments, capsys):
    code = main([str(each) for each in arguments])
    told = capsys.readouterr()
    return code, told.out.strip().splitlines(), told.err.strip().splitlines()


# from end to end


def test_the_fit_reports_the_pairing_and_the_candidates(world):
    said = (world / "said.txt").read_text()
    assert "delay: none found" in said and "enhancers, error on held-out blocks" in said and "Used: ridge" in said
    assert {path.name for path in (world / "models" / "celsius").iterdir()} >= {"manifest.json", "report.json", "report.png", "arrays.npz"}


def test_fit_as_a_command(world, tmp_path, capsys):
    arguments = ["fit", world / "telemetry.csv", "--coarse", world / "simulator.csv", "--out", tmp_path / "m", "--window", "32"]
    arguments += ["--enhancer", "level-and-gain", "--coarse-column", "volts", "--delay", "10", "--noise", "residual-windows"]
    code, out, errors = run_command(arguments, capsys)
    assert code == 0 and not errors
    assert any("delay: 10 s as given" in line for line in out) and any("Used: level and gain" in line for line in out)
    assert EnhancedSimulator.load(tmp_path / "m" / "celsius").alignment.columns == ("volts",)


def test_two_commands_give_labelled_training_data(world, tmp_path, capsys):
    path = tmp_path / "training.parquet"
    code, out, _ = run_command(["generate", world / "models", "--coarse", world / "fault.csv", "--copies", "4", "--out", path], capsys)
    covered = next(line for line in out if "the training range covers" in line)
    assert code == 0 and "(nominal " in covered and "4 copies of 300 samples" in out[-1]
    assert run_command(["generate", world / "models", "--windows", "5", "--out", tmp_path / "w.parquet"], capsys)[0] == 0, "without a run"
    frame = pd.read_parquet(path)
    assert len(frame) == 1_200 and list(frame.columns) == ["copy", "time", "value", "out_of_range", "scenario", "severity", "mask"]
    run = fault()
    expected = 20 + 2 * run["volts"] + 0.01 * np.roll(run["watts"], 1)
    for _, copy in frame.groupby("copy"):
        assert np.sqrt(np.mean((copy["value"].to_numpy() - expected)[5:-5] ** 2)) < 0.2
        assert copy["scenario"].tolist() == run["scenario"].tolist() and copy["mask"].tolist() == run["mask"].tolist()


def test_scores_are_those_of_the_difference(world, tmp_path, capsys):
    path = tmp_path / "scores.csv"
    code, out, _ = run_command(
        ["score", world / "models", world / "new.csv", "--coarse", world / "fault.csv", "--windows", 300, "--out", path], capsys
    )
    assert code == 0 and "of 300 scored samples" in out[-2]
    assert "events.csv" in out[-1] and "false alarms per day" in out[-1]
    frame = pd.read_csv(path)
    assert list(frame.columns)[1:] == ["value", "enhanced", "score", "flag", "out_of_range"] and len(frame) == 300
    assert np.corrcoef(frame["value"], frame["enhanced"])[0, 1] > 0.98
    assert list(pd.read_csv(tmp_path / "scores.events.csv").columns)[:3] == ["begin", "end", "peak"]


def test_update_as_a_command(world, tmp_path, capsys):
    arguments = ["update", world / "models", world / "telemetry.csv", "--coarse", world / "simulator.csv", "--out", tmp_path / "new"]
    code, out, errors = run_command(arguments, capsys)
    assert code == 0 and not errors and any("updated with 1,500 samples" in line for line in out)
    assert EnhancedSimulator.load(tmp_path / "new" / "celsius").trained["updates"][0]["num_samples"] == 1_500


# bad input: one line, exit code 2, nothing written


@pytest.mark.parametrize(
    ("run", "words"), [(fault().drop(columns="watts"), ["without 'watts'", "volts"]), (fault().assign(value=1.0), ["'value'"])]
)
def test_bad_fault_runs(world, tmp_path, capsys, run, words):
    run.to_csv(tmp_path / "bad.csv", index=False)
    arguments = ["generate", world / "models", "--coarse", tmp_path / "bad.csv", "--out", tmp_path / "out" / "t.parquet"]
    code, out, errors = run_command(arguments, capsys)
    assert code == 2 and len(errors) == 1 and errors[0].startswith("error: Expected ") and not out
    assert all(word in errors[0] for word in words) and not list((tmp_path / "out").iterdir())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["fit", "telemetry.csv", "--delay", "3"], ["--delay", "--coarse"]),
        (["fit", "telemetry.csv", "--coarse-column", "volts"], ["--coarse-column", "--coarse"]),
        (["generate", "models", "--copies", "3", "--windows", "2"], ["--copies", "--coarse"]),
        (["generate", "models", "--coarse", "fault.csv", "--windows", "2"], ["--windows", "--coarse"]),
        (["generate", "models", "--coarse", "fault.csv", "--scenario", "stuck:0.5"], ["--scenario", "--coarse"]),
        (["generate", "models", "--coarse", "fault.csv", "--timeeval"], ["--timeeval", "--coarse"]),
        (["generate", "models", "--coarse", "fault.csv", "--copies", "0"], ["1 copy or more"]),
        (["generate", "models", "--continuous", "1h", "--scenario", "stuck:0.5"], ["generate MODEL_DIR --coarse"]),
        (["generate", "models", "--continuous", "1h", "--at", "stuck:0.5@10/20"], ["generate MODEL_DIR --coarse"]),
        (["generate", "models", "--windows", "4", "--scenario", "stuck:0.5"], ["generate MODEL_DIR --coarse"]),
        (["generate", "models", "--windows", "4", "--scenario", "stuck:0.5", "--workers", "1"], ["a model of recorded runs"]),
        (["generate", "models", "--coarse", "short.csv"], ["at least one window of 32 samples"]),
        (["score", "models", "new.csv"], ["--coarse", "simulator.csv", "Received: none"]),
        (["update", "models", "new.csv"], ["--coarse", "Received: none"]),
        (["score", "models", "new.csv", "--coarse", "later.csv"], ["overlaps the telemetry in time"]),
    ],
)
def test_options_and_models_that_do_not_fit_together(world, tmp_path, capsys, arguments, words, monkeypatch):
    monkeypatch.chdir(world)
    code, _, errors = run_command([*arguments, "--out", tmp_path / "out.parquet"], capsys)
    assert code == 2 and len(errors) == 1 and "Expected " in errors[0] and all(word in errors[0] for word in words)
    assert not (tmp_path / "out.parquet").exists()


def test_a_coarse_run_is_not_overwritten(world, tmp_path, capsys):
    frame = fault()
    frame.to_parquet(tmp_path / "fault.parquet")
    before = (tmp_path / "fault.parquet").read_bytes()
    code, _, errors = run_command(
        ["generate", world / "models", "--coarse", tmp_path / "fault.parquet", "--out", tmp_path / "fault.parquet"], capsys
    )
    assert code == 2 and "differ" in errors[0] and (tmp_path / "fault.parquet").read_bytes() == before
