import numpy as np
import pytest

from enhsim_tf.common.errors import InputError
from enhsim_tf.paper.square_wave import square_wave
from enhsim_tf.paper.telemetry import (
    ParquetStore,
    Telemetry,
    cut_windows,
    make_telemetry,
    random_starts,
    split,
    true_signal,
)
from tests.paper.conftest import tiny_settings

SETTINGS = tiny_settings()
SIGNAL = true_signal(SETTINGS)


def test_the_signal_at_times_worked_out_by_hand():
    # 30 s: a quarter of the rotation and an eighth of a half orbit; 120 s: a quarter of the orbit
    # and a whole rotation
    np.testing.assert_allclose(
        SIGNAL(np.array([0.0, 30.0, 120.0])), [0, 0.25 + 0.5 * np.sin(np.pi / 8), 0.5], atol=1e-12
    )


def test_the_noise_of_the_telemetry_is_white_with_the_standard_deviation_asked_for():
    telemetry = make_telemetry(SETTINGS, np.random.default_rng(0))
    noise = telemetry.values - SIGNAL(telemetry.time)
    assert np.std(noise) == pytest.approx(0.1, rel=0.02)
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.03


def test_the_store_gives_back_what_was_placed_in_it(tmp_path):
    placed = Telemetry(np.float32([0.1, -3.5e8, 1e-20]), 0.5, "2020-02-29T23:59:59Z", "wheel")
    store = ParquetStore(tmp_path / "telemetry.parquet")
    store.write(placed)
    found = store.read()
    np.testing.assert_array_equal(found.values, placed.values)
    assert (found.interval, found.start, found.name) == (0.5, "2020-02-29T23:59:59Z", "wheel")


def test_no_window_lies_in_two_parts_and_no_time_is_lost():
    telemetry = make_telemetry(SETTINGS, np.random.default_rng(0))
    parts = list(split(telemetry, 100, 25).values())
    for before, after in zip(parts[:-1], parts[1:], strict=True):
        assert after.first - (before.first + len(before.values)) == 100
    np.testing.assert_array_equal(
        parts[2].values, telemetry.values[parts[2].first : parts[2].first + len(parts[2].values)]
    )


def test_telemetry_that_is_too_short_is_refused():
    # 109 samples of noise in each quarter: ten windows of 100
    parts = split(Telemetry(np.zeros(732, np.float32), 1.0), 100, 25)
    assert [len(part.values) - 24 - 99 for part in parts.values()] == [143, 10, 10]
    with pytest.raises(InputError, match="at least 732 samples"):
        split(Telemetry(np.zeros(731, np.float32), 1.0), 100, 25)


def test_random_starts_reach_the_first_and_the_last_window():
    assert set(random_starts(12, 10, 200, np.random.default_rng(0))) == {0, 1, 2}


def test_windows_cut_by_hand():
    values = np.array([5, 6, 7, 8, 9], np.float32)
    found = cut_windows(values, np.array([0, 2, 2]), 3)
    assert found.tolist() == [[5, 6, 7], [7, 8, 9], [7, 8, 9]] and found.dtype == np.float32


def test_a_square_wave_is_high_in_the_first_half_of_its_period():
    np.testing.assert_array_equal(
        square_wave(np.array([0, 59, 60, 119, 120]), 120, 0.25), [0.25, 0.25, -0.25, -0.25, 0.25]
    )
