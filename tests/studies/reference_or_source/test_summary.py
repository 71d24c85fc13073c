import numpy as np
import pandas as pd
import pytest

from studies.reference_or_source.summary import answer, nested_interval


@pytest.mark.parametrize(
    ("low", "mean", "high", "expected"),
    [
        (1, 6, 11, "better"),
        (1, 4, 9, "parity"),
        (1, 4, 12, "undecided"),
        (-12, -6, -1, "worse"),
        (-12, 0, 9, "undecided"),
    ],
)
def test_an_interval_has_the_answer_that_was_set_before(low, mean, high, expected):
    assert answer({"low": low / 100, "mean": mean / 100, "high": high / 100}) == expected


def test_an_interval_over_cells_has_the_variance_of_groups_and_cells():
    rng = np.random.default_rng(0)
    groups = np.repeat(np.arange(40), 10)
    values = rng.standard_normal(40)[groups] + rng.standard_normal(400)
    index = pd.MultiIndex.from_arrays([groups, np.arange(400)], names=["group", "cell"])
    interval = nested_interval(pd.Series(values, index))
    # the standard error of the mean of 40 groups of 10: sqrt((1 + 1 / 10) / 40); resampling cells
    # within groups adds a second 1 / 10
    half = 1.96 * np.sqrt((1 + 2 / 10) / 40)
    assert interval["mean"] == pytest.approx(values.mean())
    assert interval["high"] - interval["low"] == pytest.approx(2 * half, rel=0.25)
