"""Training pairs: indices of window starts over the parts of a series, and simulators that are fitted to each window."""

import numpy as np
import pytest

from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.enhancer.training_pairs import (
    MIN_GAIN,
    apply_shift_and_gain,
    cut_pairs,
    paired_windows,
    split_end,
    window_errors,
)
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import (
    cut_windows_from_parts,
    evenly_spaced_starts,
    first_samples,
    num_window_starts,
    random_window_starts,
)

COARSE = SquareWaveSimulator([SquareWave(period_s=100, phase=0.005, duty=0.3, low=-1.0, high=1.0)])  # edges between samples


def part(begin, stop, interval_s=1.0):
    """A part whose values are the numbers of its samples on the series' clock."""
    return Telemetry(np.arange(begin, stop, dtype=np.float32), interval_s, offset_s=interval_s * begin)


PARTS = [part(0, 10), part(20, 23), part(30, 35), part(50, 54)]  # windows of 4 begin at 0..6, nowhere, 30..31, 50


def test_window_starts_are_counted_over_all_parts():
    assert num_window_starts(PARTS, 4) == 7 + 0 + 2 + 1
    windows, time_s = cut_windows_from_parts(PARTS, np.arange(10), 4)
    begins = [0, 1, 2, 3, 4, 5, 6, 30, 31, 50]
    np.testing.assert_array_equal(windows, np.array(begins)[:, None] + np.arange(4))
    np.testing.assert_array_equal(time_s, begins)
    assert windows.dtype == np.float32


def test_first_samples_are_counted_over_all_samples_of_long_parts():
    assert first_samples(PARTS, np.arange(10), 4).tolist() == [0, 1, 2, 3, 4, 5, 6, 10, 11, 15]
    assert first_samples(PARTS, [9, 0, 7, 9], 4).tolist() == [15, 0, 10, 15]


def test_window_starts_may_be_unsorted_and_repeated():
    windows, time_s = cut_windows_from_parts(PARTS, np.array([9, 0, 7, 9]), 4)
    np.testing.assert_array_equal(windows[:, 0], [50, 0, 30, 50])
    np.testing.assert_array_equal(time_s, [50, 0, 30, 50])


def test_times_are_in_seconds_on_the_clock_of_the_series():
    _, time_s = cut_windows_from_parts([part(0, 6, 0.5), part(40, 46, 0.5)], np.array([1, 5]), 4)
    np.testing.assert_array_equal(time_s, [0.5, 21.0])


@pytest.mark.parametrize("starts", [[-1], [10], [0, 99]])
def test_window_starts_out_of_range_are_refused(refused, starts):
    with refused("before 10"):
        cut_windows_from_parts(PARTS, np.array(starts), 4)


def test_parts_shorter_than_a_window_have_no_window_starts(refused):
    assert (
        num_window_starts(PARTS, 11) == 0
        and evenly_spaced_starts(PARTS, 11, 5).size == 0
        and cut_windows_from_parts(PARTS, [], 11)[0].shape == (0, 11)
    )
    with refused("11 samples", "Received: 10"):
        random_window_starts(PARTS, 11, 5, np.random.default_rng(0))
    with refused("Received: 0"):
        random_window_starts([], 11, 5, np.random.default_rng(0))


def test_random_window_starts_are_uniform():
    starts = random_window_starts(PARTS, 4, 20_000, np.random.default_rng(3))
    counts = np.bincount(starts, minlength=10)
    assert len(counts) == 10 and np.abs(counts - 2_000).max() < 5 * np.sqrt(20_000 * 0.1 * 0.9)
    np.testing.assert_array_equal(starts, random_window_starts(PARTS, 4, 20_000, np.random.default_rng(3)))


@pytest.mark.parametrize("number", [1, 2, 4, 9, 10, 50])
def test_evenly_spaced_starts_are_sorted_and_distinct(number):
    starts = evenly_spaced_starts(PARTS, 4, number)
    assert len(starts) == min(number, 10) and (np.diff(starts) > 0).all() and starts[0] == 0
    assert number == 1 or starts[-1] == 9
    assert np.ptp(np.diff(starts), axis=0) <= 1 if number > 2 else True


@pytest.mark.parametrize(
    ("share", "first", "rest"),
    [
        (0.5, [(0, 10), (20, 21)], [(21, 23), (30, 35), (50, 54)]),  # 22 samples: 11 and 11
        (4 / 22, [(0, 10), (20, 23), (30, 35)], [(50, 54)]),
        (0.01, [(0, 10), (20, 23), (30, 35), (50, 54)], []),
        (0.99, [], [(0, 10), (20, 23), (30, 35), (50, 54)]),
        (0, [(0, 10), (20, 23), (30, 35), (50, 54)], [(0, 10), (20, 23), (30, 35), (50, 54)]),
    ],
)
def test_the_end_is_split_off(share, first, rest):
    for found, expected in zip(split_end(PARTS, share), (first, rest), strict=True):
        assert [(int(each.values[0]), int(each.values[-1]) + 1) for each in found] == expected
        assert all(each.offset_s == each.values[0] for each in found)  # on the same clock


def test_without_following_they_are_the_paired_windows_to_the_bit():
    rng = np.random.default_rng(1)
    series = Telemetry(rng.standard_normal(700).astype(np.float32), 2.0, offset_s=33.0)
    starts = random_window_starts([series], 120, 40, rng)
    pairs = cut_pairs([series], COARSE, starts, 120)
    coarse, target = paired_windows(series, COARSE, starts, 120)
    assert pairs.coarse.tobytes() == coarse.tobytes() and pairs.target.tobytes() == target.tobytes()
    assert (pairs.shift == 0).all() and (pairs.gain == 1).all() and len(pairs) == 40
    np.testing.assert_array_equal(pairs.coarse_rescaled, coarse)
    np.testing.assert_array_equal(pairs.target_in_unit, target)


