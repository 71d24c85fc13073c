"""Left matrix-profile discord: how far a window is from all windows before it (Yeh et al. 2016; Lu et al. 2022).

A baseline for detectors that are trained. Each window is normalised to mean 0 and standard deviation 1 and compared with every earlier
window of the same length that shares no sample with it. The largest distances are the discords.
"""

import numpy as np

from enhsim_tf.common.errors import InputError

_FLAT = 1e-6  # a window whose standard deviation is below this share of the largest one is constant


def left_discord(series: np.ndarray, begins: np.ndarray, window: int) -> np.ndarray:
    """Scores windows by their distance to the nearest earlier window.

    Args:
        series: The whole series, training part included, shape `(samples,)`.
        begins: First samples of the windows to score, shape `(windows,)`.
        window: Length of a window in samples.

    Returns:
        For each window, the z-normalised Euclidean distance to its nearest neighbour among the windows that end before it begins,
        float64 of shape `(windows,)`. It is the largest possible distance, `2 * sqrt(window)`, if there is none. The distance
        between a constant window and one that is not constant is `sqrt(window)`, and between two constant ones 0.

    Raises:
        InputError: If a window leaves the series.
    """
    begins = np.asarray(begins)
    if not len(begins) or begins.min() < 0 or begins.max() + window > len(series):
        raise InputError(f"Expected windows inside the series of {len(series)} samples. Received: windows of {window} samples beyond it.")
    every = np.lib.stride_tricks.sliding_window_view(np.asarray(series, np.float64), window)
    mean, spread = every.mean(axis=1), every.std(axis=1)
    is_flat = spread <= _FLAT * spread.max(initial=0.0)
    found = np.full(len(begins), 2.0 * np.sqrt(window))
    for number, begin in enumerate(begins):
        earlier = slice(0, max(0, begin - window + 1))
        if not len(mean[earlier]):
            continue
        if is_flat[begin]:
            found[number] = 0.0 if is_flat[earlier].any() else np.sqrt(window)
            continue
        centred = (every[begin] - mean[begin]) / spread[begin]
        scale = np.where(is_flat[earlier], np.inf, spread[earlier])
        correlation = every[earlier] @ centred / (window * scale)  # the centred window has mean 0, so the means of the others do not count
        found[number] = np.sqrt(max(2 * window * (1 - correlation.max()), 0.0)) if not is_flat[earlier].all() else np.sqrt(window)
    return found
