"""Measures of how close generated telemetry is to real: pure functions of arrays of shape `(windows, samples)`."""

import numpy as np

from enhsim_tf.errors import InputError


def nrmse(estimate: np.ndarray, truth: np.ndarray) -> float:
    """Root-mean-square error in units of the standard deviation of the truth; 1 is what predicting the mean reaches."""
    error = np.asarray(estimate, np.float64) - truth
    return float(np.sqrt(np.mean(error**2)) / np.std(truth, dtype=np.float64))


def roughness(windows: np.ndarray) -> float:
    """Standard deviation of the first differences, in the telemetry's unit: how restless a signal is."""
    return float(np.std(np.diff(np.asarray(windows, np.float64), axis=-1)))


def effective_rank(windows: np.ndarray) -> float:
    """How many dimensions the windows fill: the exponential of the entropy of their covariance's eigenvalue shares.

    From 1 (all on one line) to the number of samples (round in every direction). Roy and Vetterli 2007. It grows with
    the number of windows, so compare equal numbers.
    """
    centred = np.asarray(windows, np.float64) - np.mean(windows, axis=0, dtype=np.float64)
    energy = np.linalg.svd(centred, compute_uv=False) ** 2
    share = energy[energy > 0] / energy.sum()
    return float(np.exp(-np.sum(share * np.log(share))))


def autocorrelation(windows: np.ndarray, max_lag: int) -> np.ndarray:
    """Autocorrelation at lags 0 to `max_lag`, pooled over the windows; shape `(max_lag + 1,)`."""
    centred = np.asarray(windows, np.float64) - np.mean(windows, dtype=np.float64)
    samples = centred.shape[1]
    products = [np.mean(centred[:, : samples - lag] * centred[:, lag:]) for lag in range(max_lag + 1)]
    return np.array(products) / products[0]


def scale_difference(generated: np.ndarray, real: np.ndarray) -> float:
    """Absolute logarithm of the ratio of standard deviations: 0 for equal scale, 0.1 for ten per cent."""
    return float(abs(np.log(np.std(generated, dtype=np.float64) / np.std(real, dtype=np.float64))))


def marginal_distance(generated: np.ndarray, real: np.ndarray) -> float:
    """First Wasserstein distance of the values, in units of the real standard deviation."""
    quantiles = (np.arange(2000) + 0.5) / 2000
    difference = np.quantile(generated, quantiles) - np.quantile(real, quantiles)
    return float(np.mean(np.abs(difference)) / np.std(real, dtype=np.float64))


def power_spectrum(windows: np.ndarray) -> np.ndarray:
    """Mean periodogram (Hann taper) without its zero frequency, shape `(samples // 2,)`, in value^2 a bin."""
    samples = windows.shape[1]
    taper = np.hanning(samples + 2)[1:-1]
    transformed = np.fft.rfft(np.asarray(windows, np.float64) * taper, axis=1)
    return np.mean(np.abs(transformed[:, 1:]) ** 2, axis=0) / np.sum(taper**2)


def window_features(windows: np.ndarray) -> np.ndarray:
    """Fourteen features of each window, float64 of shape `(windows, 14)`.

    Mean, log sd, excess kurtosis, largest value, log sd of first differences, lag-1 correlation, and the log power in
    eight bands that double in width.
    """
    values = np.asarray(windows, np.float64)
    tiny = 1e-12  # keeps the logarithm of a window that stands still finite
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


def two_sample_auc(generated: np.ndarray, real: np.ndarray, seed: int, num_folds: int = 5) -> float:
    """How well a classifier tells generated from real windows by `window_features`: 0.5 cannot, 1 always can.

    A two-sample test (Lopez-Paz and Oquab 2017): gradient-boosted trees, area under the ROC curve over held-out folds of
    consecutive windows, so that neighbours in time are never on both sides.

    Args:
        generated: Generated windows, shape `(windows, samples)`.
        real: Real windows in the order of time; the smaller of both numbers is used.
        seed: Seed of the trees.
        num_folds: Number of folds.

    Returns:
        The area, from 0 to 1.

    Raises:
        InputError: If there are fewer than two windows a fold.
    """
    from sklearn.ensemble import HistGradientBoostingClassifier
    from sklearn.metrics import roc_auc_score
    from sklearn.model_selection import cross_val_predict
    from threadpoolctl import threadpool_limits

    number = min(len(generated), len(real))
    if number < 2 * num_folds:
        raise InputError(f"Expected at least {2 * num_folds} windows of each kind. Received: {number}.")
    features = window_features(np.concatenate([generated[:number], real[:number]]))
    labels = np.repeat([1, 0], number)
    folds = np.tile(np.arange(number) * num_folds // number, 2)
    splits = [(np.flatnonzero(folds != fold), np.flatnonzero(folds == fold)) for fold in range(num_folds)]
    classifier = HistGradientBoostingClassifier(random_state=seed)
    with threadpool_limits(1, user_api="openmp"):  # threads that wait for each other on a busy machine take ten times as long
        scores = cross_val_predict(classifier, features, labels, cv=splits, method="predict_proba")[:, 1]
    return float(roc_auc_score(labels, scores))
