"""The evaluation of arms: the counted quantities, and the same real telemetry for all arms."""

import numpy as np

from enhsim_tf.detection import metrics
from enhsim_tf.detection.anomalies import INJECTIONS, SEVERITIES
from enhsim_tf.detection.detectors import PCAResidual
from studies.common.evaluation import cross_fitted_scores, evaluate_arm, make_trial

WINDOW = 300


class Largest:
    """Scores a window by its maximum, so that all rates can be computed by hand."""

    def fit(self, windows):
        return self

    def score(self, windows):
        return np.max(windows, axis=1)


def noise(num_windows, seed, sd=1.0):
    return np.random.default_rng(seed).normal(0, sd, (num_windows, WINDOW)).astype(np.float32)


def false_alarm_rate(found):
    return sum(row["alarms"] for row in found["alarms"]) / sum(row["windows"] for row in found["alarms"])


def trial(seed=0, num_windows=120, **settings):
    return make_trial(noise(num_windows, 1), noise(num_windows, 2), 1.0, seed, num_anomalous=30, **settings)


def test_every_kind_and_severity_is_there_at_the_same_places():
    made = trial()
    assert set(made.anomalous) == {(kind, severity) for kind in INJECTIONS for severity in SEVERITIES}
    chosen = made.nominal[np.linspace(0, 119, 30).astype(int)]
    in_thirds = np.concatenate([chosen[number::3] for number in range(3)])
    changed = {key: windows != in_thirds for key, windows in made.anomalous.items()}
    for kind in ("level_shift", "variance_change", "oscillation"):
        lengths = {1.0: changed[kind, 1.0].sum(axis=1), 8.0: changed[kind, 8.0].sum(axis=1)}
        for severity in (1.0, 8.0):
            for third, duration in enumerate((25, 100, 250)):
                assert (np.abs(lengths[severity][10 * third : 10 * third + 10] - duration) <= duration // 10 + 1).all()
    np.testing.assert_array_equal(changed["level_shift", 1.0], changed["level_shift", 8.0])
    # an oscillation of 20 samples is zero at every tenth sample of the range; everything else it shares with the shift
    assert (changed["level_shift", 1.0] | ~changed["oscillation", 1.0]).all()


def test_rates_worked_by_hand():
    made = trial(rate=0.1)
    held_out = noise(99, 5)
    found = evaluate_arm(noise(50, 4), held_out, made, {"largest": lambda seed: Largest()}, seed=0)
    threshold = np.sort(held_out.max(axis=1))[89]  # rank ceil(100 * 0.9) of 99
    alarms = made.nominal.max(axis=1) > threshold
    assert [row["alarms"] for row in found["alarms"]] == [int(block.sum()) for block in np.split(alarms, 10)]
    assert [row["windows"] for row in found["alarms"]] == [12] * 10
    (row,) = [row for row in found["recall"] if (row["kind"], row["severity"]) == ("level_shift", 4.0)]
    scores = made.anomalous["level_shift", 4.0].max(axis=1)
    assert row["recall"] == np.mean(scores > threshold)
    assert row["recall_at_real_rate"] == np.mean(scores > metrics.threshold(made.reference.max(axis=1), 0.1))
    assert len(found["recall"]) == len(INJECTIONS) * len(SEVERITIES)


def test_too_clean_an_arm_alarms_on_everything_and_too_noisy_a_one_on_nothing():
    made = trial()
    rates = {}
    for name, sd in (("clean", 0.5), ("right", 1.0), ("noisy", 2.0)):
        found = evaluate_arm(noise(200, 6, sd), noise(200, 7, sd), made, {"PCA": lambda seed: PCAResidual(5, seed=seed)}, seed=0)
        rates[name] = false_alarm_rate(found)
        recalls = [row["recall"] for row in found["recall"] if row["kind"] == "variance_change"]
        assert recalls == sorted(recalls)  # grows with the severity
    assert rates["clean"] == 1.0 and rates["right"] < 0.1 and rates["noisy"] == 0.0


def test_cross_fitted_scores_come_from_detectors_that_saw_no_sample_of_the_window():
    fitted = []

    class Mean:
        def fit(self, windows):
            fitted.append(windows)
            self.mean = windows.mean(axis=0)
            return self

        def score(self, windows):
            return np.abs(windows - self.mean).max(axis=1)

    starts = np.arange(0, 291, 3)
    windows = np.lib.stride_tricks.sliding_window_view(np.arange(300.0), 10)[starts]
    scores = cross_fitted_scores(Mean, windows, starts, 5)
    assert len(fitted) == 5
    for learnt, held_out in zip(fitted, np.array_split(np.arange(len(starts)), 5), strict=True):
        assert not set(learnt.ravel()) & set(windows[held_out].ravel())
        np.testing.assert_allclose(scores[held_out], np.abs(windows[held_out] - learnt.mean(axis=0)).max(axis=1))
