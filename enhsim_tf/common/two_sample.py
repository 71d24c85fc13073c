"""Features of windows, and classifiers that tell generated windows from real ones by them
(evaluates sections 2.2 and 2.3 of the paper).
"""

from typing import Any

import numpy as np

from enhsim_tf.common.errors import InputError

_FOLDS = 5  # of consecutive windows, so that few neighbours in time are separated


def window_features(windows: np.ndarray) -> np.ndarray:
    """Computes fourteen features of windows of shape `(windows, samples)`. Values far below 1e-6
    have to be given in a larger unit.

    They are the mean, the logarithm of the standard deviation, the excess kurtosis, the maximum,
    the logarithm of the standard deviation of the first differences, the autocorrelation at lag 1,
    and the logarithm of the power in eight frequency bands whose edges are spaced evenly on a
    logarithmic scale. Very short windows have fewer bands.
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
    bands = [
        np.log(power[:, a:b].mean(axis=1) + tiny)
        for a, b in zip(edges[:-1], edges[1:], strict=True)
    ]
    columns = [
        mean,
        np.log(variance) / 2,
        kurtosis,
        values.max(axis=1),
        np.log(steps + tiny),
        correlation,
        *bands,
    ]
    return np.stack(columns, axis=1)


def boosted_trees(
    generated_features: np.ndarray, real_features: np.ndarray, seed: int = 0
) -> float:
    """Classifier two-sample test (Lopez-Paz and Oquab 2017) with gradient-boosted trees and fixed
    hyperparameters.

    Args:
        generated_features: Features of generated windows, shape `(windows, features)`.
        real_features: Features of real windows, in the order of time. If the numbers of windows
            differ, additional windows are ignored.
        seed: Seed for the trees.

    Returns:
        The cross-validated area under the ROC curve (AUC): 0.5 if the classifier cannot distinguish
        the windows, 1 if it always can.

    Raises:
        InputError: If there are fewer than two windows of each kind for each fold.
    """
    from sklearn.ensemble import HistGradientBoostingClassifier

    return held_out_auc(
        HistGradientBoostingClassifier(random_state=seed),
        "predict_proba",
        generated_features,
        real_features,
    )


def held_out_auc(
    classifier: Any, method: str, generated_features: np.ndarray, real_features: np.ndarray
) -> float:
    """The same as `boosted_trees` for a classifier of scikit-learn and the method that gives its
    scores.
    """
    from sklearn.metrics import roc_auc_score
    from sklearn.model_selection import cross_val_predict
    from threadpoolctl import threadpool_limits

    number = min(len(generated_features), len(real_features))
    if number < 2 * _FOLDS:
        raise InputError(
            f"Expected at least {2 * _FOLDS} windows of each kind. Received: {number}."
        )
    features = np.concatenate([generated_features[:number], real_features[:number]])
    labels = np.repeat([1, 0], number)
    folds = np.tile(np.arange(number) * _FOLDS // number, 2)
    splits = [
        (np.flatnonzero(folds != fold), np.flatnonzero(folds == fold)) for fold in range(_FOLDS)
    ]
    # on a busy machine, several threads that wait for each other are ten times slower
    with threadpool_limits(1):
        scores = cross_val_predict(classifier, features, labels, cv=splits, method=method)
    return float(roc_auc_score(labels, scores[:, 1] if scores.ndim == 2 else scores))


def two_sample_auc(generated: np.ndarray, real: np.ndarray, seed: int) -> float:
    """AUC of `boosted_trees` on `window_features` of windows of shape `(windows, samples)`."""
    return boosted_trees(window_features(generated), window_features(real), seed)
