"""Tests of single series: their values, their clock, and their reading without any repair."""

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.telemetry.series import Telemetry, check_values
from enhsim_tf.telemetry.sources import read_telemetry

RAMP = np.arange(12.0)


def write(path, content):
    """Writes an array or a table to `path`, by its suffix."""
    table = pd.DataFrame({"value": content} if np.ndim(content) == 1 else content)
    if path.suffix == ".npy":
        np.save(path, content)
    elif path.suffix == ".csv":
        table.to_csv(path, index=False)
    else:
        table.to_parquet(path)
    return path


def with_one(bad, values=RAMP):
    values = values.copy()
    values[4] = bad
    return values


BAD_VALUES = {  # name: values, words of the message
    "empty": (np.array([]), "none"),
    "text": (np.array(["a", "b", "c"]), "numbers"),
    "complex": (np.array([1j, 2j, 3j]), "numbers"),
    "constant": (np.full(12, 3.5), "constant 3.5"),
    "constant once it is float32": (1e9 + RAMP, "constant"),
    "NaN": (with_one(np.nan), "1 others in here, the first (nan) at sample 4"),
    "minus infinite": (with_one(-np.inf), "(-inf) at sample 4"),
    "beyond float32": (with_one(-1e300), "(-1e+300) at sample 4"),
    "beyond float32, and a gap": (np.where(RAMP == 2, 1e300, with_one(np.nan)), "2 others"),
    "true and false": (RAMP % 3 == 0, "dtype bool"),
    "too short": (RAMP[:9], "at least 10 samples"),
    "two axes": (np.zeros((3, 4)), "(3, 4)"),
    "no axis": (np.zeros(()), "()"),
}


@pytest.mark.parametrize("name", BAD_VALUES)
def test_bad_values_are_refused(refused, name):
    values, words = BAD_VALUES[name]
    with refused(words, "here"):
        check_values(values, "here", min_samples=10)


@pytest.mark.parametrize("dtype", [np.uint8, np.int64, np.float16, np.float64])
def test_numbers_of_any_kind_become_float32(dtype):
    values = check_values(np.array([0, 1, 1, 0]).astype(dtype), "here")
    assert values.dtype == np.float32 and values.tolist() == [0, 1, 1, 0]


@pytest.mark.parametrize(
    ("file", "arguments"),
    [("a.npy", {}), ("a.npy", {"column": "-1"}), ("a.npy", {"column": "value"}), ("a.csv", {"time": "t"}), ("a.parquet", {})],
)
def test_a_column_that_is_not_there_or_not_named_is_refused(tmp_path, refused, file, arguments):
    with refused(*(repr(each) for each in arguments.values())):
        read_telemetry(write(tmp_path / file, np.zeros((5, 3)) if file == "a.npy" else pd.DataFrame({"a": RAMP, "b": RAMP})), **arguments)


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
    assert (read.name, read.start[:19], read.has_time, read.time_unit) == ("a", "1970-01-01T00:00:00", True, "s")


def test_what_is_no_file_is_refused(tmp_path, refused):
    (tmp_path / "folder.csv").mkdir()
    for name in ("absent.csv", "folder.csv"):
        with refused(name):
            read_telemetry(tmp_path / name)


def test_parts_keep_the_clock():
    whole = Telemetry(np.arange(100, dtype=np.float32), interval_s=0.5, offset_s=7.0, start="2020-03-01", name="n", unit="V")
    part = whole.part(30, 40).part(2, 5)
    assert part.values.tolist() == [32, 33, 34]
    assert part.time_s.tolist() == [23.0, 23.5, 24.0] == whole.time_s[32:35].tolist()
    assert (part.start, part.name, part.unit, len(part)) == ("2020-03-01", "n", "V", 3)
