"""Brings telemetry and a recorded run of the coarse simulator to one clock (steps 3 and 4 of the pipeline).

They are cut to the time that they share. A constant delay between them is estimated by cross-correlation, unless it is given.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from enhsim_tf.coarse_simulator.recording import Recording, Run
from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.cleaning.report import iso_time
from enhsim_tf.telemetry.series import Telemetry, nanoseconds
from enhsim_tf.telemetry.windows import runs_of

_EQUALLY_GOOD = 0.02  # a maximum with at least 1 - 0.02 of the largest squared correlation is as good; the nearest to 0 is taken
_LEAST_CORRELATION = 0.1  # below this correlation at every delay, no delay is estimated
_LEAST_SHARE = 0.5  # a delay is considered only if at least this share of the samples remains


@dataclasses.dataclass(frozen=True)
class Delay:
    """A constant delay between the coarse run and the telemetry."""

    seconds: float  # how much later the telemetry is; in samples if there are no times
    column: str | None = (
        None  # the coarse column that it was estimated from; None if it was not estimated
    )
    correlation: float = float("nan")  # of that column with the telemetry at this delay
    undelayed: float = float("nan")  # the same without a delay


def pair_recordings(
    telemetry: Recording, run: Recording, delay_s: float = 0.0, least_samples: int = 2
) -> tuple[Recording, Recording]:
    """Cuts telemetry and a coarse run, which is so much earlier, to the same parts, which both cover, on the clock of the telemetry.

    Raises InputError if the two share no time, or no stretch of so many samples.
    """
    clocks, interval_s = [telemetry.clock(part) for part in telemetry.parts], telemetry.interval_s
    shift_s = _seconds_between(clocks[0], run) + delay_s
    values, coarse, longest = [], [], 0
    for part, clock in zip(telemetry.parts, clocks, strict=True):
        there = run.at(clock.time_s - shift_s)
        for first, stop in runs_of(np.isfinite(there).all(axis=1)):
            longest = max(longest, stop - first)
            if stop - first >= least_samples:
                begin_s = part.offset_s + interval_s * first
                values.append(Run(part.values[first:stop], begin_s))
                coarse.append(Run(there[first:stop], begin_s))
    if not longest:
        spans, advice = (
            (_span(telemetry, 0.0), _span(run, shift_s)),
            "Record the same time, or give --delay.",
        )
        if run.clock().counts and not clocks[0].counts:
            begin = iso_time(nanoseconds(clocks[0], 0, 1)[0]).removesuffix("+00:00")
            spans, advice = (
                ("dates", "times from zero"),
                f"Give the time of that zero: --coarse-start {begin} if both begin together.",
            )
        raise InputError(
            f"Expected a coarse run that overlaps the telemetry in time. Received: {spans[0]} in {telemetry.name}, {spans[1]} in {run.name}. {advice}"
        )
    if not values:
        raise InputError(
            f"Expected at least {least_samples} samples that telemetry and coarse run share without a gap. Received: {longest}. "
            "Record a longer run, or choose a smaller window."
        )
    joined = dataclasses.replace(telemetry, parts=tuple(values))
    return joined, dataclasses.replace(
        run, parts=tuple(coarse), interval_s=interval_s, start=telemetry.start
    )


def _span(recording: Recording, shift_s: float) -> str:
    last = recording.clock(recording.parts[-1]).time_s[-1]
    return f"{recording.parts[0].offset_s + shift_s:.6g} to {last + shift_s:.6g} s after the telemetry's start"


def _seconds_between(telemetry: Telemetry, recording: Recording) -> float:
    """Returns how many seconds the zero of the recording's clock is after that of the telemetry; 0 if neither has times."""
    clock = recording.clock()
    if telemetry.has_time != clock.has_time:
        with_times, without = (telemetry, clock) if telemetry.has_time else (clock, telemetry)
        raise InputError(
            f"Expected times in both the telemetry and the coarse run, or in neither. Received: {with_times.name} with times, "
            f"{without.name} without. Name the time columns, or `none` for both."
        )
    zeros = [
        int(nanoseconds(dataclasses.replace(each, offset_s=0.0), 0, 1)[0])
        for each in (telemetry, clock)
    ]
    return float(zeros[1] - zeros[0]) / 1e9


