"""Fits of many channels: identical results with any number of workers, safe folder names, and atomic output."""

import contextlib
import dataclasses
import importlib.util
import json
import multiprocessing
import os
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.enhanced_simulator import fit_many, fitting, report_figure, report_measure
from enhsim_tf.enhanced_simulator.fit_many import MANIFEST, fit_channels, fit_job
from enhsim_tf.enhanced_simulator.fit_options import FitOptions
from enhsim_tf.enhanced_simulator.model_folder import folder_of, models_of, refuse_foreign
from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
from enhsim_tf.enhancer import network as enhancer
from enhsim_tf.enhancer.network import build_enhancer
from enhsim_tf.telemetry.cleaning.clean import Cleaning

TINY = {"window": 64, "num_windows": 30, "epochs": 1, "noise": "autoregression", "seed": 3, "enhancer": "network"}
REPORTS = []  # reports of the first fit
HOSTILE = ["../x", "a/b", "<b>", ".", "..", ".hidden", "%2E", "a%2Fb", " ", "ä 漢", "C:\\x", "[!.]*", "~", "-rf", "a\nb", "manifest.json"]


def series(period=40, num_samples=1_200, seed=0):
    rng = np.random.default_rng(seed)
    values = np.sin(2 * np.pi * np.arange(num_samples) / period) + 0.1 * rng.standard_normal(num_samples)
    return pd.Series(values, index=pd.date_range("2024-01-01", periods=num_samples, freq="10s", name="time"))


