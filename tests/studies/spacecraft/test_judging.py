"""False alarms, finds, and scores that need no trained detector, compared with small cases by hand and with direct computations."""

import numpy as np
import pytest

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import mean_over_windows
from studies.spacecraft.judging import Judge
from studies.spacecraft.reference import left_discord
from studies.spacecraft.telemanom import LabelledChannel


def channel(sequences, samples=400):
    series = Telemetry(np.random.default_rng(0).standard_normal(samples).astype(np.float32))
    return LabelledChannel("A", series, series, tuple(sequences))


def test_alarms_and_finds_by_hand():
    judge = Judge(channel([(100, 120), (300, 301)]), 16, 8, 0.1)  # a window every second sample
    first, second = (
        slice(50 - 7, 60),
        slice(150 - 7, 151),
    )  # begin from 86 to 118, and from 286 to 300
    nominal = len(judge.begins) - 17 - 8
    assert (
        judge.is_nominal.sum() == nominal
        and not judge.is_nominal[first].any()
        and not judge.is_nominal[second].any()
    )
    scores = np.zeros(len(judge.begins))
    scores[np.flatnonzero(judge.is_nominal)[: nominal // 20]] = 2.0  # 5 % of the nominal windows
    scores[first], scores[second.start] = 1.0, 3.0
    own, past = np.arange(99) / 66, np.zeros(5)
    found = judge.judge(scores, own, past)
    assert found["false_alarms"] == pytest.approx(
        nominal // 20 / nominal
    )  # the threshold is the 90th of 99 scores, 1.35
    assert (
        found["false_alarms_past"] == found["false_alarms"]
    )  # five scores support no smaller rate than 1 / 6: their largest, 0
    assert (found["found_at_0.01"], found["found_at_0.05"], found["found_at_0.1"]) == (
        1,
        2,
        2,
    ) and found["sequences"] == 2


def test_the_areas_of_a_perfect_and_of_a_random_score():
    judge = Judge(channel([(2_000, 2_300)], samples=5_000), 16, 8, 0.1)
    own = np.zeros(20)
    perfect = judge.judge(np.where(judge.is_nominal, 0.0, 1.0), own, own)
    random = judge.judge(np.random.default_rng(1).random(len(judge.begins)), own, own)
    assert perfect["auc_pr"] > 0.95  # the windows at its edges hold nominal samples, too
    assert random["auc_pr"] == pytest.approx(300 / 5_000, abs=0.05)  # the share of labelled samples


def test_samples_behind_the_last_window_take_its_score():
    scores = mean_over_windows(np.array([1.0, 3.0, 8.0]), np.array([0, 2, 4]), 4, 10)
    assert scores.tolist() == [1, 1, 2, 2, 5.5, 5.5, 8, 8, 8, 8]


def test_a_test_part_without_nominal_windows_is_refused():
    with pytest.raises(InputError, match="no labelled sample"):
        Judge(channel([(0, 400)]), 16, 8, 0.1)


def discord_by_definition(series, begin, window):
    pieces = [series[start : start + window] for start in (*range(begin - window + 1), begin)]
    *earlier, last = [(piece - piece.mean()) / piece.std() for piece in pieces]
    return min(np.linalg.norm(last - each) for each in earlier)


def test_left_discord_is_the_distance_to_the_nearest_earlier_window_whatever_its_level_and_scale():
    series = np.random.default_rng(0).standard_normal(300)
    begins = np.array([40, 100, 270])
    np.testing.assert_allclose(
        left_discord(series, begins, 30),
        [discord_by_definition(series, begin, 30) for begin in begins],
        rtol=1e-9,
    )
    assert left_discord(np.concatenate([series[:20], 5 + 3 * series[:20]]), [20], 20)[
        0
    ] == pytest.approx(0, abs=1e-6)


def test_left_discord_of_constant_windows_and_of_the_first_window():
    series = np.concatenate([np.random.default_rng(2).standard_normal(40), np.ones(40)])
    found = left_discord(series, np.array([0, 40, 60]), 20)
    np.testing.assert_allclose(found, [2 * np.sqrt(20), np.sqrt(20), 0.0])
