"""Synthetic anomalies that are injected into nominal windows, to evaluate detectors (title and abstract of the paper).

The severity of an anomaly is stated in units of the standard deviation of the noise. The position of an anomaly is the first
random number that is drawn. The same seed therefore gives the same positions for every kind and severity, so that detectors
are always compared on the same windows.

Each kind of anomaly is a function. Its arguments are the samples to change, of shape `(windows, duration)`, the severity in
the unit of the telemetry, the mean of each whole window, of shape `(windows, 1)`, and a random number generator. It returns
the changed samples.
"""

from collections.abc import Callable

import numpy as np

from enhsim_tf.common.errors import InputError

SEVERITIES = (0.5, 1.0, 2.0, 4.0, 8.0)
"""Severities of the experiments, in units of the standard deviation of the noise."""

DURATIONS = (25, 100, 250)
"""Durations of the experiments, in samples."""

SPIKE_INTERVAL = 25  # number of samples from one spike of an anomaly to the next
OSCILLATION_PERIOD = 20  # in samples; shorter than the shortest duration, and much shorter than the periods of the telemetry


def _spike(pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Shifts the first of every 25 samples by the severity. All shifts have the same, random sign."""
    changed = pieces.copy()
    changed[:, ::SPIKE_INTERVAL] += size * _sides(pieces, rng)
    return changed


def _level_shift(pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Shifts all samples by the severity, with a random sign."""
    return pieces + size * _sides(pieces, rng)


def _ramp(pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Adds a linear ramp with a random sign, which reaches the severity at the last sample."""
    duration = pieces.shape[1]
    return pieces + size * _sides(pieces, rng) * np.arange(1, duration + 1) / duration


def _stuck(pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Simulates a stuck sensor: holds each value until the true value differs by more than the severity, and then takes that value.

    An infinite severity holds the first value throughout.
    """
    changed = pieces.copy()
    for place in range(1, pieces.shape[1]):
        held = changed[:, place - 1]
        changed[:, place] = np.where(np.abs(pieces[:, place] - held) > size, pieces[:, place], held)
    return changed


def _variance_change(pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Adds white Gaussian noise, whose standard deviation is the severity."""
    return pieces + size * rng.standard_normal(pieces.shape)


def _oscillation(pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Adds a sine with a period of 20 samples, whose amplitude is the severity. It starts at zero."""
    return pieces + size * np.sin(2 * np.pi * np.arange(pieces.shape[1]) / OSCILLATION_PERIOD)


def _dropout(pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Simulates the loss of a signal: replaces all samples by a constant, which lies below the first sample by the severity.

    Unlike for the other kinds, a severity of 0 changes the samples: it holds the first value.
    """
    return np.repeat(pieces[:, :1] - size, pieces.shape[1], axis=1)


def _gain(pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Amplifies the deviations from the mean of the window, such that the root mean square of the change is the severity.

    Samples that all equal the mean are not changed.
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
"""Maps each kind of anomaly to the function that changes the samples."""


def inject(
    windows: np.ndarray, kind: str, severity: float, duration: int, noise_sd: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Injects one anomaly into each window, at a random position.

    Args:
        windows: Nominal windows, shape `(windows, samples)`. They are not modified.
        kind: Kind of the anomaly, a key of `INJECTIONS`.
        severity: Severity of the anomaly, in units of `noise_sd`.
        duration: Duration of the anomaly, in samples.
        noise_sd: Standard deviation of the noise, in the unit of the telemetry.
        rng: Random number generator. Positions are drawn first, so that the same state gives the same positions for every
            kind and severity.

    Returns:
        `(anomalous, mask)`: float32 windows, and a boolean array that marks the anomalous samples. Both have the shape of
        `windows`.

    Raises:
        InputError: If the kind is unknown, if the anomaly is longer than a window, or if the severity is negative.
    """
    _check(kind, severity, duration, windows.shape[1])
    begins = rng.integers(0, windows.shape[1] - duration + 1, len(windows))
    return _put(windows, np.arange(len(windows))[:, None], begins[:, None] + np.arange(duration), kind, severity * noise_sd, rng)


def inject_into_trace(
    trace: np.ndarray, kind: str, severity: float, duration: int, noise_sd: float, num_ranges: int, gap: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Injects anomalies of one kind into a continuous trace, at positions drawn uniformly from all possible arrangements.

    Args:
        trace: Nominal telemetry, shape `(samples,)`. It is not modified.
        kind: Kind of the anomalies, a key of `INJECTIONS`.
        severity: Severity of the anomalies, in units of `noise_sd`.
        duration: Duration of each anomaly, in samples.
        noise_sd: Standard deviation of the noise, in the unit of the telemetry.
        num_ranges: Number of anomalies.
        gap: Minimum number of nominal samples between two anomalies, before the first and after the last.
        rng: Random number generator. Positions are drawn first.

    Returns:
        `(anomalous, labels)`: the float32 trace, and a boolean array that marks the anomalous samples. Both have the shape of
        `trace`.

    Raises:
        InputError: If the kind is unknown, if the anomalies do not fit into the trace, or if the severity is negative.
    """
    _check(kind, severity, duration, len(trace))
    free = len(trace) - num_ranges * (duration + gap) - gap
    if free < 0 or num_ranges < 1:
        raise InputError(
            f"Expected at least one anomaly, and a trace of at least {len(trace) - free} samples. "
            f"Received: num_ranges={num_ranges} and {len(trace)} samples."
        )
    steps = np.sort(rng.choice(free + num_ranges, num_ranges, replace=False))  # an arrangement, with each anomaly shrunk to one sample
    begins = gap + steps + np.arange(num_ranges) * (duration + gap - 1)
    rows, columns = np.zeros((num_ranges, 1), int), begins[:, None] + np.arange(duration)
    anomalous, labels = _put(np.asarray(trace)[None], rows, columns, kind, severity * noise_sd, rng)
    return anomalous[0], labels[0]


def _put(
    windows: np.ndarray, rows: np.ndarray, columns: np.ndarray, kind: str, size: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Changes the samples at `columns` of the windows `rows`, and returns the changed windows and the mask."""
    means = np.mean(windows, axis=1, dtype=np.float64)
    pieces = INJECTIONS[kind](np.asarray(windows[rows, columns], np.float64), size, means[rows], rng)
    anomalous, mask = np.array(windows, np.float32), np.zeros(windows.shape, bool)
    step = SPIKE_INTERVAL if kind == "spike" else 1  # the samples between spikes are nominal
    anomalous[rows, columns[:, ::step]], mask[rows, columns[:, ::step]] = pieces[:, ::step], True
    return anomalous, mask


def _sides(pieces: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Draws a sign, -1 or 1, for each window."""
    return rng.choice([-1.0, 1.0], (len(pieces), 1))


def _check(kind: str, severity: float, duration: int, samples: int) -> None:
    """Checks the arguments of `inject` and `inject_into_trace`."""
    if kind not in INJECTIONS:
        raise InputError(f"Expected one of {', '.join(INJECTIONS)}. Received: kind={kind!r}.")
    if not 1 <= duration <= samples:
        raise InputError(f"Expected a duration of 1 to {samples} samples. Received: duration={duration}.")
    if not severity >= 0 or (severity == np.inf and kind != "stuck"):
        raise InputError(f"Expected a severity of 0 or more, which may be infinite only for kind='stuck'. Received: severity={severity}.")
