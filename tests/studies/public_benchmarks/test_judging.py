"""Each measure on series that can be counted by hand, and against direct computations."""

import numpy as np
import pytest

from studies.public_benchmarks.judging import Judge, found_by_chance


def scores_of(number, **places):
    """Zeros with other values, given as `from_to=value`."""
    scores = np.zeros(number)
    for place, value in places.items():
        begin, end = map(int, place[1:].split("_"))
        scores[begin:end] = value
    return scores


def test_samples_within_a_window_of_a_label_are_not_nominal():
    judge = Judge(((10, 12),), 30, 4)
    assert np.flatnonzero(~judge.is_nominal).tolist() == list(range(6, 16))
    assert np.flatnonzero(judge.labels).tolist() == [10, 11]


def test_the_limit_of_a_share_is_exceeded_by_no_more_of_the_nominal_samples():
    judge = Judge(((100, 101),), 101, 0)
    scores = np.arange(101.0)
    assert judge.limit(scores, 0.05) == 94  # five of a hundred are above
    assert judge.limit(np.ones(101), 0.05) == 1  # equal scores: none is above
    assert Judge(((0, 5),), 5, 1).limit(np.ones(5), 0.05) == np.inf


def test_one_series_by_hand():
    judge = Judge(((40, 50), (90, 92)), 200, 5)  # 20 and 12 samples are near a label
    # an alarm of 6 nominal samples, one from 3 samples before the first event, a weak one at the
    # second
    scores = scores_of(200, _150_156=5, _37_45=6, _90_91=4)
    found = judge.judge(scores, scores_of(200, _44_50=1), scores > 4.5)
    assert found["false_alarms"] == 6 / 168
    assert (found["events"], found["found"]) == (2, 1)
    assert (found["found_at_0.01"], found["found_at_0.05"]) == (1, 2)
    assert (found["onset_error"], found["delay"]) == (3, 4)
    # 5 of the first 8 samples are labelled, then 5 of 14, then 6 of 15, at last 12 of 200
    area = 5 / 12 * 5 / 8 + 1 / 12 * 6 / 15 + 6 / 12 * 12 / 200
    assert found["auc_pr"] == pytest.approx(area)


def test_alarms_within_a_window_of_each_other_are_one_whose_begin_counts():
    judge = Judge(((50, 60),), 100, 5)
    flags = scores_of(100, _40_42=1, _46_48=1, _52_55=1) > 0
    assert judge.onset_error(flags) == 10  # gaps of 4 and 4
    assert Judge(((50, 60),), 100, 3).onset_error(flags) == 2
    assert np.isnan(judge.onset_error(np.zeros(100, bool)))


@pytest.mark.parametrize("density", [0.0, 0.03, 0.5, 1.0])
def test_finds_by_chance_are_the_mean_over_all_moved_alarms(density):
    flags, events = np.random.default_rng(1).random(60) < density, ((5, 12), (58, 60))
    judge = Judge(events, 60, 1)
    moved = [judge.num_found(np.roll(flags, shift)) for shift in range(60)]
    assert found_by_chance(flags, events) == pytest.approx(np.mean(moved))
