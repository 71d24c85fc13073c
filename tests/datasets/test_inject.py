"""Tests of anomalies in a user's own telemetry: columns, places by time, and the layout of TimeEval."""

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.datasets.inject import InjectOptions, inject_channel
from enhsim_tf.datasets.label_columns import LABELS, label_samples, write_table, write_timeeval
from enhsim_tf.telemetry.cleaning.clean import clean
from enhsim_tf.telemetry.series import Telemetry


def parts(times=True, gap=True):
    rng, places = np.random.default_rng(0), np.arange(3_000)
    values = 20 + 3 * np.sin(2 * np.pi * places / 80) + 0.2 * rng.standard_normal(3_000)
    index = pd.date_range("2024-01-01", periods=3_000, freq="10s", tz="UTC") if times else None
    series = pd.Series(values, index=index, name="volts")
    return clean(series.drop(series.index[1_000:1_200]) if gap else series).parts


def test_labels_of_samples_by_hand():
    mask = np.array([0, 1, 0, 1, 0, 0, 1, 1], bool)
    columns = label_samples(mask, [("spike", 4.0, 1, 4), ("ramp", 2.0, 6, 8)])
    assert tuple(columns) == LABELS
    assert columns["scenario"].tolist() == ["nominal", "spike", "nominal", "spike", "nominal", "nominal", "ramp", "ramp"]
    assert columns["severity"].tolist() == [0, 4, 0, 4, 0, 0, 2, 2]
    assert pd.Series(columns["onset"]).tolist() == [pd.NA, 1, pd.NA, 1, pd.NA, pd.NA, 6, 6]
    assert pd.Series(columns["end"]).tolist() == [pd.NA, 4, pd.NA, 4, pd.NA, pd.NA, 8, 8]


def test_marked_samples_are_the_changed_ones_and_events_have_their_labels():
    given = parts()
    frame = inject_channel(given, InjectOptions(("level_shift", "stuck"), (2, 8), ("50", "20min"), 6, noise_sd=0.2, seed=5))
    nominal = np.concatenate([part.values for part in given])
    assert list(frame) == ["value", *LABELS] and frame.index.name == "time" and len(frame) == 2_800
    np.testing.assert_array_equal(frame["mask"], frame["value"].to_numpy() != nominal)
    np.testing.assert_array_equal(frame["mask"], frame["scenario"] != "nominal")
    events = frame[frame["mask"]].groupby(["onset", "end", "scenario"], observed=True)["severity"].nunique()
    assert len(events) == 6 and (events == 1).all()
    for onset, end, _ in events.index:
        assert 1 <= end - onset <= 120 and frame["mask"].iloc[onset] and frame["mask"].iloc[end - 1]
    assert frame["severity"][frame["mask"]].between(2, 8).all() and frame.attrs["noise_sd"] == 0.2


def test_the_noise_is_estimated_and_sets_the_severity():
    frame = inject_channel(parts(), InjectOptions(at=["level_shift:5@200/100"]))
    assert frame.attrs["noise_sd"] == pytest.approx(0.2, rel=0.05)
    nominal = np.concatenate([part.values for part in parts()])
    change = np.abs(frame["value"].to_numpy() - nominal)
    assert change[200:300] == pytest.approx(5 * frame.attrs["noise_sd"], rel=1e-4) and change[:200].max() == change[300:].max() == 0


def test_a_place_may_be_a_time():
    frame = inject_channel(parts(), InjectOptions(at=["ramp:4@2024-01-01T01:00/10min", "stuck:inf@2024-01-01T05:00+01:00/100"]))
    first = frame.index[frame["scenario"] == "ramp"]
    assert first[0] == pd.Timestamp("2024-01-01T01:00Z") and len(first) == 60
    assert frame.index[frame["scenario"] == "stuck"].min() >= pd.Timestamp("2024-01-01T04:00Z")


