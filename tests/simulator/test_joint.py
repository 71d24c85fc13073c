import numpy as np

from enhsim_tf.simulator.joint import (
    cut,
    join_channels,
    long_enough,
    split_end,
    telemetry_of,
    times_of,
)
from enhsim_tf.telemetry.series import Telemetry

START = "2024-01-01T00:00:00+00:00"


def part(first, number, interval_s=10.0, start=START):
    return Telemetry(
        np.arange(first, first + number, dtype=np.float32),
        interval_s,
        first * interval_s,
        start,
        "x",
    )


def test_channels_are_cut_to_the_time_that_all_cover():
    (joined,) = join_channels({"a": [part(0, 50), part(60, 40)], "b": [part(10, 80)]})
    assert joined.columns == ("a", "b") and [
        (each.offset_s, len(each)) for each in joined.parts
    ] == [(100.0, 40), (600.0, 30)]
    np.testing.assert_array_equal(joined.parts[1].values, np.tile(np.arange(60, 90)[:, None], 2))


def test_channels_that_start_at_other_times_meet_on_one_clock():
    late = Telemetry(
        np.arange(30, dtype=np.float32), 10.0, 0.0, "2024-01-01T00:01:40+00:00", "b"
    )  # ten samples later
    (joined,) = join_channels({"a": part(0, 40), "b": late})
    np.testing.assert_array_equal(
        joined.parts[0].values, np.stack([np.arange(10, 40), np.arange(30)], axis=1)
    )
    (found,) = telemetry_of(joined, 1)
    assert (found.name, found.offset_s, found.start) == (
        "b",
        100.0,
        START,
    ) and found.values.tolist() == list(range(30))


def test_other_rates_and_other_times_get_recordings_of_their_own():
    found = join_channels(
        {"a": part(0, 50), "fast": part(0, 500, 1.0), "b": part(0, 50), "later": part(45, 50)}
    )
    assert [each.columns for each in found] == [("a",), ("b",), ("later",), ("fast",)]


def test_the_end_is_split_off_across_parts():
    (joined,) = join_channels({"a": [part(0, 60), part(70, 40)]})
    first, end = split_end(joined, 0.5)
    assert [len(each) for each in first.parts] == [50] and [
        (each.offset_s, len(each)) for each in end.parts
    ] == [(500.0, 10), (700.0, 40)]
    assert (
        split_end(joined, 0)[1] is None
        and long_enough(end, 30).parts[0].offset_s == 700.0
        and long_enough(end, 60) is None
    )


def test_windows_and_their_times_are_those_of_the_samples():
    (joined,) = join_channels({"a": [part(0, 12), part(20, 5), part(30, 11)], "b": [part(0, 50)]})
    starts = np.array(
        [0, 2, 3, 4]
    )  # three starts in the first part of twelve, none in the second, two in the third
    values = [each.values for each in joined.parts]
    np.testing.assert_array_equal(cut(values, starts, 10)[:, 0, 0], [0, 2, 30, 31])
    np.testing.assert_array_equal(cut(values, starts, 10)[3, :, 1], np.arange(31, 41))
    np.testing.assert_array_equal(times_of(joined, starts, 10), [0, 2, 30, 31])
