"""End-to-end tests of the commands, and their error messages for invalid input."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.__main__ import main
from enhsim_tf.cli import arguments as commands
from enhsim_tf.cli.arguments import parse
from enhsim_tf.cli.checks import cleaning_options
from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.detection.anomalies import INJECTIONS
from enhsim_tf.simulator.model_folder import channels_of, models_of
from enhsim_tf.simulator.simulator import EnhancedSimulator
from tests.known_simulators import of_waves

ROOT = Path(__file__).parents[2]
COMMAND = [sys.executable, "-m", "enhsim_tf"]
TINY = [
    "--num-windows",
    "40",
    "--window",
    "64",
    "--enhancer",
    "ridge",
    "--noise",
    "residual-windows",
]


def table(num_samples=1_500):
    """Clean telemetry of two channels."""
    rng, places = np.random.default_rng(0), np.arange(num_samples)
    volts = 20 + 3 * np.sin(2 * np.pi * places / 40) + 0.2 * rng.standard_normal(num_samples)
    amps = np.round(2 + np.sin(2 * np.pi * places / 50), 1)
    return pd.DataFrame(
        {
            "utc": pd.date_range("2024-01-01", periods=num_samples, freq="10s"),
            "volts": volts,
            "amps": amps,
        }
    )


def dirty():
    """The same telemetry with a short and a long gap, duplicate rows, missing values, a word, and unsorted rows."""
    rows = table().astype({"volts": object})
    rows.loc[100:102, "volts"] = np.nan
    rows.loc[200, "volts"] = "offline"
    rows = rows.drop(index=[*range(400, 403), *range(900, 1_000)])
    return pd.concat([rows.iloc[:600], rows.iloc[590:600], rows.iloc[600:]])


def small(*channels, window=60):
    """A simulator that is not fitted, whose waves have about the period of the telemetry."""
    waves = SquareWaveSimulator([SquareWave(400, low=17, high=23)])
    return of_waves([waves] * len(channels), window, 0.2, 10.0, channels=channels)


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    """A read-only folder with telemetry and fitted simulators."""
    folder = tmp_path_factory.mktemp("world")
    table().to_csv(folder / "two.csv", index=False)
    table()[["utc", "volts"]].to_csv(folder / "one.csv", index=False)
    dirty().to_csv(folder / "dirty.csv", index=False)
    pd.DataFrame({"volts": np.ones(1_500), "amps": np.arange(1_500) % 2 * 0.0}).to_csv(
        folder / "still.csv", index=False
    )
    for name in ("volts", "amps"):
        small(name).save(folder / "models" / name)
    small("volts").save(folder / "single" / "volts")
    small("volts", "amps").save(folder / "joint" / "volts~amps")
    (folder / "foreign" / "volts").mkdir(parents=True)
    (folder / "foreign" / "volts" / "notes.txt").write_text("mine")
    return folder


def files(folder):
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}


def coarse_run(num_samples=1_500, seed=0):
    """A recorded run of somebody's own simulator."""
    rng = np.random.default_rng(seed)
    volts, watts = (
        np.convolve(each, np.hanning(12), "same") for each in rng.standard_normal((2, num_samples))
    )
    times = pd.date_range("2024-01-01", periods=num_samples, freq="10s")
    return pd.DataFrame({"utc": times, "volts": volts.round(4), "watts": (100 * watts).round(2)})


def clean_celsius(run):
    return 20 + 2 * run["volts"] + 0.01 * np.roll(run["watts"], 1)


def telemetry_of(run, seed=1):
    noise = 0.1 * np.random.default_rng(seed).standard_normal(len(run))
    return pd.DataFrame({"utc": run["utc"], "celsius": (clean_celsius(run) + noise).round(4)})


