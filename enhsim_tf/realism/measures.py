"""Measures of how close generated telemetry is to real: pure functions of arrays of shape `(windows, samples)`.

Those that compare spectra or correlations take what `window_spectra` and `lagged_products` make of each window, so that a
floor over many re-splits of the same windows transforms each window once. `realism` holds each against its floor.
"""

import functools

import numpy as np

_TINY = 1e-30  # keeps the logarithm of what stands still finite


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
    share = energy / energy.sum()
    share = share[share > 0]
    return float(np.exp(-np.sum(share * np.log(share))))


def lagged_products(windows: np.ndarray, max_lag: int) -> np.ndarray:
    """Mean product of each window's values with those 0 to `max_lag` samples later, about the mean of all windows.

    Averaged over windows they are the autocovariance; shape `(windows, max_lag + 1)`.
    """
    centred = np.asarray(windows, np.float64) - np.mean(windows, dtype=np.float64)
    samples = centred.shape[1]
    products = [np.einsum("ws,ws->w", centred[:, : samples - lag], centred[:, lag:]) / (samples - lag) for lag in range(max_lag + 1)]
    return np.stack(products, axis=1)


def lagged_square_products(windows: np.ndarray, max_lag: int) -> np.ndarray:
    """`lagged_products` of the squares of the values about their mean: how scale follows scale (volatility clustering)."""
    return lagged_products((np.asarray(windows, np.float64) - np.mean(windows, dtype=np.float64)) ** 2, max_lag)


def autocorrelation(windows: np.ndarray, max_lag: int) -> np.ndarray:
    """Autocorrelation at lags 0 to `max_lag`, pooled over the windows; shape `(max_lag + 1,)`."""
    products = np.mean(lagged_products(windows, max_lag), axis=0)
    return products / products[0]


def autocorrelation_distance(generated_products: np.ndarray, real_products: np.ndarray) -> float:
    """Largest difference of the autocorrelations that two sets of `lagged_products` make up."""
    generated, real = (np.mean(products, axis=0) for products in (generated_products, real_products))
    return float(np.max(np.abs(generated / (generated[0] + _TINY) - real / (real[0] + _TINY))))


def scale_difference(generated: np.ndarray, real: np.ndarray) -> float:
    """Absolute logarithm of the ratio of standard deviations: 0 for equal scale, 0.1 for ten per cent."""
    return float(abs(np.log(np.std(generated, dtype=np.float64) / np.std(real, dtype=np.float64))))


def log_scales(windows: np.ndarray) -> np.ndarray:
    """Logarithm of each window's standard deviation, shape `(windows,)`."""
    return np.log(np.std(windows, axis=1, dtype=np.float64) + _TINY)


def log_scale_distance(generated_scales: np.ndarray, real_scales: np.ndarray) -> float:
    """First Wasserstein distance of two sets of `log_scales`: how wrongly the scale varies from window to window."""
    from scipy.stats import wasserstein_distance

    return float(wasserstein_distance(generated_scales, real_scales))


def marginal_distance(generated: np.ndarray, real: np.ndarray) -> float:
    """First Wasserstein distance of the values, from 2,000 of their quantiles, in units of the real standard deviation."""
    difference = _quantiles(generated) - _quantiles(real)
    return float(np.mean(np.abs(difference)) / np.std(real, dtype=np.float64))


def _quantiles(values: np.ndarray, number: int = 2000) -> np.ndarray:
    """`np.quantile` in the middles of equal shares, several times as fast: one sort for all."""
    ordered = np.sort(values, axis=None)
    place = (np.arange(number) + 0.5) / number * (ordered.size - 1)
    below = place.astype(int)
    return ordered[below] + (place - below) * (ordered[np.minimum(below + 1, ordered.size - 1)] - ordered[below])


def excess_kurtosis(windows: np.ndarray) -> float:
    """Fourth moment of the values in units of the squared variance, less the 3 of a Gaussian."""
    centred = np.asarray(windows, np.float64) - np.mean(windows, dtype=np.float64)
    squares = centred**2
    return float(np.mean(squares**2) / (np.mean(squares) ** 2 + _TINY) - 3)


def kurtosis_difference(generated: np.ndarray, real: np.ndarray) -> float:
    """Excess kurtosis of the generated values less that of the real ones: above 0, their tails are too heavy."""
    return excess_kurtosis(generated) - excess_kurtosis(real)


def tail_ratio(generated: np.ndarray, real: np.ndarray) -> float:
    """Quantile 0.999 of the generated absolute values, in units of that of the real ones."""
    return float(np.quantile(np.abs(generated), 0.999) / (np.quantile(np.abs(real), 0.999) + _TINY))


def power_spectrum(windows: np.ndarray) -> np.ndarray:
    """Mean periodogram (Hann taper) without its zero frequency, shape `(samples // 2,)`, in value^2 a bin."""
    samples = windows.shape[1]
    taper = np.hanning(samples + 2)[1:-1]
    transformed = np.fft.rfft(np.asarray(windows, np.float64) * taper, axis=1)
    return np.mean(np.abs(transformed[:, 1:]) ** 2, axis=0) / np.sum(taper**2)


def window_spectra(windows: np.ndarray, time_half_bandwidth: float = 4, num_tapers: int = 7) -> np.ndarray:
    """Multitaper power spectrum of each window (Thomson 1982), without zero and Nyquist frequency.

    Args:
        windows: Windows of shape `(windows, samples)`.
        time_half_bandwidth: Samples of a window times half the bandwidth of a bin, in cycles a sample.
        num_tapers: Number of Slepian tapers, whose squared transforms are averaged.

    Returns:
        float64 array of shape `(windows, (samples - 1) // 2)`, in value^2 a bin: white noise has its variance everywhere.
    """
    values = np.asarray(windows, np.float64)
    samples, power = values.shape[1], 0.0
    for taper in _slepian_tapers(samples, time_half_bandwidth, num_tapers):
        power = power + np.abs(np.fft.rfft(values * taper, axis=1)[:, 1 : (samples + 1) // 2]) ** 2
    return power / num_tapers


@functools.cache
def _slepian_tapers(samples: int, time_half_bandwidth: float, num_tapers: int) -> np.ndarray:
    from scipy.signal.windows import dpss

    return dpss(samples, time_half_bandwidth, num_tapers)


def geodesic_distance(generated_spectra: np.ndarray, real_spectra: np.ndarray) -> float:
    """Standard deviation over the bins of the log ratio of the median `window_spectra`: their shape, blind to scale.

    The geodesic distance of power spectra (Georgiou 2007), as Wunderlich and Sklar (2023) judge generated noise by.
    """
    return float(np.std(_log_ratio(generated_spectra, real_spectra)))


def log_spectral_distance(generated_spectra: np.ndarray, real_spectra: np.ndarray) -> float:
    """Root mean square over the bins of the log ratio of the median `window_spectra`: their shape and scale."""
    return float(np.sqrt(np.mean(_log_ratio(generated_spectra, real_spectra) ** 2)))


def _log_ratio(generated_spectra: np.ndarray, real_spectra: np.ndarray) -> np.ndarray:
    return np.log(np.median(generated_spectra, axis=0) + _TINY) - np.log(np.median(real_spectra, axis=0) + _TINY)
