"""Tests intervals and tests against hand-worked cases, closed forms, SciPy, and coverage in simulations with a known mean."""

import itertools

import numpy as np
import pandas as pd
import pytest
import scipy.stats

from studies.common.statistics import crossed_interval, hierarchical_interval, holm, mean_interval, t_interval, wilcoxon_signed_rank

LEVELS = ("environment", "seed", "block")


def nested(sizes, sds, seed=0, mean=0.0):
    """A table of normal values: every level of the nesting adds its own scatter; the last level's is that of the rows."""
    rng = np.random.default_rng(seed)
    values = np.full(sizes, mean)
    for depth, sd in enumerate(sds):
        values = values + sd * rng.standard_normal((*sizes[: depth + 1], *[1] * (len(sizes) - depth - 1)))
    labels = np.indices(sizes).reshape(len(sizes), -1)
    return pd.DataFrame({**dict(zip(LEVELS, labels, strict=False)), "value": values.ravel()})


def half_width(interval):
    return (interval.high - interval.low) / 2


def test_the_interval_of_nested_data_has_the_width_that_the_bootstrap_has_in_closed_form():
    # with all resamples drawn, the variance of a resample's mean is, cluster sizes being equal, the sum over the levels
    # of the mean variance among the children of a cluster, over the number of clusters drawn on that level
    sizes = (6, 5, 4)
    table = nested(sizes, (1.0, 0.7, 1.2))
    values = table["value"].to_numpy().reshape(sizes)
    variance = values.mean(axis=(1, 2)).var() / 6 + values.mean(axis=2).var(axis=1).mean() / 30 + values.var(axis=2).mean() / 120
    interval = hierarchical_interval(table.sample(frac=1, random_state=1), "value", LEVELS, num_resamples=20_000)
    assert interval.estimate == pytest.approx(values.mean()) and interval.level == 0.95
    # an end's own error is sqrt(q (1 - q) / 20,000) / density = 0.019 sd; the shape is nearly normal
    assert half_width(interval) == pytest.approx(scipy.stats.norm.ppf(0.975) * np.sqrt(variance), rel=0.04)
    narrower = hierarchical_interval(table, "value", LEVELS, num_resamples=20_000, level=0.5)
    assert half_width(narrower) == pytest.approx(scipy.stats.norm.ppf(0.75) * np.sqrt(variance), rel=0.04)


def test_rows_of_a_last_cluster_stay_together():
    table = nested((6, 5, 4), (1.0, 0.7, 1.2))
    means = table.groupby("environment")["value"].mean()
    interval = hierarchical_interval(table, "value", ["environment"], num_resamples=20_000)
    assert half_width(interval) == pytest.approx(scipy.stats.norm.ppf(0.975) * means.std(ddof=0) / np.sqrt(6), rel=0.05)


def test_every_resample_is_made_of_whole_clusters_of_equal_labels_below_different_parents():
    # seed 0 of one environment is not seed 0 of the other: were they one cluster, 1 and 100 would come together
    table = pd.DataFrame({"environment": list("aabb"), "seed": [0, 1, 0, 1], "value": [1.0, 10.0, 100.0, 1000.0]})
    seen = []
    hierarchical_interval(table, "value", ["environment", "seed"], lambda values: seen.append(tuple(np.sort(values))) or 0.0)
    pairs = {a: list(itertools.combinations_with_replacement(two, 2)) for a, two in {"a": (1.0, 10.0), "b": (100.0, 1000.0)}.items()}
    possible = {tuple(sorted(x + y)) for one, two in ("aa", "ab", "bb") for x in pairs[one] for y in pairs[two]}
    assert set(seen) == possible


def test_one_label_below_every_parent_is_a_cluster_of_its_own_below_each():
    table = pd.DataFrame({"environment": list("abc"), "seed": [0, 0, 0], "value": [1.0, 10.0, 100.0]})
    seen = []
    hierarchical_interval(table, "value", ["environment", "seed"], lambda values: seen.append(tuple(np.sort(values))) or 0.0)
    assert set(seen) == set(itertools.combinations_with_replacement((1.0, 10.0, 100.0), 3))


def test_unequal_clusters_are_drawn_equally_often():
    # the mean share of rows from a cluster of 1 beside one of 3, the last level's rows kept: draws aa, ab, ba, bb
    table = pd.DataFrame({"seed": [0, 1, 1, 1], "value": [1.0, 0.0, 0.0, 0.0]})
    seen = []
    hierarchical_interval(table, "value", ["seed"], lambda values: seen.append(values.mean()) or 0.0, num_resamples=4_000)
    shares, counts = np.unique(seen[1:], return_counts=True)
    np.testing.assert_allclose(shares, [0, 0.25, 1])
    np.testing.assert_allclose(counts / 4_000, [0.25, 0.5, 0.25], atol=4 * np.sqrt(0.25 / 4_000))


