"""Two-sample tests: can generated windows be told from real ones, and how much of the real do they cover?

Pure functions. `window_features` says what a window looks like in fourteen numbers, `convolution_features` in what random
convolutions find in it; the tests stand on either.
"""

from typing import Any, NamedTuple

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.realism.window_features import window_features


def convolution_features(windows: np.ndarray, num_kernels: int = 16, seed: int = 0) -> np.ndarray:
    """What fixed random convolutions find in each window: largest response and share of responses above a threshold.

    The one small one-dimensional CNN of the two-sample test, without training and so without TensorFlow: random kernels of
    nine taps at every dilation that fits (ROCKET, Dempster et al. 2020), pooled in two ways for a linear classifier.

    Args:
        windows: Windows of shape `(windows, samples)`, in units of the real standard deviation and about the real mean.
        num_kernels: Kernels for each dilation 1, 2, 4, ...
        seed: Draws the kernels and thresholds.

    Returns:
        float32 array of shape `(windows, dilations * 2 * num_kernels)`.

    Raises:
        InputError: If the windows are shorter than a kernel.
    """
    rng, taps = np.random.default_rng(seed), 9
    values = np.asarray(windows, np.float32)
    if values.shape[1] < taps:
        raise InputError(f"Expected windows of at least {taps} samples. Received: {values.shape[1]}.")
    found = []
    for dilation in 2 ** np.arange(int(np.log2((values.shape[1] - 1) / (taps - 1))) + 1):
        kernels = rng.standard_normal((taps, num_kernels)).astype(np.float32)
        kernels /= np.linalg.norm(kernels, axis=0)  # so that white noise of sd 1 responds with sd 1
        thresholds = rng.standard_normal(num_kernels).astype(np.float32)
        pooled = []
        for begin in range(0, len(values), 64):  # as many as stay in the processor's cache
            reach = np.lib.stride_tricks.sliding_window_view(values[begin : begin + 64], (taps - 1) * dilation + 1, axis=1)
            response = np.ascontiguousarray(reach[:, :, ::dilation]) @ kernels
            pooled.append(np.concatenate([response.max(axis=1), np.mean(response > thresholds, axis=1, dtype=np.float32)], axis=1))
        found.append(np.concatenate(pooled))
    return np.concatenate(found, axis=1)


class HeldOut(NamedTuple):
    """Scores that a classifier gave to windows it had not seen; higher means generated."""

    scores: np.ndarray
    is_generated: np.ndarray
    folds: np.ndarray

    @property
    def auc(self) -> float:
        """Area under the ROC curve: 0.5 cannot tell generated from real, 1 always can."""
        from sklearn.metrics import roc_auc_score

        return float(roc_auc_score(self.is_generated, self.scores))

    def p_value(self, num_permutations: int = 1_000, seed: int = 0) -> float:
        """Share of label permutations whose area is as large; labels move within a fold, where the classifier was fixed."""
        from scipy.stats import rankdata

        ranks, rng = rankdata(self.scores), np.random.default_rng(seed)
        sums = np.zeros(num_permutations)
        for fold in np.unique(self.folds):
            inside = self.folds == fold
            shuffled = rng.permuted(np.tile(ranks[inside], (num_permutations, 1)), axis=1)
            sums += shuffled @ self.is_generated[inside]
        return float((1 + np.sum(sums >= ranks @ self.is_generated - 1e-9)) / (1 + num_permutations))


def boosted_trees(generated_features: np.ndarray, real_features: np.ndarray, seed: int = 0, num_folds: int = 5) -> HeldOut:
    """Two-sample test (Lopez-Paz and Oquab 2017) by gradient-boosted trees of fixed settings.

    Args:
        generated_features: Features of shape `(windows, features)`.
        real_features: As many features of real windows, in the order of time.
        seed: Seed of the trees.
        num_folds: Folds of consecutive windows, so that few neighbours in time are on both sides.
    """
    from sklearn.ensemble import HistGradientBoostingClassifier

    return _held_out(HistGradientBoostingClassifier(random_state=seed), "predict_proba", generated_features, real_features, num_folds)


def linear_classifier(generated_features: np.ndarray, real_features: np.ndarray, num_folds: int = 5) -> HeldOut:
    """Two-sample test by ridge regression on standardised features, with a fixed penalty; for `convolution_features`.

    Args:
        generated_features: Features of shape `(windows, features)`.
        real_features: As many features of real windows, in the order of time.
        num_folds: Folds of consecutive windows.
    """
    from sklearn.linear_model import RidgeClassifier
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    classifier = make_pipeline(StandardScaler(), RidgeClassifier(alpha=100.0))
    return _held_out(classifier, "decision_function", generated_features, real_features, num_folds)


