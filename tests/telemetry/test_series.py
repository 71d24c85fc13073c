"""Tests of single series: their values, their clock, and their reading without any repair."""

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.telemetry.series import Telemetry, check_telemetry, check_values
from enhsim_tf.telemetry.sources import read_telemetry

RAMP = np.arange(12.0)


def write(path, content):
    """Writes an array or a table to `path`, by its suffix."""
    if isinstance(content, np.ndarray):
        np.save(path, content)
    elif path.suffix == ".csv":
        content.to_csv(path, index=False)
    else:
        content.to_parquet(path)
    return path


def with_one(bad, values=RAMP):
    values = values.copy()
    values[4] = bad
    return values


BAD_VALUES = {  # name: values, words of the message about the values alone, words of the message about a file with them
    "empty": (np.array([]), "none", "none"),
    "text": (np.array(["a", "b", "c"]), "numbers", "numbers"),
    "complex": (np.array([1j, 2j, 3j]), "numbers", "complex"),
    "constant": (np.full(12, 3.5), "constant 3.5", "constant 3.5"),
    "constant once it is float32": (1e9 + RAMP, "constant", "constant"),
    "NaN": (with_one(np.nan), "(NaN) at sample 4", "1 (first: "),
    "infinite": (with_one(np.inf), "(infinite) at sample 4", "1 (first: "),
    "minus infinite": (with_one(-np.inf), "(infinite) at sample 4", "1 (first: "),
    "beyond float32": (with_one(-1e300), "(-1e+300) at sample 4", "-1e+300 at "),
    "beyond float32, and a gap": (np.where(RAMP == 2, 1e300, with_one(np.nan)), "1 NaN or infinite", "1e+300 at "),
    "true and false": (RAMP % 3 == 0, "dtype bool", "numbers"),
    "too short": (RAMP[:9], "at least 10 samples", "at least 10 samples"),
}


@pytest.mark.parametrize("name", BAD_VALUES)
def test_bad_values_are_refused(tmp_path, refused, name):
    values, words, words_of_file = BAD_VALUES[name]
    with refused(words, "here"):
        check_values(values, "here", min_samples=10)
    for suffix in (".npy", ".csv", ".parquet") if values.dtype.kind != "c" else (".npy",):
        content = values if suffix == ".npy" else pd.DataFrame({"value": values})
        with refused(words_of_file, f"series{suffix}"):
            read_telemetry(write(tmp_path / f"series{suffix}", content), min_samples=10)


@pytest.mark.parametrize("shape", [(), (3, 4), (2, 3, 2)])
def test_values_of_another_shape_are_refused(refused, shape):
    with refused(str(shape)):
        check_values(np.zeros(shape), "here")


@pytest.mark.parametrize("dtype", [np.uint8, np.int64, np.float16, np.float64])
def test_numbers_of_any_kind_become_float32(dtype):
    values = check_values(np.array([0, 1, 1, 0]).astype(dtype), "here")
    assert values.dtype == np.float32 and values.tolist() == [0, 1, 1, 0]


FALSE = {  # file, content, arguments
    "columns, none named": ("a.npy", np.zeros((5, 3)), {}),
    "no such column number": ("a.npy", np.zeros((5, 3)), {"column": "3"}),
    "a negative column number": ("a.npy", np.zeros((5, 3)), {"column": "-1"}),
    "a name for a column of an array": ("a.npy", np.zeros((5, 3)), {"column": "value"}),
    "a time column of an array": ("a.npy", RAMP, {"time": "t"}),
    "no such column": ("a.csv", pd.DataFrame({"value": RAMP}), {"column": "values"}),
    "no such time column": ("a.csv", pd.DataFrame({"value": RAMP}), {"time": "t"}),
    "two columns, none named": ("a.parquet", pd.DataFrame({"a": RAMP, "b": RAMP}), {}),
}


@pytest.mark.parametrize("name", FALSE)
def test_a_column_that_is_not_there_or_not_named_is_refused(tmp_path, refused, name):
    file, content, arguments = FALSE[name]
    with refused(*(repr(each) for each in arguments.values())):
        read_telemetry(write(tmp_path / file, content), **arguments)


