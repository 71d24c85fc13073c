"""Tests of cleaning: a known series is damaged in a known way, and is either repaired as stated or
refused in one line.
"""

import datetime
import decimal
import json

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from enhsim_tf.common.errors import InputError
from enhsim_tf.datasets.anomalies import estimate_noise_sd
from enhsim_tf.telemetry.cleaning.clean import Cleaning, clean
from enhsim_tf.telemetry.cleaning.numbers import parse_numbers
from enhsim_tf.telemetry.cleaning.regular_grid import find_interval
from enhsim_tf.telemetry.cleaning.report import KINDS, lines_of

settings.register_profile(
    "repeatable",
    derandomize=True,
    deadline=None,
    max_examples=150,
    suppress_health_check=list(HealthCheck),
)
settings.load_profile("repeatable")

N = 400
START = pd.Timestamp("2020-03-01T00:00:00Z")
TIMES = pd.date_range(START, periods=N, freq="s")
ROWS = np.arange(N)
VALUES = np.sin(ROWS / 7.3) + 0.01 * np.random.default_rng(0).standard_normal(N)
CLEAN = pd.Series(VALUES, index=TIMES, name="volts")


def check_balance(cleaned):
    """Checks that every row and sample is accounted for, and that the parts are regular, finite and
    in chronological order.
    """
    report = cleaned.report
    assert report.rows_in == report.rows_used + report.rows_left_out
    assert (
        report.samples == report.rows_used + report.samples_filled == sum(map(len, cleaned.parts))
    )
    assert report.num_parts == len(cleaned.parts) > 0
    assert {finding.kind for finding in report.findings} <= set(KINDS)
    assert all(
        finding.count > 0 and len(finding.line().splitlines()) == 1 for finding in report.findings
    )
    assert all(finding.action == "left out" for finding in report.findings if finding.rows_left_out)
    assert json.loads(json.dumps(report.to_dict(), allow_nan=False))["rows_in"] == report.rows_in
    ends = -np.inf
    for part in cleaned.parts:
        assert part.values[:, 0].dtype == np.float32 and np.isfinite(part.values[:, 0]).all()
        assert (part.interval_s, part.start) == (
            cleaned.parts[0].interval_s,
            cleaned.parts[0].start,
        )
        assert part.offset_s > ends
        ends = part.time_s[-1]


def repairs(report):
    """All findings but the clock, which every report has."""
    return [finding for finding in report.findings if finding.kind != "clock"]


def cleaned_of(series, **options):
    cleaned = clean(series, Cleaning(**options))
    check_balance(cleaned)
    return cleaned


def as_one(cleaned, values=VALUES, off=1e-6):
    """Checks that there is one part with the given values and the undamaged start; returns it."""
    (part,) = cleaned.parts
    assert part.interval_s == pytest.approx(1.0, abs=1e-9)
    assert pd.Timestamp(part.start) == START
    np.testing.assert_allclose(part.values[:, 0], values, atol=off)
    return part


def assert_kept(part, values):
    """Asserts that a part has exactly these values."""
    np.testing.assert_array_equal(part.values[:, 0], np.asarray(values, np.float32))


def in_seconds(numbers):
    return pd.to_timedelta(numbers, unit="s")


def set_rows(rows, bad, kind=object):
    values = CLEAN.astype(kind)
    values.iloc[rows] = bad
    return values


def with_times(times, values=VALUES):
    return pd.Series(values, index=times, name="volts")


def linear(rows, values=VALUES):
    """The values with some rows replaced by linear interpolation between the others."""
    kept = np.delete(np.arange(len(values)), rows)
    return np.interp(np.arange(len(values)), kept, np.asarray(values)[kept])


