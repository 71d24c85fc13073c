"""End-to-end tests of the commands, and their error messages for invalid input."""

import contextlib
import io
import json
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.__main__ import main
from enhsim_tf.cli import arguments as commands
from enhsim_tf.cli.arguments import parse
from enhsim_tf.cli.checks import cleaning_options
from enhsim_tf.coarse.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.datasets.anomalies import INJECTIONS
from enhsim_tf.simulator.model_folder import channels_of, models_of
from enhsim_tf.simulator.simulator import EnhancedSimulator
from tests.clone import ROOT, answered, blocks_of, python
from tests.fitted_simulators import TINY
from tests.known_simulators import of_waves
from tests.ray_servers import starts_ray

ENVIRONMENT = os.environ | {"PYTHONPATH": str(ROOT)}


def table(num_samples=1_500):
    """Clean telemetry of two channels."""
    rng, places = np.random.default_rng(0), np.arange(num_samples)
    volts = 20 + 3 * np.sin(2 * np.pi * places / 40) + 0.2 * rng.standard_normal(num_samples)
    amps = np.round(2 + np.sin(2 * np.pi * places / 50), 1)
    times = pd.date_range("2024-01-01", periods=num_samples, freq="10s")
    return pd.DataFrame({"utc": times, "volts": volts, "amps": amps})


def dirty():
    """The same telemetry with a short and a long gap, duplicate rows, missing values, a word, and
    unsorted rows.
    """
    rows = table().astype({"volts": object})
    rows.loc[100:102, "volts"] = np.nan
    rows.loc[200, "volts"] = "offline"
    rows = rows.drop(index=[*range(400, 403), *range(900, 1_000)])
    return pd.concat([rows.iloc[:600], rows.iloc[590:600], rows.iloc[600:]])


def small(*channels, window=60):
    """A simulator that is not fitted, whose waves have about the period of the telemetry."""
    waves = SquareWaveSimulator([SquareWave(400, low=17, high=23)])
    nominal = [table()[list(channels)].to_numpy(np.float32)]
    return of_waves([waves] * len(channels), window, 0.2, 10.0, channels=channels, nominal=nominal)


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    """A read-only folder with telemetry and simulators."""
    folder = tmp_path_factory.mktemp("world")
    still = pd.DataFrame({"volts": np.ones(1_500), "amps": np.arange(1_500) % 2 * 0.0})
    for name, frame in (
        ("two", table()),
        ("one", table()[["utc", "volts"]]),
        ("dirty", dirty()),
        ("still", still),
        ("short", table(100)),
    ):
        frame.to_csv(folder / f"{name}.csv", index=False)
    for name in ("volts", "amps"):
        small(name).save(folder / "models" / name)
    small("volts").save(folder / "single" / "volts")
    small("volts", "amps").save(folder / "joint" / "volts~amps")
    (folder / "foreign" / "volts").mkdir(parents=True)
    (folder / "foreign" / "volts" / "notes.txt").write_text("mine")
    return folder


def files(folder):
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}


def names_in(folder):
    return {path.name for path in folder.iterdir()}


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


