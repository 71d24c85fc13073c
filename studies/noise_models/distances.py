"""Further distances between generated and real windows, with which `real_floor` judges noise
(evaluates section 2.3 of the paper).

Distances of spectra and correlations take the results of `window_spectra` or `lagged_products`, so
that each window is transformed only once when the same windows are resampled many times.
"""

import functools

import numpy as np
from sklearn.preprocessing import StandardScaler

from enhsim_tf.common.measures import lagged_products

_TINY = 1e-30  # keeps logarithms and quotients of constant windows finite
# samples times half the bandwidth in cycles a sample; Slepian tapers that are averaged
_TIME_HALF_BANDWIDTH = 4
_NUM_TAPERS = 7
_NUM_KERNELS = 16  # of each of the dilations 1, 2, 4, ...
_NUM_NEIGHBOURS = 5  # rank of the neighbour that defines the radius of a neighbourhood


def lagged_square_products(windows: np.ndarray, max_lag: int) -> np.ndarray:
    """`lagged_products` of the squared deviations from the mean, which show volatility
    clustering.
    """
    return lagged_products(
        (np.asarray(windows, np.float64) - np.mean(windows, dtype=np.float64)) ** 2, max_lag
    )


def autocorrelation_distance(generated_products: np.ndarray, real_products: np.ndarray) -> float:
    """Largest absolute difference of two autocorrelations, which are computed from two sets of
    `lagged_products`.
    """
    generated, real = (
        np.mean(products, axis=0) for products in (generated_products, real_products)
    )
    return float(np.max(np.abs(generated / (generated[0] + _TINY) - real / (real[0] + _TINY))))


def log_scales(windows: np.ndarray) -> np.ndarray:
    """Logarithm of each window's standard deviation, shape `(windows,)`."""
    return np.log(np.std(windows, axis=1, dtype=np.float64) + _TINY)


def log_scale_distance(generated_scales: np.ndarray, real_scales: np.ndarray) -> float:
    """First Wasserstein distance between two sets of `log_scales`, which compares how the scale
    varies between windows.
    """
    from scipy.stats import wasserstein_distance

    return float(wasserstein_distance(generated_scales, real_scales))


def kurtosis_difference(generated: np.ndarray, real: np.ndarray) -> float:
    """Excess kurtosis of the generated values minus that of the real values. A positive difference
    means too heavy tails.
    """
    return _standardised_fourth_moment(generated) - _standardised_fourth_moment(real)


def _standardised_fourth_moment(windows: np.ndarray) -> float:
    squares = (np.asarray(windows, np.float64) - np.mean(windows, dtype=np.float64)) ** 2
    return float(np.mean(squares**2) / (np.mean(squares) ** 2 + _TINY))


def tail_ratio(generated: np.ndarray, real: np.ndarray) -> float:
    """Ratio of the 0.999 quantiles of the absolute values, generated to real. A ratio above 1 means
    too heavy tails.
    """
    return float(np.quantile(np.abs(generated), 0.999) / (np.quantile(np.abs(real), 0.999) + _TINY))


