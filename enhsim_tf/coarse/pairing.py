"""Brings telemetry and a recorded run of the coarse simulator to one clock (steps 3 and 4 of the
pipeline).

They are cut to the time that they share. A constant delay between them is estimated by
cross-correlation, unless it is given.
"""

import dataclasses

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.series import Part, Telemetry, iso_time
from enhsim_tf.telemetry.windows import runs_of

# a maximum with at least 1 - 0.02 of the largest squared correlation is as good; the nearest to 0
# is taken
_EQUALLY_GOOD = 0.02
_LEAST_CORRELATION = 0.1  # below this correlation at every delay, no delay is estimated
_LEAST_SHARE = 0.5  # a delay is considered only if at least this share of the samples remains


@dataclasses.dataclass(frozen=True)
class Delay:
    """A constant delay between the coarse run and the telemetry."""

    seconds: float  # how much later the telemetry is; in samples if there are no times
    # the coarse column that it was estimated from; None if it was not estimated
    column: str | None = None
    correlation: float = float("nan")  # of that column with the telemetry at this delay
    undelayed: float = float("nan")  # the same without a delay


def pair_recordings(
    telemetry: Telemetry, run: Telemetry, delay_s: float = 0.0, least_samples: int = 2
) -> tuple[Telemetry, Telemetry]:
    """Cuts telemetry and a coarse run, which is so much earlier, to the same parts, which both
    cover, on the clock of the telemetry.

    Raises InputError if the two share no time, or no stretch of so many samples.
    """
    interval_s = telemetry.interval_s
    shift_s = _seconds_between(telemetry, run) + delay_s
    values = []
    coarse = []
    longest = 0
    for part in telemetry.parts:
        there = run.at(part.offset_s + interval_s * np.arange(len(part)) - shift_s)
        for first, stop in runs_of(np.isfinite(there).all(axis=1)):
            longest = max(longest, stop - first)
            if stop - first >= least_samples:
                begin_s = part.offset_s + interval_s * first
                values.append(Part(part.values[first:stop], begin_s))
                coarse.append(Part(there[first:stop], begin_s))
    if not longest:
        spans = (_span(telemetry, 0.0), _span(run, shift_s))
        advice = "Record the same time, or give --delay."
        if run.clock.counts and not telemetry.clock.counts:
            begin = iso_time(telemetry.nanoseconds[0]).removesuffix("+00:00")
            spans = ("dates", "times from zero")
            advice = f"Give the time of that zero: --coarse-start {begin} if both begin together."
        raise InputError(
            f"Expected a coarse run that overlaps the telemetry in time. Received: {spans[0]} in "
            f"{telemetry.name}, {spans[1]} in {run.name}. {advice}"
        )
    if not values:
        raise InputError(
            f"Expected at least {least_samples} samples that telemetry and coarse run share "
            f"without a gap. Received: {longest}. "
            "Record a longer run, or choose a smaller window."
        )
    joined = dataclasses.replace(telemetry, parts=tuple(values))
    return joined, dataclasses.replace(run, parts=tuple(coarse), clock=telemetry.clock)


def _span(recording: Telemetry, shift_s: float) -> str:
    last = recording.time_s[-1]
    first = recording.offset_s
    return f"{first + shift_s:.6g} to {last + shift_s:.6g} s after the telemetry's start"


def _seconds_between(telemetry: Telemetry, recording: Telemetry) -> float:
    """Returns how many seconds the zero of the recording's clock is after that of the telemetry; 0
    if neither has times.
    """
    both = telemetry, recording
    if telemetry.clock.has_time != recording.clock.has_time:
        with_times, without = both if telemetry.clock.has_time else both[::-1]
        raise InputError(
            "Expected times in both the telemetry and the coarse run, or in neither. Received: "
            f"{with_times.name} with times, "
            f"{without.name} without. Name the time columns, or `none` for both."
        )
    return float(recording.clock.start_ns - telemetry.clock.start_ns) / 1e9


