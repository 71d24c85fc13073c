"""Copies of recorded runs on disk: every label stays with its sample, and nothing half written is
left.
"""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.coarse.runs import Runs
from enhsim_tf.datasets.labelled_runs import coverage_lines, write_copies
from enhsim_tf.noise.window_bootstrap import WindowBootstrap
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.series import Clock, Part, Telemetry
from tests.fitted_simulators import START, recorded
from tests.known_simulators import parts_of, unchanged


def model(window=8, delay_s=0.0, interval_s=10.0):
    """A simulator of recorded runs: the telemetry is twice the coarse run, which was seen from 0 to
    0.75.
    """
    seen = np.arange(31, dtype=np.float32) / 40
    nominal = Telemetry.of(seen, interval_s, start=START, name="volts")
    noise = WindowBootstrap(0.1 * np.random.default_rng(0).standard_normal((50, window, 1)))
    runs = Runs(nominal, ["celsius"], window, delay_s)
    return EnhancedSimulator(runs, unchanged(window, 1, 2.0), noise, ("celsius",), interval_s)


def run(**carried):
    parts = []
    for first, length in ((0, 20), (30, 5), (40, 12)):  # the second part is shorter than a window
        places = np.arange(first, first + length)
        labels = {
            "scenario": np.where(places < 45, "nominal", "leak"),
            "severity": places / 100.0,
        } | {name: np.broadcast_to(values, 20)[:length] for name, values in carried.items()}
        parts.append(Part((places[:, None] / 40).astype(np.float32), 10.0 * first, labels))
    return parts_of(tuple(parts), ("volts",), 10.0, START, "fault.csv")


def test_every_row_has_its_labels_and_the_time_of_the_telemetry(tmp_path):
    assert write_copies(tmp_path / "out.parquet", model(delay_s=25.0), run(), 3, seed=1) == 96
    frame = pd.read_parquet(tmp_path / "out.parquet")
    assert list(frame.columns) == ["copy", "time", "value", "out_of_range", "scenario", "severity"]
    seconds = (frame["time"] - pd.Timestamp(START)).dt.total_seconds()
    places = ((seconds - 25) / 10).to_numpy()
    assert places.tolist() == [*range(20), *range(40, 52)] * 3
    assert frame["copy"].tolist() == np.repeat(range(3), 32).tolist()
    assert (frame["scenario"] == np.where(places < 45, "nominal", "leak")).all()
    np.testing.assert_allclose(frame["severity"], places / 100)
    np.testing.assert_array_equal(frame["out_of_range"] > 1, places >= 40)
    noise = frame["value"] - 2 * places / 40
    assert 0.08 < noise.std() < 0.12 and not np.array_equal(noise[:32], noise[32:64])


def test_carried_columns_never_replace_ours_nor_those_of_channels(tmp_path):
    both = model()
    both = EnhancedSimulator(
        Runs(both.alignment.nominal, ["copy", "volts"], 8),
        unchanged(8, 2),
        WindowBootstrap(np.zeros((1, 8, 2))),
        ("copy", "volts"),
        10.0,
    )
    # both channels follow the one column
    main = np.zeros(2, int), np.float32([1, 2])
    both.enhancer = dataclasses.replace(
        both.enhancer, columns=1, centre=np.zeros(1, np.float32), main=main
    )
    write_copies(tmp_path / "out.parquet", both, run(volts=-999.0, copy=7.0), 1)
    frame = pd.read_parquet(tmp_path / "out.parquet")
    assert (frame["copy"] == 0).all() and (frame["copy (run)"] == 7).all()
    assert (frame["volts (run)"] == -999).all()
    np.testing.assert_allclose(frame["volts"], 2 * frame["copy (channel)"], atol=1e-6)
    np.testing.assert_allclose(frame["copy (channel)"][:20], np.arange(20) / 40, atol=1e-6)


def test_a_clock_from_zero_is_in_seconds_and_a_mask_of_ones_is_boolean(tmp_path):
    counting = run(mask=np.arange(20) % 2, masked=1)
    counting = dataclasses.replace(counting, clock=Clock.of(10.0, "1970-01-01T00:00:00+00:00"))
    write_copies(tmp_path / "out", model(delay_s=25.0), counting, 1)
    frame = pd.read_parquet(tmp_path / "out")
    assert frame["time"].tolist() == [25.0 + 10 * place for place in (*range(20), *range(40, 52))]
    assert frame["mask"].dtype == bool and frame["mask"].tolist() == [False, True] * 16
    assert frame["masked"].tolist() == [1] * 32


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
    part = Part(np.zeros((20, 1), np.float32), 0.0, {"note": mixed})
    write_copies(tmp_path / "out.parquet", model(interval_s=1.0), parts_of((part,), ("volts",)), 1)
    frame = pd.read_parquet(tmp_path / "out.parquet")
    assert frame["note"].iloc[:2].tolist() == ["1", "two"] and frame["note"].isna().sum() == 8
    assert frame["sample"].tolist() == list(range(20))


def test_nothing_is_written_if_a_run_cannot_be_used(refused, tmp_path):
    out, amps = tmp_path / "out.parquet", dataclasses.replace(run(), columns=("amps",))
    for words, given, copies in (
        ("copy", run(), 0),
        ("rows", run(), 10**9),
        ("without 'volts'", amps, 2),
    ):
        with refused(words):
            write_copies(out, model(), given, copies)
    broken = model()
    broken.noise = SimpleNamespace(
        generate_series=lambda num_samples, rng, signal: np.zeros(10**15)
    )
    with pytest.raises(MemoryError):
        write_copies(out, broken, run(), 2)
    assert not list(tmp_path.iterdir())


def test_the_lines_say_what_is_covered_and_what_is_left_out():
    lines = coverage_lines(model(), run())
    # 20 of 32 samples; 20 of 25
    assert "covers 62.5% of the run (nominal 80.0%, leak 0.0%)" in lines[0]
    assert "5 of 37 samples" in lines[-1] and "shorter than a window of 8" in lines[-1]
    assert "extrapolation" in coverage_lines(model(), recorded(np.full(20, 3)))[0]