def _held_out(classifier: Any, method: str, generated_features: np.ndarray, real_features: np.ndarray, num_folds: int) -> HeldOut:
    from sklearn.model_selection import cross_val_predict
    from threadpoolctl import threadpool_limits

    number = min(len(generated_features), len(real_features))
    if number < 2 * num_folds:
        raise InputError(f"Expected at least {2 * num_folds} windows of each kind. Received: {number}.")
    features = np.concatenate([generated_features[:number], real_features[:number]])
    labels = np.repeat([1, 0], number)
    folds = np.tile(np.arange(number) * num_folds // number, 2)
    splits = [(np.flatnonzero(folds != fold), np.flatnonzero(folds == fold)) for fold in range(num_folds)]
    with threadpool_limits(1):  # threads that wait for each other on a busy machine take ten times as long
        scores = cross_val_predict(classifier, features, labels, cv=splits, method=method)
    return HeldOut(scores[:, 1] if scores.ndim == 2 else scores, labels, folds)


def two_sample_auc(generated: np.ndarray, real: np.ndarray, seed: int, num_folds: int = 5) -> float:
    """How well `boosted_trees` tell generated from real windows by `window_features`: 0.5 cannot, 1 always can.

    Args:
        generated: Generated windows, shape `(windows, samples)`.
        real: Real windows in the order of time; the smaller of both numbers is used.
        seed: Seed of the trees.
        num_folds: Number of folds.

    Returns:
        The area under the ROC curve over held-out folds, from 0 to 1.

    Raises:
        InputError: If there are fewer than two windows a fold.
    """
    return boosted_trees(window_features(generated), window_features(real), seed, num_folds).auc


def density(generated_features: np.ndarray, real_features: np.ndarray, num_neighbours: int = 5) -> float:
    """How many real neighbourhoods a generated window lies in, in units of what is expected (Naeem et al. 2020).

    A neighbourhood reaches from a real window to its `num_neighbours`-th nearest real one, in features standardised by the
    real ones. 1 is perfect; copies of a few typical windows score above 1.

    Args:
        generated_features: Features of shape `(windows, features)`.
        real_features: Features of real windows.
        num_neighbours: Which nearest real window a neighbourhood reaches to.
    """
    return float(_inside(generated_features, real_features, num_neighbours).sum() / (num_neighbours * len(generated_features)))


def coverage(generated_features: np.ndarray, real_features: np.ndarray, num_neighbours: int = 5) -> float:
    """Share of real neighbourhoods, as in `density`, with a generated window inside (Naeem et al. 2020).

    As many real windows cover `1 - 2 ** -num_neighbours`; a generator that repeats itself covers less.

    Args:
        generated_features: Features of shape `(windows, features)`.
        real_features: Features of real windows.
        num_neighbours: Which nearest real window a neighbourhood reaches to.
    """
    return float(_inside(generated_features, real_features, num_neighbours).any(axis=0).mean())


def _inside(generated_features: np.ndarray, real_features: np.ndarray, num_neighbours: int) -> np.ndarray:
    """Whether each generated window lies in each real neighbourhood, shape `(generated, real)`."""
    from scipy.spatial.distance import cdist

    if len(real_features) <= num_neighbours:
        raise InputError(f"Expected more than {num_neighbours} real windows. Received: {len(real_features)}.")
    generated, real = (_standardised(features, real_features) for features in (generated_features, real_features))
    reach = np.partition(cdist(real, real, "sqeuclidean"), num_neighbours, axis=1)[:, num_neighbours]  # the nearest is itself
    return cdist(generated, real, "sqeuclidean") <= reach


def mmd_squared(generated_features: np.ndarray, real_features: np.ndarray) -> float:
    """Unbiased squared maximum mean discrepancy (Gretton et al. 2012): 0 on average for one process, below 0 by chance.

    Kernel exp(-d^2 / (2 m^2)) of features standardised by the real ones, m the median distance among the real ones.
    """
    return float(_mmd(_kernel(generated_features, real_features), len(generated_features), np.arange(len(generated_features))[None])[0])


def mmd_p_value(generated_features: np.ndarray, real_features: np.ndarray, num_permutations: int = 500, seed: int = 0) -> float:
    """Share of permutations of generated and real windows with as large an `mmd_squared`.

    Args:
        generated_features: Features of shape `(windows, features)`.
        real_features: Features of real windows.
        num_permutations: Number of permutations.
        seed: Draws the permutations.
    """
    kernel, number, rng = _kernel(generated_features, real_features), len(generated_features), np.random.default_rng(seed)
    chosen = rng.permuted(np.tile(np.arange(len(kernel)), (num_permutations, 1)), axis=1)[:, :number]
    found = _mmd(kernel, number, np.concatenate([np.arange(number)[None], chosen]))
    return float((1 + np.sum(found[1:] >= found[0] - 1e-12)) / (1 + num_permutations))


def _kernel(generated_features: np.ndarray, real_features: np.ndarray) -> np.ndarray:
    """Kernel matrix of all windows, generated first, with zeros on the diagonal."""
    from scipy.spatial.distance import pdist, squareform

    generated, real = (_standardised(features, real_features) for features in (generated_features, real_features))
    bandwidth = max(np.median(pdist(real, "sqeuclidean")), 1e-12)
    return squareform(np.exp(pdist(np.concatenate([generated, real]), "sqeuclidean") / (-2 * bandwidth)))


def _mmd(kernel: np.ndarray, number: int, chosen: np.ndarray) -> np.ndarray:
    """The unbiased estimate for each row of indices that are taken as generated."""
    is_generated = np.zeros((len(kernel), len(chosen)))
    np.put_along_axis(is_generated, chosen.T, 1.0, axis=0)
    to_generated, other = kernel @ is_generated, len(kernel) - number
    both, cross = np.sum(is_generated * to_generated, axis=0), np.sum((1 - is_generated) * to_generated, axis=0)
    rest = kernel.sum() - both - 2 * cross
    return both / (number * (number - 1)) + rest / (other * (other - 1)) - 2 * cross / (number * other)


def _standardised(features: np.ndarray, reference: np.ndarray) -> np.ndarray:
    spread = np.std(reference, axis=0)
    return (features - np.mean(reference, axis=0)) / np.where(spread > 0, spread, 1)
