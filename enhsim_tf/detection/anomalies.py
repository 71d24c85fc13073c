"""Anomalies put into nominal windows: the same windows, the same places, whatever the detectors were trained on.

Each kind has one severity, in units of the standard deviation of the noise, so that 1 is as large as what the noise hides.
Where an anomaly lies is drawn before anything else: the same seed gives the same places for every kind and severity.

A kind is a function of the samples to change, shape `(windows, duration)`, the severity in the telemetry's unit, the mean
of each whole window, shape `(windows, 1)`, and the owner of the draws; it returns the changed samples.
"""

from collections.abc import Callable

import numpy as np

from enhsim_tf.common.errors import InputError

SEVERITIES = (0.5, 1.0, 2.0, 4.0, 8.0)
"""In units of the standard deviation of the noise."""

DURATIONS = (25, 100, 250)
"""In samples."""

SPIKE_INTERVAL = 25  # samples between two spikes of one range
OSCILLATION_PERIOD = 20  # samples: below the shortest duration, and far below the periods of the telemetry


def _spike(pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The first of every 25 samples of the range is off by the severity, all to one side, which is drawn."""
    changed = pieces.copy()
    changed[:, ::SPIKE_INTERVAL] += size * _sides(pieces, rng)
    return changed


def _level_shift(pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The whole range is off by the severity, to a side that is drawn."""
    return pieces + size * _sides(pieces, rng)


def _ramp(pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The range drifts off in equal steps until its last sample is off by the severity, to a side that is drawn."""
    duration = pieces.shape[1]
    return pieces + size * _sides(pieces, rng) * np.arange(1, duration + 1) / duration


def _stuck(pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The sensor sticks: its value is held until the true one is further away than the severity, and then takes that.

    An infinite severity holds the first value of the range to its end.
    """
    changed = pieces.copy()
    for place in range(1, pieces.shape[1]):
        held = changed[:, place - 1]
        changed[:, place] = np.where(np.abs(pieces[:, place] - held) > size, pieces[:, place], held)
    return changed


def _variance_change(pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """White Gaussian noise with a standard deviation of the severity comes on top in the range."""
    return pieces + size * rng.standard_normal(pieces.shape)


def _oscillation(pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A sine with a period of 20 samples and an amplitude of the severity comes on top; it begins at zero."""
    return pieces + size * np.sin(2 * np.pi * np.arange(pieces.shape[1]) / OSCILLATION_PERIOD)


def _dropout(pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The signal is lost: the range reads one value, the severity below its first sample.

    At severity 0 it is the range held at its first sample, so 0 is not nominal here.
    """
    return np.repeat(pieces[:, :1] - size, pieces.shape[1], axis=1)


def _gain(pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Deviations from the window's mean are stretched by one factor, so that the change's root mean square is the severity.

    A range that lies on the mean stays as it is.
    """
    deviation = pieces - centre
    square = np.mean(deviation**2, axis=1, keepdims=True)
    return pieces + size * deviation / np.sqrt(np.where(square > 0, square, 1))


INJECTIONS: dict[str, Callable[[np.ndarray, float, np.ndarray, np.random.Generator], np.ndarray]] = {
    "spike": _spike,
    "level_shift": _level_shift,
    "ramp": _ramp,
    "stuck": _stuck,
    "variance_change": _variance_change,
    "oscillation": _oscillation,
    "dropout": _dropout,
    "gain": _gain,
}
"""From a kind to the function that changes the samples of a range."""


def inject(
    windows: np.ndarray, kind: str, severity: float, duration: int, noise_sd: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Puts one anomaly into each window, at a place that is drawn.

    Args:
        windows: Nominal windows, shape `(windows, samples)`; they are not changed.
        kind: One of `INJECTIONS`.
        severity: In units of `noise_sd`.
        duration: Samples of the range.
        noise_sd: Standard deviation of the noise, in the telemetry's unit.
        rng: Owner of the draws. The places come first, so that one seed gives every kind and severity the same.

    Returns:
        `(anomalous, mask)`: float32 windows, and which of their samples are anomalous; both of the shape of `windows`.

    Raises:
        InputError: If the kind is unknown, the range does not fit or the severity is negative.
    """
    _check(kind, severity, duration, windows.shape[1])
    begins = rng.integers(0, windows.shape[1] - duration + 1, len(windows))
    return _put(windows, np.arange(len(windows))[:, None], begins[:, None] + np.arange(duration), kind, severity * noise_sd, rng)


def inject_into_trace(
    trace: np.ndarray, kind: str, severity: float, duration: int, noise_sd: float, num_ranges: int, gap: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Puts ranges of one kind into a continuous trace, at places that are drawn: every arrangement is as likely as any other.

    Args:
        trace: Nominal telemetry, shape `(samples,)`; it is not changed.
        kind: One of `INJECTIONS`.
        severity: In units of `noise_sd`.
        duration: Samples of each range.
        noise_sd: Standard deviation of the noise, in the telemetry's unit.
        num_ranges: Number of ranges.
        gap: Nominal samples that lie between two ranges at least, and before the first and after the last.
        rng: Owner of the draws; the places come first.

    Returns:
        `(anomalous, labels)`: float32 trace, and which of its samples are anomalous; both of the shape of `trace`.

    Raises:
        InputError: If the kind is unknown, the ranges do not fit or the severity is negative.
    """
    _check(kind, severity, duration, len(trace))
    free = len(trace) - num_ranges * (duration + gap) - gap
    if free < 0 or num_ranges < 1:
        raise InputError(
            f"Expected at least one range, and a trace of {len(trace) - free} samples or more for them. "
            f"Received: num_ranges={num_ranges} and {len(trace)} samples."
        )
    steps = np.sort(rng.choice(free + num_ranges, num_ranges, replace=False))  # a range counts for one place here
    begins = gap + steps + np.arange(num_ranges) * (duration + gap - 1)
    rows, columns = np.zeros((num_ranges, 1), int), begins[:, None] + np.arange(duration)
    anomalous, labels = _put(np.asarray(trace)[None], rows, columns, kind, severity * noise_sd, rng)
    return anomalous[0], labels[0]


def _put(
    windows: np.ndarray, rows: np.ndarray, columns: np.ndarray, kind: str, size: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Changes the samples at `columns` of the windows `rows`; returns the windows and the mask."""
    means = np.mean(windows, axis=1, dtype=np.float64)
    pieces = INJECTIONS[kind](np.asarray(windows[rows, columns], np.float64), size, means[rows], rng)
    anomalous, mask = np.array(windows, np.float32), np.zeros(windows.shape, bool)
    step = SPIKE_INTERVAL if kind == "spike" else 1  # what lies between spikes is nominal
    anomalous[rows, columns[:, ::step]], mask[rows, columns[:, ::step]] = pieces[:, ::step], True
    return anomalous, mask


def _sides(pieces: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """-1 or 1 for each window."""
    return rng.choice([-1.0, 1.0], (len(pieces), 1))


def _check(kind: str, severity: float, duration: int, samples: int) -> None:
    """Refuses what makes no sense."""
    if kind not in INJECTIONS:
        raise InputError(f"Expected one of {', '.join(INJECTIONS)}. Received: kind={kind!r}.")
    if not 1 <= duration <= samples:
        raise InputError(f"Expected a duration of 1 to {samples} samples. Received: duration={duration}.")
    if not severity >= 0 or (severity == np.inf and kind != "stuck"):
        raise InputError(f"Expected a severity of 0 or more, infinite for stuck alone. Received: severity={severity}.")