def said_by(words):
    """What the command says, which must end well."""
    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert main(words.split()) == 0
    return out.getvalue()


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A read-only folder with telemetry, recorded runs, and a simulator that was fitted to one."""
    folder, run = tmp_path_factory.mktemp("runs"), coarse_run()
    for name, frame in (
        ("run", run),
        ("old", telemetry_of(run)),
        ("fault", fault_run()),
        ("new", telemetry_of(fault_run(), seed=9)),
        ("short", run.iloc[:20]),
        ("later", run.assign(utc=run["utc"] + pd.Timedelta("400D"))),
    ):
        frame.to_csv(folder / f"{name}.csv", index=False)
    said_by(
        f"fit {folder}/old.csv --coarse {folder}/run.csv --out {folder}/models --window 32 "
        "--num-windows 300 --noise residual-windows"
    )
    return folder


@pytest.fixture
def ended(world, tmp_path, monkeypatch, capfd, request):
    """Runs the command in this process and in a temporary folder; returns exit code, stdout and the
    lines of stderr.
    """
    monkeypatch.chdir(tmp_path)

    def run(words):
        for name in ("world", "runs"):
            if name.upper() in words:
                words = words.replace(name.upper(), str(request.getfixturevalue(name)))
        code = main(words.split())
        out, error = capfd.readouterr()
        return code, out, error.splitlines()

    return run


@pytest.fixture
def told(ended):
    """Runs the command, which must end well, and returns what it says."""

    def run(words):
        code, out, errors = ended(words)
        assert (code, errors) == (0, [])
        return out

    return run


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
    done = answered("enhsim_tf.__main__", words.split())
    assert done.stdout.splitlines()[-1] == "set()"
    if "--help" in words:
        assert (done.returncode, done.stderr) == (0, "") and "usage: enhsim-tf" in done.stdout
    else:
        assert done.returncode == 2 and len(done.stderr.splitlines()) == 1
        assert done.stderr.startswith("error: Expected ")


# end to end


@pytest.fixture(scope="module")
def fitted(world, tmp_path_factory):
    """A simulator fitted by the command to the dirty table, and the output of the command."""
    folder = tmp_path_factory.mktemp("fitted") / "models"
    return folder, said_by(f"fit {world}/dirty.csv --column volts --drop-bad --out {folder} {TINY}")


def test_fit_counts_what_it_cleaned_and_reports(fitted):
    models, said = fitted
    assert names_in(models) == {"volts"}
    assert names_in(models / "volts") >= {"report.json", "report.png", "manifest.json"}
    for words in (
        "volts: 1,407 rows",  # 1,500 rows without the 103 dropped ones, and 10 duplicates
        "rows that repeat the time and value of another: 10",
        "values that cannot be read, taken as missing: 1",
        "volts: noise: residual windows",
    ):
        assert words in said


def test_fit_makes_one_simulator_of_all_channels_although_they_never_vary(told, tmp_path):
    ((name, about),) = json.loads(told(f"fit WORLD/still.csv --out models --json {TINY}")).items()
    ((found, folder),) = models_of(tmp_path / "models").items()
    assert name == found == "volts~amps"
    assert list(channels_of(folder)) == about["report"]["channels"] == ["volts", "amps"]


def test_generate_writes_training_data_with_a_fitted_simulator(fitted, told, tmp_path):
    first, second, third = told(
        f"generate {fitted[0]} --windows 40 --scenario stuck:0.5 --scenario drift:1:0.5 "
        "--out deep/training.parquet --seed 3"
    ).splitlines()
    assert first == "volts: 40 windows of 64 samples in deep/training.parquet"
    assert re.match(r"volts: stuck at 0\.5: \d+% of such windows are outside", second)
    assert third.startswith("volts: drift at 1: 100% of such")
    frame = pd.read_parquet(tmp_path / "deep" / "training.parquet")
    assert (frame["scenario"] == "drift").sum() == 10
    assert frame["onset"].min() >= 16 - 4 and np.stack(frame["window"]).shape == (40, 64)
    assert 10 < np.stack(frame["window"]).mean() < 30  # in the telemetry's unit


def test_generate_writes_a_series_with_several_events(fitted, told, tmp_path):
    series = (
        f"generate {fitted[0]} --continuous 2000 --scenario stuck:1 --scenario drift:1 --number 3 "
        "--length 30:60 --at gain_loss:1@2025-01-01T01:00/10min --start 2025-01-01"
    )
    assert "with 4 events" in told(f"{series} --out day.csv")
    frame = pd.read_csv(tmp_path / "day.csv")
    assert list(frame) == ["time", "value", "scenario", "severity", "onset", "end", "mask"]
    assert set(frame["scenario"]) == {"nominal", "stuck", "drift", "gain_loss"}
    assert frame["onset"].nunique() == 4
    first = frame.loc[frame["scenario"] == "gain_loss", "onset"].iloc[0]
    assert 360 - 4 <= first < 420  # changes fade in over a sixteenth of a window
    told(f"{series} --timeeval --out eval.csv")
    same = pd.read_csv(tmp_path / "eval.csv")
    assert list(same) == ["timestamp", "volts", "is_anomaly"]
    assert same["is_anomaly"].astype(bool).tolist() == frame["mask"].tolist()


def test_score_gives_every_sample_a_score_and_a_flag(fitted, told, tmp_path):
    said = told(f"score {fitted[0]} WORLD/one.csv --figure --out scores.csv")
    assert "of 1,500 scored samples" in said and "set to flag 3.8%" in said
    frame = pd.read_csv(tmp_path / "scores.csv")
    assert list(frame.columns) == ["time", "value", "score", "flag"]
    assert len(frame) == 1_500 and frame["score"].notna().all()
    assert (pd.DatetimeIndex(frame["time"]) == table()["utc"].dt.tz_localize("UTC")).all()
    np.testing.assert_allclose(frame["value"], table()["volts"], rtol=1e-6)
    assert names_in(tmp_path) == {"scores.csv", "scores.events.csv", "scores.png"}


def test_update_keeps_the_old_simulator_and_replaces_one_only_if_asked(
    fitted, told, ended, tmp_path
):
    before = files(fitted[0])
    command = f"update {fitted[0]} WORLD/one.csv --out new"
    assert "updated with 1,500 samples; judged on 300 held-out ones" in told(command)
    assert files(fitted[0]) == before and set(models_of(tmp_path / "new")) == {"volts"}
    code, out, errors = ended(command)
    assert code == 2 and out == "" and "--replace" in errors[0]
    update = json.loads(told(f"{command} --replace --json --seed 1"))["volts"]["update"]
    assert update["num_samples"] == 1_500
    assert update["before"]["period_s"]["volts"] == pytest.approx(400, rel=0.01)


# several channels


def test_several_simulators_have_a_file_each(told, tmp_path):
    assert len(told("generate WORLD/models --windows 10 --out sets").splitlines()) == 2
    assert names_in(tmp_path / "sets") == {"volts.parquet", "amps.parquet"}
    told("generate WORLD/models --channel amps --windows 1 --out one.parquet")
    assert len(pd.read_parquet(tmp_path / "one.parquet")) == 1
    told("score WORLD/models WORLD/two.csv --out scores.v2/new")
    names = {"volts.parquet", "amps.parquet", "volts.events.csv", "amps.events.csv"}
    assert names_in(tmp_path / "scores.v2" / "new") == names
    # an existing folder may have a dot in its name
    told("generate WORLD/single --windows 1 --out scores.v2")


def test_a_simulator_of_several_channels_has_one_file(told, tmp_path):
    told("generate WORLD/joint --windows 10 --scenario amps=drift:1 --out x.parquet")
    frame = pd.read_parquet(tmp_path / "x.parquet")
    assert np.stack(frame["mask amps"]).any() and not np.stack(frame["mask volts"]).any()
    said = json.loads(told("score WORLD/joint WORLD/two.csv --out scores.csv --json"))
    assert said["volts~amps"]["not_judged"] == []
    assert list(pd.read_csv(tmp_path / "scores.csv"))[:4] == ["time", "volts", "amps", "score"]


def test_inject_writes_labelled_telemetry(told, tmp_path):
    said = told(
        "inject WORLD/one.csv --kinds all --length 20:60 --at level_shift:8@2024-01-01T02:00/5min "
        "--seed 3 --figure --out x.parquet"
    )
    assert names_in(tmp_path) == {"x.parquet", "x.png"}
    assert "9 anomalies" in said and "noise sd 0.19" in said
    frame = pd.read_parquet(tmp_path / "x.parquet")
    assert list(frame) == ["time", "value", "scenario", "severity", "onset", "end", "mask"]
    assert frame.loc[frame["severity"] == 8, "time"].min() == pd.Timestamp("2024-01-01T02:00Z")
    assert set(frame["scenario"]) == {"nominal", *INJECTIONS}
    np.testing.assert_array_equal(
        frame["mask"], frame["value"].to_numpy() != table()["volts"].to_numpy(np.float32)
    )


def test_inject_writes_one_table_or_one_file_for_each_channel(told, tmp_path):
    inject = "inject WORLD/two.csv --kinds"
    told(f"{inject} ramp --at spike@9/5 --noise-sd 1 --timeeval --out joint.csv")
    columns = ["timestamp", "volts", "amps", "is_anomaly"]
    assert list(pd.read_csv(tmp_path / "joint.csv")) == columns
    told(f"{inject} ramp --timeeval --out single")
    assert names_in(tmp_path / "single") == {"amps.csv", "volts.csv"}
    said = told(f"{inject} delay --out both.parquet")
    assert "volts, amps: 1 anomaly, 100 samples of 1,500 changed" in said
    assert list(pd.read_parquet(tmp_path / "both.parquet"))[-2:] == ["mask volts", "mask amps"]


def test_a_single_channel_and_a_single_simulator_match_whatever_their_names(told, tmp_path):
    score = "score WORLD/single WORLD/two.csv --out scores.parquet"
    # smaller than 25 nominal windows support
    said = told(f"{score} --column amps --false-alarm-rate 1e-4")
    assert "set to flag 3.8% of nominal samples" in said
    assert len(pd.read_parquet(tmp_path / "scores.parquet")) == 1_500
    assert "left out: amps" in told(score)


def test_a_simulator_that_fails_does_not_stop_the_others(ended, tmp_path):
    rows = table()
    rows["volts"] = rows["volts"].where(rows.index < 30)  # shorter than a window
    rows.to_csv(tmp_path / "new.csv", index=False)
    code, out, (error,) = ended("score WORLD/models new.csv --out scores")
    assert code == 2 and error.startswith("error: volts: Expected a part of at least one window")
    assert names_in(tmp_path / "scores") == {"amps.parquet", "amps.events.csv"}
    assert "amps: " in out


@pytest.mark.parametrize("options", ["", "--separately --workers 1"])
def test_every_channel_that_cannot_be_fitted_is_reported_in_one_line(ended, tmp_path, options):
    code, _, errors = ended(f"fit WORLD/short.csv --out models {options} {TINY}")
    named = {name for line in errors for name in line.split(": ")[1].split(", ")}
    assert code == 2 and named == {"volts", "amps"}
    assert all(": Expected " in line and "samples to learn from" in line for line in errors)
    assert not names_in(tmp_path)


def test_scores_go_on_without_a_channel_that_is_missing_or_empty(told, tmp_path):
    command = "score WORLD/joint new.csv --out scores.csv"
    for rows, reason in (
        (table().drop(columns="amps"), "amps: not judged: it is not in the source"),
        (table().assign(amps=np.nan), "amps: not judged: "),
    ):
        rows.to_csv(tmp_path / "new.csv", index=False)
        said = told(command)
        assert reason in said and "1,500 scored samples" in said
        assert list(pd.read_csv(tmp_path / "scores.csv")) == ["time", "volts", "score", "flag"]
        assert json.loads(told(f"{command} --json"))["volts~amps"]["not_judged"] == ["amps"]


def test_a_fit_that_fails_says_it_once_and_leaves_no_new_folder(ended, tmp_path):
    (tmp_path / "old" / "empty").mkdir(parents=True)
    code, _, (error,) = ended("fit WORLD/two.csv --coarse RUNS/later.csv --out old/new/models")
    assert code == 2
    assert error.startswith("error: volts, amps: Expected a coarse run that overlaps")
    assert [path.name for path in tmp_path.rglob("*")] == ["old", "empty"]


def test_several_sources_and_what_reading_takes_are_options():
    words = "--missing-values=-999.9,9999 --label-column x --no-header --out y"
    options = parse(["inject", "a.csv", "b.csv", *words.split()])
    chosen = cleaning_options(options, 3)
    assert options.source == ["a.csv", "b.csv"]
    assert parse("inject a.csv --out y".split()).source == "a.csv"
    assert (chosen.missing_values, chosen.label_column) == (("-999.9", "9999"), ("x",))
    assert chosen.no_header


# a simulator of one's own

COPIES = "generate RUNS/models --coarse RUNS/fault.csv --out x.parquet"


def test_options_of_a_fit_with_a_run(told, tmp_path):
    said = told(
        "fit RUNS/old.csv --coarse RUNS/run.csv --out m --enhancer level-and-gain "
        "--coarse-column volts --delay 10 --noise residual-windows --window 32"
    )
    assert "delay: 10 s as given" in said and "Used: level and gain" in said
    assert EnhancedSimulator.load(tmp_path / "m" / "celsius").alignment.columns == ("volts",)


def test_copies_of_a_run_keep_its_labels(told, tmp_path):
    said = told(f"{COPIES} --copies 4")
    assert "the training range covers" in said and "4 copies of 300 samples" in said
    frame, run = pd.read_parquet(tmp_path / "x.parquet"), fault_run()
    assert len(frame) == 1_200
    for _, copy in frame.groupby("copy"):
        assert np.sqrt(np.mean((copy["value"].to_numpy() - clean_celsius(run))[5:-5] ** 2)) < 0.2
        assert copy[["scenario", "mask"]].to_numpy().tolist() == (
            run[["scenario", "mask"]].to_numpy().tolist()
        )
    told("generate RUNS/models --windows 5 --out w.parquet")  # nominal windows need no run


def test_scores_are_those_of_the_difference(told, tmp_path):
    said = told("score RUNS/models RUNS/new.csv --coarse RUNS/fault.csv --out scores.csv")
    assert "of 300 scored samples" in said and "false alarms per day" in said
    frame = pd.read_csv(tmp_path / "scores.csv")
    columns = ["time", "value", "enhanced", "score", "flag", "out_of_range"]
    assert list(frame.columns) == columns and len(frame) == 300
    assert np.corrcoef(frame["value"], frame["enhanced"])[0, 1] > 0.98
    events = pd.read_csv(tmp_path / "scores.events.csv")
    assert list(events.columns)[:4] == ["begin", "end", "detected", "peak"]


def test_an_update_with_a_run(told, tmp_path):
    told("update RUNS/models RUNS/old.csv --coarse RUNS/run.csv --out new")
    updates = EnhancedSimulator.load(tmp_path / "new" / "celsius").trained["updates"]
    assert updates[0]["num_samples"] == 1_500


# examples of the README and of the page on telemetry of one's own


def test_the_commands_of_the_pages_can_be_parsed():
    pages = [(ROOT / "README.md"), *sorted((ROOT / "docs").glob("*.md"))]
    texts = [*(page.read_text(encoding="utf-8") for page in pages), commands.EXAMPLES]
    pattern = r"^ *(?:python -m enhsim_tf|enhsim-tf) (\S.*)"
    asked = re.findall(pattern, "\n".join(texts), re.MULTILINE)
    asked = [line.split() for line in asked if "--help" not in line]
    assert {words[0] for words in asked} >= {"fit", "generate", "score", "inject", "verify"}
    assert len(asked) > 15
    for words in asked:
        assert parse(words).command == words[0]


def test_the_python_example_of_the_page_runs(tmp_path, monkeypatch, capsys):
    (snippet,) = [block for block in blocks_of("docs/own_data.md") if "fit(" in block]
    tiny = "FitOptions(window=64, num_windows=40, enhancer='ridge', noise='residual windows')"
    for long, short in (("FitOptions(seed=0)", tiny), ("num_windows=1000", "num_windows=20")):
        assert long in snippet
        snippet = snippet.replace(long, short)
    table()[["utc", "volts"]].to_csv(tmp_path / "telemetry.csv", index=False)
    monkeypatch.chdir(tmp_path)
    made = {}
    exec(snippet, made)
    day, scores = made["day"], made["scored"].table
    assert (made["windows"].shape, day.shape, len(scores)) == ((20, 64, 1), (8_640, 6), 1_500)
    assert all(isinstance(table.index, pd.DatetimeIndex) for table in (day, scores))
    assert (tmp_path / "model_dir" / "manifest.json").is_file()
    assert "volts: signal: error" in capsys.readouterr().out


# invalid input

FIT = "fit WORLD/one.csv --out models"
GENERATE = "generate WORLD/single --out x.parquet"
INJECT = "inject WORLD/one.csv --out x.csv"
SCORE = "score WORLD/single WORLD/one.csv --out x.parquet"
STILL = "score WORLD/single WORLD/still.csv --column volts --out x.csv"
OF_RUNS = "generate RUNS/models --out x.parquet"
WRONG = {  # a command, and what its error says
    "": "{fit,generate,verify,score,update,inject}",
    f"{GENERATE} --windows 5 --seed {2**31}": str(2**31),
    "fit WORLD/one.csv --out WORLD/one.csv": "one.csv",
    "fit WORLD/one.csv --out WORLD/foreign": "something else",
    f"{FIT} --held-out 20": "(--held-out)",
    f"{FIT} --window 2000": "--window",
    f"{FIT} --delay 3": "--delay without --coarse",
    f"{FIT} --coarse WORLD/one.csv --part-column time": "--part-column with --coarse",
    GENERATE: "--windows",
    f"{GENERATE} --workers 1": "--windows",
    f"{GENERATE} --windows 0": "--windows 0",
    f"{GENERATE} --continuous 1d --number 3 --scenario stuck:1:0.1-0.5": "a range of onsets",
    f"{GENERATE} --windows 5 --scenario stuck:0.5 --nominal-share 2": "2.0",
    f"{GENERATE} --windows 5 --scenario watts=drift:0.5": "'watts'",
    f"{GENERATE} --windows 5 --start 2024-01-01": "--start",
    f"{GENERATE} --windows 5 --channel amps": "'amps'",
    "generate nowhere --windows 5 --out x.parquet": "nowhere",
    "generate WORLD/models --windows 5 --out x.parquet": "2 files",
    f"generate WORLD/single --windows 5 --out {'x' * 300}.parquet": "long",
    "verify WORLD/single": "which has no _manifest.json. Give another folder.",
    f"{SCORE} --false-alarm-rate 0": "(--false-alarm-rate)",
    STILL: "Give telemetry with a time column.",
    f"{STILL} --interval 10": "or leave it out.",
    "score WORLD/single WORLD/one.csv --out WORLD/one.csv": "one.csv for both",
    "update WORLD/single WORLD/one.csv --out WORLD/models": "--replace",
    f"{COPIES} --windows 2": "--windows with --coarse",
    f"{OF_RUNS} --windows 4 --scenario stuck:0.5": "Received: stuck at 0.5. Simulate it and give",
    f"{OF_RUNS} --continuous 1h --at stuck@10/20": "generate MODEL_DIR --coarse",
    "generate RUNS/models --windows 4 --scenario stuck:0.5 --workers 1 --out x": "MODEL_DIR",
    f"{OF_RUNS} --coarse RUNS/short.csv": "32 samples",
    "score RUNS/models RUNS/new.csv --out x.csv": "Give it with --coarse",
    "score RUNS/models RUNS/new.csv --coarse RUNS/later.csv --out x.csv": "in time",
    # the telemetry and the run swapped
    "score RUNS/models RUNS/run.csv --column volts --coarse RUNS/new.csv --out x.csv": (
        "Expected a channel of new.csv: celsius. Received: 'volts'."
    ),
    f"{INJECT} --kinds ramp --severity high": "--severity high",
    "inject WORLD/two.csv --kinds delay,another_time --severity 4 --out x.csv": (
        "Received: --severity. Leave it out."
    ),
    f"{INJECT} --kinds spikes,delay": "common_shift. Received: 'spikes'",
    "inject WORLD/one.csv --out new/folder --kinds ramp --number 9999": "space for events",
    "inject WORLD/one.csv --kinds ramp --out WORLD/one.csv": "for both",
    "inject WORLD/one.csv --kinds ramp --timeeval --out x.parquet": "x.parquet",
}


@pytest.mark.filterwarnings("error:::enhsim_tf")
@pytest.mark.parametrize("words", WRONG, ids=range(len(WRONG)))
def test_invalid_use_gives_one_line_and_changes_no_file(ended, world, tmp_path, words):
    before = files(world)
    code, out, errors = ended(words)
    assert code == 2 and out in ("", "reading ...\n")
    (error,) = errors
    assert error.startswith("error: ") and "Expected " in error and "Received: " in error
    assert WRONG[words] in error
    assert files(world) == before and not names_in(tmp_path)


def test_two_models_of_one_channel_both_score_it(told, tmp_path):
    for name in ("volts", "again"):
        small("volts").save(tmp_path / "models" / name)
    told("score models WORLD/one.csv --out scores")
    one, other = (
        pd.read_parquet(tmp_path / "scores" / f"{name}.parquet") for name in ("volts", "again")
    )
    pd.testing.assert_frame_equal(one, other)
    assert len(one) == 1_500


# conditions of the machine


def test_scores_of_a_folder_do_not_overwrite_the_telemetry(ended, tmp_path):
    table()[["utc", "volts"]].to_parquet(tmp_path / "volts.parquet")
    before = (tmp_path / "volts.parquet").read_bytes()
    code, _, errors = ended("score WORLD/single volts.parquet --out .")
    assert code == 2 and "for both" in errors[0]
    assert (tmp_path / "volts.parquet").read_bytes() == before


def started(words, **options):
    """The command in a new process, as a shell starts it."""
    return subprocess.Popen(
        [sys.executable, "-m", "enhsim_tf", *words.split()],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=ENVIRONMENT,
        text=True,
        **options,
    )


def test_a_closed_pipe_ends_the_command_without_a_message(world, tmp_path):
    process = started(f"generate {world}/models --windows 5 --out {tmp_path}/sets")
    process.stdout.close()
    error = process.stderr.read()
    assert (process.wait(), error) == (141, "")


@pytest.mark.skipif(os.name != "posix", reason="signals are those of POSIX")
@pytest.mark.parametrize(
    ("engine", "after_s"),
    [
        ("local", 1),
        pytest.param("local", 8, marks=pytest.mark.slow),
        pytest.param("ray", 10, marks=[pytest.mark.slow, starts_ray]),
    ],
)
def test_an_interrupt_ends_a_fit_with_its_processes(engine, after_s, world, tmp_path):
    process = started(
        f"fit {world}/two.csv --out {tmp_path}/models --workers 2 --epochs 1000000 --separately "
        f"--enhancer network --engine {engine}",
        start_new_session=True,
    )
    while not (tmp_path / "models").is_dir():
        assert process.poll() is None
        time.sleep(0.1)
    time.sleep(after_s)  # the worker processes may be starting or fitting
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does
    out, error = process.communicate(timeout=60)
    assert (process.returncode, error) == (130, "interrupted; what was finished is kept\n")
    assert out.startswith("reading ...\n")
    if engine == "ray":
        return  # its servers end when Ray sees that their client has gone
    end = time.monotonic() + 60
    with pytest.raises(ProcessLookupError):  # no process of the session is left
        while time.monotonic() < end:
            os.killpg(process.pid, 0)
            time.sleep(0.1)
    assert not names_in(tmp_path)


@pytest.mark.parametrize(("module", "said"), [("ray", "said"), ("json", "said, and more")])
def test_a_process_that_used_ray_exits_at_once_and_flushes_its_output(module, said):
    program = (
        f"import atexit, sys, types; sys.modules[{module!r}] = types.ModuleType({module!r})\n"
        "from enhsim_tf.__main__ import exit_process\n"
        "atexit.register(lambda: print(', and more', end=''))\n"
        "print('said', end=''); exit_process(3)"
    )
    done = python(program)
    assert (done.returncode, done.stdout, done.stderr) == (3, said, "")
