"""False alarms, finds, and cross-fitted scores, compared with small cases by hand."""

import numpy as np
import pytest

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.series import Telemetry
from studies.spacecraft.judging import Judge, cross_fitted_scores, windows_that_meet
from studies.spacecraft.telemanom import LabelledChannel, Labels


def channel(sequences, samples=400):
    series, none = Telemetry(np.random.default_rng(0).standard_normal(samples).astype(np.float32)), np.zeros((samples, 0), np.float32)
    return LabelledChannel(Labels("A", tuple(sequences), ("point",) * len(sequences)), series, series, none, none)


def test_windows_meet_the_ranges_whose_samples_they_hold():
    begins, window, ranges = np.arange(0, 91, 5), 10, [(20, 23), (60, 75)]
    for row, labelled in zip(windows_that_meet(begins, window, ranges), map(set, (range(*each) for each in ranges)), strict=True):
        assert row.tolist() == [bool(labelled & set(range(begin, begin + window))) for begin in begins]


def test_alarms_and_finds_by_hand():
    judge = Judge(channel([(100, 120), (300, 301)]), 16, 8, 0.1)  # a window every second sample
    first, second = (slice(50 - 7, 60), slice(150 - 7, 151))  # begin from 86 to 118, and from 286 to 300
    nominal = len(judge.begins) - 17 - 8
    assert judge.is_nominal.sum() == nominal and not judge.is_nominal[first].any() and not judge.is_nominal[second].any()
    scores = np.zeros(len(judge.begins))
    scores[np.flatnonzero(judge.is_nominal)[: nominal // 20]] = 2.0  # 5 % of the nominal windows
    scores[first], scores[second.start] = 1.0, 3.0
    own, past = np.arange(99) / 66, np.zeros(5)
    found = judge.judge(scores, own, past)
    assert found["false_alarms"] == pytest.approx(nominal // 20 / nominal)  # the threshold is the 90th of 99 scores, 1.35
    assert found["false_alarms_past"] == found["false_alarms"]  # five scores support no smaller rate than 1 / 6: their largest, 0
    assert (found["found_at_0.01"], found["found_at_0.05"], found["found_at_0.1"]) == (1, 2, 2) and found["sequences"] == 2


def test_the_areas_of_a_perfect_and_of_a_random_score():
    judge = Judge(channel([(2_000, 2_300)], samples=5_000), 16, 8, 0.1)
    own = np.zeros(20)
    perfect = judge.judge(np.where(judge.is_nominal, 0.0, 1.0), own, own)
    random = judge.judge(np.random.default_rng(1).random(len(judge.begins)), own, own)
    assert perfect["auc_pr"] > 0.95  # the windows at its edges hold nominal samples, too
    assert random["auc_pr"] == pytest.approx(300 / 5_000, abs=0.05)  # the share of labelled samples


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
