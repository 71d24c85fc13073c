import numpy as np
from sklearn.base import clone
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from enhsim_tf.simulator.estimator import TelemetryDetector
from tests.simulator.conftest import joint


def test_it_runs_in_a_pipeline_and_finds_a_fault():
    nominal, new = joint(1_500).parts[0].values, joint(seed=1).parts[0].values.copy()
    new[1_000:1_200, 1] -= 12.0
    pipeline = make_pipeline(
        StandardScaler(), clone(TelemetryDetector(window=80, detector="PCA residual"))
    ).fit(nominal)
    flagged = pipeline.predict(new) == -1
    assert flagged[1_020:1_180].mean() > 0.9 and flagged[:900].mean() < 0.05
    decision, samples = pipeline.decision_function(new), pipeline.score_samples(new)
    np.testing.assert_array_equal(flagged, decision < 0)
    np.testing.assert_allclose(decision, samples + 1)
    fitted = pipeline[-1]
    np.testing.assert_array_equal(fitted.decision_scores_, -pipeline.score_samples(nominal))
    np.testing.assert_array_equal(fitted.labels_, pipeline.predict(nominal) == -1)


def test_fewer_samples_than_a_window_are_refused(refused):
    detector = TelemetryDetector(window=80, detector="largest step").fit(
        joint(1_500).parts[0].values
    )
    with refused("window of 80 samples", "50"):
        detector.predict(joint(50).parts[0].values)
