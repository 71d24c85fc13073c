import numpy as np
from sklearn.base import clone
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from enhsim_tf.scoring.estimator import TelemetryDetector
from tests.fitted_simulators import joint


def test_it_runs_in_a_pipeline_and_finds_a_fault():
    nominal, new = joint(1_500).parts[0].values, joint(seed=1).parts[0].values.copy()
    new[1_000:1_200, 1] -= 12.0
    pipeline = make_pipeline(StandardScaler(), clone(TelemetryDetector(0.01))).fit(nominal)
    flagged = pipeline.predict(new) == -1
    assert flagged[1_020:1_180].mean() > 0.9 and flagged[:900].mean() < 0.05
    decision, samples = pipeline.decision_function(new), pipeline.score_samples(new)
    np.testing.assert_array_equal(flagged, decision < 0)
    np.testing.assert_allclose(decision, samples + 1)
    fitted = pipeline[-1]
    np.testing.assert_array_equal(fitted.labels_, fitted.decision_scores_ > fitted.threshold_)
    assert fitted.decision_scores_.shape == (1_500,) and fitted.labels_.mean() <= 0.01


def test_fewer_samples_than_a_window_are_refused(refused):
    detector = TelemetryDetector().fit(joint(1_500).parts[0].values)
    with refused("window of 60 samples", "50"):
        detector.predict(joint(50).parts[0].values)


def test_small_faults_on_a_large_level_are_found():
    time = np.arange(4_000.0)[:, None]
    values = np.sin(2 * np.pi * time / 50)
    faulty = values[:1_000].copy()
    faulty[500:600] = 0.0
    detector = TelemetryDetector().fit(1e9 + values)
    found = np.flatnonzero(detector.predict(1e9 + faulty) < 0)
    assert len(found) and found.min() > 420 and found.max() < 680
