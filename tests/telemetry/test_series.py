"""Tests of single series: their values and their clock."""

import numpy as np
import pytest

from enhsim_tf.telemetry.series import Telemetry, check_values

RAMP = np.arange(12.0)


def with_one(bad):
    values = RAMP.copy()
    values[4] = bad
    return values


BAD_VALUES = {  # name: values, words of the message
    "empty": (np.array([]), "at least 2 samples. Received: 0"),
    "text": (np.array(["a", "b", "c"]), "numbers"),
    "complex": (np.array([1j, 2j, 3j]), "numbers"),
    "constant once it is float32": (1e9 + RAMP, "constant"),
    "NaN": (with_one(np.nan), "1 others in here, the first (nan) at sample 4"),
    "minus infinite": (with_one(-np.inf), "(-inf) at sample 4"),
    "beyond float32": (with_one(-1e300), "(-1e+300) at sample 4"),
    "beyond float32, and a gap": (np.where(RAMP == 2, 1e300, with_one(np.nan)), "2 others"),
    "true and false": (RAMP % 3 == 0, "dtype bool"),
    "too short": (RAMP[:1], "at least 2 samples"),
    "two axes": (np.zeros((3, 4)), "(3, 4)"),
    "no axis": (np.zeros(()), "()"),
}


@pytest.mark.parametrize("name", BAD_VALUES)
def test_bad_values_are_refused(refused, name):
    values, words = BAD_VALUES[name]
    with refused(words, "here"):
        check_values(values, "here")


@pytest.mark.parametrize("dtype", [np.uint8, np.int64, np.float16, np.float64])
def test_numbers_of_any_kind_become_float32(dtype):
    values = check_values(np.array([0, 1, 1, 0]).astype(dtype), "here")
    assert values.dtype == np.float32 and values.tolist() == [0, 1, 1, 0]


def test_parts_keep_the_clock():
    whole = Telemetry.of(
        np.arange(100, dtype=np.float32), interval_s=0.5, offset_s=7.0, start="2020-03-01", name="n"
    )
    part = whole.part(30, 40).part(2, 5)
    assert part.values[:, 0].tolist() == [32, 33, 34]
    assert part.time_s.tolist() == [23.0, 23.5, 24.0] == whole.time_s[32:35].tolist()
    assert (part.start, part.name, len(part)) == ("2020-03-01T00:00:00+00:00", "n", 3)


@pytest.mark.parametrize(
    "about",
    [
        {"start": "1500-01-01"},
        {"start": "2261-12-31", "interval_s": 1e6},
        {"offset_s": 1e12},
        {"start": "-1"},
        {"start": "soon"},
    ],
)
def test_times_beyond_the_range_of_nanoseconds_are_refused(refused, about):
    with refused("time"):
        print(Telemetry.of(RAMP.astype(np.float32), **about).nanoseconds)
