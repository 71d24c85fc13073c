"""Copies of recorded runs on disk: every label stays with its sample, and nothing half written is left."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.coarse_simulator.recording import Recording, Run
from enhsim_tf.datasets.labelled_runs import coverage_lines, write_copies
from enhsim_tf.noise.window_bootstrap import WindowBootstrap
from enhsim_tf.simulator.alignment import Runs
from enhsim_tf.simulator.simulator import EnhancedSimulator
from tests.known_simulators import unchanged

START = "2024-01-01T00:00:00+00:00"


def model(window=8, delay_s=0.0, interval_s=10.0):
    """A simulator of recorded runs: the telemetry is twice the coarse run, which was seen from 0 to 0.75."""
    nominal = Recording(
        (Run((np.arange(31, dtype=np.float32) / 40)[:, None]),), ("volts",), interval_s, START
    )
    noise = WindowBootstrap(0.1 * np.random.default_rng(0).standard_normal((50, window, 1)))
    return EnhancedSimulator(
        Runs(nominal, window, delay_s), unchanged(window, 1, 2.0), noise, ("celsius",), interval_s
    )


def run(**carried):
    parts = []
    for first, length in ((0, 20), (30, 5), (40, 12)):  # the second part is shorter than a window
        places = np.arange(first, first + length)
        labels = {
            "scenario": np.where(places < 45, "nominal", "leak"),
            "severity": places / 100.0,
        } | carried
        parts.append(Run((places[:, None] / 40).astype(np.float32), 10.0 * first, labels))
    return Recording(tuple(parts), ("volts",), 10.0, START, "fault.csv")


def test_every_row_has_its_time_and_labels(tmp_path):
    assert write_copies(tmp_path / "out.parquet", model(), run(), 3, seed=1) == 96
    frame = pd.read_parquet(tmp_path / "out.parquet")
    assert list(frame.columns) == ["copy", "time", "value", "out_of_range", "scenario", "severity"]
    places = ((frame["time"] - pd.Timestamp(START)).dt.total_seconds() / 10).round().astype(int)
    assert (
        places.tolist() == [*range(20), *range(40, 52)] * 3
        and frame["copy"].tolist() == [0] * 32 + [1] * 32 + [2] * 32
    )
    assert (frame["scenario"] == np.where(places < 45, "nominal", "leak")).all()
    np.testing.assert_allclose(frame["severity"], places / 100)
    np.testing.assert_array_equal(frame["out_of_range"] > 1, places >= 40)
    noise = frame["value"] - 2 * places / 40
    assert 0.08 < noise.std() < 0.12 and not np.array_equal(noise[:32], noise[32:64])


def test_times_are_those_of_the_telemetry(tmp_path):
    write_copies(tmp_path / "out.parquet", model(delay_s=25.0), run(), 1)
    assert pd.read_parquet(tmp_path / "out.parquet")["time"].iloc[0] == pd.Timestamp(
        START
    ) + pd.Timedelta("25s")


def test_a_clock_from_zero_is_in_seconds_and_a_mask_of_ones_is_boolean(tmp_path):
    counting = run()
    parts = tuple(
        dataclasses.replace(
            part, carried={"mask": np.arange(len(part)) % 2, "masked": np.ones(len(part), int)}
        )
        for part in counting.parts
    )
    write_copies(
        tmp_path / "out",
        model(delay_s=25.0),
        dataclasses.replace(counting, parts=parts, start="1970-01-01T00:00:00+00:00"),
        1,
    )
    frame = pd.read_parquet(tmp_path / "out")
    assert frame["time"].tolist() == [25.0 + 10 * place for place in (*range(20), *range(40, 52))]
    assert (
        frame["mask"].dtype == bool
        and frame["mask"].tolist() == [False, True] * 16
        and frame["masked"].tolist() == [1] * 32
    )


def test_same_seed_same_bytes_and_fewer_copies_are_the_first_ones(tmp_path):
    for name, copies, seed in (("a", 2, 1), ("b", 2, 1), ("c", 4, 1), ("d", 2, 2)):
        write_copies(tmp_path / name, model(), run(), copies, seed)
    a, b, c, d = ((tmp_path / name).read_bytes() for name in "abcd")
    assert a == b and a != d
    pd.testing.assert_frame_equal(
        pd.read_parquet(tmp_path / "c").iloc[:64], pd.read_parquet(tmp_path / "a")
    )


def test_labels_of_mixed_types_become_text(tmp_path):
    mixed = np.array([1, "two", None, 4.0, np.nan] * 4, object)
    recording = Recording(
        (Run(np.zeros((20, 1), np.float32), 0.0, {"note": mixed}),), ("volts",), 1.0, None
    )
    write_copies(tmp_path / "out.parquet", model(interval_s=1.0), recording, 1)
    frame = pd.read_parquet(tmp_path / "out.parquet")
    assert (
        frame["note"].iloc[0] == "1"
        and frame["note"].iloc[1] == "two"
        and frame["note"].isna().sum() == 8
    )
    assert frame["sample"].tolist() == list(range(20))


def test_nothing_is_written_if_a_run_cannot_be_used(refused, tmp_path):
    with refused("other names", "'value'"):
        write_copies(tmp_path / "out.parquet", model(), run(value=3.0), 2)
    with refused("copy"):
        write_copies(tmp_path / "out.parquet", model(), run(), 0)
    with refused("rows"):
        write_copies(tmp_path / "out.parquet", model(), run(), 10**9)
    with refused("without 'volts'"):
        write_copies(
            tmp_path / "out.parquet",
            model(),
            Recording((Run(np.zeros((20, 1), np.float32)),), ("amps",), 10.0, START),
            2,
        )
    broken = model()
    broken.noise = SimpleNamespace(
        generate_series=lambda num_samples, rng, signal: np.zeros(10**15)
    )
    with pytest.raises(MemoryError):
        write_copies(tmp_path / "out.parquet", broken, run(), 2)
    assert not list(tmp_path.iterdir())


def test_the_lines_say_what_is_covered_and_what_is_left_out():
    lines = coverage_lines(model(), run())
    assert lines[0].startswith(
        "the training range covers 62.5% of the run (nominal 80.0%, leak 0.0%)"
    )  # 20 of 32 samples; 20 of 25
    assert "5 of 37 samples" in lines[-1] and "shorter than a window of 8" in lines[-1]
    still = Recording((Run(np.full((20, 1), 3, np.float32)),), ("volts",), 10.0, START)
    assert "extrapolation" in coverage_lines(model(), still)[0]