BAD_TIMES = {
    "a word": (["2020-03-01T00:00:00", "2020-03-01T00:00:01", "soon", "2020-03-01T00:00:03"], "'soon' at line 4 "),
    "a gap": ([0.0, 1.0, np.nan, 3.0], "without a time: 1 (first: line 4)"),
    "one sample late": ([0.0, 1.0, 2.0, 3.5], "the longest 1.5 s, at which the series is split: 1 (first: line 4, 2 s)"),
    "twice": ([0.0, 1.0, 1.0, 2.0], "the first at line 4, 1 s"),
    "falling": ([3.0, 2.0, 1.0, 0.0], "descending order of time, reversed: 4"),
    "out of order": ([0.0, 2.0, 1.0, 3.0], "out of chronological order, sorted: 1 (first: line 4"),
    "off the grid": ([0.0, 1.0, 2.2, 3.0], "off the regular grid, by up to 0.1"),
}


@pytest.mark.parametrize("name", BAD_TIMES)
def test_the_time_that_cannot_be_used_is_named(tmp_path, refused, name):
    times, words = BAD_TIMES[name]
    with refused(words):
        read_telemetry(write(tmp_path / "a.csv", pd.DataFrame({"v": RAMP[:4], "t": times})), time="t")


@pytest.mark.parametrize("interval_s", [1 / 3, 1 / 30, 0.7])
def test_times_rounded_to_milliseconds_are_regular(tmp_path, interval_s):
    times = (np.arange(400) * interval_s).round(3 if interval_s > 0.1 else 4)
    read = read_telemetry(write(tmp_path / "a.csv", pd.DataFrame({"v": np.arange(400) % 7, "t": times})), "v", "t")
    assert np.abs(read.time_s - times).max() < 0.05 * interval_s and read.values.tolist() == (np.arange(400) % 7).tolist()


def test_anything_but_telemetry_is_refused(refused):
    check_telemetry(Telemetry(RAMP))
    with refused("Received: ndarray", "Telemetry(check_values("):
        check_telemetry(RAMP)


def test_what_is_no_file_is_refused(tmp_path, refused):
    (tmp_path / "folder.csv").mkdir()
    for name in ("absent.csv", "folder.csv"):
        with refused(name):
            read_telemetry(tmp_path / name)


def test_array_round_trip(tmp_path):
    values = np.random.default_rng(0).normal(size=(20, 3))
    read = read_telemetry(write(tmp_path / "wheel.npy", values), column="2")
    assert (read.values == values[:, 2].astype(np.float32)).all() and read.values.dtype == np.float32
    assert (read.name, read.interval_s, read.start, read.has_time, read.time_unit) == ("wheel", 1.0, None, False, "samples")
    for arguments in ({}, {"column": "0"}):
        assert (read_telemetry(write(tmp_path / "one.npy", values[:, 1]), **arguments).values == values[:, 1].astype(np.float32)).all()
    assert (read_telemetry(write(tmp_path / "one.npy", values[:, :1])).values == values[:, 0].astype(np.float32)).all()


@pytest.mark.parametrize(
    ("times", "start"),
    [
        (pd.date_range("2020-03-01T06:00:00", periods=20, freq="250ms"), "2020-03-01T06:00:00+00:00"),
        (pd.date_range("2020-03-01T06:00:00", periods=20, freq="250ms", tz="Europe/Berlin"), "2020-03-01T05:00:00+00:00"),
        (np.arange(20) * 0.25, "1970-01-01T00:00:00+00:00"),
        (1_583_042_400 + np.arange(20) * 0.25, "2020-03-01T06:00:00+00:00"),
    ],
    ids=["date-times", "with a zone", "seconds", "seconds since 1970"],
)
def test_table_round_trip_with_time(tmp_path, times, start):
    values = np.random.default_rng(1).normal(size=20).astype(np.float32)
    table = pd.DataFrame({"other": 0.0, "value": values, "when": times})
    read = read_telemetry(write(tmp_path / "wheel.parquet", table), column="value", time="when")
    assert (read.values == values).all()
    assert read.interval_s == pytest.approx(0.25, rel=1e-6)
    assert (read.start, read.offset_s, read.has_time, read.time_unit) == (start, 0.0, True, "s")
    assert read.time_s == pytest.approx(np.arange(20) * 0.25)


def test_parts_keep_the_clock():
    whole = Telemetry(np.arange(100, dtype=np.float32), interval_s=0.5, offset_s=7.0, start="2020-03-01", name="n", unit="V")
    part = whole.part(30, 40).part(2, 5)
    assert part.values.tolist() == [32, 33, 34]
    assert part.time_s.tolist() == [23.0, 23.5, 24.0] == whole.time_s[32:35].tolist()
    assert (part.start, part.name, part.unit, len(part)) == ("2020-03-01", "n", "V", 3)