def window_spectra(windows: np.ndarray) -> np.ndarray:
    """Multitaper power spectrum of each window (Thomson 1982), without the zero frequency and the
    Nyquist frequency.

    Args:
        windows: Windows of shape `(windows, samples)`.

    Returns:
        float64 array of shape `(windows, (samples - 1) // 2)`, in squared units for each bin. The
        expected spectrum of white noise equals its variance in every bin.
    """
    values = np.asarray(windows, np.float64)
    samples = values.shape[1]
    power = 0.0
    for taper in _slepian_tapers(samples):
        power = power + np.abs(np.fft.rfft(values * taper, axis=1)[:, 1 : (samples + 1) // 2]) ** 2
    return power / _NUM_TAPERS


@functools.cache
def _slepian_tapers(samples: int) -> np.ndarray:
    from scipy.signal.windows import dpss

    return dpss(samples, _TIME_HALF_BANDWIDTH, _NUM_TAPERS)


def geodesic_distance(generated_spectra: np.ndarray, real_spectra: np.ndarray) -> float:
    """Geodesic distance of two power spectra (Georgiou 2007), which compares their shapes
    independently of scale.

    It is the standard deviation, over the bins, of the log ratio of the median `window_spectra`.
    Wunderlich and Sklar (2023) evaluate generated noise with this distance.
    """
    return float(np.std(_log_ratio(generated_spectra, real_spectra)))


def log_spectral_distance(generated_spectra: np.ndarray, real_spectra: np.ndarray) -> float:
    """Root mean square, over the bins, of the log ratio of the median `window_spectra`, which
    compares shape and scale.
    """
    return float(np.sqrt(np.mean(_log_ratio(generated_spectra, real_spectra) ** 2)))


def _log_ratio(generated_spectra: np.ndarray, real_spectra: np.ndarray) -> np.ndarray:
    return np.log(np.median(generated_spectra, axis=0) + _TINY) - np.log(
        np.median(real_spectra, axis=0) + _TINY
    )


def convolution_features(windows: np.ndarray) -> np.ndarray:
    """Features of each window by fixed random convolutions (ROCKET, Dempster et al. 2020), for a
    linear classifier.

    The kernels have nine taps and all dilations that fit into a window. For each kernel, the
    features are the largest response and the share of responses above a random threshold. Together
    with a linear classifier, this is a small convolutional network that needs no training of its
    convolutions, and therefore no TensorFlow.

    Args:
        windows: Windows of shape `(windows, samples)`, standardised by the mean and the standard
            deviation of real windows.

    Returns:
        float32 array of shape `(windows, dilations * 2 * _NUM_KERNELS)`.
    """
    rng = np.random.default_rng(0)
    values = np.asarray(windows, np.float32)
    taps = 9
    found = []
    for dilation in 2 ** np.arange(int(np.log2((values.shape[1] - 1) / (taps - 1))) + 1):
        kernels = rng.standard_normal((taps, _NUM_KERNELS)).astype(np.float32)
        # the responses to white noise of standard deviation 1 have standard deviation 1
        kernels /= np.linalg.norm(kernels, axis=0)
        thresholds = rng.standard_normal(_NUM_KERNELS).astype(np.float32)
        pooled = []
        for begin in range(0, len(values), 64):  # 64 windows fit into the processor's cache
            reach = np.lib.stride_tricks.sliding_window_view(
                values[begin : begin + 64], (taps - 1) * dilation + 1, axis=1
            )
            response = np.ascontiguousarray(reach[:, :, ::dilation]) @ kernels
            pooled.append(
                np.concatenate(
                    [
                        response.max(axis=1),
                        np.mean(response > thresholds, axis=1, dtype=np.float32),
                    ],
                    axis=1,
                )
            )
        found.append(np.concatenate(pooled))
    return np.concatenate(found, axis=1)


def density(generated_features: np.ndarray, real_features: np.ndarray) -> float:
    """Mean number of real neighbourhoods that contain a generated window, divided by the rank of
    the neighbour (Naeem et al. 2020).

    The neighbourhood of a real window is the ball that extends to its fifth nearest real window, in
    features standardised by the real windows. The density of perfect noise is 1. Copies of a few
    typical windows have a density above 1.

    Args:
        generated_features: Features of generated windows, shape `(windows, features)`.
        real_features: Features of real windows, shape `(windows, features)`.
    """
    return float(
        _inside(generated_features, real_features).sum()
        / (_NUM_NEIGHBOURS * len(generated_features))
    )


def coverage(generated_features: np.ndarray, real_features: np.ndarray) -> float:
    """Share of real neighbourhoods (see `density`) that contain at least one generated window
    (Naeem et al. 2020).

    The expected coverage of perfect noise, with equal numbers of windows, is `1 - 2 ** -5`. A
    generator that repeats itself has a lower coverage.
    """
    return float(_inside(generated_features, real_features).any(axis=0).mean())


def _inside(generated_features: np.ndarray, real_features: np.ndarray) -> np.ndarray:
    """Whether each generated window lies in each real neighbourhood, shape `(generated, real)`."""
    from scipy.spatial.distance import cdist

    generated, real = _standardised(generated_features, real_features)
    # index 0 is the window itself
    reach = np.partition(cdist(real, real, "sqeuclidean"), _NUM_NEIGHBOURS, axis=1)[
        :, _NUM_NEIGHBOURS
    ]
    return cdist(generated, real, "sqeuclidean") <= reach


def mmd_squared(generated_features: np.ndarray, real_features: np.ndarray) -> float:
    """Unbiased estimate of the squared maximum mean discrepancy (MMD, Gretton et al. 2012).

    The estimate has a mean of 0 for two samples of the same distribution, and can be negative.
    Features are standardised by the real windows. The kernel is exp(-d^2 / (2 m^2)), where m is the
    median distance between real windows.
    """
    from scipy.spatial.distance import pdist, squareform

    generated, real = _standardised(generated_features, real_features)
    bandwidth = max(np.median(pdist(real, "sqeuclidean")), 1e-12)
    number = len(generated)
    other = len(real)
    # with zeros on the diagonal
    kernel = squareform(
        np.exp(pdist(np.concatenate([generated, real]), "sqeuclidean") / (-2 * bandwidth))
    )
    within = kernel[:number, :number].sum() / (number * (number - 1))
    within_real = kernel[number:, number:].sum() / (other * (other - 1))
    return float(within + within_real - 2 * kernel[:number, number:].mean())


def _standardised(generated: np.ndarray, real: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both features in units of the mean and standard deviation of the real ones."""
    scaler = StandardScaler().fit(real)
    return scaler.transform(generated), scaler.transform(real)