def files(folder):
    """Returns the bytes of every file in a folder, including hidden files."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def quick(monkeypatch):
    """Uses a narrow enhancer, and one report, measured on a few windows, for all fits."""
    measure = fitting.report_on

    def report_on(simulator, learnt, *others):
        if not REPORTS:
            REPORTS.append(measure(simulator, learnt, *others))
        return dataclasses.replace(REPORTS[0], channel=learnt[0].name)

    monkeypatch.setattr(fitting, "report_on", report_on)
    monkeypatch.setattr(enhancer, "build_enhancer", lambda window, seed: build_enhancer(window, 16, seed=seed))
    monkeypatch.setattr(report_measure, "_NUM_WINDOWS", 60)
    monkeypatch.setattr(report_measure, "_compare_noise", lambda *arguments: (16, []))


def fit(out, given, workers=0, engine="local", **changed):
    told = []
    return fit_channels(given, out, FitOptions(**(TINY | changed)), Cleaning(max_fill=5), workers, told.append, engine=engine), told


# names


@pytest.mark.parametrize("name", HOSTILE)
def test_no_name_gives_a_hidden_folder_or_a_folder_elsewhere(tmp_path, name):
    folder = folder_of(tmp_path / "models", name)
    assert folder.parent == tmp_path / "models" and not folder.name.startswith(".")
    assert os.path.abspath(folder) == str(folder)
    folder.mkdir(parents=True)
    (folder / MANIFEST).write_text("{}")
    assert models_of(tmp_path / "models") == {name: folder} and models_of(folder) == {name: folder}


def test_different_names_have_different_folders():
    assert len({folder_of("m", name) for name in HOSTILE}) == len(HOSTILE)


def test_two_folders_for_the_same_name_are_refused(refused, tmp_path):
    for name in ("a b", "a%20b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "manifest.json").write_text("{}")
    with refused("a b", "a%20b"):
        models_of(tmp_path)


@pytest.mark.parametrize("name", ["", "x" * 161, "漢" * 21])
def test_names_that_are_empty_or_too_long_are_refused(refused, tmp_path, name):
    with refused("1 to 160"):
        fit(tmp_path / "models", {name: series(), "volts": series()})
    assert files(tmp_path) == {}


@pytest.mark.parametrize("where", ["nothing", "empty", "file", "x" * 300, "only hidden"])
def test_folders_without_models_are_refused(refused, tmp_path, where):
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").touch()
    (tmp_path / "only hidden" / ".volts.0123abcd.enhsim_tf").mkdir(parents=True)
    (tmp_path / "only hidden" / ".volts.0123abcd.enhsim_tf" / MANIFEST).write_text("{}")  # temporary folder of a killed process
    with refused("fitted simulators", where[:50]):
        models_of(tmp_path / where)


def test_a_model_below_the_working_directory_has_its_name(tmp_path, monkeypatch):
    (tmp_path / "a%2Fb").mkdir()
    (tmp_path / "a%2Fb" / MANIFEST).write_text("{}")
    monkeypatch.chdir(tmp_path / "a%2Fb")
    assert list(models_of(".")) == ["a/b"]
    monkeypatch.chdir(tmp_path)
    assert list(models_of(".")) == ["a/b"]


# fits


def test_a_folder_contains_the_simulator_and_its_report(tmp_path, quick):
    failed, told = fit(tmp_path, {"a/b": series()})
    assert failed == {} and len(told) == 1
    assert {path.name for path in tmp_path.iterdir()} == {"a%2Fb"}
    assert {path.name for path in (tmp_path / "a%2Fb").iterdir()} == {"arrays.npz", "settings.json", MANIFEST, "report.json", "report.png"}
    report = json.loads((tmp_path / "a%2Fb" / "report.json").read_text())
    assert report["realism"]["channel"] == "a/b" and report["cleaning"]["rows_in"] == 1_200
    assert all(line in told[0] for line in report["realism"]["verdict"]) and "1,200 rows" in told[0]
    assert (tmp_path / "a%2Fb" / "report.png").read_bytes().startswith(b"\x89PNG")
    assert EnhancedSimulator.load(tmp_path / "a%2Fb").trained["telemetry"] == "a/b"


GIVEN = {"../sine": series(num_samples=600), "still": pd.Series(np.ones(600)), "slow": series(55, num_samples=600, seed=1)}


@pytest.fixture(scope="module")
def in_one_process(tmp_path_factory):
    """Two channels fitted one after the other; a third channel cannot be fitted."""
    folder = tmp_path_factory.mktemp("one")
    failed, told = fit(folder, GIVEN, workers=1, window=32)
    assert list(failed) == ["still"] and "constant" in failed["still"] and len(told) == 2
    return folder


def same_models(folder, other):
    """Whether two folders contain the same models."""
    assert models_of(folder).keys() == models_of(other).keys() == {"../sine", "slow"}
    for name, path in models_of(folder).items():
        assert files(path) == files(models_of(other)[name])
    return True


def kill_one_at_work(killed):
    """Kills a worker of this process after it has loaded TensorFlow, that is, during a fit."""
    while not killed:
        for process in multiprocessing.active_children():
            with contextlib.suppress(OSError):
                if "tensorflow" in Path(f"/proc/{process.pid}/maps").read_text():
                    os.kill(process.pid, signal.SIGKILL)
                    return killed.append(process.pid)
        time.sleep(0.01)


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="looks for processes in /proc")
def test_a_killed_worker_does_not_change_the_simulators(in_one_process, tmp_path):
    killed = []
    killer = threading.Thread(target=kill_one_at_work, args=[killed], daemon=True)
    killer.start()
    failed, told = fit(tmp_path / "two", GIVEN, workers=2, window=32)
    killer.join()
    assert len(killed) == 1 and list(failed) == ["still"] and len(told) == 2
    assert [path.name for path in tmp_path.iterdir()] == ["two"] and len(list((tmp_path / "two").iterdir())) == 2
    assert same_models(in_one_process, tmp_path / "two")


@pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason="the optional extra ray is not installed")
def test_ray_fits_the_same_simulators(in_one_process, tmp_path, monkeypatch):
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[2]))  # actors need it to import a package that is not installed
    monkeypatch.chdir(tmp_path)  # actors have another working directory, so the path must be absolute
    failed, told = fit("ray", GIVEN, workers=2, window=32, engine="ray")
    assert list(failed) == ["still"] and "constant" in failed["still"]
    assert sorted(line.splitlines()[-1].rpartition(" in ")[2] for line in told) == ["ray/%2E%2E%2Fsine/", "ray/slow/"]
    assert same_models(in_one_process, tmp_path / "ray")


def test_a_worker_that_is_always_killed_does_not_stop_the_command(tmp_path, monkeypatch):
    failed, _ = fit(tmp_path, {"a": series(num_samples=600), "b": Deadly()}, workers=2, window=32)
    assert list(failed) == ["b"] and "were killed" in failed["b"] and list(models_of(tmp_path)) == ["a"]


class Deadly:
    """Ends the process that unpickles it, as a machine without free memory does."""

    def __reduce__(self):
        return os._exit, (9,)


# existing folders


@pytest.mark.parametrize("content", ["notes.txt", MANIFEST])
def test_a_folder_with_other_content_is_left_unchanged(refused, tmp_path, content):
    (tmp_path / "volts").mkdir()
    (tmp_path / "volts" / content).write_text('{"name": "an extension of a browser"}')
    before = files(tmp_path)
    with refused("something else", "volts"):
        fit(tmp_path, {"amps": series(), "volts": series()})
    assert files(tmp_path) == before  # amps was not fitted either: all folders are checked before the first fit


def test_a_file_of_the_same_name_is_left_unchanged(refused, tmp_path):
    (tmp_path / "volts").write_text("mine")
    with refused("something else"):
        fit(tmp_path, {"volts": series()})
    (tmp_path / "link").symlink_to("nowhere")
    with refused("something else"):
        refuse_foreign(tmp_path / "link")
    assert (tmp_path / "volts").read_text() == "mine"


def test_the_folder_of_a_model_is_refused_as_output(refused, tmp_path, quick):
    fit(tmp_path, {"volts": series()})
    with refused("a model itself"):
        fit(tmp_path / "volts", {"amps": series()})


def test_an_earlier_fit_or_an_empty_folder_is_replaced(tmp_path, quick):
    folder_of(tmp_path, "volts").mkdir()
    assert fit(tmp_path, {"volts": series()})[0] == {}
    before = files(tmp_path)
    assert fit(tmp_path, {"volts": series()}, seed=4)[0] == {}
    after = files(tmp_path)
    assert set(before) == set(after) and before["volts/arrays.npz"] != after["volts/arrays.npz"]


@pytest.mark.parametrize("there_before", [False, True])
def test_a_failure_leaves_no_partial_output(tmp_path, quick, monkeypatch, refused, there_before):
    if there_before:
        fit(tmp_path, {"volts": series()})
    before = files(tmp_path)

    def fail(report):
        raise OSError("no space left on device")

    monkeypatch.setattr(report_figure, "channel_figure", fail)
    with refused("no space"):
        fit(tmp_path, {"volts": series()}, seed=5)
    assert files(tmp_path) == before and [path.name for path in tmp_path.iterdir()] == ["volts"] * there_before


def test_temporary_folders_of_killed_processes_are_removed(tmp_path, quick):
    left = tmp_path / ".volts.0123abcd.enhsim_tf"
    left.mkdir()
    fit(tmp_path, {"volts": series()})
    assert [path.name for path in tmp_path.iterdir()] == ["volts"]


def test_other_content_written_during_the_fit_is_left_unchanged(tmp_path, quick, refused, monkeypatch):
    job = fit_many.Job("volts", series(), tmp_path / "volts", FitOptions(**TINY), Cleaning())
    (tmp_path / "volts").mkdir()
    (tmp_path / "volts" / "notes.txt").write_text("mine")
    with refused("something else"):
        fit_job(job)
    assert files(tmp_path) == {"volts/notes.txt": b"mine"}
