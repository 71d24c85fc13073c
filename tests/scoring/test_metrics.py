"""Thresholds and rates, compared with small cases by hand and a closed form."""

import numpy as np
import pytest

from enhsim_tf.scoring.metrics import finite_threshold, recall, threshold


@pytest.mark.parametrize(
    ("number", "rate", "rank"),
    [
        (98, 0.01, np.inf),
        (99, 0.01, 99),
        (199, 0.01, 198),
        (1_000, 0.01, 991),
        (9, 0.5, 5),
        (9, 0.1, 9),
        (3, 0.3, 3),
    ],
)
def test_threshold_is_the_score_of_the_conformal_rank(number, rate, rank):
    scores = np.random.default_rng(0).permutation(np.arange(1.0, number + 1))
    assert threshold(scores, rate) == rank


@pytest.mark.parametrize(
    ("number", "independent", "rate", "expected"),
    [
        # just enough scores: the conformal threshold is the largest score
        (99, None, 0.01, (99, 0.01)),
        (98, None, 0.01, (98, 1 / 99)),  # one score too few
        (199, None, 0.01, (198, 0.01)),
        (990, 98, 0.01, (990, 1 / 99)),  # correlated scores count as fewer
        (990, 99, 0.01, (982, 0.01)),  # rank ceil(991 * 0.99)
    ],
)
def test_a_finite_threshold_states_the_rate_that_it_is_set_for(number, independent, rate, expected):
    scores = np.random.default_rng(0).permutation(np.arange(1.0, number + 1))
    assert finite_threshold(scores, rate, independent) == pytest.approx(expected)


@pytest.mark.parametrize(("number", "rate"), [(50, 0.05), (99, 0.01)])
def test_expected_false_alarm_rate_is_kept(number, rate):
    # uniform scores: the rate of a threshold is 1 - threshold, a Beta variable
    rates = 1 - np.array(
        [threshold(scores, rate) for scores in np.random.default_rng(1).random((4_000, number))]
    )
    error = 5 * np.std(rates) / np.sqrt(4_000)
    assert rate - 1 / (number + 1) - error <= np.mean(rates) <= rate + error


def test_a_recall_counts_what_lies_above():
    scores = [0.1, 0.5, 0.5, 0.9]
    assert [recall(scores, limit) for limit in (0.5, 0.05, 0.9)] == [0.25, 1, 0]


@pytest.mark.parametrize(("rate", "number"), [(0, 10), (1, 10), (-0.1, 10), (np.nan, 10), (0.1, 0)])
def test_thresholds_that_are_refused(refused, rate, number):
    with refused(f"rate={rate}", f"{number} scores"):
        threshold(np.zeros(number), rate)
