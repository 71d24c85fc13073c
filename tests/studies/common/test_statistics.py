"""Tests intervals and tests against hand-worked cases, closed forms, SciPy, and coverage in
simulations with a known mean.
"""

import numpy as np
import pandas as pd
import pytest
import scipy.stats

from studies.common.statistics import holm, mean_interval, paired_difference, t_interval


def test_the_interval_of_crossed_data_has_the_width_that_the_bootstrap_has_in_closed_form():
    # weights of a factor of n labels are multinomial, so E[w_i w_k] = 1 - 1 / n, and one more for i
    # = k; for cell means a less their mean the variance is (sum a^2 + (1 - 1/S) sum (sum_j a)^2 +
    # (1 - 1/E) sum (sum_i a)^2) / (E S)^2, to which the draws of rows within the drawn cells add
    # the mean variance within a cell over the number of rows
    rng, (num_e, num_s, num_rows) = np.random.default_rng(5), (6, 8, 3)
    by_environment, by_seed = rng.normal(size=(num_e, 1, 1)), 0.8 * rng.normal(size=(1, num_s, 1))
    values = 3 + by_environment + by_seed + 0.7 * rng.normal(size=(num_e, num_s, num_rows))
    cells = values.mean(axis=2) - values.mean()
    rows = (1 - 1 / num_s) * (cells.sum(axis=1) ** 2).sum()
    columns = (1 - 1 / num_e) * (cells.sum(axis=0) ** 2).sum()
    variance = ((cells**2).sum() + rows + columns) / cells.size**2
    variance += values.var(axis=2).mean() / values.size
    index = pd.MultiIndex.from_product(
        [range(num_e), range(num_s), range(num_rows)], names=["environment", "seed", "block"]
    )
    shuffled = pd.Series(values.ravel(), index).sample(frac=1, random_state=2)
    interval = mean_interval(shuffled, num_resamples=20_000)
    assert interval["mean"] == pytest.approx(values.mean())
    assert (interval["high"] - interval["low"]) / 2 == pytest.approx(
        scipy.stats.norm.ppf(0.975) * np.sqrt(variance), rel=0.04
    )


def test_a_factor_whose_labels_all_do_the_same_leaves_the_others_scatter():
    index = pd.MultiIndex.from_product([["white", "shot"], [1, 2]], names=["environment", "seed"])
    values = pd.Series([1.0, 3.0, 1.0, 3.0], index)
    assert mean_interval(values) == {"mean": 2.0, "low": 1.0, "high": 3.0}
    # the seeds are rows of its cells
    assert mean_interval(values, ["environment"]) == {"mean": 2.0, "low": 1.0, "high": 3.0}


def test_intervals_refuse_what_is_not_crossed(refused):
    values = pd.Series(
        1.0, pd.MultiIndex.from_product([[0, 1], [0, 1]], names=["environment", "seed"])
    )
    with refused("0 to 1 rows a cell"):
        mean_interval(values[:3])
    with refused("1 not finite"):
        mean_interval(values.where([True, False, True, True]))
    with refused("0 to 0 rows"):
        mean_interval(values[:0])


def test_students_interval_as_scipy_has_it():
    values = pd.Series([0.1, 0.4, -0.2, 0.3, 0.9])
    low, high = scipy.stats.ttest_1samp(values, 0).confidence_interval(0.95)
    assert t_interval(values) == pytest.approx({"mean": 0.3, "low": low, "high": high})
    assert t_interval(values[:1]) == {"mean": 0.1, "low": None, "high": None}


def test_a_paired_difference_by_hand():
    first = pd.Series([0.5, 0.7, 0.9, 0.8, 0.6], list("abcde"))
    second = pd.Series([0.2, 0.5, 0.55, 0.5, 0.4], list("edcba"))  # in another order
    found = paired_difference(first, second)
    assert found["mean"] == pytest.approx(np.mean([0.1, 0.2, 0.35, 0.3, 0.4]))
    # of five differences of one sign: two of the 32 patterns of signs are as extreme
    assert found["p"] == 2 / 32
    assert found["low"] == pytest.approx(t_interval(first - second.reindex(first.index))["low"])
    assert paired_difference(first, first)["p"] == 1


def test_holms_values_by_hand():
    # 4 * .01, 3 * .02, then 2 * .03 and 1 * .035, which may not fall below those before
    assert holm({"a": 0.035, "b": 0.01, "c": 0.02, "d": 0.03}) == pytest.approx(
        {"b": 0.04, "c": 0.06, "d": 0.06, "a": 0.06}
    )
    assert holm({"a": 0.9, "b": 0.8}) == {"b": 1.0, "a": 1.0}