def test_channels_draw_independently_and_the_same_seed_gives_the_same_table():
    options = InjectOptions(("spike",), number=3, seed=1)
    first, again = (inject_channel(parts(), options) for _ in range(2))
    pd.testing.assert_frame_equal(first, again)
    amps = [Telemetry(part.values, part.interval_s, part.offset_s, part.start, "amps") for part in parts()]
    assert (inject_channel(amps, options)["mask"].to_numpy() != first["mask"].to_numpy()).any()


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_file_holds_what_the_frame_holds(suffix, tmp_path):
    frame = inject_channel(parts(), InjectOptions(("gain", "spike"), number=4))
    frame.attrs = {}
    write_table(tmp_path / f"labelled{suffix}", frame)
    if suffix == ".csv":
        read = pd.read_csv(tmp_path / "labelled.csv", parse_dates=["time"], dtype={"value": np.float32, "onset": "Int32", "end": "Int32"})
    else:
        read = pd.read_parquet(tmp_path / "labelled.parquet")
    assert list(read) == ["time", "value", *LABELS] and [path.name for path in tmp_path.iterdir()] == [f"labelled{suffix}"]
    for name in ("value", "onset", "end", "mask"):
        assert read[name].tolist() == frame[name].tolist()
    assert read["scenario"].astype(str).tolist() == frame["scenario"].astype(str).tolist()


@pytest.mark.parametrize("times", [True, False])
def test_timeeval_files_have_times_first_and_labels_last(times, tmp_path, refused):
    options = InjectOptions(("level_shift",), number=2)
    volts = inject_channel(parts(times, gap=False), options)
    amps = inject_channel(
        [Telemetry(part.values, *(part.interval_s, part.offset_s, part.start), "amps") for part in parts(times, False)], options
    )
    write_timeeval(tmp_path / "x.csv", {"volts": volts, "amps": amps})
    read = pd.read_csv(tmp_path / "x.csv")
    assert list(read) == ["timestamp", "volts", "amps", "is_anomaly"] and read["is_anomaly"].isin([0, 1]).all()
    np.testing.assert_array_equal(read["is_anomaly"], volts["mask"].to_numpy() | amps["mask"].to_numpy())
    np.testing.assert_array_equal(read["volts"].astype(np.float32), volts["value"])
    assert read["timestamp"].iloc[1] == ("2024-01-01 00:00:10" if times else 1)
    with refused("same times", "'amps' with 2,999"):
        write_timeeval(tmp_path / "y.csv", {"volts": volts, "amps": amps.iloc[1:]})
    with refused("'is_anomaly'"):
        write_timeeval(tmp_path / "y.csv", {"is_anomaly": volts})
    assert not (tmp_path / "y.csv").exists()


def test_wrong_options_are_refused(refused):
    for wrong in (
        {},
        {"kinds": ["rust"]},
        {"kinds": ["ramp"], "severity": (4, 2)},
        {"kinds": ["ramp"], "severity": (np.inf, np.inf)},
        {"kinds": ["stuck"], "severity": (1, np.inf)},
        {"kinds": ["ramp"], "length": ("long", "long")},
        {"kinds": ["ramp"], "number": 0},
        {"at": ["ramp@1/5"], "number": 3},
        {"kinds": ["ramp"], "gap": -1},
        {"kinds": ["ramp"], "noise_sd": 0},
        {"at": ["ramp"]},
        {"at": ["ramp:much@5/5"]},
        {"at": ["rust:4@5/5"]},
        {"at": ["ramp:4@5/soon"]},
    ):
        with refused():
            InjectOptions(**wrong)
    with refused("not in a gap"):
        inject_channel(parts(), InjectOptions(at=["ramp@2024-01-01T03:00/5"]))
    with refused("not in a gap"):
        inject_channel(parts(), InjectOptions(at=["ramp@2025-01-01/5"]))
    with refused("sample number"):
        inject_channel(parts(times=False, gap=False), InjectOptions(at=["ramp@2024-01-01/5"]))
    with refused("lengths", "20min:50"):
        inject_channel(parts(), InjectOptions(("ramp",), length=("20min", "50")))
    with refused("--noise-sd"):
        inject_channel([Telemetry(np.arange(200, dtype=np.float32))], InjectOptions(("ramp",)))
