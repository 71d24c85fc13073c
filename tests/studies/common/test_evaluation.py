"""The evaluation of training data: the counted quantities, and the same real telemetry for all."""

import numpy as np

from enhsim_tf.datasets.anomalies import INJECTIONS
from enhsim_tf.scoring import metrics
from studies.common.evaluation import cross_fitted_scores, evaluate_arm, make_trial
from studies.common.injections import SEVERITIES


class Largest:
    """A detector whose scores are easily computed: the largest sample of a window."""

    def fit(self, windows):
        return self

    def score(self, windows):
        return windows.reshape(len(windows), -1).max(axis=1)


def noise(num_windows, seed):
    return np.random.default_rng(seed).normal(0, 1, (num_windows, 300)).astype(np.float32)


def trial(rate=0.1):
    return make_trial(noise(120, 1), noise(120, 2), 1.0, 0, num_anomalous=30, rate=rate)


def test_every_kind_and_severity_is_there_at_the_same_places():
    made = trial()
    assert set(made.anomalous) == {
        (kind, severity) for kind in INJECTIONS for severity in SEVERITIES
    }
    chosen = made.nominal[np.linspace(0, 119, 30).astype(int)]
    in_thirds = np.concatenate([chosen[number::3] for number in range(3)])
    changed = {key: windows != in_thirds for key, windows in made.anomalous.items()}
    for severity in (1.0, 8.0):
        lengths = changed["level_shift", severity].sum(axis=1).reshape(3, 10)
        assert (np.abs(lengths - [[25], [100], [250]]) <= [[3], [11], [26]]).all()
    np.testing.assert_array_equal(changed["level_shift", 1.0], changed["level_shift", 8.0])
    # an oscillation of 20 samples is zero at every tenth sample of the range; everything else it
    # shares with the shift
    assert (changed["level_shift", 1.0] | ~changed["oscillation", 1.0]).all()


def test_rates_worked_by_hand():
    made, held_out = trial(), noise(99, 5)
    found = evaluate_arm(noise(50, 4), held_out, made, {"largest": lambda seed: Largest()}, seed=0)
    threshold = np.sort(held_out.max(axis=1))[89]  # rank ceil(100 * 0.9) of 99
    alarms = made.nominal.max(axis=1) > threshold
    expected = [{"alarms": block.sum(), "windows": 12} for block in np.split(alarms, 10)]
    assert [{name: row[name] for name in expected[0]} for row in found["alarms"]] == expected
    rows = {(row["kind"], row["severity"]): row for row in found["recall"]}
    assert rows.keys() == made.anomalous.keys()
    row, scores = rows["level_shift", 4.0], made.anomalous["level_shift", 4.0].max(axis=1)
    assert row["recall"] == np.mean(scores > threshold)
    real_threshold = metrics.threshold(made.reference.max(axis=1), 0.1)
    assert row["recall_at_real_rate"] == np.mean(scores > real_threshold)


def test_cross_fitted_scores_come_from_detectors_that_saw_no_sample_of_the_window():
    class Memory:
        def fit(self, windows):
            self.seen = set(windows.ravel())
            return self

        def score(self, windows):
            return np.array([len(self.seen & set(window)) for window in windows])

    starts = np.arange(0, 291, 3)
    windows = np.lib.stride_tricks.sliding_window_view(np.arange(300.0), 10)[starts]
    assert not cross_fitted_scores(Memory, windows, starts, 5).any()