def test_coverage_on_nested_data_is_what_theory_says_and_that_of_single_rows_is_not():
    num_clusters, num_blocks, trials = 20, 5, 300
    hits = np.zeros(2)
    for seed in range(trials):
        table = nested((num_clusters, num_blocks), (1.0, 1.0), seed=seed, mean=3.0).assign(row=np.arange(num_clusters * num_blocks))
        for place, levels in enumerate((["environment", "seed"], ["row"])):
            interval = hierarchical_interval(table, "value", levels, num_resamples=300, seed=seed)
            hits[place] += interval.low <= 3 <= interval.high
    variance = (1 + 1 / num_blocks) / num_clusters
    nested_variance = (num_clusters - 1) / num_clusters * variance + (num_blocks - 1) / num_blocks**2 / num_clusters
    expected = 2 * scipy.stats.t.cdf(1.96 * np.sqrt(nested_variance / variance), num_clusters - 1) - 1
    alone = 2 * scipy.stats.norm.cdf(1.96 * np.sqrt(2 / (num_clusters * num_blocks) / variance)) - 1
    assert expected > 0.93 and alone < 0.8
    for share, wanted in zip(hits / trials, (expected, alone), strict=True):
        assert share == pytest.approx(wanted, abs=4 * np.sqrt(wanted * (1 - wanted) / trials))


def test_intervals_are_of_the_statistic_asked_for_and_of_their_seed():
    table = nested((10, 4), (1.0, 0.5))
    table.loc[0, "value"] = 1e6  # a median does not mind
    interval = hierarchical_interval(table, "value", ["environment", "seed"], np.median, seed=3)
    assert interval.estimate == np.median(table["value"]) and interval.low < interval.estimate < interval.high < 10
    assert interval == hierarchical_interval(table, "value", ["environment", "seed"], np.median, seed=3)
    assert interval != hierarchical_interval(table, "value", ["environment", "seed"], np.median, seed=4)


def test_many_rows_are_drawn_in_batches(monkeypatch):
    table = nested((8, 3), (1.0, 1.0))
    whole = hierarchical_interval(table, "value", ["environment", "seed"], num_resamples=8_000)
    seen = []
    monkeypatch.setattr("studies.common.statistics._BATCH", 100)
    parts = hierarchical_interval(table, "value", ["environment", "seed"], lambda v: seen.append(len(v)) or v.mean(), num_resamples=8_000)
    assert seen == [24] * 8_001
    assert half_width(parts) == pytest.approx(half_width(whole), rel=0.06)


def test_the_interval_of_crossed_data_has_the_width_that_the_bootstrap_has_in_closed_form():
    # weights of a factor of n labels are multinomial, so E[w_i w_k] = 1 - 1 / n, and one more for i = k; for cell means a
    # less their mean the variance is (sum a^2 + (1 - 1/S) sum (sum_j a)^2 + (1 - 1/E) sum (sum_i a)^2) / (E S)^2, to which
    # the draws of rows within the drawn cells add the mean variance within a cell over the number of rows
    rng, (num_e, num_s, num_rows) = np.random.default_rng(5), (6, 8, 3)
    by_environment, by_seed = rng.normal(size=(num_e, 1, 1)), 0.8 * rng.normal(size=(1, num_s, 1))
    values = 3 + by_environment + by_seed + 0.7 * rng.normal(size=(num_e, num_s, num_rows))
    cells = values.mean(axis=2) - values.mean()
    rows, columns = (1 - 1 / num_s) * (cells.sum(axis=1) ** 2).sum(), (1 - 1 / num_e) * (cells.sum(axis=0) ** 2).sum()
    variance = ((cells**2).sum() + rows + columns) / cells.size**2 + values.var(axis=2).mean() / values.size
    labels = np.indices(values.shape).reshape(3, -1)
    table = pd.DataFrame({**dict(zip(LEVELS, labels, strict=True)), "value": values.ravel()}).sample(frac=1, random_state=2)
    interval = crossed_interval(table, "value", LEVELS[:2], num_resamples=20_000)
    assert interval.estimate == pytest.approx(values.mean())
    assert half_width(interval) == pytest.approx(scipy.stats.norm.ppf(0.975) * np.sqrt(variance), rel=0.04)
    nested = hierarchical_interval(table, "value", LEVELS, num_resamples=20_000)  # takes what seeds share for chance
    assert half_width(nested) < 0.9 * half_width(interval)


def test_one_factor_with_one_row_a_label_is_the_plain_bootstrap():
    table = pd.DataFrame({"seed": np.arange(30), "value": np.random.default_rng(1).normal(size=30)})
    interval = crossed_interval(table, "value", ["seed"], num_resamples=20_000)
    assert half_width(interval) == pytest.approx(scipy.stats.norm.ppf(0.975) * table["value"].std(ddof=0) / np.sqrt(30), rel=0.04)
    assert crossed_interval(table, "value", ["seed"], seed=3) == crossed_interval(table, "value", ["seed"], seed=3)
    assert crossed_interval(table, "value", ["seed"], seed=3) != crossed_interval(table, "value", ["seed"], seed=4)
    assert crossed_interval(table, "value", ["seed"], np.median).estimate == table["value"].median()