@pytest.mark.parametrize("ahead_s", [0, 7, -31, 50])
@pytest.mark.parametrize(("shift", "gain"), [(0, 1), (3, 2.5), (-200, 0.2), (0.001, 40)])
def test_a_simulator_that_is_the_telemetry_is_found_with_its_clock_level_and_amplitude(ahead_s, shift, gain):
    times = np.arange(1_000.0)
    values = (shift + gain * COARSE(times + ahead_s)).astype(np.float32)
    parts = [Telemetry(values[:400]), Telemetry(values[450:], offset_s=450.0)]
    pairs = cut_pairs(parts, COARSE, evenly_spaced_starts(parts, 150, 30), 150, follow=True)
    np.testing.assert_allclose(pairs.shift, shift, atol=2e-6 * (abs(shift) + gain))
    np.testing.assert_allclose(pairs.gain, gain, rtol=2e-6 * (1 + abs(shift) / gain))
    np.testing.assert_allclose(pairs.coarse_rescaled, pairs.target, atol=5e-6 * (abs(shift) + gain))
    np.testing.assert_allclose(pairs.target_in_unit, pairs.coarse, atol=5e-6 * (1 + abs(shift) / gain))
    np.testing.assert_array_equal(pairs.coarse, COARSE(pairs.time_s[:, None] + ahead_s + np.arange(150)).astype(np.float32))
    assert len(pairs.drop_flat()) == 30


def test_level_and_amplitude_of_each_window_are_its_own():
    times, steps = np.arange(2_000.0), np.repeat([0.0, 1.0, 2.0, 3.0], 500)
    series = Telemetry(((10 * steps) + (1 + steps) * COARSE(times)).astype(np.float32))
    pairs = cut_pairs([series], COARSE, np.array([0, 510, 1_020, 1_530]), 300, follow=True)
    np.testing.assert_allclose(pairs.shift, [0, 10, 20, 30], atol=1e-4)
    np.testing.assert_allclose(pairs.gain, [1, 2, 3, 4], rtol=1e-5)


def test_shift_and_gain_are_those_of_least_squares():
    rng = np.random.default_rng(5)
    series = Telemetry((4 + 3 * COARSE(np.arange(600.0)) + rng.standard_normal(600)).astype(np.float32))
    pairs = cut_pairs([series], COARSE, evenly_spaced_starts([series], 200, 8), 200, follow=True)
    for coarse, target, shift, gain in zip(pairs.coarse, pairs.target, pairs.shift, pairs.gain, strict=True):
        design = np.stack([np.ones(200), coarse], axis=1).astype(np.float64)
        expected = np.linalg.lstsq(design, target.astype(np.float64), rcond=None)[0]
        np.testing.assert_allclose([shift, gain], expected, rtol=1e-5)


def test_flat_windows_are_dropped():
    moving, still = COARSE(np.arange(300.0)), np.zeros(300)
    series = Telemetry(np.concatenate([moving, still, 0.5 * MIN_GAIN * moving, moving]).astype(np.float32))
    pairs = cut_pairs([series], COARSE, np.array([0, 300, 600, 900]), 300, follow=True)
    np.testing.assert_allclose(pairs.gain, [1, 0, 0.5 * MIN_GAIN, 1], atol=1e-6)
    kept = pairs.drop_flat()
    np.testing.assert_array_equal(kept.time_s, [0, 900])
    assert kept.coarse.shape == kept.target.shape == (2, 300) and len(kept.shift) == len(kept.gain) == 2


def test_telemetry_that_stands_still_is_refused(refused):
    series = Telemetry(np.full(500, 7.0, np.float32))
    pairs = cut_pairs([series], COARSE, evenly_spaced_starts([series], 100, 5), 100, follow=True)
    assert (pairs.gain == 0).all() and (pairs.shift == 7).all()
    with refused("none of 5", "follow the coarse simulator"):
        pairs.drop_flat()


def test_windows_without_an_edge_of_the_simulator_have_no_gain():
    slow = SquareWaveSimulator([SquareWave(period_s=1e6)])
    series = Telemetry(np.random.default_rng(0).standard_normal(300).astype(np.float32))
    pairs = cut_pairs([series], slow, np.array([0, 100]), 100)
    followed = cut_pairs([series], slow, np.array([0, 100]), 100, follow=True)
    assert (pairs.coarse == 1).all() and np.isfinite(followed.coarse_rescaled).all()
    flat = followed.gain == 0
    np.testing.assert_allclose(followed.shift[flat], followed.target[flat].mean(axis=1, dtype=np.float64))


def test_at_level_worked_by_hand():
    moved = apply_shift_and_gain(np.array([[0.0, 1.0], [1.0, -1.0]]), np.array([10.0, 0.0]), np.array([2.0, -3.0]))
    np.testing.assert_array_equal(moved, [[10, 12], [-3, 3]])
    assert moved.dtype == np.float32


def test_errors_are_in_units_of_each_windows_own_deviation():
    target = np.array([[1, -1, 1, -1], [3, 7, 3, 7], [5, 5, 5, 5]], np.float32)  # deviations 1, 2, 0
    errors = window_errors(target + np.array([[3, 3, 3, 3], [0, 0, 0, 4], [1, 1, 1, 1]], np.float32), target)
    np.testing.assert_array_equal(errors, [3, 1, np.nan])
