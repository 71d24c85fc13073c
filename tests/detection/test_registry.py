"""The registry of detectors, and the adapter for estimators of scikit-learn and PyOD."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from sklearn.covariance import EllipticEnvelope
from sklearn.ensemble import IsolationForest
from sklearn.neighbors import LocalOutlierFactor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import OneClassSVM

from enhsim_tf.detection import registry
from enhsim_tf.detection.detectors import LimitCheck, PCAResidual
from enhsim_tf.detection.estimators import EstimatorDetector, as_detector
from enhsim_tf.detection.interface import Detector
from enhsim_tf.detection.registry import CONTROLS, DETECTORS, option_name, register, unregister
from enhsim_tf.simulator.options import ScoreOptions

ESTIMATORS = {
    "isolation forest": lambda: IsolationForest(n_estimators=20, random_state=3),
    "local outlier factor": lambda: LocalOutlierFactor(n_neighbors=5, novelty=True),
    "one-class SVM": lambda: OneClassSVM(nu=0.1),
    "elliptic envelope": lambda: EllipticEnvelope(random_state=0, support_fraction=1.0),
    "pipeline": lambda: make_pipeline(StandardScaler(), IsolationForest(n_estimators=20, random_state=3)),
}


class OfPyOD:
    """An estimator of PyOD's form: its largest value is its anomaly score, and higher is more anomalous."""

    def fit(self, X, y=None):  # noqa: N803 - the argument's name in PyOD
        self.decision_scores_ = self.decision_function(X)
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


@pytest.fixture
def registered():
    """Registers detectors, and removes them afterwards."""
    names = []

    def add(name, factory):
        register(name, factory)
        names.append(name)

    yield add
    for name in names:
        unregister(name)


def windows(number, seed, samples=12):
    return np.random.default_rng(seed).normal(size=(number, samples))


@pytest.mark.parametrize("name", ESTIMATORS)
def test_scores_are_those_of_scikit_learn_with_the_sign_turned(name):
    training, nominal, anomalous = windows(100, 0), windows(30, 1), 4 + windows(30, 2)
    detector, oracle = as_detector(ESTIMATORS[name]()).fit(training), ESTIMATORS[name]().fit(training)
    scores = detector.score(nominal)
    np.testing.assert_array_equal(scores, -oracle.score_samples(nominal))
    # decision_function is score_samples less an offset, in all of scikit-learn's outlier detectors: the order is the same
    assert (np.argsort(scores) == np.argsort(-oracle.decision_function(nominal), kind="stable")).all()
    assert detector.score(anomalous).min() > np.median(scores)
    assert (oracle.predict(anomalous) == -1).all()


def test_scores_of_pyod_keep_their_sign():
    nominal = windows(20, 0)
    np.testing.assert_array_equal(as_detector(OfPyOD()).fit(nominal).score(nominal), nominal.max(axis=1))


def test_a_detector_of_the_package_is_left_as_it_is():
    detector = Largest()
    assert as_detector(detector) is detector and isinstance(detector, Detector)
    assert isinstance(as_detector(OfPyOD()), EstimatorDetector)


@pytest.mark.parametrize("estimator", [StandardScaler(), LocalOutlierFactor(novelty=False), object()])
def test_estimators_without_scores_are_refused(refused, estimator):
    with refused("Expected an estimator", type(estimator).__name__):
        as_detector(estimator)


def test_scores_of_another_shape_are_refused(refused):
    detector = as_detector(Wrong()).fit(windows(5, 0))
    with refused("one score for each of 5 windows", "(5, 2)", "Wrong"):
        detector.score(windows(5, 0))


def test_a_registered_estimator_takes_part_like_any_other(registered):
    before = list(DETECTORS)
    registered("their outlier factor", lambda seed: LocalOutlierFactor(novelty=True))
    registered("their forest", lambda seed: IsolationForest(n_estimators=5, random_state=seed))
    registered("largest value", lambda seed: Largest())
    assert list(DETECTORS) == [*before, "their outlier factor", "their forest", "largest value"]
    assert DETECTORS["their forest"](7).estimator.random_state == 7
    assert ScoreOptions(detector="their forest").detector == "their forest"
    loud = windows(40, 1, 60) + 8
    for name in ("their outlier factor", "their forest", "largest value"):
        score = DETECTORS[name](0).fit(windows(60, 3, 60)).score
        assert np.mean(score(loud) > np.quantile(score(windows(60, 4, 60)), 0.9)) > 0.5


@pytest.mark.parametrize("name", ["PCA residual", "pca residual", "PCA-residual", "random score"])
def test_names_are_given_once(refused, name):
    with refused("Expected a name that no detector has yet", repr(name)):
        register(name, lambda seed: Largest())


def test_what_is_no_factory_is_refused(refused):
    with refused("Expected a factory", "Largest"):
        register("largest value", Largest())


@pytest.mark.parametrize("name", ["PCA residual", "unheard of"])
def test_only_what_was_registered_is_removed(refused, name):
    with refused("Expected the name of a registered detector", repr(name)):
        unregister(name)


def test_built_in_detectors_get_the_seed_if_they_take_one():
    assert DETECTORS["PCA residual"](9).seed == 9 and isinstance(DETECTORS["PCA residual"](9), PCAResidual)
    assert isinstance(DETECTORS["limit check"](9), LimitCheck)
    assert (CONTROLS["random score"](9).score(windows(5, 0)) == np.random.default_rng(9).random(5)).all()


def test_names_on_the_command_line_differ():
    assert option_name("PCA residual") == "pca-residual"
    assert len(set(map(option_name, (*DETECTORS, *CONTROLS)))) == len(DETECTORS) + len(CONTROLS)


def test_the_registry_imports_nothing_slow():
    script = "import sys, enhsim_tf.detection.registry; print([name for name in ('numpy', 'sklearn', 'tensorflow') if name in sys.modules])"
    ended = subprocess.run(
        [sys.executable, "-c", script], cwd=Path(registry.__file__).parents[2], capture_output=True, text=True, check=True
    )
    assert ended.stdout == "[]\n"