RNG = np.random.default_rng(1)
# most times are undamaged
JITTER = in_seconds(np.where(ROWS % 5 < 2, RNG.uniform(-0.2, 0.2, N), 0))
SHUFFLED = RNG.permutation(N)
NANOSECONDS = TIMES.as_unit("ns").asi8
ISO, ONE_MORE = TIMES.astype(str).to_numpy(object), np.insert(VALUES, 30, 7)
WORDS = [f"{value:.9f}" for value in VALUES]
DROP = {"drop_bad": True}
DROPPED = {"bad values": 1, "gaps filled": 1}, linear([7]), DROP
UNDAMAGED_TIMES = {
    "ISO text": TIMES.astype(str),
    "ISO text, basic form": TIMES.strftime("%Y%m%dT%H%M%SZ"),
    "date-times as objects": pd.Index([time.to_pydatetime() for time in TIMES], dtype=object),
    "epoch seconds": NANOSECONDS // 10**9,
    "epoch milliseconds": NANOSECONDS // 10**6,
    "epoch nanoseconds": NANOSECONDS,
    "epoch nanoseconds as text": NANOSECONDS.astype(str),
    "periods": pd.period_range("2020-03-01", periods=N, freq="s"),
    "time spans since 1970": TIMES - pd.Timestamp(0, tz="UTC"),
}
UNDAMAGED = {
    "as it should be": CLEAN,
    "a pandas extension type": CLEAN.astype("Float64"),
    "times of another zone": CLEAN.tz_convert("America/New_York"),
    "categories": with_times(pd.CategoricalIndex(TIMES.astype(str)), pd.Categorical(WORDS)),
    "numbers as text with spaces": with_times(TIMES, [f" {word}\t" for word in WORDS]),
    "decimals as objects": with_times(TIMES, list(map(decimal.Decimal, WORDS))),
} | {name: with_times(times) for name, times in UNDAMAGED_TIMES.items()}
# name: series, {kind of finding: count}, values where they are not the clean ones, options
REPAIRED = {
    "local times with a zone": (
        CLEAN.tz_convert("Asia/Kolkata").tz_localize(None),
        {},
        VALUES,
        {"timezone": "Asia/Kolkata"},
    ),
    "dates of a given format": (
        with_times(TIMES.strftime("%d.%m.%y %H:%M:%S")),
        {},
        VALUES,
        {"time_format": "%d.%m.%y %H:%M:%S"},
    ),
    "days since 1970": (with_times(NANOSECONDS / 86_400e9), {}, VALUES, {"time_format": "D"}),
    "shuffled": (
        CLEAN.iloc[SHUFFLED],
        {"unsorted": np.sum(SHUFFLED < np.maximum.accumulate(SHUFFLED))},
    ),
    "two rows exchanged": (CLEAN.iloc[[0, 2, 1, *range(3, N)]], {"unsorted": 1}),
    "from the last to the first": (CLEAN.iloc[::-1], {"unsorted": N - 1}),
    "rows twice": (pd.concat([CLEAN, CLEAN.iloc[3:8]]).sort_index(), {"duplicate rows": 5}),
    "jitter": (
        with_times(TIMES + JITTER),
        {"jitter": np.sum(np.abs(JITTER.total_seconds()) > 1e-3)},
    ),
    "rows without a time": (
        with_times(np.insert(ISO, [5, 5, 9], ""), np.insert(VALUES, [5, 5, 9], 7)),
        {"missing times": 3},
    ),
    "words among the times, dropped": (
        with_times(np.insert(ISO, 30, "reboot"), ONE_MORE),
        {"bad times": 1},
        VALUES,
        DROP,
    ),
    "times that nobody lives to see": (
        with_times(np.insert(NANOSECONDS / 1e9, 30, 1e18), ONE_MORE),
        {"bad times": 1},
        VALUES,
        DROP,
    ),
    "NaN": (
        set_rows([7, 8, 50], np.nan, float),
        {"missing values": 3, "gaps filled": 2},
        linear([7, 8, 50]),
    ),
    "pandas' NA": (
        set_rows([7], pd.NA, "Float64"),
        {"missing values": 1, "gaps filled": 1},
        linear([7]),
    ),
    "empty text": (
        set_rows([7, 50], ["", " "]),
        {"missing values": 2, "gaps filled": 2},
        linear([7, 50]),
    ),
    "words for nothing": (
        set_rows([7, 50, 90], ["nan", "N/A", "NULL"]),
        {"missing values": 3, "gaps filled": 3},
        linear([7, 50, 90]),
    ),
    "a word of this source for nothing": (
        set_rows([7], "offline"),
        {"missing words": 1, "missing values": 1, "gaps filled": 1},
        linear([7]),
        {"missing_values": "offline"},
    ),
    "rows missing": (CLEAN.drop(TIMES[[7, 8, 50]]), {"gaps filled": 2}, linear([7, 8, 50])),
    "decimal commas": (
        with_times(TIMES, [word.replace(".", ",") for word in WORDS]),
        {"decimal comma": N},
    ),
    "a unit behind one number, dropped": (set_rows([7], "1.5 V"), *DROPPED),
    "beyond float32, dropped": (set_rows([7], 1e39, float), *DROPPED),
    "beyond float64, dropped": (set_rows([7], 10**400), *DROPPED),
} | {name: (series, {}) for name, series in UNDAMAGED.items()}


def repair(series, kinds, values=VALUES, options=None):
    """Checks that a series is repaired to the values, with findings of these kinds."""
    before = series.copy(deep=True)
    cleaned = cleaned_of(series, **(options or {}))
    as_one(cleaned, values)
    found = [(finding.kind, finding.count) for finding in repairs(cleaned.report)]
    assert sorted(found) == sorted(kinds.items())
    pd.testing.assert_series_equal(series, before)