def estimate_delay(parts: Sequence[Telemetry], recording: Recording, max_samples: int) -> Delay:
    """Estimates a constant delay of at most so many samples by cross-correlation; 0 if no coarse column is correlated with the telemetry.

    The coarse column with the largest squared correlation at any delay is used. Among its local maxima that are about as high as the
    highest, the one nearest to no delay is taken, because a periodic signal has a maximum in every period.

    Raises:
        InputError: If the telemetry agrees clearly better at a longer delay.
    """
    interval_s = parts[0].interval_s
    places = [round((part.offset_s - parts[0].offset_s) / interval_s) for part in parts]
    telemetry = np.full(places[-1] + len(parts[-1]), np.nan)
    for place, part in zip(places, parts, strict=True):
        telemetry[place : place + len(part)] = part.values
    time_s = parts[0].offset_s + interval_s * np.arange(len(telemetry))
    coarse = recording.at(time_s - _seconds_between(parts[0], recording)).astype(np.float64)
    if not np.isfinite(coarse).all(axis=1).any():
        return Delay(0.0)  # pairing says that they share no time
    longest = max(max_samples, len(telemetry) // 4)
    delays = np.arange(-longest, longest + 1)
    found = np.stack(
        [_correlation(telemetry, coarse[:, column], delays) for column in range(coarse.shape[1])]
    )
    near = np.abs(delays) <= max_samples
    column = int(np.argmax(np.max(found[:, near] ** 2, axis=1)))
    signed = found[column]
    is_positive = max(signed[near].max(), 0.0) ** 2 >= (1 - _EQUALLY_GOOD) * np.max(
        signed[near] ** 2
    )
    squared = (
        np.maximum(signed if is_positive else -signed, 0.0) ** 2
    )  # half a period away, a sine is the same upside down
    undelayed = float(found[column, longest])
    if squared[near].max() < _LEAST_CORRELATION**2:
        return Delay(0.0, None, undelayed, undelayed)
    if squared.max() > squared[near].max() + 0.1:
        far = int(delays[np.argmax(squared)])
        raise InputError(
            f"Expected a delay of at most a window, {max_samples} samples. Received: {parts[0].name}, which agrees best with {recording.columns[column]!r} "
            f"{abs(far):,} samples {'earlier' if far > 0 else 'later'}. Give --delay {far * interval_s:g} if this is right, or correct the clocks."
        )
    best = _nearest_maximum(np.where(near, squared, -1.0), longest, max(3, max_samples // 20))
    return Delay(
        float(delays[best] * interval_s),
        recording.columns[column],
        float(found[column, best]),
        undelayed,
    )


def _nearest_maximum(squared: np.ndarray, centre: int, reach: int) -> int:
    """Returns the index, nearest to the centre, of a local maximum that is about as high as the highest value."""
    padded = np.pad(squared, reach, constant_values=-1.0)
    highest_near = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1).max(axis=1)
    good = np.flatnonzero(
        (squared >= highest_near) & (squared >= (1 - _EQUALLY_GOOD) * squared.max())
    )
    return int(good[np.argmin(np.abs(good - centre))])


def _correlation(telemetry: np.ndarray, coarse: np.ndarray, delays: np.ndarray) -> np.ndarray:
    """Computes the correlation of the telemetry with the delayed coarse column, over the samples that both have at each delay."""
    size = 1 << int(np.ceil(np.log2(2 * len(telemetry))))
    have = [np.isfinite(each).astype(np.float64) for each in (coarse, telemetry)]
    values = [
        np.where(mask > 0, each - np.nanmean(each), 0.0)
        for each, mask in zip((coarse, telemetry), have, strict=True)
    ]

    def shifted(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        product = np.conj(np.fft.rfft(first, size)) * np.fft.rfft(second, size)
        return np.fft.irfft(product, size)[delays]  # negative delays are at the end of the circle

    (x, y), (x_there, y_there) = values, have
    number = np.maximum(shifted(x_there, y_there), 1e-9)
    sum_x, sum_y = shifted(x, y_there), shifted(x_there, y)
    covariance = shifted(x, y) - sum_x * sum_y / number
    power = (shifted(x**2, y_there) - sum_x**2 / number) * (
        shifted(x_there, y**2) - sum_y**2 / number
    )
    enough = number >= _LEAST_SHARE * number.max()
    is_known = enough & (power > 1e-12 * max(float(power.max()), 1e-300))
    return np.where(is_known, covariance / np.sqrt(np.where(power > 0, power, 1.0)), 0.0)
