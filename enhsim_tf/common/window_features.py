"""Summary features of windows, for two-sample tests and for anomaly detectors (evaluates sections 2.2 and 2.3 of the paper)."""

import numpy as np


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
