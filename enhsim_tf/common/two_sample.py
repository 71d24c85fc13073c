"""Classifiers that tell generated windows from real ones by their features (evaluates sections 2.2 and 2.3 of the paper)."""

from typing import Any, NamedTuple

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.window_features import window_features

_FOLDS = 5  # of consecutive windows, so that few neighbours in time are separated


class HeldOut(NamedTuple):
    """Cross-validated scores of a classifier.

    Args:
        scores: Score of each window, from a classifier that was not trained on it; higher if it is more likely generated.
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
        """Share of label permutations whose AUC is at least as large; within each fold, whose scores are of the same classifier."""
        from scipy.stats import rankdata

        ranks, rng = rankdata(self.scores), np.random.default_rng(seed)
        sums = np.zeros(num_permutations)
        for fold in np.unique(self.folds):
            inside = self.folds == fold
            shuffled = rng.permuted(np.tile(ranks[inside], (num_permutations, 1)), axis=1)
            sums += shuffled @ self.is_generated[inside]
        return float((1 + np.sum(sums >= ranks @ self.is_generated - 1e-9)) / (1 + num_permutations))


def boosted_trees(generated_features: np.ndarray, real_features: np.ndarray, seed: int = 0) -> HeldOut:
    """Classifier two-sample test (Lopez-Paz and Oquab 2017) with gradient-boosted trees and fixed hyperparameters.

    Args:
        generated_features: Features of generated windows, shape `(windows, features)`.
        real_features: Features of real windows, same shape, in the order of time.
        seed: Seed for the trees.

    Returns:
        The cross-validated scores.
    """
    from sklearn.ensemble import HistGradientBoostingClassifier

    return _held_out(HistGradientBoostingClassifier(random_state=seed), "predict_proba", generated_features, real_features)


def linear_classifier(generated_features: np.ndarray, real_features: np.ndarray) -> HeldOut:
    """The same as `boosted_trees` with a ridge classifier on standardised features, intended for many features."""
    from sklearn.linear_model import RidgeClassifier
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    classifier = make_pipeline(StandardScaler(), RidgeClassifier(alpha=100.0))
    return _held_out(classifier, "decision_function", generated_features, real_features)


def _held_out(classifier: Any, method: str, generated_features: np.ndarray, real_features: np.ndarray) -> HeldOut:
    from sklearn.model_selection import cross_val_predict
    from threadpoolctl import threadpool_limits

    number = min(len(generated_features), len(real_features))
    if number < 2 * _FOLDS:
        raise InputError(f"Expected at least {2 * _FOLDS} windows of each kind. Received: {number}.")
    features = np.concatenate([generated_features[:number], real_features[:number]])
    labels = np.repeat([1, 0], number)
    folds = np.tile(np.arange(number) * _FOLDS // number, 2)
    splits = [(np.flatnonzero(folds != fold), np.flatnonzero(folds == fold)) for fold in range(_FOLDS)]
    with threadpool_limits(1):  # on a busy machine, several threads that wait for each other are ten times slower
        scores = cross_val_predict(classifier, features, labels, cv=splits, method=method)
    return HeldOut(scores[:, 1] if scores.ndim == 2 else scores, labels, folds)


def two_sample_auc(generated: np.ndarray, real: np.ndarray, seed: int) -> float:
    """AUC of `boosted_trees` on `window_features`: 0.5 if generated and real windows are indistinguishable, 1 if separable.

    Args:
        generated: Generated windows, shape `(windows, samples)`.
        real: Real windows in the order of time. If the numbers of windows differ, additional windows are ignored.
        seed: Seed for the trees.

    Raises:
        InputError: If there are fewer than two windows of each kind for each fold.
    """
    return boosted_trees(window_features(generated), window_features(real), seed).auc