def estimate_delay(channel: Telemetry, run: Telemetry, max_samples: int) -> Delay:
    """Estimates a constant delay of at most so many samples by cross-correlation; 0 if no coarse
    column is correlated with the telemetry.

    The coarse column with the largest squared correlation at any delay is used. Among its local
    maxima that are about as high as the highest, the one nearest to no delay is taken, because a
    periodic signal has a maximum in every period.

    Raises:
        InputError: If the telemetry agrees clearly better at a longer delay.
    """
    interval_s = channel.interval_s
    places = np.round((channel.time_s - channel.offset_s) / interval_s).astype(int)
    telemetry = np.full(places[-1] + 1, np.nan)
    telemetry[places] = channel.values[:, 0]
    time_s = channel.offset_s + interval_s * np.arange(len(telemetry))
    coarse = run.at(time_s - _seconds_between(channel, run)).astype(np.float64)
    if not np.isfinite(coarse).all(axis=1).any():
        return Delay(0.0)  # pairing says that they share no time
    longest = min(max(max_samples, len(telemetry) // 4), len(telemetry) - 1)
    delays = np.arange(-longest, longest + 1)
    correlations = np.stack(
        [_correlation(telemetry, coarse[:, column], delays) for column in range(coarse.shape[1])]
    )
    near = np.abs(delays) <= max_samples
    column = int(np.argmax(np.max(correlations[:, near] ** 2, axis=1)))
    signed = correlations[column]
    is_positive = max(signed[near].max(), 0.0) ** 2 >= (1 - _EQUALLY_GOOD) * np.max(
        signed[near] ** 2
    )
    # half a period away, a sine is the same upside down
    squared = np.maximum(signed if is_positive else -signed, 0.0) ** 2
    undelayed = float(correlations[column, longest])
    if squared[near].max() < _LEAST_CORRELATION**2:
        return Delay(0.0, None, undelayed, undelayed)
    if squared.max() > squared[near].max() + 0.1:
        far = int(delays[np.argmax(squared)])
        raise InputError(
            f"Expected a delay of at most a window, {max_samples} samples. Received: "
            f"{channel.columns[0]}, which agrees best with {run.columns[column]!r} "
            f"{abs(far):,} samples {'earlier' if far > 0 else 'later'}. Give --delay "
            f"{far * interval_s:g} if this is right, or correct the clocks."
        )
    best = _nearest_maximum(np.where(near, squared, -1.0), longest, max(3, max_samples // 20))
    return Delay(
        float(delays[best] * interval_s),
        run.columns[column],
        float(correlations[column, best]),
        undelayed,
    )


def _nearest_maximum(squared: np.ndarray, centre: int, reach: int) -> int:
    """Returns the index, nearest to the centre, of a local maximum that is about as high as the
    highest value.
    """
    padded = np.pad(squared, reach, constant_values=-1.0)
    highest_near = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1).max(axis=1)
    good = np.flatnonzero(
        (squared >= highest_near) & (squared >= (1 - _EQUALLY_GOOD) * squared.max())
    )
    return int(good[np.argmin(np.abs(good - centre))])


def _correlation(telemetry: np.ndarray, coarse: np.ndarray, delays: np.ndarray) -> np.ndarray:
    """Computes the correlation of the telemetry with the delayed coarse column, over the samples
    that both have at each delay.
    """
    size = 1 << int(np.ceil(np.log2(2 * len(telemetry))))
    x_there = np.isfinite(coarse).astype(np.float64)
    y_there = np.isfinite(telemetry).astype(np.float64)
    x = np.where(x_there > 0, coarse - np.nanmean(coarse), 0.0)
    y = np.where(y_there > 0, telemetry - np.nanmean(telemetry), 0.0)

    def shifted(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        product = np.conj(np.fft.rfft(first, size)) * np.fft.rfft(second, size)
        return np.fft.irfft(product, size)[delays]  # negative delays are at the end of the circle

    number = np.maximum(shifted(x_there, y_there), 1e-9)
    sum_x = shifted(x, y_there)
    sum_y = shifted(x_there, y)
    covariance = shifted(x, y) - sum_x * sum_y / number
    power = (shifted(x**2, y_there) - sum_x**2 / number) * (
        shifted(x_there, y**2) - sum_y**2 / number
    )
    enough = number >= _LEAST_SHARE * number.max()
    is_known = enough & (power > 1e-12 * max(float(power.max()), 1e-300))
    return np.where(is_known, covariance / np.sqrt(np.where(power > 0, power, 1.0)), 0.0)


def most_similar(coarse: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Returns, for each channel of windows of telemetry, the number of the coarse column that has
    the largest squared correlation with it, shape `(channels,)`.
    """
    covariance, power = covariance_and_power(coarse, targets)
    return np.argmax(covariance**2 / np.where(power > 0, power, 1.0), axis=1)


def covariance_and_power(coarse: np.ndarray, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns the summed products of each channel, shape `(channels, columns)`, and the summed
    squares of each column, about the means of both.
    """
    centred = coarse - coarse.mean(axis=(0, 1), dtype=np.float64)
    apart = targets - targets.mean(axis=(0, 1), dtype=np.float64)
    covariance = np.einsum("wsk,wsc->ck", centred, apart)
    return covariance, np.einsum("wsk,wsk->k", centred, centred)
