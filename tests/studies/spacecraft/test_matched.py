"""Finds at matched false-alarm rates and their chance level, compared with small cases by hand and with a direct implementation."""

import numpy as np
import pytest
from scipy.stats import rankdata

from studies.spacecraft.matched import (
    chance_of,
    finds_by_shift,
    matched_thresholds,
    shifts_around,
    windows_that_meet,
)

BEGINS, WINDOW, SAMPLES = np.arange(0, 91, 5), 10, 100
RANGES = [(20, 23), (60, 75)]


@pytest.mark.parametrize("shift", [0, 5, 30, 78, 99])
def test_windows_meet_the_labels_that_were_shifted_around_the_circle(shift):
    meets = windows_that_meet(BEGINS, WINDOW, SAMPLES, RANGES, shift)
    for row, (start, stop) in zip(meets, RANGES, strict=True):
        labelled = {(sample + shift) % SAMPLES for sample in range(start, stop)}
        assert row.tolist() == [bool(labelled & set(range(begin, begin + WINDOW))) for begin in BEGINS]


def test_shifts_go_once_around():
    assert shifts_around(100, 30).tolist() == [0, 30, 60, 90]


def test_at_most_the_given_share_of_nominal_windows_is_above_a_matched_threshold():
    # 40 nominal windows: 1 %, 5 % and 10 % allow 0, 2 and 4 of them
    ranks = np.random.default_rng(0).permutation(np.arange(1, 51))[None]
    is_nominal = np.arange(50) < 40
    nominal = np.sort(ranks[0, is_nominal])
    assert matched_thresholds(ranks, is_nominal, (0.01, 0.05, 0.1))[:, 0].tolist() == [nominal[39], nominal[37], nominal[35]]
    tied = np.full((1, 50), 50)  # all scores are equal: no window is above the threshold
    assert (tied[:, is_nominal] > matched_thresholds(tied, is_nominal, (0.1,))[0]).sum() == 0


def test_finds_equal_those_of_a_direct_implementation():
    rng = np.random.default_rng(1)
    scores = rng.standard_normal((3, len(BEGINS)))
    ranks = rankdata(scores, method="max", axis=1).astype(int)
    found = finds_by_shift(ranks, BEGINS, WINDOW, SAMPLES, RANGES, np.full((1, 3), 15), rates=(0.05, 0.2))
    assert found.shape == (20, 3, 3, 2)
    for number, shift in enumerate(range(0, 100, 5)):
        touched = [{(sample + shift) % SAMPLES for sample in range(*bounds)} for bounds in RANGES]
        meets = np.array([[bool(each & set(range(begin, begin + WINDOW))) for begin in BEGINS] for each in touched])
        nominal = ~meets.any(axis=0)
        for detector in range(3):
            descending = np.sort(scores[detector, nominal])[::-1]
            for place, limit in enumerate(
                [descending[int(rate * nominal.sum())] for rate in (0.05, 0.2)] + [np.sort(scores[detector])[14]]
            ):
                expected = [bool((scores[detector, each] > limit).any()) for each in meets]
                assert found[number, place, detector].tolist() == expected


def test_an_oracle_is_beyond_chance_and_a_random_score_is_not():
    rng, begins = np.random.default_rng(2), np.arange(0, 1_991, 10)
    meets = windows_that_meet(begins, 20, 2_000, [(500, 540), (1_500, 1_520)])
    p_values = []
    for scores in (meets.any(axis=0) + 0.1 * rng.random(len(begins)), *rng.random((40, len(begins)))):
        ranks = rankdata(scores, method="max").astype(int)[None]
        found = finds_by_shift(ranks, begins, 20, 2_000, [(500, 540), (1_500, 1_520)], np.zeros((0, 1)), rates=(0.05,))
        expected, p_value = chance_of([found[:, 0].sum(axis=2).mean(axis=1)] * 2, num_draws=2_000)
        p_values.append(p_value)
        assert 0 <= expected <= 4
    assert p_values[0] < 0.01
    # under chance, the p-value is at most 0.05 with a probability of at most 0.05: more than 7 of 40 has a probability below 0.002
    assert sum(p_value <= 0.05 for p_value in p_values[1:]) <= 7


def test_the_expected_number_is_the_mean_over_shifts_and_the_p_value_counts_draws():
    # each channel finds one sequence at one of four shifts, the unshifted one: both with a probability of 1 / 16
    counts = np.array([1.0, 0.0, 0.0, 0.0])
    expected, p_value = chance_of([counts, counts], num_draws=40_000)
    assert expected == 0.5
    assert p_value == pytest.approx(1 / 16, abs=5 * np.sqrt(1 / 16 * 15 / 16 / 40_000))
