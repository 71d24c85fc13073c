"""Thresholds, ranks and cross-fitted scores of the study of labelled telemetry."""

import numpy as np
import pytest

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.telemanom import LabelledChannel, Labels
from studies.spacecraft.judging import Judge, cross_fitted_scores


def channel(sequences=((100, 120),), samples=400):
    values = np.random.default_rng(0).standard_normal(samples).astype(np.float32)
    commands = np.zeros((samples, 0), np.float32)
    series = Telemetry(values)
    return LabelledChannel(Labels("A", tuple(sequences), ("point",) * len(sequences)), series, series, commands, commands)


def test_ranks_and_thresholds_keep_every_alarm():
    judge = Judge(channel(), 16, 8, 0.1)
    rng = np.random.default_rng(1)
    scores = np.round(rng.standard_normal(len(judge.begins)), 1)  # with ties
    own, past = rng.standard_normal(99), rng.standard_normal(5)
    judge.add("real", "PCA residual", scores, own, past)
    ranks = np.array([row["rank"] for row in judge.rows["scores"]])
    limits = {row["rule"]: row for row in judge.rows["thresholds"]}
    np.testing.assert_array_equal(ranks > limits["own"]["rank"], scores > np.sort(own)[89])  # rank ceil(100 * 0.9)
    assert limits["own"]["rate"] == 0.1
    np.testing.assert_array_equal(ranks > limits["past"]["rank"], scores > past.max())
    assert limits["past"]["rate"] == pytest.approx(1 / 6)  # five scores support no smaller rate
    nominal = ~((judge.begins < 120) & (judge.begins + 16 > 100))
    assert judge.share_of_alarms("real") == {"PCA residual": pytest.approx(np.mean(scores[nominal] > np.sort(own)[89]))}


class Mean:
    """Scores a window by its distance from the mean training window, and remembers what it was fitted to."""

    fitted = []

    def fit(self, windows):
        self.fitted.append(windows)
        self.mean = windows.mean(axis=0)
        return self

    def score(self, windows):
        return np.abs(windows - self.mean).max(axis=1)


def test_cross_fitted_scores_come_from_detectors_that_saw_no_sample_of_the_window():
    values, window = np.arange(300.0), 10
    starts = np.arange(0, 291, 3)
    windows = np.lib.stride_tricks.sliding_window_view(values, window)[starts]
    Mean.fitted = []
    scores = cross_fitted_scores(Mean, windows, starts, 5)
    assert len(Mean.fitted) == 5 and np.isfinite(scores).all()
    for learnt, held_out in zip(Mean.fitted, np.array_split(np.arange(len(starts)), 5), strict=True):
        assert not set(learnt.ravel()) & set(windows[held_out].ravel())
        np.testing.assert_allclose(scores[held_out], np.abs(windows[held_out] - learnt.mean(axis=0)).max(axis=1))


def test_a_test_part_without_nominal_windows_is_refused():
    with pytest.raises(InputError, match="no labelled sample"):
        Judge(channel([(0, 400)]), 16, 8, 0.1)
