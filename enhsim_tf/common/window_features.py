"""Summary features of windows, for two-sample tests and for anomaly detectors (evaluates sections 2.2 and 2.3 of the paper).

Features of noise together with the signal below it tell noise that depends on the signal from noise that does not.
"""

import numpy as np

DECIMALS = 4
"""Decimals, in standard deviations of the noise, at which noise is compared. Smaller differences are rounding errors of 32-bit telemetry, by
which a classifier tells quantised noise from itself."""


def window_features(windows: np.ndarray) -> np.ndarray:
    """Computes fourteen features of windows of shape `(windows, samples)`. Values far below 1e-6 have to be given in a larger unit.

    They are the mean, the logarithm of the standard deviation, the excess kurtosis, the maximum, the logarithm of the
    standard deviation of the first differences, the autocorrelation at lag 1, and the logarithm of the power in eight
    frequency bands whose edges are spaced evenly on a logarithmic scale. Very short windows have fewer bands.
    """
    values = np.asarray(windows, np.float64)
    tiny = 1e-12  # keeps logarithms and quotients of constant windows finite
    mean = values.mean(axis=1)
    centred = values - mean[:, None]
    variance = np.mean(centred**2, axis=1) + tiny
    kurtosis = np.mean(centred**4, axis=1) / variance**2 - 3
    steps = np.std(np.diff(values, axis=1), axis=1)
    correlation = np.mean(centred[:, 1:] * centred[:, :-1], axis=1) / variance
    power = np.abs(np.fft.rfft(centred, axis=1)) ** 2
    edges = np.unique(np.rint(np.geomspace(1, power.shape[1], 9)).astype(int))
    bands = [np.log(power[:, a:b].mean(axis=1) + tiny) for a, b in zip(edges[:-1], edges[1:], strict=True)]
    columns = [mean, np.log(variance) / 2, kurtosis, values.max(axis=1), np.log(steps + tiny), correlation, *bands]
    return np.stack(columns, axis=1)


def signal_edges(signal_windows: np.ndarray) -> np.ndarray:
    """Where `signal_features` divides a signal's levels, and its slopes, into thirds: both edges of each, shape `(2, 2)`."""
    values = np.asarray(signal_windows, np.float64)
    return np.stack([np.quantile(each, (1 / 3, 2 / 3)) for each in (values, np.gradient(values, axis=1))])


def signal_features(noise_windows: np.ndarray, signal_windows: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Computes twelve features of noise and the signal below it, of windows of the same shape, given the result of `signal_edges`.

    The features are the mean of the noise and the logarithm of its root mean square, each where the signal is low, medium and
    high, and where it falls, is flat and rises. Where a window has no such samples, they are those of the whole window.
    """
    noise, signal = np.asarray(noise_windows, np.float64), np.asarray(signal_windows, np.float64)
    columns = []
    for values, (low, high) in zip((signal, np.gradient(signal, axis=1)), edges, strict=True):
        third = (values > low).astype(int) + (values > high)
        for number in range(3):
            is_there = third == number
            is_there[~is_there.any(axis=1)] = True
            count = is_there.sum(axis=1)
            mean_square = np.sum(noise**2, axis=1, where=is_there) / count
            columns += [np.sum(noise, axis=1, where=is_there) / count, np.log(mean_square + 1e-24) / 2]
    return np.stack(columns, axis=1)