@pytest.mark.parametrize("name", REPAIRED)
def test_a_known_damage_is_repaired_and_reported(name):
    repair(*REPAIRED[name])


BAD_VALUES = {
    "a unit behind one number": (set_rows([7], "1.5 V"), "'1.5 V' at row 7 of volts (1 in all)"),
    "commas and points": (set_rows([7, 8], ["1,5", "1.5"]), "'1,5' at row 7"),
    "thousands or thousandths": (
        with_times(TIMES, ["1,500", "2,250"] * (N // 2)),
        "'1,500' at row 0",
    ),
    "beyond float32": (set_rows([7], 1e39, float), "1e+39 at row 7"),
    "an integer beyond float64": (set_rows([7], 10**400), "at row 7"),
    "text beyond float64": (set_rows([7], "1e999"), "'1e999' at row 7"),
    "true among numbers": (set_rows([7], True), "True at row 7"),
    "a list among numbers": (with_times(TIMES, pd.Series([[1.0]] * N).array), "[1.0] at row 0"),
    "words": (with_times(TIMES, ["high", "low"] * (N // 2)), "'high' at row 0"),
    "true and false": (CLEAN > 0, "dtype bool"),
    "complex": (with_times(TIMES, VALUES + 1j), "dtype complex128"),
    "dates as values": (with_times(TIMES, TIMES), "datetime64"),
    "all NaN": (CLEAN * np.nan, "only missing"),
    "nothing": (CLEAN.iloc[:0], "none from volts"),
    "one row": (CLEAN.iloc[:1], "1 usable row"),
    "one time only": (with_times([START] * N, 7.0), "1 usable row"),
    "a table": (CLEAN.to_frame(), "shape (400, 1)"),
    "two axes": (np.zeros((3, 4)), "shape (3, 4)"),
    "a structured array": (np.zeros(3, [("a", float)]), "telemetry"),
    "one index of two levels": (
        with_times(pd.MultiIndex.from_product([["a"], TIMES])),
        "MultiIndex",
    ),
}
# name: times, words of the message
BAD_TIMES = {
    "words": (["noon"] * N, "'noon' at row 0 of the times of volts (400 in all)"),
    "days with two-digit years": (TIMES.strftime("%d/%m/%y %H:%M:%S"), "--time-format"),
    "dates as numbers": (
        pd.date_range("2020-03-01", periods=N).strftime("%Y%m%d").astype(int),
        "--time-format %Y%m%d",
    ),
    "numbers of no unit": (ROWS + 10**10, "--time-format ms"),
    "numbers, text and dates": (
        pd.Index([1, "2", datetime.datetime(2020, 1, 1), None] * (N // 4), dtype=object),
        "at row 2",
    ),
    "intervals": (pd.interval_range(0, N), "interval"),
    "date-times in the year 9000": (
        pd.DatetimeIndex(np.array(["9000-01-01"] * N, "datetime64[s]")),
        "1678 to 2261",
    ),
    "centuries apart": (
        pd.DatetimeIndex(["1700-01-01", *TIMES.tz_localize(None)[1:]]),
        "within 292 years",
    ),
    "infinite": (np.where(ROWS == 9, np.inf, ROWS), "inf at row 9"),
    "far away": (np.where(ROWS == 9, 1e18, ROWS), "1e+18 at row 9"),
    "true and false": (ROWS % 2 == 0, "dtype bool"),
    "complex": (ROWS + 1j, "complex"),
    "some with a zone": ([str(TIMES[0]), *TIMES.tz_localize(None).astype(str)[1:]], "all or none"),
    "objects": (pd.Index([datetime.timedelta] * N, dtype=object), "at row 0"),
    "none at all": (pd.DatetimeIndex([pd.NaT] * N), "Received: none"),
    "at random": (
        TIMES[0] + in_seconds(np.cumsum(RNG.exponential(size=N))),
        "--interval 0.739",
    ),
    "a local clock set back": (
        pd.date_range("2020-10-25T00:30Z", periods=N, freq="min")
        .tz_convert("Europe/Berlin")
        .tz_localize(None),
        "--timezone UTC, or the zone of the clock",
    ),
}
REFUSED = BAD_VALUES | {
    f"times: {name}": (with_times(times), words) for name, (times, words) in BAD_TIMES.items()
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", REFUSED)
def test_input_that_cannot_be_parsed_is_refused_with_its_place(refused, name):
    series, words = REFUSED[name]
    with refused(words):
        clean(series)


@pytest.mark.parametrize(
    ("cell", "number"),
    [
        ("1'234.5", 1234.5),
        ("1\u00a0234,5", 1234.5),
        ("12 345", 12345),
        ("+   1.5", 1.5),
        ("1.5D-01", 0.15),
        ("1234 5", None),
    ],
)
def test_numbers_of_other_programs_by_hand(cell, number):
    values, bad, _ = parse_numbers(pd.Series([cell, "2"]), "", drop=True)
    assert (None if bad[0] else values[0]) == number and values[1] == 2


def test_the_interval_is_that_of_the_long_run_before_a_jump_of_the_clock():
    """A jump of 0.4 intervals hides in rounded steps; a line through all rows would have another
    slope.
    """
    times = 1.1 * ROWS + np.where(ROWS < 300, 0, 0.45)
    jittered = START + in_seconds(times + 0.01 * np.sin(ROWS))
    assert cleaned_of(with_times(jittered)).report.interval_s == pytest.approx(1.1, abs=2e-5)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("same_time", "median"),
        ("interval_s", float("nan")),
        ("max_fill", -1),
        ("min_part", 0),
        ("time_format", "weeks"),
        ("decimal", ";"),
        ("fill", "nearest"),
    ],
)
def test_options_out_of_range_are_refused(refused, name, value):
    with refused(f"{name}={value!r}"):
        Cleaning(**{name: value})


def test_an_unknown_time_zone_and_an_interval_without_times_are_refused(refused):
    for zone, words in (("Mars/Gale", "'Mars/Gale'"), ("", "timezone=''")):
        with refused(words):
            clean(CLEAN.tz_localize(None), Cleaning(timezone=zone))
    with refused("interval_s (--interval)"):
        clean(VALUES, Cleaning(interval_s=2))


@pytest.mark.parametrize(("how", "value"), [("mean", 5.0), ("last", 6.0)])
def test_one_of_several_values_at_the_same_time_is_taken(how, value):
    series = pd.concat([CLEAN.iloc[:11], with_times(TIMES[[11, 11]], [4.0, 6.0]), CLEAN.iloc[12:]])
    cleaned = cleaned_of(series, same_time=how)
    as_one(cleaned, np.where(ROWS == 11, value, VALUES))
    (finding,) = repairs(cleaned.report)
    assert (finding.kind, finding.count, finding.rows_left_out) == ("same time", 1, 1)
    assert "2020-03-01T00:00:11" in finding.places[0]


@pytest.mark.parametrize("interval_s", [None, 1.0])
def test_one_late_row_is_snapped_and_named(interval_s):
    series = with_times(TIMES + in_seconds(np.where(ROWS == 70, 0.125, 0.0)))
    found = cleaned_of(series, interval_s=interval_s).report.find("jitter")
    assert (found.count, found.details["largest_s"]) == (1, 0.125)
    assert found.places[0] == "row 70, 2020-03-01T00:01:10.125000+00:00"


def test_rows_that_two_exports_share_are_merged_and_others_at_their_times_are_refused(refused):
    rows = [*range(40), *range(20, 60)]
    series = pd.Series(np.arange(60.0)[rows] % 7, pd.date_range("2024", periods=60, freq="s")[rows])
    cleaned = clean(series)
    assert cleaned.telemetry.values[:, 0].tolist() == [row % 7 for row in range(60)]
    assert cleaned.report.find("duplicate rows").count == 20
    series.iloc[40:60] += 1
    with refused("cover the same time once more"):
        clean(series)
    zoned = series.tz_localize("UTC")
    with refused("same_time='last'"):
        clean(zoned)
    cleaned = clean(zoned, Cleaning(same_time="last"))
    assert cleaned.telemetry.values[20:40, 0].tolist() == [row % 7 + 1 for row in range(20, 40)]


def test_rows_without_a_value_do_not_take_a_clock_back():
    times = pd.date_range("2024", periods=60, freq="s", tz="UTC")
    values = np.r_[np.arange(60.0) % 7, np.full(60, np.nan)]
    assert len(clean(pd.Series(values, times.append(times))).telemetry) == 60


@pytest.mark.parametrize("interval_s", [2.4, 2.5, 7.3])
@pytest.mark.parametrize("cut", [np.floor, np.round])
def test_times_that_were_cut_to_whole_seconds_keep_their_interval(interval_s, cut):
    cleaned = clean(pd.Series(np.arange(300) % 7.0, cut(interval_s * np.arange(300))))
    assert cleaned.telemetry.interval_s == pytest.approx(interval_s, rel=1e-9)
    assert len(cleaned.telemetry) == 300


def test_a_clock_that_lost_every_third_digit_is_not_averaged(refused):
    times = np.floor(np.arange(60) * 40 / 60) * 60
    with refused("a clock that lost digits"):
        clean(pd.Series(np.arange(60.0), times))


def test_steps_that_differ_are_rows_missing_and_no_other_rate():
    times = START + in_seconds(np.cumsum([1] * 200 + [3, 4] * 40))
    assert cleaned_of(with_times(times, VALUES[: len(times)])).report.find("other rates") is None


@pytest.mark.parametrize(
    "steps",
    [
        [1] * 4 + [5] * 3 + [9] * 3,
        [1] * 4 + [0.1] * 3 + [0.3] * 3,
        [1] * 40 + [10] + [1] * 50 + [1.2] + [1] * 49,
    ],
    ids=["rows missing", "finer stretches", "a gap and a step of the clock"],
)
def test_the_interval_by_hand(steps):
    assert find_interval(np.round(np.cumsum([0, *steps]) * 1e9).astype(np.int64)) == 1e9


MEAN = (9 + VALUES[50]) / 2


@pytest.mark.parametrize(
    ("options", "value"),
    [({}, MEAN), ({"same_time": "last"}, 9), ({"same_time": "last", "interval_s": 1.0}, MEAN)],
)
def test_rows_near_the_same_sample_are_merged_as_asked(options, value):
    series = pd.concat([CLEAN, with_times([TIMES[50] + pd.Timedelta("200ms")], [9.0])]).sort_index()
    as_one(cleaned_of(series, **options), np.where(ROWS == 50, value, VALUES))


def test_whole_seconds_that_would_be_dates_of_2299_are_seconds():
    cleaned = cleaned_of(with_times(22_990_101 + np.arange(28), VALUES[:28]))
    assert cleaned.report.find("clock").details["form"] == "seconds since zero"


def test_two_rows_are_enough_for_an_interval():
    as_one(cleaned_of(CLEAN.iloc[:2]), VALUES[:2])


@pytest.mark.parametrize("how", ["mean", "last"])
def test_a_missing_value_at_a_repeated_time_is_ignored(how):
    series = pd.concat([CLEAN.iloc[:6], with_times(TIMES[[5, 6]], [np.nan, 9.0]), CLEAN.iloc[7:]])
    cleaned = cleaned_of(series, same_time=how)
    as_one(cleaned, np.where(ROWS == 6, 9.0, VALUES))
    assert cleaned.report.find("missing values").count == 1
    assert cleaned.report.find("same time") is None


GAP = np.arange(100, 106)


@pytest.mark.parametrize(
    "series",
    [CLEAN.drop(TIMES[GAP]), set_rows(GAP, np.nan, float), set_rows(GAP, np.inf, float)],
    ids=["-", "NaN", "inf"],
)
def test_a_gap_of_more_than_max_fill_splits_the_series(series):
    cleaned = cleaned_of(series)
    before, after = cleaned.parts
    assert_kept(before, VALUES[:100])
    assert_kept(after, VALUES[106:])
    assert (before.offset_s, after.offset_s, after.start) == (0, 106, before.start)
    assert len(cleaned.longest) == len(after)
    found = cleaned.report.find("gaps")
    assert (found.count, found.details["longest"]) == (1, 7.0)
    assert "2020-03-01T00:01:39" in found.places[0]


def test_the_longest_gap_is_told_in_seconds():
    values = [*range(6), *[np.nan] * 7, *range(17)]
    series = with_times(pd.date_range(START, periods=30, freq="10s"), values)
    assert cleaned_of(series).report.find("gaps").details["longest"] == 80.0


def test_a_gap_of_max_fill_is_filled_on_a_given_grid_as_well():
    cleaned = cleaned_of(CLEAN.drop(TIMES[100:105]), interval_s=1.0)
    as_one(cleaned, linear(np.arange(100, 105)))
    assert cleaned.report.samples_filled == 5


def test_telemetry_that_is_sent_on_change_is_held_until_the_next_row():
    times = START + in_seconds([0, 7, 8, 30, 31.2, 90])
    series = with_times(times, [1.0, 2.0, 2.5, 0.0, 4.0, 5.0])
    held = cleaned_of(series, interval_s=1.0, fill="hold")
    expected = [*[1.0] * 7, 2.0, *[2.5] * 22, 0.0, *[4.0] * 59, 5.0]
    (part,) = held.parts
    assert_kept(part, expected)
    assert held.report.samples_filled == len(expected) - 6
    assert "filled with the value before them" in held.report.find("gaps filled").text
    # the last of several rows in an interval counts, and a long gap splits the series if it is
    # asked for
    (coarser,) = cleaned_of(series, interval_s=10.0, fill="hold").parts
    assert_kept(coarser, [1, 2.5, 2.5, 4, 4, 4, 4, 4, 4, 5])
    split = cleaned_of(series, interval_s=1.0, fill="hold", max_fill=30)
    assert split.report.find("gaps").count == 1


def test_short_parts_are_left_out_and_counted(refused):
    # leaves an isolated part of five samples
    series = CLEAN.drop(TIMES[[*range(100, 110), *range(115, 130)]])
    assert [len(part) for part in cleaned_of(series).parts] == [100, 5, 270]
    cleaned = cleaned_of(series, min_part=6)
    assert [len(part) for part in cleaned.parts] == [100, 270]
    assert cleaned.report.find("short parts").rows_left_out == 5
    with refused("at least 300", "270 at most"):
        clean(series, Cleaning(min_part=300))


def test_jumps_of_the_clock_split_the_series_and_keep_every_row():
    """The grid of the first part lies between the times before and after the first jump, which are
    0.4 s apart.
    """
    late = in_seconds(0.4 * (ROWS >= 100) + 0.4 * (ROWS >= 150))
    cleaned = cleaned_of(with_times(TIMES + late))
    before, after = cleaned.parts
    assert after.offset_s == pytest.approx(150 + 0.8 - 0.2)
    assert_kept(before, VALUES[:150])
    assert_kept(after, VALUES[150:])
    assert (cleaned.report.find("clock steps").count, cleaned.report.rows_used) == (1, N)


@pytest.mark.parametrize("interval", [1 / 3, 0.25, 60.0, 98.5, 1.0003, 1e-4, 3_600.0])
@pytest.mark.parametrize("unit", ["ns", "us"])
def test_the_interval_is_that_of_the_rows(interval, unit):
    number = 5_000
    nanoseconds = np.round(np.arange(number) * interval * 1e9).astype(np.int64)
    times = pd.DatetimeIndex(nanoseconds.view("datetime64[ns]"), tz="UTC").as_unit(unit)
    (part,) = cleaned_of(with_times(times, np.sin(np.arange(number) / 9))).parts
    assert len(part) == number
    assert part.interval_s == pytest.approx(interval, abs=0.1 * interval / number)


@pytest.mark.parametrize("where", [0, 150, 340])
def test_a_finer_stretch_is_averaged_down_to_the_grid(where):
    """Each sample of the stretch is replaced by five rows around its time whose mean equals the
    sample.
    """
    offsets, differences = np.array([[-0.4, -0.2, 0.0, 0.2, 0.4], [1.0, -2.0, 0.5, 2.0, -1.5]])
    inside = np.arange(where + 1, where + 51)
    times = START + in_seconds((inside[:, None] + offsets).ravel())
    fine = with_times(times, (VALUES[inside, None] + differences).ravel())
    cleaned = cleaned_of(pd.concat([CLEAN.drop(TIMES[inside]), fine]).sort_index())
    as_one(cleaned, off=1e-5)
    assert cleaned.report.find("averaged").rows_left_out == 50 * 4
    # the steps of 0.6 s before and after it, too
    assert cleaned.report.find("other rates").count == 50 * 5 + 2


def test_a_wandering_clock_splits_the_series_before_a_time_is_off_by_more_than_a_quarter():
    wander = 2 * np.sin(ROWS / 40)  # in intervals; too much to be snapped
    cleaned = cleaned_of(with_times(TIMES + in_seconds(wander), ROWS))
    assert len(cleaned.parts) > 5 and cleaned.report.rows_used > 0.9 * N
    begin = (pd.Timestamp(cleaned.parts[0].start) - START).total_seconds()
    for part in cleaned.parts:
        # values are row numbers, so a filled sample lies between two integers
        rows = part.values[:, 0].astype(int)
        real = part.values[:, 0] == rows
        assert np.abs(begin + part.time_s - rows - wander[rows])[real].max() <= 0.25 + 1e-6


def test_a_coarser_stretch_is_filled_or_splits_the_series():
    inside = np.delete(np.arange(120, 241), np.arange(0, 121, 4))  # a row every 4 s from 120 to 240
    series = CLEAN.drop(TIMES[inside])
    cleaned = cleaned_of(series)
    as_one(cleaned, linear(inside))
    assert cleaned.report.samples_filled == len(inside)
    assert cleaned.report.find("other rates").count == 31
    # three missing samples between rows are more than max_fill
    wide = cleaned_of(series, max_fill=2)
    assert [len(part) for part in wide.parts] == [121, 160]


def test_a_given_interval_averages_the_rows_that_share_it():
    cleaned = cleaned_of(CLEAN, interval_s=4)
    (part,) = cleaned.parts
    # the nearest grid point, with ties to even
    means = pd.Series(VALUES).groupby(np.round(ROWS / 4)).mean()
    np.testing.assert_allclose(part.values[:, 0], means, atol=1e-6)
    assert (part.interval_s, cleaned.report.find("averaged").rows_left_out) == (4, N - len(part))


def test_local_times_are_converted_across_clock_changes():
    berlin = "Europe/Berlin"
    wave = np.sin(np.arange(500) / 9)
    times = pd.date_range("2020-10-24T22:00Z", periods=500, freq="min")
    local = with_times(times.tz_convert(berlin).tz_localize(None), wave)
    shuffled = cleaned_of(local.sample(frac=1, random_state=0), timezone=berlin).report
    # without chronological order, the repeated hour is ambiguous
    assert shuffled.find("clock change").rows_left_out == 120
    merged = cleaned_of(local, timezone="UTC").report
    assert merged.find("same time").rows_left_out == 60
    spring = with_times(pd.date_range("2020-03-29T00:00", periods=300, freq="min"), wave[:300])
    report = cleaned_of(spring, timezone=berlin).report
    assert report.find("clock change").rows_left_out == 60


def test_samples_are_counted_without_times():
    values = VALUES.copy()
    values[[7, *range(100, 120)]] = np.nan
    for series in (values, values.tolist(), pd.Series(values), pd.Series(values.astype(object))):
        cleaned = cleaned_of(series)
        before, after = cleaned.parts
        assert (before.clock.has_time, before.clock.unit) == (False, "samples")
        assert (before.interval_s, before.offset_s, after.offset_s) == (1.0, 0, 120)
        assert_kept(after, values[120:])
        gaps = cleaned.report.find("gaps")
        assert gaps.places == ("row 99",) and gaps.details == {"longest": 21.0}
    piece = cleaned_of(pd.Series(VALUES)[50:90])
    assert piece.parts[0].offset_s == 50, "a piece of a series keeps its clock"
    values[:3] = np.nan
    assert cleaned_of(values).parts[0].offset_s == 3


def found_in(values, kind):
    """The finding of one kind in a series of these values."""
    return cleaned_of(with_times(TIMES, values)).report.find(kind)


def test_properties_of_the_values_are_reported():
    assert repairs(cleaned_of(CLEAN).report) == []
    steps = np.round(VALUES * 16) / 16
    found = found_in(steps, "quantised")
    assert found.details == {"step": 0.0625} and found.count == len(np.unique(steps))
    constant = cleaned_of(with_times(TIMES, 3.5))
    assert [finding.kind for finding in repairs(constant.report)] == ["constant"]
    assert set(constant.parts[0].values[:, 0]) == {3.5}
    # float32 keeps steps of 1/16 at a million
    error = found_in(VALUES + 1e6, "resolution").details["error"]
    assert error == pytest.approx(0.03, abs=0.01)


def test_values_that_stay_longer_than_others_are_stuck():
    values = VALUES.copy()
    values[200:260] = values[200]
    stuck = found_in(values, "stuck")
    assert (stuck.count, stuck.details["longest"]) == (1, 60)
    assert stuck.places[0].startswith("row 200,")
    # plateaus are what this channel does
    plateaus = np.where(ROWS // 25 % 2, 1.0, -1.0)
    plateaus[200:300] = 0.5
    assert found_in(plateaus, "stuck").count == 1


def test_a_level_or_a_spread_that_changes_is_reported():
    drifting = found_in(VALUES + ROWS / 100, "changing level")
    low = drifting.details["low"]
    assert len(low) == drifting.count == 10
    assert low[-1] - low[0] == pytest.approx(3.6, abs=1)
    assert found_in(VALUES * np.linspace(1, 5, N), "changing level") is not None


DIRTY_CELL = st.one_of(
    st.floats(-5, 5),
    st.sampled_from([np.nan, np.inf, -np.inf, None, pd.NA, 1e39, 10**400, True]),
    st.sampled_from(["", "nan", "1.5", "-", "1.5 V", "1,5"]),
)
DIRTY_STEP = st.one_of(
    st.just(1.0),
    st.floats(0, 3),
    st.sampled_from([0.0, -1.0, -7.5, 0.25, 2.0, 6.0, 40.0, 3_600.0, -3_600.0, None]),
)


@given(
    cells=st.lists(st.tuples(DIRTY_STEP, DIRTY_CELL), max_size=60),
    nominal=st.integers(0, 60),
    options=st.fixed_dictionaries(
        {
            "same_time": st.sampled_from(["mean", "last"]),
            "drop_bad": st.sampled_from([True, True, False]),
            "max_fill": st.integers(0, 8),
            "min_part": st.integers(1, 12),
            "interval_s": st.sampled_from([None, None, 0.7, 5]),
        }
    ),
    form=st.sampled_from(["stamps", "seconds", "text", "none"]),
)
def test_no_row_is_lost_silently(cells, nominal, options, form):
    steps = [1.0] * nominal + [step for step, _ in cells]
    values = [float(row % 7) for row in range(nominal)] + [cell for _, cell in cells]
    seconds = np.cumsum([step or 0.0 for step in steps]) + 1e6
    seconds[[step is None for step in steps]] = np.nan
    times = pd.to_datetime(seconds, unit="s", utc=True)
    if form == "text":
        index = times.astype(str)
    elif form == "seconds":
        index = pd.Index(seconds)
    else:
        index = times if form == "stamps" else pd.RangeIndex(len(values))
        options = options | ({"interval_s": None} if form == "none" else {})
    series = pd.Series(pd.Series(values, dtype=object).array, index=index, name="x")
    try:
        cleaned = clean(series, Cleaning(**options))
    except InputError as error:
        message = str(error)
        assert message.startswith("Expected ") and "Received: " in message
        assert len(message.splitlines()) == 1
    else:
        check_balance(cleaned)
        assert cleaned.report.rows_in == len(values)


@given(
    lost=st.lists(st.integers(0, 149), max_size=60),
    blank=st.lists(st.integers(0, 149), max_size=20),
    twice=st.lists(st.integers(0, 149), max_size=10),
    jitter=st.sampled_from([0.0, 0.05, 0.2]),
    seed=st.integers(0, 10**6),
    max_fill=st.integers(0, 6),
)
def test_remaining_samples_keep_their_times(lost, blank, twice, jitter, seed, max_fill):
    """Rows are dropped, emptied, duplicated, jittered and shuffled; the oracle builds the parts
    from the remaining times.
    """
    rng = np.random.default_rng(seed)
    values = rng.standard_normal(300)
    off = rng.uniform(-jitter, jitter, 300)
    kept = np.setdiff1d(np.arange(300), lost)
    with_value = np.setdiff1d(kept, blank)
    rows = rng.permutation(np.concatenate([kept, np.intersect1d(twice, kept)])).astype(int)
    times = START + in_seconds(rows + off[rows])
    series = with_times(times, np.where(np.isin(rows, blank), np.nan, values[rows]))
    cleaned = clean(series, Cleaning(max_fill=max_fill, min_part=1))
    check_balance(cleaned)
    runs = np.split(with_value, np.flatnonzero(np.diff(with_value) > max_fill + 1) + 1)
    expected = [np.interp(np.arange(run[0], run[-1] + 1), run, values[run]) for run in runs]
    assert [len(part) for part in cleaned.parts] == [len(part) for part in expected]
    begin = (pd.Timestamp(cleaned.parts[0].start) - START).total_seconds()
    for part, wanted, run in zip(cleaned.parts, expected, runs, strict=True):
        np.testing.assert_allclose(part.values[:, 0], wanted, atol=1e-5)
        assert begin + part.offset_s == pytest.approx(run[0], abs=max(1e-5, 1.5 * jitter))


def test_what_channels_share_is_said_once():
    series = CLEAN.drop(TIMES[[20, 21]])
    reports = [clean(series).report, clean(series.round().rename("amperes")).report]
    first, *rest = lines_of(reports)
    assert first.startswith("volts, amperes: 398 rows, 398 used")
    shared = [finding.line() for finding in reports[0].findings]
    own = [line for line in rest if not line.startswith("volts, amperes: ")]
    assert shared and [line for line in rest if line not in own] == [
        f"volts, amperes: {line}" for line in shared
    ]
    assert own and all(line.startswith("amperes: ") for line in own)
    assert lines_of(reports[:1]) == reports[0].lines() == [f"volts: {reports[0].summary}", *shared]


def test_a_logger_clock_with_jitter_is_read_at_its_median_rate():
    """Steps of 4 ms, of which each is longer or shorter by up to a half, as flight loggers have."""
    rng, number = np.random.default_rng(5), 4_000
    seconds = np.cumsum(4e-3 * rng.uniform(0.5, 1.5, number))
    times = START + in_seconds(seconds)
    cleaned = clean(pd.Series(np.sin(3 * seconds), times), Cleaning(min_part=32))
    assert cleaned.report.find("jitter") and len(cleaned.parts) == 1
    assert cleaned.report.rows_used > 0.6 * number
    begin_s = (pd.Timestamp(cleaned.telemetry.start) - START).total_seconds()
    at = begin_s + cleaned.telemetry.time_s
    np.testing.assert_allclose(cleaned.telemetry.values[:, 0], np.sin(3 * at), atol=0.02)


def test_noise_is_measured_on_what_was_measured_and_filled_samples_are_a_warning():
    rng, number = np.random.default_rng(6), 2_000
    values = np.sin(np.arange(number) / 300) + 0.1 * rng.standard_normal(number)
    values[np.arange(number) % 5 > 1] = np.nan  # two of five are there
    cleaned = clean(values)
    assert cleaned.report.find("mostly filled").action == "WARNING"
    assert cleaned.report.lines()[0].startswith("WARNING: 60%")
    (part,) = cleaned.telemetry.parts
    assert part.measured.sum() == 800
    assert estimate_noise_sd([part.measured_values(0)]) == pytest.approx(0.1, rel=0.1)
    assert estimate_noise_sd([part.values[:, 0]]) < 0.07
