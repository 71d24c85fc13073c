"""Pairing: known delays are recovered, both series are cut to the time they share, and other clocks
are refused.
"""

import dataclasses

import numpy as np
import pytest

from enhsim_tf.coarse.pairing import estimate_delay, pair_recordings
from enhsim_tf.telemetry.joining import one_series
from enhsim_tf.telemetry.series import Clock, Part
from tests.fitted_simulators import recorded


def drive(num_samples=2_000, seed=0):
    """A smooth signal that does not repeat."""
    return np.convolve(
        np.random.default_rng(seed).standard_normal(num_samples), np.hanning(15), "same"
    )


def pair_of(values, delay, others=(), noise=0.3):
    """A recording of the values, and telemetry that follows it `delay` samples later."""
    rng = np.random.default_rng(1)
    telemetry = np.roll(values, delay) + noise * values.std() * rng.standard_normal(len(values))
    columns = [*others, values]
    names = [f"c{number}" for number in range(len(columns))]
    return recorded(telemetry), recorded(np.stack(columns, axis=1), names)


def from_start(recording, start):
    """A recording whose clock begins at another time."""
    return dataclasses.replace(recording, clock=Clock.of(recording.interval_s, start))


@pytest.mark.parametrize("delay", [0, 1, -64])
def test_a_known_delay_is_recovered(delay):
    telemetry, recording = pair_of(drive(), delay, others=[drive(seed=5)])
    found = estimate_delay(telemetry, recording, 64)
    assert found.seconds == 10 * delay and found.column == "c1" and found.correlation > 0.9


def test_a_delay_is_recovered_across_gaps_and_a_negative_correlation():
    telemetry, recording = pair_of(drive(), 7)
    parts = [telemetry.part(0, 700), telemetry.part(760, 1_500), telemetry.part(1_530, 2_000)]
    values = -recording.values
    recording = dataclasses.replace(
        recording, parts=(Part(values[:900]), Part(values[950:], 9_500.0))
    )
    found = estimate_delay(one_series(parts), recording, 64)
    coarse = recording.at(10.0 * np.arange(2_000) - 70.0)[:, 0]
    there = np.isfinite(coarse)
    there[700:760] = there[1_500:1_530] = False
    expected = np.corrcoef(coarse[there], telemetry.values[there, 0])[0, 1]
    assert found.seconds == 70 and found.correlation == pytest.approx(expected, abs=1e-6)


def test_of_the_equal_maxima_of_a_periodic_signal_the_nearest_is_taken():
    telemetry, recording = pair_of(np.sin(2 * np.pi * np.arange(2_000) / 50), 13, noise=0.1)
    assert estimate_delay(telemetry, recording, 200).seconds == pytest.approx(130, abs=10)


def test_a_delay_longer_than_a_window_is_refused_with_the_delay_to_give(refused):
    telemetry, recording = pair_of(drive(), 200)
    with refused("at most a window, 64 samples", "--delay 2000"):
        estimate_delay(telemetry, recording, 64)
    found, run = pair_recordings(telemetry, recording, 2_000.0)
    assert found.parts[0].offset_s == 2_000
    assert np.corrcoef(found.values[:, 0], run.values[:, 0])[0, 1] > 0.9


def test_both_are_cut_to_the_time_they_share():
    telemetry, recording = pair_of(drive(), 0, noise=0)
    late = recorded(recording.values[60:1_000], ["c0"], "2024-01-01T00:10:00+00:00")
    parts = [telemetry.part(0, 500), telemetry.part(520, 2_000)]
    found, run = pair_recordings(one_series(parts), late)
    assert [(part.offset_s, len(part)) for part in found.parts] == [(600.0, 440), (5_200.0, 480)]
    assert [part.offset_s for part in run.parts] == [600.0, 5_200.0]
    np.testing.assert_allclose(found.values, run.values, atol=1e-5)


def test_runs_of_another_time_are_refused(refused):
    telemetry, recording = pair_of(drive(), 0)
    elsewhere = from_start(recording, "2025-01-01T00:00:00+00:00")
    assert estimate_delay(telemetry, elsewhere, 64).column is None
    for words, run, least_samples in (
        (["overlaps the telemetry in time", "--delay"], elsewhere, 2),
        (
            ["in both the telemetry and the coarse run, or in neither"],
            from_start(recording, None),
            2,
        ),
        (["at least 3000 samples"], recording, 3_000),
    ):
        with refused(*words):
            pair_recordings(telemetry, run, least_samples=least_samples)
