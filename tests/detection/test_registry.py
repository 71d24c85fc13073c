"""The registry of detectors, and the adapter for estimators of scikit-learn and PyOD."""

import numpy as np
import pytest
from sklearn.ensemble import IsolationForest
from sklearn.neighbors import LocalOutlierFactor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import OneClassSVM

from enhsim_tf.detection import registry
from enhsim_tf.detection.interface import as_detector
from enhsim_tf.detection.registry import DETECTORS, all_detectors, option_name, register
from enhsim_tf.simulator.options import ScoreOptions

ESTIMATORS = {
    "local outlier factor": lambda: LocalOutlierFactor(n_neighbors=5, novelty=True),
    "one-class SVM": lambda: OneClassSVM(nu=0.1),
    "pipeline": lambda: make_pipeline(StandardScaler(), IsolationForest(n_estimators=20, random_state=3)),
}


class OfPyOD:
    """An estimator of PyOD's form: its largest value is its anomaly score, and higher is more anomalous."""

    def fit(self, X, y=None):  # noqa: N803 - the argument's name in PyOD
        return self

    def decision_function(self, X):  # noqa: N803
        return np.max(X, axis=1)


class Wrong(OfPyOD):
    def decision_function(self, X):  # noqa: N803
        return np.zeros((len(X), 2))


class Largest:
    """A detector of this package's interface."""

    def fit(self, windows):
        return self

    def score(self, windows):
        return windows.max(axis=1)


def windows(number, seed, samples=12):
    return np.random.default_rng(seed).normal(size=(number, samples))


@pytest.mark.parametrize("name", ESTIMATORS)
def test_scores_are_those_of_scikit_learn_with_the_sign_turned(name):
    training, nominal, anomalous = windows(100, 0), windows(30, 1), 4 + windows(30, 2)
    detector, oracle = as_detector(ESTIMATORS[name]()).fit(training), ESTIMATORS[name]().fit(training)
    scores = detector.score(nominal)
    np.testing.assert_array_equal(scores, -oracle.score_samples(nominal))
    assert detector.score(anomalous).min() > np.median(scores)
    assert (oracle.predict(anomalous) == -1).all()


def test_scores_of_pyod_keep_their_sign_and_those_of_a_detector_are_its_own():
    nominal, detector = windows(20, 0), Largest()
    np.testing.assert_array_equal(as_detector(OfPyOD()).fit(nominal).score(nominal), nominal.max(axis=1))
    assert as_detector(detector) is detector


@pytest.mark.parametrize("estimator", [StandardScaler(), LocalOutlierFactor(novelty=False), object()])
def test_estimators_without_scores_are_refused(refused, estimator):
    with refused("Expected an estimator", type(estimator).__name__):
        as_detector(estimator)


def test_scores_of_another_shape_are_refused(refused):
    detector = as_detector(Wrong()).fit(windows(5, 0))
    with refused("one score for each of 5 windows", "(5, 2)", "Wrong"):
        detector.score(windows(5, 0))


def test_a_registered_estimator_takes_part_like_any_other(monkeypatch):
    monkeypatch.setattr(registry, "DETECTORS", dict(DETECTORS))
    register("their forest", lambda seed: IsolationForest(n_estimators=5, random_state=seed))
    register("largest value", lambda seed: Largest())
    assert set(all_detectors()) - set(DETECTORS) == {*registry.FURTHER, "their forest", "largest value"}
    assert all_detectors()["their forest"](7).estimator.random_state == 7
    assert ScoreOptions(detector="their forest").detector == "their forest"
    assert all_detectors()["largest value"](0).score(np.array([[1.0, 3.0]])) == [3.0]


@pytest.mark.parametrize("name", ["PCA residual", "pca residual", "PCA-residual", "largest step", "residual"])
def test_names_are_given_once(refused, name):
    with refused("Expected a name that no detector has yet", repr(name)):
        register(name, lambda seed: Largest())
    with refused("Expected a factory", "Largest"):
        register("largest value", Largest())


def test_every_detector_is_made_with_the_seed_if_it_takes_one_and_names_on_the_command_line_differ():
    made = {name: make(9) for name, make in all_detectors().items()}
    assert {name: each.seed for name, each in made.items() if hasattr(each, "seed")} == dict.fromkeys(
        ("PCA residual", "isolation forest", "dense autoencoder", "convolutional autoencoder"), 9
    )
    assert option_name("PCA residual") == "pca-residual" and len(set(map(option_name, made))) == len(made)
