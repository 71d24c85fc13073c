"""Synthetic anomalies that are injected into nominal telemetry, to evaluate detectors (title and
abstract of the paper).

The severity of an anomaly is stated in units of the standard deviation of the noise. Each kind is a
function of the samples to change, shape `(windows, duration)`, the severity in the unit of the
telemetry, the mean of each whole window, shape `(windows, 1)`, and a random number generator; it
returns the changed samples. `inject.inject` puts them into a series.
"""

from collections.abc import Callable, Collection, Sequence

import numpy as np

from enhsim_tf.common.errors import InputError

SPIKE_INTERVAL = 25  # number of samples from one spike of an anomaly to the next
# in samples; shorter than the shortest duration, and much shorter than the periods of the telemetry
OSCILLATION_PERIOD = 20
# standard deviation of a normal distribution, in units of its median absolute deviation
_NORMAL_MAD = 1.482602218505602


def _sides(pieces: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Draws a sign, -1 or 1, for each window."""
    return rng.choice([-1.0, 1.0], (len(pieces), 1))


def _spike(
    pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Shifts the first of every 25 samples by the severity. All shifts have the same, random
    sign.
    """
    changed = pieces.copy()
    changed[:, ::SPIKE_INTERVAL] += size * _sides(pieces, rng)
    return changed


def _level_shift(
    pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Shifts all samples by the severity, with a random sign."""
    return pieces + size * _sides(pieces, rng)


def _ramp(
    pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Adds a linear ramp with a random sign, which reaches the severity at the last sample."""
    duration = pieces.shape[1]
    return pieces + size * _sides(pieces, rng) * np.arange(1, duration + 1) / duration


def _stuck(
    pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Simulates a stuck sensor: holds each value until the true one differs by more than the
    severity; if infinite, throughout.
    """
    changed = pieces.copy()
    for place in range(1, pieces.shape[1]):
        held = changed[:, place - 1]
        changed[:, place] = np.where(np.abs(pieces[:, place] - held) > size, pieces[:, place], held)
    return changed


def _variance_change(
    pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Adds white Gaussian noise, whose standard deviation is the severity."""
    return pieces + size * rng.standard_normal(pieces.shape)


def _oscillation(
    pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Adds a sine with a period of 20 samples, whose amplitude is the severity. It starts at
    zero.
    """
    return pieces + size * np.sin(2 * np.pi * np.arange(pieces.shape[1]) / OSCILLATION_PERIOD)


def _dropout(
    pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Simulates the loss of a signal: a constant, below the first sample by the severity. A
    severity of 0 holds the first value.
    """
    return np.repeat(pieces[:, :1] - size, pieces.shape[1], axis=1)


def _gain(
    pieces: np.ndarray, size: float, centre: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Amplifies the deviations from the mean of the window, such that the root mean square of the
    change is the severity.
    """
    deviation = pieces - centre
    square = np.mean(deviation**2, axis=1, keepdims=True)
    return pieces + size * deviation / np.sqrt(np.where(square > 0, square, 1))


INJECTIONS: dict[
    str, Callable[[np.ndarray, float, np.ndarray, np.random.Generator], np.ndarray]
] = {
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


def check_kind(kind: str, severity: float, known: Collection[str] = INJECTIONS) -> None:
    """Raises InputError if a kind is unknown, or its severity is not a number of at least 0; only
    `stuck` may be infinite.
    """
    if kind not in known:
        raise InputError(
            f"Expected a kind of anomaly, one of: {', '.join(known)}. Received: {kind!r}. Name one "
            "of these."
        )
    if not severity >= 0 or (severity == np.inf and kind != "stuck"):
        raise InputError(
            "Expected a severity of 0 or more, which may be infinite only for stuck. Received: "
            f"{kind} at {severity}."
        )


def estimate_noise_sd(parts: Sequence[np.ndarray]) -> float:
    """Estimates the standard deviation of the noise of a smooth signal from its second differences.

    The second difference of white noise with the standard deviation s has the standard deviation s
    * sqrt(6), which is estimated by the median absolute deviation, so that jumps of the signal do
    not count (Gasser, Sroka and Jennen-Steinmetz 1986, with a robust scale). If more than half of
    the differences are zero, as in telemetry with few levels, their root mean square is used
    instead; if all are, the result is 0. Noise that is correlated between neighbouring samples is
    underestimated.
    """
    differences = np.concatenate(
        [
            np.zeros(0),
            *(np.diff(np.asarray(part, np.float64), 2) for part in parts if len(part) > 2),
        ]
    )
    if not len(differences):
        return 0.0
    robust = _NORMAL_MAD * np.median(np.abs(differences))
    return float((robust or np.sqrt(np.mean(differences**2))) / np.sqrt(6))