def test_a_factor_whose_labels_all_do_the_same_leaves_the_others_scatter():
    table = pd.DataFrame({"environment": [0, 1] * 2, "seed": [0, 0, 1, 1], "value": [1.0, 1.0, 3.0, 3.0]})
    found = crossed_interval(table, "value", ["environment", "seed"])
    assert (found.estimate, found.low, found.high) == (2, 1, 3)


def test_crossed_intervals_refuse_what_is_not_crossed(refused):
    table = pd.DataFrame({"environment": [0, 1, 0, 1], "seed": [0, 0, 1, 1], "value": 1.0})
    with refused("0 to 1 rows a cell"):
        crossed_interval(table[:3], "value", ["environment", "seed"])
    with refused("1 not finite"):
        crossed_interval(table.assign(value=[1, np.nan, 2, 3]), "value", ["environment", "seed"])
    with refused("0 to 0 rows"):
        crossed_interval(table[:0], "value", ["seed"])
    with refused("level=95"):
        crossed_interval(table, "value", ["seed"], level=95)


def test_the_interval_refuses_a_table_it_cannot_read(refused):
    table = nested((3, 2), (1.0, 1.0))
    with refused("'nothing'"):
        hierarchical_interval(table, "nothing", ["seed"])
    with refused("0 rows"):
        hierarchical_interval(table[:0], "value", ["seed"])
    with refused("columns asked for"):
        hierarchical_interval(table, "value", [])
    with refused("1 rows"):
        hierarchical_interval(table.assign(value=[np.nan, 1, 2, 3, 4, 5]), "value", ["seed"])
    with refused("level=95"):
        hierarchical_interval(table, "value", ["seed"], level=95)


def test_holm_by_hand():
    np.testing.assert_allclose(holm([0.01, 0.04, 0.03]), [0.03, 0.06, 0.06])  # 3 x 0.01, 2 x 0.03, then never below it
    np.testing.assert_allclose(holm([0.6, 0.7, 0.001, 0.02]), [1, 1, 0.004, 0.06])
    np.testing.assert_allclose(holm([0.2]), [0.2])


def test_holm_refuses_what_is_no_probability(refused):
    for p_values in ([0.1, 1.2], [np.nan], [-0.1]):
        with refused("p-values"):
            holm(p_values)


@pytest.mark.parametrize("number", [5, 10, 23, 40])
def test_signed_ranks_as_scipy_counts_them(number):
    differences = np.random.default_rng(number).standard_normal(number) + 0.3
    assert wilcoxon_signed_rank(differences) == pytest.approx(scipy.stats.wilcoxon(differences, method="exact").pvalue, rel=1e-9)


def test_signed_ranks_with_ties_by_counting_all_signs():
    differences = np.array([1.0, -1.0, 2.0, 2.0, 2.0, -3.0, 4.0, 0.0, 4.0])
    sizes = np.abs(differences[differences != 0])
    ranks = scipy.stats.rankdata(sizes)
    sums = np.array([ranks[list(signs)].sum() for signs in itertools.product([False, True], repeat=8)])
    found = ranks[differences[differences != 0] > 0].sum()
    expected = 2 * min(np.mean(sums <= found), np.mean(sums >= found))
    assert wilcoxon_signed_rank(differences) == pytest.approx(expected)
    assert wilcoxon_signed_rank(-differences) == pytest.approx(expected)


def test_the_least_p_values_that_few_replicates_can_reach():
    assert wilcoxon_signed_rank(np.arange(1.0, 11)) == pytest.approx(0.001953125)  # 2 / 2^10
    assert wilcoxon_signed_rank(-np.arange(1.0, 6)) == pytest.approx(0.0625)
    for number in (5, 10, 20, 40):  # ties leave it what it is, also where SciPy takes a normal law
        assert wilcoxon_signed_rank(np.ones(number)) == pytest.approx(2 / 2**number, rel=1e-9)
    assert wilcoxon_signed_rank(np.zeros(4)) == 1
    assert wilcoxon_signed_rank([1.0, -1.0]) == 1


def test_signed_ranks_refuse_what_is_missing(refused):
    for differences in ([], [1.0, np.nan]):
        with refused("differences"):
            wilcoxon_signed_rank(differences)


def test_the_interval_of_a_mean_over_the_levels_of_its_index():
    index = pd.MultiIndex.from_product([["white", "shot"], [1, 2]], names=["environment", "seed"])
    values = pd.Series([1.0, 3.0, 1.0, 3.0], index)
    assert mean_interval(values) == {"mean": 2.0, "low": 1.0, "high": 3.0}
    assert mean_interval(values, ["environment"]) == {"mean": 2.0, "low": 1.0, "high": 3.0}  # the seeds are rows of its cells


def test_students_interval_as_scipy_has_it():
    values = pd.Series([0.1, 0.4, -0.2, 0.3, 0.9])
    low, high = scipy.stats.ttest_1samp(values, 0).confidence_interval(0.95)
    assert t_interval(values) == pytest.approx({"mean": 0.3, "low": low, "high": high})
    assert t_interval(values[:1]) == {"mean": 0.1, "low": None, "high": None}
