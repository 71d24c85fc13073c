"""Tests of reading and checking single files, and of splitting and cutting series."""

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.telemetry.series import Telemetry, check_telemetry, check_values
from enhsim_tf.telemetry.sources import read_telemetry
from enhsim_tf.telemetry.windows import (
    cut_windows,
    disjoint_starts,
    evenly_spaced_starts,
    random_window_starts,
    scattered_starts,
)

RAMP = np.arange(12.0)


def write(path, content):
    """Writes bytes, an array or a table to `path`, by its suffix."""
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif isinstance(content, np.ndarray):
        np.save(path, content)
    elif path.suffix.lower() == ".csv":
        content.to_csv(path, index=False)
    else:
        content.to_parquet(path)
    return path


def times_of(*seconds):
    return pd.to_datetime("2020-03-01T00:00:00Z") + pd.to_timedelta(list(seconds), unit="s")


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


BAD_FILES = {
    "an object array": ("a.npy", np.array([{}, None], dtype=object), {}),
    "bytes that are no array": ("a.npy", b"not an array at all", {}),
    "nothing": ("a.npy", b"", {}),
    "an array cut short": ("a.npy", b"\x93NUMPY\x01\x00v\x00{'descr': '<f8'", {}),
    "three dimensions": ("a.npy", np.zeros((3, 4, 5)), {}),
    "a single number": ("a.npy", np.array(3.0), {}),
    "columns, none named": ("a.npy", np.zeros((5, 3)), {}),
    "no such column number": ("a.npy", np.zeros((5, 3)), {"column": "3"}),
    "a negative column number": ("a.npy", np.zeros((5, 3)), {"column": "-1"}),
    "a name for a column of an array": ("a.npy", np.zeros((5, 3)), {"column": "value"}),
    "a column of a single series": ("a.npy", RAMP, {"column": "1"}),
    "a time column of an array": ("a.npy", RAMP, {"time": "t"}),
    "a table without a line": ("a.csv", b"", {}),
    "a table of bytes": ("a.csv", b"value\n\xff\xfe\x00\x01\n", {}),
    "a ragged table": ("a.csv", b"a,b\n1,2\n1,2,3,4\n", {}),
    "no Parquet": ("a.parquet", b"PAR1 but no more", {}),
    "no such column": ("a.csv", pd.DataFrame({"value": RAMP}), {"column": "values"}),
    "no such time column": ("a.csv", pd.DataFrame({"value": RAMP}), {"time": "t"}),
    "two columns, none named": ("a.parquet", pd.DataFrame({"a": RAMP, "b": RAMP}), {}),
    "a column of dates": ("a.parquet", pd.DataFrame({"a": times_of(*RAMP)}), {}),
    "a suffix nobody reads": ("a.xlsx", b"x", {}),
    "times that are words": ("a.csv", pd.DataFrame({"v": RAMP, "t": ["noon"] * 12}), {"time": "t"}),
    "a sample missing": ("a.csv", pd.DataFrame({"v": RAMP[:5], "t": times_of(0, 1, 2, 4, 5)}), {"time": "t"}),
    "a time twice": ("a.csv", pd.DataFrame({"v": RAMP[:5], "t": times_of(0, 1, 2, 2, 3)}), {"time": "t"}),
    "times that fall": ("a.csv", pd.DataFrame({"v": RAMP[:5], "t": [4, 3, 2, 1, 0]}), {"time": "t"}),
    "times that stand": ("a.csv", pd.DataFrame({"v": RAMP[:5], "t": [4, 4, 4, 4, 4]}), {"time": "t"}),
    "a time missing": ("a.csv", pd.DataFrame({"v": RAMP[:5], "t": [0, 1, None, 3, 4]}), {"time": "t"}),
    "an infinite time": ("a.csv", pd.DataFrame({"v": RAMP[:5], "t": [0, 1, 2, 3, np.inf]}), {"time": "t"}),
    "a time nobody lives to see": ("a.csv", pd.DataFrame({"v": RAMP[:5], "t": np.arange(5) * 1e15}), {"time": "t"}),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_bad_files_are_refused(tmp_path, refused, name):
    file, content, arguments = BAD_FILES[name]
    with refused("" if "time" in arguments or "column" in arguments else file):
        read_telemetry(write(tmp_path / file, content), **arguments)


BAD_TIMES = {
    "a word": (["2020-03-01T00:00:00", "2020-03-01T00:00:01", "soon", "2020-03-01T00:00:03"], "'soon' at line 4 "),
    "a word after a gap": (["2020-03-01T00:00:00", None, "2020-03-01T00:00:02", "late"], "'late' at line 5 "),
    "too far away": ([0.0, 1.0, 2.0, 1e15], "1000000000000000.0 at line 5 "),
    "a gap": ([0.0, 1.0, np.nan, 3.0], "without a time: 1 (first: line 4)"),
    "one sample late": (
        [0.0, 1.0, 2.0, 3.5],
        "the longest 1.5 s, at which the series is split: 1 (first: line 4, 2 s)",
    ),
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


def test_a_repeated_column_name_is_refused_if_it_is_needed(tmp_path, refused):
    lines = [f"{number},{number % 7},{-number}," for number in range(12)]
    path = write(tmp_path / "a.csv", "\n".join(["a,b,a,", *lines]).encode())
    for arguments in ({"column": "a"}, {}, {"column": "b", "time": "a"}):
        with refused("'a' more than once in a.csv"):
            read_telemetry(path, **arguments)
    assert read_telemetry(path, column="b").values.tolist() == (np.arange(12) % 7).tolist()
    path = write(tmp_path / "b.csv", b"a,,\n1,,\n2,,\n4,,\n")
    assert read_telemetry(path, column="a").values.tolist() == [1, 2, 4], "columns without a name have no name in common"


def test_anything_but_telemetry_is_refused(refused):
    check_telemetry(Telemetry(RAMP))
    with refused("Received: ndarray", "Telemetry(check_values("):
        check_telemetry(RAMP)


def test_missing_file_folder_and_pickle_are_refused(tmp_path, refused):
    with refused("absent.csv"):
        read_telemetry(tmp_path / "absent.csv")
    (tmp_path / "folder.csv").mkdir()
    with refused("folder.csv"):
        read_telemetry(tmp_path / "folder.csv")
    ran = tmp_path / "ran"

    class Payload:
        def __reduce__(self):
            return (ran.touch, ())

    np.save(tmp_path / "payload.npy", np.array([Payload()], dtype=object), allow_pickle=True)
    with refused("payload.npy"):
        read_telemetry(tmp_path / "payload.npy")
    assert not ran.exists()


def test_archive_under_the_name_of_an_array_is_refused(tmp_path, refused):
    np.savez(tmp_path / "a.npz", RAMP)
    (tmp_path / "a.npz").rename(tmp_path / "a.npy")
    with refused("an archive"):
        read_telemetry(tmp_path / "a.npy")


def test_array_round_trip(tmp_path):
    values = np.random.default_rng(0).normal(size=(20, 3))
    read = read_telemetry(write(tmp_path / "wheel.npy", values), column="2")
    assert (read.values == values[:, 2].astype(np.float32)).all() and read.values.dtype == np.float32
    assert (read.name, read.interval_s, read.start, read.has_time, read.time_unit) == ("wheel", 1.0, None, False, "samples")
    for arguments in ({}, {"column": "0"}):
        assert (read_telemetry(write(tmp_path / "one.npy", values[:, 1]), **arguments).values == values[:, 1].astype(np.float32)).all()
    assert (read_telemetry(write(tmp_path / "one.npy", values[:, :1])).values == values[:, 0].astype(np.float32)).all()


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
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
def test_table_round_trip_with_time(tmp_path, suffix, times, start):
    values = np.random.default_rng(1).normal(size=20).astype(np.float32)
    table = pd.DataFrame({"other": 0.0, "value": values, "when": times})
    read = read_telemetry(write(tmp_path / f"wheel{suffix}", table), column="value", time="when")
    assert (read.values == values).all()
    assert read.interval_s == pytest.approx(0.25, rel=1e-6)
    assert (read.start, read.offset_s, read.has_time, read.time_unit) == (start, 0.0, True, "s")
    assert read.time_s == pytest.approx(np.arange(20) * 0.25)


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_only_column_of_a_table_needs_no_name(tmp_path, suffix):
    table = pd.DataFrame({"when": np.arange(20), "value": np.arange(20.0) % 7})
    read = read_telemetry(write(tmp_path / f"a{suffix}", table), time="when")
    assert read.values.tolist() == (np.arange(20.0) % 7).tolist()
    read = read_telemetry(write(tmp_path / f"b{suffix.upper()}", table), column="value")
    assert read.values.tolist() == (np.arange(20.0) % 7).tolist() and read.start is None


def test_parts_keep_the_clock():
    whole = Telemetry(np.arange(100, dtype=np.float32), interval_s=0.5, offset_s=7.0, start="2020-03-01", name="n", unit="V")
    part = whole.part(30, 40).part(2, 5)
    assert part.values.tolist() == [32, 33, 34]
    assert part.time_s.tolist() == [23.0, 23.5, 24.0] == whole.time_s[32:35].tolist()
    assert (part.start, part.name, part.unit, len(part)) == ("2020-03-01", "n", "V", 3)


def test_random_starts_reach_every_window_and_no_more(refused):
    starts = random_window_starts([range(30)], 20, 5_000, np.random.default_rng(0))
    counts = np.bincount(starts, minlength=11)
    assert len(counts) == 11  # 0 to 10: the last window ends with the series
    assert counts == pytest.approx(np.full(11, 5_000 / 11), abs=5 * np.sqrt(5_000 / 11))
    assert random_window_starts([range(20)], 20, 3, np.random.default_rng(0)).tolist() == [0, 0, 0]
    assert (starts == random_window_starts([range(30)], 20, 5_000, np.random.default_rng(0))).all()
    assert (starts != random_window_starts([range(30)], 20, 5_000, np.random.default_rng(1))).any()
    with refused("at least 20 samples", "Received: 19"):
        random_window_starts([range(19)], 20, 3, np.random.default_rng(0))


def test_scattered_starts_share_no_sample_and_begin_at_all_phases():
    rng = np.random.default_rng(0)
    found = [scattered_starts(80_000, 400, rng) for _ in range(20)]
    for starts in found:
        assert len(starts) == 175 and np.all(np.diff(starts) >= 400) and starts[0] >= 0 and starts[-1] <= 79_600
    phases = np.bincount(np.concatenate(found) % 400 // 100)  # quarters of the window; 3,500 starts, and 26 is one standard deviation
    assert np.all(np.abs(phases - 875) < 4 * 26)
    assert [scattered_starts(length, 400, rng).shape[0] for length in (399, 400, 799, 1_000)] == [0, 1, 1, 2]


def test_disjoint_starts_share_no_sample():
    assert disjoint_starts(1_499, 500).tolist() == [0, 500]
    assert disjoint_starts(1_500, 500).tolist() == [0, 500, 1_000]
    assert disjoint_starts(499, 500).tolist() == []


def test_evenly_spaced_starts_reach_from_end_to_end():
    assert evenly_spaced_starts([range(110)], 10, 5).tolist() == [0, 25, 50, 75, 100]
    starts = evenly_spaced_starts([range(1_000)], 60, 37)
    assert (starts[0], starts[-1]) == (0, 940) and set(np.diff(starts)) == {26, 27}  # 940 / 36 = 26.1
    assert evenly_spaced_starts([range(60)], 60, 3).tolist() == [0]


def test_cut_windows_by_hand():
    values = np.array([5, 6, 7, 8, 9], np.float32)
    assert cut_windows(values, np.array([0, 2, 2]), 3).tolist() == [[5, 6, 7], [7, 8, 9], [7, 8, 9]]
    assert cut_windows(values, np.array([0, 2]), 3).dtype == np.float32