def fault_run():
    run, late = coarse_run(300, seed=5), np.arange(300) >= 100
    run.loc[late, "watts"] *= 0.5
    return run.assign(scenario=np.where(late, "weak", "nominal"), severity=0.5 * late, mask=late)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A read-only folder with telemetry, recorded runs, a simulator that was fitted to one, and what the fit said."""
    folder, run = tmp_path_factory.mktemp("runs"), coarse_run()
    frames = {
        "run": run,
        "old": telemetry_of(run),
        "fault": fault_run(),
        "new": telemetry_of(fault_run(), seed=9),
        "short": run.iloc[:20],
    }
    for name, frame in (
        frames | {"later": run.assign(utc=run["utc"] + pd.Timedelta("400D"))}
    ).items():
        frame.to_csv(folder / f"{name}.csv", index=False)
    chosen = ["--window", "32", "--num-windows", "300", "--noise", "residual-windows"]
    ended = shell("fit", "old.csv", "--coarse", "run.csv", "--out", "models", *chosen, cwd=folder)
    assert (ended.returncode, ended.stderr) == (0, ""), ended.stderr
    (folder / "said.txt").write_text(ended.stdout)
    return folder


@pytest.fixture
def told(world, tmp_path, monkeypatch, capfd, request):
    """Runs the command in this process and in a temporary folder; returns exit code, stdout and the lines of stderr."""

    def run(*arguments):
        monkeypatch.chdir(tmp_path)
        arguments = [str(argument).replace("WORLD", str(world)) for argument in arguments]
        if any("RUNS" in argument for argument in arguments):
            arguments = [
                argument.replace("RUNS", str(request.getfixturevalue("runs")))
                for argument in arguments
            ]
        code = main(arguments)
        out, error = capfd.readouterr()
        return code, out, error.splitlines()

    return run


def shell(*arguments, cwd, **options):
    """Runs the command in a new process, as a shell does."""
    path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = os.environ | {"PYTHONPATH": path}
    return subprocess.run(
        [*COMMAND, *map(str, arguments)],
        cwd=cwd,
        env=environment,
        capture_output=True,
        text=True,
        **options,
    )


# help


@pytest.mark.parametrize(
    "words",
    [
        "--help",
        "score --help",
        "scrore",
        "fit x.csv --out m --delay 3",
        "score m x.csv --out y.csv --false-alarm-rate 0",
        "generate m --out x --windows 5 --scenario stuck:half",
        "inject x.csv --out y.csv --kinds rust",
    ],
)
def test_help_and_wrong_options_import_nothing_slow(words):
    arguments = words.split()
    script = (
        "import sys\nfrom enhsim_tf.__main__ import main\ncode = 0\n"
        f"try:\n    code = main({arguments})\nexcept SystemExit as end:\n    code = end.code\n"
        "print('loaded:', [name for name in ('pandas', 'tensorflow', 'keras', 'pyarrow', 'sklearn', 'scipy', 'matplotlib') if name in sys.modules])\n"
        "sys.exit(code)"
    )
    ended = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True)
    assert ended.stdout.splitlines()[-1] == "loaded: []"
    assert ended.returncode == (0 if "--help" in arguments else 2), ended.stderr
    if "--help" in arguments:
        assert (
            "usage: enhsim-tf" in ended.stdout and "exit code" in ended.stdout and not ended.stderr
        )
    else:
        assert len(ended.stderr.splitlines()) == 1 and ended.stderr.startswith("error: Expected ")


# end to end


@pytest.fixture(scope="module")
def fitted(world, tmp_path_factory):
    """A simulator fitted by the command to the dirty table, and the output of the command."""
    folder = tmp_path_factory.mktemp("fitted")
    ended = shell(
        "fit",
        world / "dirty.csv",
        "--column",
        "volts",
        "--drop-bad",
        "--out",
        "models",
        *TINY,
        cwd=folder,
    )
    assert (ended.returncode, ended.stderr) == (0, ""), ended.stderr
    return folder / "models", ended.stdout


def test_fit_prints_the_cleaning_and_the_report(fitted):
    models, said = fitted
    assert {path.name for path in models.iterdir()} == {"volts"}
    assert {"report.json", "report.png", "manifest.json"} <= {
        path.name for path in (models / "volts").iterdir()
    }
    for words in (
        "volts: 1,407 rows",  # 1,500 rows without the 103 dropped ones, and 10 duplicates
        "rows that repeat the time and value of another: 10",
        "gaps of more than 5 samples",
        "filled by straight lines",
        "values that cannot be read, taken as missing: 1",
        "volts: signal: error",
        "volts: noise: residual windows",
        "of held-out time",
        "score uses: ",
        "models/volts/",
    ):
        assert words in said


def test_fit_makes_one_simulator_of_all_channels(told, tmp_path):
    code, out, errors = told("fit", "WORLD/two.csv", "--out", "models", "--json", *TINY)
    assert (code, errors) == (0, []) and set(json.loads(out)) == {"volts~amps"}
    ((name, folder),) = models_of(tmp_path / "models").items()
    assert name == "volts~amps" and channels_of(folder) == ("volts", "amps")
    assert json.loads(out)[name]["report"]["channels"] == ["volts", "amps"]


def test_generate_writes_training_data_with_a_fitted_simulator(fitted, told, tmp_path):
    scenarios = ["--scenario", "stuck:0.5", "--scenario", "drift:1:0.5"]
    code, out, errors = told(
        "generate",
        fitted[0],
        "--windows",
        40,
        *scenarios,
        "--out",
        "deep/training.parquet",
        "--seed",
        3,
    )
    first, second, third = out.splitlines()
    assert (code, errors) == (
        0,
        [],
    ) and first == "volts: 40 windows of 64 samples in deep/training.parquet"
    assert re.fullmatch(
        r"volts: stuck at 0\.5: \d+% of such windows are outside its enhancer's training range",
        second,
    )
    assert third.startswith("volts: drift at 1: 100% of such")
    frame = pd.read_parquet(tmp_path / "deep" / "training.parquet")
    changed = np.stack(frame["mask"]).any(axis=1)
    assert ((frame["scenario"] == "nominal") == ~changed).all() and (
        frame["scenario"] == "drift"
    ).sum() == 10
    assert 0 < (frame["scenario"] == "stuck").sum() <= 10
    assert frame["onset"].min() >= 16 - 4 and np.stack(frame["window"]).shape == (40, 64)
    assert 10 < np.stack(frame["window"]).mean() < 30  # in the telemetry's unit


def test_generate_writes_a_series_with_several_events(fitted, told, tmp_path):
    arguments = [
        "generate",
        fitted[0],
        "--continuous",
        "2000",
        "--scenario",
        "stuck:1",
        "--scenario",
        "drift:1",
        "--number",
        "3",
    ]
    arguments += [
        "--length",
        "30:60",
        "--at",
        "gain_loss:1@2025-01-01T01:00/10min",
        "--start",
        "2025-01-01",
    ]
    code, out, errors = told(*arguments, "--out", "day.csv")
    assert (code, errors) == (0, []) and "with 4 events" in out
    frame = pd.read_csv(tmp_path / "day.csv")
    assert list(frame) == ["time", "value", "scenario", "severity", "onset", "end", "mask"]
    assert (
        set(frame["scenario"]) == {"nominal", "stuck", "drift", "gain_loss"}
        and frame["onset"].nunique() == 4
    )
    first = frame.loc[frame["scenario"] == "gain_loss", "onset"].iloc[0]
    assert 360 - 4 <= first < 420  # changes fade in over a sixteenth of a window
    assert told(*arguments, "--timeeval", "--out", "eval.csv")[0] == 0
    same = pd.read_csv(tmp_path / "eval.csv")
    assert (
        list(same) == ["timestamp", "volts", "is_anomaly"]
        and same["is_anomaly"].astype(bool).tolist() == frame["mask"].tolist()
    )


def test_score_gives_every_sample_a_score_and_a_flag(fitted, told, tmp_path):
    code, out, errors = told(
        "score", fitted[0], "WORLD/one.csv", "--windows", 60, "--figure", "--out", "scores.csv"
    )
    assert (
        (code, errors) == (0, []) and "of 1,500 scored samples" in out and "set to flag 1.0%" in out
    )
    frame = pd.read_csv(tmp_path / "scores.csv")
    assert (
        list(frame.columns) == ["time", "value", "score", "flag"]
        and len(frame) == 1_500
        and frame["score"].notna().all()
    )
    assert (
        pd.DatetimeIndex(frame["time"])
        == pd.date_range("2024-01-01", periods=1_500, freq="10s", tz="UTC")
    ).all()
    np.testing.assert_allclose(frame["value"], table()["volts"], rtol=1e-6)
    assert {path.name for path in tmp_path.iterdir()} == {
        "scores.csv",
        "scores.events.csv",
        "scores.png",
    }


def test_a_promise_that_is_not_kept_comes_first_and_is_in_the_json(told, tmp_path):
    simulator = small("volts")
    simulator.trained |= {"keeps_promise": False, "false_alarms": 0.5, "detector": "limit check"}
    simulator.save(tmp_path / "volts")
    words = ("score", "volts", "WORLD/one.csv", "--windows", 30, "--out", "scores.csv")
    assert told(*words)[1].startswith("volts: WARNING: on held-out nominal time 50% were flagged")
    assert json.loads(told(*words, "--json")[1])["volts"]["keeps_promise"] is False


def test_channels_of_other_rates_get_a_simulator_of_their_own_and_the_fit_says_so(told, tmp_path):
    table().assign(amps=table()["amps"].where(np.arange(1_500) % 2 == 0)).to_csv(
        tmp_path / "two.csv", index=False
    )
    code, out, errors = told("fit", "two.csv", "--max-fill", 0, "--out", "models", *TINY)
    assert (code, errors) == (0, []) and "times get a simulator of their own: volts; amps" in out
    assert set(models_of(tmp_path / "models")) == {"volts", "amps"}


def test_update_keeps_the_old_simulator_and_replaces_one_only_if_asked(fitted, told, tmp_path):
    before = files(fitted[0])
    command = ["update", fitted[0], "WORLD/one.csv", "--out", "new"]
    code, out, errors = told(*command)
    assert (code, errors) == (
        0,
        [],
    ) and "volts: updated with 1,500 samples; judged on 300 held-out ones" in out
    assert files(fitted[0]) == before and set(models_of(tmp_path / "new")) == {"volts"}
    code, out, errors = told(*command)
    assert code == 2 and out == "" and "--replace" in errors[0]
    code, out, errors = told(*command, "--replace", "--json", "--seed", 1)
    assert (code, errors) == (0, [])
    update = json.loads(out)["volts"]["update"]
    assert update["num_samples"] == 1_500 and update["before"]["period_s"][
        "volts"
    ] == pytest.approx(400, rel=0.01)


# several channels


def test_several_simulators_have_a_file_each(told, tmp_path):
    code, out, errors = told("generate", "WORLD/models", "--windows", 10, "--out", "sets")
    assert (code, errors, len(out.splitlines())) == (0, [], 2)
    assert {path.name for path in (tmp_path / "sets").iterdir()} == {
        "volts.parquet",
        "amps.parquet",
    }
    assert (
        told(
            "generate", "WORLD/models", "--channel", "amps", "--windows", 1, "--out", "one.parquet"
        )[0]
        == 0
    )
    assert len(pd.read_parquet(tmp_path / "one.parquet")) == 1
    code, out, errors = told(
        "score",
        "WORLD/models",
        "WORLD/two.csv",
        "--windows",
        30,
        "--detector",
        "limit-check",
        "--out",
        "scores.v2/new",
    )
    assert (code, errors) == (0, [])
    names = {"volts.parquet", "amps.parquet", "volts.events.csv", "amps.events.csv"}
    assert {path.name for path in (tmp_path / "scores.v2" / "new").iterdir()} == names
    assert (
        told("generate", "WORLD/single", "--windows", 1, "--out", "scores.v2")[0] == 0
    )  # an existing folder may have a dot in its name


def test_a_simulator_of_several_channels_has_one_file(told, tmp_path):
    drift = ["--scenario", "amps=drift:1"]
    code, out, errors = told(
        "generate", "WORLD/joint", "--windows", 10, *drift, "--out", "x.parquet"
    )
    assert (code, errors) == (0, []) and out.startswith("volts~amps: 10 windows")
    frame = pd.read_parquet(tmp_path / "x.parquet")
    assert np.stack(frame["mask amps"]).any() and not np.stack(frame["mask volts"]).any()
    score = [
        "score",
        "WORLD/joint",
        "WORLD/two.csv",
        "--windows",
        30,
        "--detector",
        "innovation",
        "--out",
        "scores.csv",
        "--json",
    ]
    code, out, errors = told(*score)
    assert (code, errors) == (0, []) and json.loads(out)["volts~amps"]["detector"] == "innovation"
    assert list(pd.read_csv(tmp_path / "scores.csv"))[:4] == ["time", "volts", "amps", "score"]


def test_inject_writes_labelled_telemetry(told, tmp_path):
    place = ["--at", "level_shift:8@2024-01-01T02:00/5min"]
    arguments = [
        "--kinds",
        "all",
        "--length",
        "20:60",
        *place,
        "--seed",
        3,
        "--figure",
        "--out",
        "x.parquet",
    ]
    code, out, errors = told("inject", "WORLD/one.csv", *arguments)
    assert {path.name for path in tmp_path.iterdir()} == {"x.parquet", "x.png"}
    assert code == 0 and not errors and "9 anomalies" in out and "noise sd 0.19" in out
    frame = pd.read_parquet(tmp_path / "x.parquet")
    assert list(frame) == ["time", "value", "scenario", "severity", "onset", "end", "mask"]
    assert frame.loc[frame["severity"] == 8, "time"].min() == pd.Timestamp("2024-01-01T02:00Z")
    assert set(frame["scenario"]) == {"nominal", *INJECTIONS}
    np.testing.assert_array_equal(
        frame["mask"], frame["value"].to_numpy() != table()["volts"].to_numpy(np.float32)
    )


def test_inject_writes_one_table_or_one_file_for_each_channel(told, tmp_path):
    code, _, errors = told(
        "inject",
        "WORLD/two.csv",
        "--kinds",
        "ramp",
        "--at",
        "spike@9/5",
        "--noise-sd",
        1,
        "--timeeval",
        "--out",
        "joint.csv",
    )
    assert (
        code == 0
        and not errors
        and list(pd.read_csv(tmp_path / "joint.csv"))
        == ["timestamp", "volts", "amps", "is_anomaly"]
    )
    code, _, errors = told(
        "inject", "WORLD/two.csv", "--kinds", "ramp", "--timeeval", "--out", "single"
    )
    assert (
        code == 0
        and not errors
        and sorted(path.name for path in (tmp_path / "single").iterdir())
        == ["amps.csv", "volts.csv"]
    )
    code, out, errors = told("inject", "WORLD/two.csv", "--kinds", "delay", "--out", "both.parquet")
    assert (
        code == 0 and not errors and "volts, amps: 1 anomaly, 100 samples of 1,500 changed" in out
    )
    assert list(pd.read_parquet(tmp_path / "both.parquet"))[-2:] == ["mask volts", "mask amps"]


def test_a_single_channel_and_a_single_simulator_match_whatever_their_names(told, tmp_path):
    command = [
        "score",
        "WORLD/single",
        "WORLD/two.csv",
        "--column",
        "amps",
        "--windows",
        30,
        "--out",
        "scores.parquet",
    ]
    code, out, errors = told(
        *command, "--false-alarm-rate", "1e-4"
    )  # smaller than the generated windows support
    assert (code, errors) == (0, []) and "set to flag 0.1% of nominal samples" in out
    assert len(pd.read_parquet(tmp_path / "scores.parquet")) == 1_500
    code, out, errors = told(
        *command[:3], "--detector", "limit-check", "--windows", 30, "--out", "scores.parquet"
    )
    assert (code, errors) == (0, []) and "left out: amps" in out


def test_a_simulator_that_fails_does_not_stop_the_others(told, tmp_path):
    rows = table()
    rows["volts"] = rows["volts"].where(rows.index < 30)  # shorter than a window
    rows.to_csv(tmp_path / "new.csv", index=False)
    code, out, errors = told(
        "score", "WORLD/models", tmp_path / "new.csv", "--windows", 30, "--out", "scores"
    )
    assert (
        code == 2
        and len(errors) == 1
        and errors[0].startswith("error: volts: Expected a part of at least one window")
    )
    assert {path.name for path in (tmp_path / "scores").iterdir()} == {
        "amps.parquet",
        "amps.events.csv",
    } and "amps: " in out


@pytest.mark.parametrize("options", [[], ["--separately", "--workers", "1"]])
def test_every_channel_that_cannot_be_fitted_is_reported_in_one_line(told, tmp_path, options):
    code, out, errors = told("fit", "WORLD/still.csv", "--out", "models", *options, *TINY)
    assert (
        code == 2
        and [line.split(": ")[1] for line in errors] == ["volts", "amps"]
        and out == "reading ...\n"
    )
    assert all(": Expected " in line and "constant" in line for line in errors)
    assert not list(tmp_path.iterdir())


def test_a_fit_that_fails_says_it_once_and_leaves_no_new_folder(told, tmp_path):
    (tmp_path / "old" / "empty").mkdir(parents=True)
    code, _, errors = told(
        "fit", "WORLD/two.csv", "--coarse", "RUNS/later.csv", "--out", "old/new/models"
    )
    assert (code, len(errors)) == (2, 1) and errors[0].startswith(
        "error: volts, amps: Expected a coarse run that overlaps"
    )
    assert [path.name for path in tmp_path.rglob("*")] == ["old", "empty"]


def test_several_sources_and_what_reading_takes_are_options():
    words = [
        "inject",
        "a.csv",
        "b.csv",
        "--missing-values=-999.9,9999",
        "--label-column",
        "x",
        "--no-header",
        "--out",
        "y",
    ]
    options = parse(words)
    chosen = cleaning_options(options, 3)
    assert (
        options.source == ["a.csv", "b.csv"]
        and parse(["inject", "a.csv", "--out", "y"]).source == "a.csv"
    )
    assert (chosen.missing_values, chosen.label_column, chosen.no_header) == (
        ("-999.9", "9999"),
        ("x",),
        True,
    )


# a simulator of one's own

COPIES = ["generate", "RUNS/models", "--coarse", "RUNS/fault.csv", "--out", "x.parquet"]


def test_the_fit_reports_the_pairing_and_the_candidates(runs):
    said = (runs / "said.txt").read_text()
    assert (
        "delay: none found" in said
        and "enhancers, error on held-out blocks" in said
        and "Used: ridge" in said
    )
    assert {path.name for path in (runs / "models" / "celsius").iterdir()} >= {
        "manifest.json",
        "report.json",
        "report.png",
        "arrays.npz",
    }


def test_options_of_a_fit_with_a_run(told, tmp_path):
    chosen = [
        "--enhancer",
        "level-and-gain",
        "--coarse-column",
        "volts",
        "--delay",
        "10",
        "--noise",
        "residual-windows",
        "--window",
        "32",
    ]
    code, out, errors = told(
        "fit", "RUNS/old.csv", "--coarse", "RUNS/run.csv", "--out", "m", *chosen
    )
    assert (
        (code, errors) == (0, [])
        and "delay: 10 s as given" in out
        and "Used: level and gain" in out
    )
    assert EnhancedSimulator.load(tmp_path / "m" / "celsius").alignment.columns == ("volts",)


def test_copies_of_a_run_keep_its_labels(told, tmp_path):
    code, out, errors = told(*COPIES, "--copies", 4)
    covered = next(line for line in out.splitlines() if "the training range covers" in line)
    assert (
        (code, errors) == (0, [])
        and "(nominal " in covered
        and "4 copies of 300 samples" in out.splitlines()[-1]
    )
    frame, run = pd.read_parquet(tmp_path / "x.parquet"), fault_run()
    assert len(frame) == 1_200 and list(frame.columns) == [
        "copy",
        "time",
        "value",
        "out_of_range",
        "scenario",
        "severity",
        "mask",
    ]
    for _, copy in frame.groupby("copy"):
        assert np.sqrt(np.mean((copy["value"].to_numpy() - clean_celsius(run))[5:-5] ** 2)) < 0.2
        assert (
            copy["scenario"].tolist() == run["scenario"].tolist()
            and copy["mask"].tolist() == run["mask"].tolist()
        )
    assert told("generate", "RUNS/models", "--windows", 5, "--out", "w.parquet")[0] == 0, (
        "nominal windows need no run"
    )


def test_scores_are_those_of_the_difference(told, tmp_path):
    score = [
        "score",
        "RUNS/models",
        "RUNS/new.csv",
        "--coarse",
        "RUNS/fault.csv",
        "--windows",
        300,
        "--out",
        "scores.csv",
    ]
    code, out, errors = told(*score)
    assert (
        (code, errors) == (0, [])
        and "of 300 scored samples" in out
        and "events.csv" in out
        and "false alarms per day" in out
    )
    frame = pd.read_csv(tmp_path / "scores.csv")
    assert (
        list(frame.columns)[1:] == ["value", "enhanced", "score", "flag", "out_of_range"]
        and len(frame) == 300
    )
    assert np.corrcoef(frame["value"], frame["enhanced"])[0, 1] > 0.98
    assert list(pd.read_csv(tmp_path / "scores.events.csv").columns)[:3] == ["begin", "end", "peak"]


def test_an_update_with_a_run(told, tmp_path):
    code, out, errors = told(
        "update", "RUNS/models", "RUNS/old.csv", "--coarse", "RUNS/run.csv", "--out", "new"
    )
    assert (code, errors) == (0, []) and "updated with 1,500 samples" in out
    assert (
        EnhancedSimulator.load(tmp_path / "new" / "celsius").trained["updates"][0]["num_samples"]
        == 1_500
    )


# examples of the README and of the page on telemetry of one's own


def test_the_commands_of_the_pages_can_be_parsed():
    pages = [(ROOT / "README.md"), *sorted((ROOT / "docs").glob("*.md"))]
    lines = [
        line.strip()
        for text in (*(page.read_text(encoding="utf-8") for page in pages), commands.EXAMPLES)
        for line in text.splitlines()
    ]
    asked = [
        re.sub(r"^(python -m enhsim_tf|enhsim-tf) ", "", line).split()
        for line in lines
        if re.match(r"(python -m enhsim_tf|enhsim-tf) \S", line)
    ]
    asked = [words for words in asked if "--help" not in words]
    assert {words[0] for words in asked} >= {
        "fit",
        "generate",
        "score",
        "inject",
        "verify",
    } and len(asked) > 15
    for words in asked:
        assert parse(words).command == words[0]


def test_the_python_example_of_the_page_runs(tmp_path, monkeypatch, capsys):
    page = (ROOT / "docs" / "own_data.md").read_text(encoding="utf-8")
    (snippet,) = [
        part.partition("```")[0]
        for part in page.split("```python")[1:]
        if "fit(" in part.partition("```")[0]
    ]
    tiny = "FitOptions(window=64, num_windows=40, enhancer='ridge', noise='residual windows')"
    assert "FitOptions(seed=0)" in snippet and "num_windows=1000" in snippet
    snippet = snippet.replace("FitOptions(seed=0)", tiny).replace(
        "num_windows=1000", "num_windows=20"
    )
    table()[["utc", "volts"]].to_csv(tmp_path / "telemetry.csv", index=False)
    monkeypatch.chdir(tmp_path)
    made = {}
    exec(snippet, made)
    assert (
        made["windows"].shape == (20, 64, 1)
        and made["day"].shape == (8_640, 6)
        and len(made["scores"]) == 1_500
    )
    assert all(isinstance(made[name].index, pd.DatetimeIndex) for name in ("day", "scores"))
    assert (
        tmp_path / "model_dir" / "manifest.json"
    ).is_file() and "volts: signal: error" in capsys.readouterr().out


# invalid input

FIT = ["fit", "WORLD/one.csv", "--out", "models"]
GENERATE = ["generate", "WORLD/single", "--out", "x.parquet"]
INJECT = ["inject", "WORLD/one.csv", "--out", "x.csv"]
SCORE = ["score", "WORLD/single", "WORLD/one.csv", "--out", "x.parquet"]
OF_RUNS = "generate MODEL_DIR --coarse"
WRONG = {
    "no command": ([], "{fit,generate,verify,score,update,inject}"),
    "seed too large": ([*GENERATE, "--windows", "5", "--seed", str(2**31)], str(2**31)),
    "fit into a file": (["fit", "WORLD/one.csv", "--out", "WORLD/one.csv"], "one.csv"),
    "fit into a foreign folder": (
        ["fit", "WORLD/one.csv", "--out", "WORLD/foreign"],
        "something else",
    ),
    "no windows of a large data set": ([*GENERATE, "--workers", "1"], "--windows"),
    "more scenarios than windows": (
        [*GENERATE, "--windows", "2", "--scenario", "stuck:0.5", "--scenario", "drift:1"],
        "each of 2 scenarios",
    ),
    "a range of onsets of events": (
        [*GENERATE, "--continuous", "1d", "--number", "3", "--scenario", "stuck:1:0.1-0.5"],
        "a range of onsets",
    ),
    "neither windows nor a length": (GENERATE, "--windows"),
    "no windows": ([*GENERATE, "--windows", "0"], "--windows 0"),
    "share out of range": (
        [*GENERATE, "--windows", "5", "--scenario", "stuck:0.5", "--nominal-share", "2"],
        "2.0",
    ),
    "scenario of another channel": (
        [*GENERATE, "--windows", "5", "--scenario", "watts=drift:0.5"],
        "'watts'",
    ),
    "start without a series": ([*GENERATE, "--windows", "5", "--start", "2024-01-01"], "--start"),
    "models that are not there": (
        ["generate", "nowhere", "--windows", "5", "--out", "x.parquet"],
        "nowhere",
    ),
    "channel that was not fitted": ([*GENERATE, "--windows", "5", "--channel", "amps"], "'amps'"),
    "one file for two channels": (
        ["generate", "WORLD/models", "--windows", "5", "--out", "x.parquet"],
        "2 files",
    ),
    "output of a name no file can have": (
        ["generate", "WORLD/single", "--windows", "5", "--out", "x" * 300 + ".parquet"],
        "long",
    ),
    "rate of nothing": ([*SCORE, "--false-alarm-rate", "0"], "(--false-alarm-rate)"),
    "hardly any windows": ([*SCORE, "--windows", "9"], "(--windows)"),
    "a percentage of held-out time": ([*FIT, "--held-out", "20"], "(--held-out)"),
    "a window longer than the telemetry": ([*FIT, "--window", "2000"], "--window"),
    "verify a model": (
        ["verify", "WORLD/single"],
        "which has no _manifest.json. Give another folder.",
    ),
    "scores of half of the channels": (
        ["score", "WORLD/joint", "WORLD/one.csv", "--out", "x.csv"],
        "Give telemetry with these columns.",
    ),
    "scores without a clock": (
        [*SCORE[:2], "WORLD/still.csv", "--column", "volts", "--out", "x.csv"],
        "Give telemetry with a time column.",
    ),
    "an interval without a clock": (
        [*SCORE[:2], "WORLD/still.csv", "--column", "volts", "--interval", "10", "--out", "x.csv"],
        "or leave it out.",
    ),
    "telemetry and run swapped": (
        [
            "score",
            "RUNS/models",
            "RUNS/run.csv",
            "--column",
            "volts",
            "--coarse",
            "RUNS/new.csv",
            "--out",
            "x.csv",
        ],
        "Expected a channel of new.csv: celsius. Received: 'volts'.",
    ),
    "scores in place of the telemetry": (
        ["score", "WORLD/single", "WORLD/one.csv", "--out", "WORLD/one.csv"],
        "one.csv for both",
    ),
    "update where a simulator is": (
        ["update", "WORLD/single", "WORLD/one.csv", "--out", "WORLD/models"],
        "--replace",
    ),
    "a delay without a run": ([*FIT, "--delay", "3"], "--delay without --coarse"),
    "windows of a run": ([*COPIES, "--windows", "2"], "--windows with --coarse"),
    "a scenario of a model of runs": (
        [
            "generate",
            "RUNS/models",
            "--windows",
            "4",
            "--scenario",
            "stuck:0.5",
            "--out",
            "x.parquet",
        ],
        f"Received: stuck:0.5:0.25. Simulate it and give the run: {OF_RUNS}",
    ),
    "an event in a series of it": (
        [
            "generate",
            "RUNS/models",
            "--continuous",
            "1h",
            "--at",
            "stuck@10/20",
            "--out",
            "x.parquet",
        ],
        OF_RUNS,
    ),
    "one in a large data set of it": (
        [
            "generate",
            "RUNS/models",
            "--windows",
            "4",
            "--scenario",
            "stuck:0.5",
            "--workers",
            "1",
            "--out",
            "x",
        ],
        OF_RUNS,
    ),
    "a run shorter than a window": (
        ["generate", "RUNS/models", "--coarse", "RUNS/short.csv", "--out", "x.parquet"],
        "32 samples",
    ),
    "scores without a run": (
        ["score", "RUNS/models", "RUNS/new.csv", "--out", "x.parquet"],
        "Expected --coarse",
    ),
    "a run of another time": (
        [
            "score",
            "RUNS/models",
            "RUNS/new.csv",
            "--coarse",
            "RUNS/later.csv",
            "--out",
            "x.parquet",
        ],
        "in time",
    ),
    "inject at a severity that is none": (
        [*INJECT, "--kinds", "ramp", "--severity", "high"],
        "--severity high",
    ),
    "inject at a severity that has no effect": (
        [
            "inject",
            "WORLD/two.csv",
            "--kinds",
            "delay,another_time",
            "--severity",
            "4",
            "--out",
            "x.csv",
        ],
        "Received: --severity. Leave it out.",
    ),
    "inject an unknown kind": (
        [*INJECT, "--kinds", "spikes,delay"],
        "gain, another_time, delay, lost_coupling, common_shift. Received: 'spikes'",
    ),
    "inject into the telemetry itself": (
        ["inject", "WORLD/one.csv", "--kinds", "ramp", "--out", "WORLD/one.csv"],
        "for both",
    ),
    "inject TimeEval's table as Parquet": (
        [*INJECT[:-1], "x.parquet", "--kinds", "ramp", "--timeeval"],
        "x.parquet",
    ),
}


@pytest.mark.filterwarnings("error:::enhsim_tf")
@pytest.mark.parametrize("case", WRONG)
def test_invalid_use_gives_one_line_and_changes_no_file(told, world, tmp_path, case):
    arguments, word = WRONG[case]
    before = files(world)
    code, out, errors = told(*arguments)
    assert (code, len(errors)) == (2, 1) and out in ("", "reading ...\n"), errors
    assert (
        errors[0].startswith("error: ")
        and "Expected " in errors[0]
        and "Received: " in errors[0]
        and word in errors[0]
    )
    assert files(world) == before and not files(tmp_path)


# conditions of the machine


def test_scores_of_a_folder_do_not_overwrite_the_telemetry(told, world, tmp_path):
    table()[["utc", "volts"]].to_parquet(tmp_path / "volts.parquet")
    before = (tmp_path / "volts.parquet").read_bytes()
    code, _, errors = told("score", "WORLD/single", "volts.parquet", "--windows", 30, "--out", ".")
    assert (
        code == 2
        and "for both" in errors[0]
        and (tmp_path / "volts.parquet").read_bytes() == before
    )


def test_a_closed_pipe_ends_the_command_without_a_message(world, tmp_path):
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [*COMMAND, "generate", world / "models", "--windows", "5", "--out", tmp_path / "sets"]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment, text=True
    )
    process.stdout.close()
    error = process.stderr.read()
    assert (process.wait(), error) == (141, "")


@pytest.mark.skipif(os.name != "posix", reason="signals are those of POSIX")
@pytest.mark.parametrize(
    ("engine", "after_s"),
    [
        ("local", 1),
        pytest.param("local", 8, marks=pytest.mark.slow),
        pytest.param("ray", 10, marks=pytest.mark.slow),
    ],
)
def test_an_interrupt_ends_a_fit_with_its_processes(engine, after_s, world, tmp_path):
    if engine == "ray":
        pytest.importorskip("ray", reason="the optional extra ray is not installed")
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [
        *COMMAND,
        "fit",
        world / "two.csv",
        "--out",
        tmp_path / "models",
        "--workers",
        "2",
        "--epochs",
        "1000000",
    ]
    command += ["--separately", "--enhancer", "network", "--engine", engine]
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=environment,
        text=True,
        start_new_session=True,
    )
    while not (tmp_path / "models").is_dir():
        assert process.poll() is None
        time.sleep(0.1)
    time.sleep(after_s)  # the worker processes may be starting or fitting
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does
    out, error = process.communicate(timeout=60)
    assert (process.returncode, error) == (
        130,
        "interrupted; what was finished is kept\n",
    ) and out.startswith("reading ...\n")
    with pytest.raises(ProcessLookupError):  # no process of the session is left
        while True:
            os.killpg(process.pid, 0)
            time.sleep(0.1)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("module", "said"), [("ray", "said"), ("json", "said, and more")])
def test_a_process_that_used_ray_exits_at_once_and_flushes_its_output(module, said):
    program = (
        f"import atexit, sys, types; sys.modules[{module!r}] = types.ModuleType({module!r})\n"
        "from enhsim_tf.__main__ import exit_process\n"
        "atexit.register(lambda: print(', and more', end=''))\n"
        "print('said', end=''); exit_process(3)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=ROOT)
    assert (done.returncode, done.stdout, done.stderr) == (3, said, "")
