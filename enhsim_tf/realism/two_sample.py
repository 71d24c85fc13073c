"""Two-sample tests between generated and real windows, and measures of coverage (evaluates sections 2.2 and 2.3 of the paper).

All tests are pure functions of features. The features are either those of `window_features` (fourteen statistics) or those of
`convolution_features` (responses of random convolutions).
"""

from typing import Any, NamedTuple

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.realism.window_features import window_features


def convolution_features(windows: np.ndarray, num_kernels: int = 16, seed: int = 0) -> np.ndarray:
    """Features of each window by fixed random convolutions (ROCKET, Dempster et al. 2020), for a linear classifier.

    The kernels have nine taps and all dilations that fit into a window. For each kernel, the features are the largest response
    and the share of responses above a random threshold. Together with a linear classifier, this is a small convolutional
    network that needs no training of its convolutions, and therefore no TensorFlow.

    Args:
        windows: Windows of shape `(windows, samples)`, standardised by the mean and the standard deviation of real windows.
        num_kernels: Number of kernels for each of the dilations 1, 2, 4, ...
        seed: Seed for the kernels and the thresholds.

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
        kernels /= np.linalg.norm(kernels, axis=0)  # the responses to white noise of standard deviation 1 have standard deviation 1
        thresholds = rng.standard_normal(num_kernels).astype(np.float32)
        pooled = []
        for begin in range(0, len(values), 64):  # 64 windows fit into the processor's cache
            reach = np.lib.stride_tricks.sliding_window_view(values[begin : begin + 64], (taps - 1) * dilation + 1, axis=1)
            response = np.ascontiguousarray(reach[:, :, ::dilation]) @ kernels
            pooled.append(np.concatenate([response.max(axis=1), np.mean(response > thresholds, axis=1, dtype=np.float32)], axis=1))
        found.append(np.concatenate(pooled))
    return np.concatenate(found, axis=1)


class HeldOut(NamedTuple):
    """Cross-validated scores of a classifier; a higher score means that the classifier considers a window more likely generated.

    Args:
        scores: Score of each window, from a classifier that was not trained on it.
        is_generated: Label of each window, 1 for generated and 0 for real.
        folds: Cross-validation fold of each window.
    """

    scores: np.ndarray
    is_generated: np.ndarray
    folds: np.ndarray

    @property
    def auc(self) -> float:
        """Area under the ROC curve (AUC): 0.5 if the classifier cannot distinguish the windows, 1 if it always can."""
        from sklearn.metrics import roc_auc_score

        return float(roc_auc_score(self.is_generated, self.scores))

    def p_value(self, num_permutations: int = 1_000, seed: int = 0) -> float:
        """Share of label permutations whose AUC is at least as large.

        Labels are permuted within each fold, because all scores of a fold come from the same classifier.

        Args:
            num_permutations: Number of permutations.
            seed: Seed for the permutations.
        """
        from scipy.stats import rankdata

        ranks, rng = rankdata(self.scores), np.random.default_rng(seed)
        sums = np.zeros(num_permutations)
        for fold in np.unique(self.folds):
            inside = self.folds == fold
            shuffled = rng.permuted(np.tile(ranks[inside], (num_permutations, 1)), axis=1)
            sums += shuffled @ self.is_generated[inside]
        return float((1 + np.sum(sums >= ranks @ self.is_generated - 1e-9)) / (1 + num_permutations))


def boosted_trees(generated_features: np.ndarray, real_features: np.ndarray, seed: int = 0, num_folds: int = 5) -> HeldOut:
    """Classifier two-sample test (Lopez-Paz and Oquab 2017) with gradient-boosted trees and fixed hyperparameters.

    Args:
        generated_features: Features of generated windows, shape `(windows, features)`.
        real_features: Features of real windows, same shape, in the order of time.
        seed: Seed for the trees.
        num_folds: Number of folds. Folds consist of consecutive windows, so that few neighbours in time are separated.

    Returns:
        The cross-validated scores.
    """
    from sklearn.ensemble import HistGradientBoostingClassifier

    return _held_out(HistGradientBoostingClassifier(random_state=seed), "predict_proba", generated_features, real_features, num_folds)


def linear_classifier(generated_features: np.ndarray, real_features: np.ndarray, num_folds: int = 5) -> HeldOut:
    """Classifier two-sample test with a ridge classifier on standardised features, intended for `convolution_features`.

    Args:
        generated_features: Features of generated windows, shape `(windows, features)`.
        real_features: Features of real windows, same shape, in the order of time.
        num_folds: Number of folds, which consist of consecutive windows.

    Returns:
        The cross-validated scores.
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
    with threadpool_limits(1):  # on a busy machine, several threads that wait for each other are ten times slower
        scores = cross_val_predict(classifier, features, labels, cv=splits, method=method)
    return HeldOut(scores[:, 1] if scores.ndim == 2 else scores, labels, folds)


def two_sample_auc(generated: np.ndarray, real: np.ndarray, seed: int, num_folds: int = 5) -> float:
    """AUC of `boosted_trees` on `window_features`: 0.5 if generated and real windows are indistinguishable, 1 if separable.

    Args:
        generated: Generated windows, shape `(windows, samples)`.
        real: Real windows in the order of time. If the numbers of windows differ, additional windows are ignored.
        seed: Seed for the trees.
        num_folds: Number of folds.

    Returns:
        The cross-validated area under the ROC curve, from 0 to 1.

    Raises:
        InputError: If there are fewer than two windows of each kind for each fold.
    """
    return boosted_trees(window_features(generated), window_features(real), seed, num_folds).auc


