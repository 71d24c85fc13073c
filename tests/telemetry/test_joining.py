import numpy as np
import pytest

from enhsim_tf.telemetry.joining import join_channels, one_series
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import cut, times_of

START = "2024-01-01T00:00:00+00:00"


def recorded(values, interval_s=10.0, offset_s=0.0, start=START):
    return Telemetry.of(np.asarray(values, np.float32), interval_s, offset_s, start, "x")


def part(first, number, interval_s=10.0):
    """A part whose values are the numbers of its samples."""
    return recorded(range(first, first + number), interval_s, first * interval_s)


def places_of(joined):
    return [(each.offset_s, len(each)) for each in joined.parts]


def test_channels_are_cut_to_the_time_that_all_cover():
    (joined,) = join_channels({"a": [part(0, 50), part(60, 40)], "b": [part(10, 80)]})
    assert joined.columns == ("a", "b") and places_of(joined) == [(100.0, 40), (600.0, 30)]
    np.testing.assert_array_equal(joined.parts[1].values, np.tile(np.arange(60, 90)[:, None], 2))


def test_channels_that_start_at_other_times_meet_on_one_clock():
    # ten samples later
    late = recorded(range(30), start="2024-01-01T00:01:40+00:00")
    (joined,) = join_channels({"a": part(0, 40), "b": late})
    expected = np.stack([np.arange(10, 40), np.arange(30)], axis=1)
    np.testing.assert_array_equal(joined.parts[0].values, expected)
    found = joined.select(["b"])
    assert (found.columns, found.offset_s, found.start) == (("b",), 100.0, START)
    assert found.values[:, 0].tolist() == list(range(30))


def test_parts_with_zeros_of_their_own_meet_on_one_clock():
    late = recorded(range(30), start="2024-01-01T00:10:00+00:00")
    (joined,) = join_channels({"a": [part(0, 40), late]})
    assert places_of(joined) == [(0.0, 40), (600.0, 30)]


def test_other_rates_and_other_times_get_recordings_of_their_own():
    found = join_channels(
        {"a": part(0, 50), "fast": part(0, 500, 1.0), "b": part(0, 50), "later": part(45, 50)}
    )
    assert [each.columns for each in found] == [("a",), ("b",), ("later",), ("fast",)]


def test_the_end_is_split_off_across_parts():
    (joined,) = join_channels({"a": [part(0, 60), part(70, 40)]})
    first, end = joined.split_end(0.5)
    assert places_of(first) == [(0.0, 50)] and places_of(end) == [(500.0, 10), (700.0, 40)]
    assert joined.split_end(0)[1] is None
    assert places_of(end.long_enough(30)) == [(700.0, 40)] and end.long_enough(60) is None


def test_windows_and_their_times_are_those_of_the_samples():
    (joined,) = join_channels({"a": [part(0, 12), part(20, 5), part(30, 11)], "b": [part(0, 50)]})
    # three starts in the first part of twelve, none in the second, two in the third
    starts = np.array([0, 2, 3, 4])
    values = [each.values for each in joined.parts]
    np.testing.assert_array_equal(cut(values, starts, 10)[:, 0, 0], [0, 2, 30, 31])
    np.testing.assert_array_equal(cut(values, starts, 10)[3, :, 1], np.arange(31, 41))
    np.testing.assert_array_equal(times_of(joined, starts, 10), [0, 2, 30, 31])


@pytest.mark.parametrize(
    ("interval_s", "groups"),
    # after 20,000 samples the clocks are 18 samples apart, or a fifth of one
    [(1.0009, [("a",), ("b",)]), (1.00001, [("a", "b")])],
)
def test_clocks_are_compared_over_their_whole_length(interval_s, groups):
    values = np.arange(20_000)
    found = join_channels({"a": recorded(values, 1.0), "b": recorded(values, interval_s)})
    assert [group.columns for group in found] == groups
    for group in found:
        np.testing.assert_array_equal(group.values[:, -1], values)


def test_what_the_door_returns_is_taken_as_it_is():
    (joined,) = join_channels({"a": part(0, 50), "b": part(0, 50)})
    assert one_series([joined]) is joined is one_series(joined)


def test_several_series_of_several_channels_are_given_on_their_own(refused):
    (joined,) = join_channels({"a": part(0, 50), "b": part(0, 50)})
    with refused("Expected parts of one channel. Received: 2 channels in"):
        one_series([joined, part(0, 50)])