def density(generated_features: np.ndarray, real_features: np.ndarray, num_neighbours: int = 5) -> float:
    """Mean number of real neighbourhoods that contain a generated window, divided by `num_neighbours` (Naeem et al. 2020).

    The neighbourhood of a real window is the ball that extends to its `num_neighbours`-th nearest real window, in features
    standardised by the real windows. The density of perfect noise is 1. Copies of a few typical windows have a density above 1.

    Args:
        generated_features: Features of generated windows, shape `(windows, features)`.
        real_features: Features of real windows, shape `(windows, features)`.
        num_neighbours: Rank of the neighbour that defines the radius of a neighbourhood.
    """
    return float(_inside(generated_features, real_features, num_neighbours).sum() / (num_neighbours * len(generated_features)))


def coverage(generated_features: np.ndarray, real_features: np.ndarray, num_neighbours: int = 5) -> float:
    """Share of real neighbourhoods (see `density`) that contain at least one generated window (Naeem et al. 2020).

    The expected coverage of perfect noise, with equal numbers of windows, is `1 - 2 ** -num_neighbours`. A generator that
    repeats itself has a lower coverage.

    Args:
        generated_features: Features of generated windows, shape `(windows, features)`.
        real_features: Features of real windows, shape `(windows, features)`.
        num_neighbours: Rank of the neighbour that defines the radius of a neighbourhood.
    """
    return float(_inside(generated_features, real_features, num_neighbours).any(axis=0).mean())


def _inside(generated_features: np.ndarray, real_features: np.ndarray, num_neighbours: int) -> np.ndarray:
    """Returns whether each generated window lies in each real neighbourhood, shape `(generated, real)`."""
    from scipy.spatial.distance import cdist

    if len(real_features) <= num_neighbours:
        raise InputError(f"Expected more than {num_neighbours} real windows. Received: {len(real_features)}.")
    generated, real = (_standardised(features, real_features) for features in (generated_features, real_features))
    reach = np.partition(cdist(real, real, "sqeuclidean"), num_neighbours, axis=1)[:, num_neighbours]  # index 0 is the window itself
    return cdist(generated, real, "sqeuclidean") <= reach


def mmd_squared(generated_features: np.ndarray, real_features: np.ndarray) -> float:
    """Unbiased estimate of the squared maximum mean discrepancy (MMD, Gretton et al. 2012).

    The estimate has a mean of 0 for two samples of the same distribution, and can be negative. Features are standardised by
    the real windows. The kernel is exp(-d^2 / (2 m^2)), where m is the median distance between real windows.
    """
    return float(_mmd(_kernel(generated_features, real_features), len(generated_features), np.arange(len(generated_features))[None])[0])


def mmd_p_value(generated_features: np.ndarray, real_features: np.ndarray, num_permutations: int = 500, seed: int = 0) -> float:
    """Permutation p-value of `mmd_squared`: the share of permutations of all windows whose MMD is at least as large.

    Args:
        generated_features: Features of generated windows, shape `(windows, features)`.
        real_features: Features of real windows, shape `(windows, features)`.
        num_permutations: Number of permutations.
        seed: Seed for the permutations.
    """
    kernel, number, rng = _kernel(generated_features, real_features), len(generated_features), np.random.default_rng(seed)
    chosen = rng.permuted(np.tile(np.arange(len(kernel)), (num_permutations, 1)), axis=1)[:, :number]
    found = _mmd(kernel, number, np.concatenate([np.arange(number)[None], chosen]))
    return float((1 + np.sum(found[1:] >= found[0] - 1e-12)) / (1 + num_permutations))


def _kernel(generated_features: np.ndarray, real_features: np.ndarray) -> np.ndarray:
    """Returns the kernel matrix of all windows, the generated windows first, with zeros on the diagonal."""
    from scipy.spatial.distance import pdist, squareform

    generated, real = (_standardised(features, real_features) for features in (generated_features, real_features))
    bandwidth = max(np.median(pdist(real, "sqeuclidean")), 1e-12)
    return squareform(np.exp(pdist(np.concatenate([generated, real]), "sqeuclidean") / (-2 * bandwidth)))


def _mmd(kernel: np.ndarray, number: int, chosen: np.ndarray) -> np.ndarray:
    """Returns the unbiased estimate for each row of `chosen`, which holds the indices of the windows treated as generated."""
    is_generated = np.zeros((len(kernel), len(chosen)))
    np.put_along_axis(is_generated, chosen.T, 1.0, axis=0)
    to_generated, other = kernel @ is_generated, len(kernel) - number
    both, cross = np.sum(is_generated * to_generated, axis=0), np.sum((1 - is_generated) * to_generated, axis=0)
    rest = kernel.sum() - both - 2 * cross
    return both / (number * (number - 1)) + rest / (other * (other - 1)) - 2 * cross / (number * other)


def _standardised(features: np.ndarray, reference: np.ndarray) -> np.ndarray:
    spread = np.std(reference, axis=0)
    return (features - np.mean(reference, axis=0)) / np.where(spread > 0, spread, 1)
