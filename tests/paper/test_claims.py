from types import SimpleNamespace

import numpy as np
import pytest

from enhsim_tf.paper.claims import (
    BASIC,
    CLAIMS,
    NOT_MEASURED,
    NOT_REPRODUCED,
    PARTLY,
    REPRODUCED,
    SHOWN,
    WHOLE,
    Limit,
    balance,
    binomial_interval,
    outside,
    resemblance,
    settling,
    title,
    verdict,
)
from enhsim_tf.paper.detectors import DETECTORS, threshold
from tests.paper.conftest import tiny_settings

LIMITS = {claim.id: claim.limits for claim in CLAIMS}
RNG = np.random.default_rng


def white(number=400, samples=100, seed=0):
    return 0.1 * RNG(seed).standard_normal((number, samples))


def correlated(number=400, samples=100, seed=0):
    """Moving averages of two samples, whose lag-1 correlation is exactly .5."""
    draws = RNG(seed).standard_normal((number, samples + 1))
    return 0.1 * (draws[:, 1:] + draws[:, :-1]) / np.sqrt(2)


def of_history(**history):
    """A pipeline with a recorded training of 2,000 iterations, every 100."""
    iteration = np.arange(100, 2_001, 100)
    settings = tiny_settings(iterations=1_000, record_every=100, rows=200)
    arrays = {
        name: np.broadcast_to(np.asarray(values, float), iteration.shape)
        for name, values in history.items()
    }
    return SimpleNamespace(
        settings=settings, history={"iteration": iteration, "real_sd": 0.1} | arrays
    )


@pytest.mark.parametrize(
    ("measured", "expected"),
    [
        ({"a": 0, "b": 0, "c": 0}, REPRODUCED),
        ({"a": 0, "b": 0, "c": 2}, REPRODUCED),
        ({"a": 0, "b": 2, "c": 0}, PARTLY),
        ({"a": 2, "b": 0, "c": 0}, NOT_REPRODUCED),
        ({"a": 1, "b": 1, "c": 1}, REPRODUCED),
        ({"a": float("nan"), "b": 0, "c": 0}, NOT_REPRODUCED),
        ({}, NOT_MEASURED),
    ],
)
def test_basic_limits_decide_first_and_shown_ones_never(measured, expected):
    limits = tuple(
        Limit(name, name, high=1, decides=kind)
        for name, kind in (("a", BASIC), ("b", WHOLE), ("c", SHOWN))
    )
    assert verdict(limits, measured) == expected


@pytest.mark.parametrize(
    ("early", "late_real", "late_generated", "expected"),
    [
        (0.9, 0.7, 0.5, REPRODUCED),
        (0.5, 0.7, 0.5, PARTLY),  # never ahead
        (0.9, 0.99, 0.01, NOT_REPRODUCED),  # accepts nearly every row
        (0.9, 0.01, 0.99, NOT_REPRODUCED),  # rejects nearly every row
        (0.9, 0.5, 0.5, REPRODUCED),
        (0.9, 0.95, 0.95, NOT_REPRODUCED),  # the generator does not keep up
        (0.9, 0.3, 0.3, NOT_REPRODUCED),
    ],
)
def test_c5_asks_for_a_discriminator_that_is_ahead_and_for_balance(
    early, late_real, late_generated, expected
):
    is_early = np.arange(100, 2_001, 100) <= 500
    history = {
        f"accuracy_{kind}": np.where(is_early, early, late)
        for kind, late in (("real", late_real), ("generated", late_generated))
    }
    # Wilson's, of a textbook
    assert binomial_interval(0.5, 100) == pytest.approx((0.4038, 0.5962), abs=1e-4)
    assert verdict(LIMITS["C5"], balance(of_history(**history))) == expected


@pytest.mark.parametrize(
    ("errors", "expected"),
    [
        ((4, 1, 1), REPRODUCED),
        ((4, 1.4, 1), REPRODUCED),
        ((1.4, 1, 1), PARTLY),  # 500 iterations are enough
        ((4, 2, 1), NOT_REPRODUCED),  # more iterations are better
    ],
)
@pytest.mark.parametrize("is_lag", [False, True])
def test_c4_compares_the_noise_around_1000_iterations_with_earlier_and_later(
    errors, expected, is_lag
):
    iteration = np.arange(100, 2_001, 100)
    error = np.select([iteration <= 500, iteration <= 1_250], errors[:2], errors[2])
    noise = {"sd": 0.1, "lag_one": 0.05 * error} if is_lag else {}
    noise = noise or {"sd": 0.1 * np.exp(0.1 * error), "lag_one": 0.0}
    measured = settling(of_history(real_lag_one=0.0, **noise))
    assert measured["error_around"] == pytest.approx(errors[1])
    assert verdict(LIMITS["C4"], measured) == expected


def test_c4_passes_a_network_that_fluctuates_as_long_as_it_is_not_better_later():
    sizes = np.where(np.arange(20) < 5, 9, np.where(np.arange(20) % 2, 1, 3))
    measured = settling(of_history(sd=0.1, lag_one=0.05 * sizes, real_lag_one=0.0))
    assert verdict(LIMITS["C4"], measured) == REPRODUCED


def failed(measured, factor=1.0):
    return {limit.name for limit in LIMITS["C6"] if not limit.holds(measured, factor)}


def test_c6_passes_noise_of_the_same_process_by_every_measure():
    measured = resemblance(correlated(seed=1), correlated(seed=2), correlated(seed=3), seed=0)
    assert measured["real_lag_one"] == pytest.approx(0.5, abs=0.02)
    assert verdict(LIMITS["C6"], measured) == REPRODUCED and not failed(measured)


def test_c6_fails_white_noise_where_the_noise_is_not_white():
    measured = resemblance(white(seed=1), correlated(seed=2), correlated(seed=3), seed=0)
    assert verdict(LIMITS["C6"], measured) == NOT_REPRODUCED
    assert {"auc_over_floor", "lag_one_error"} <= failed(measured)


def test_the_rescaled_auc_does_not_see_a_wrong_scale_or_mean():
    measured = resemblance(1 + 3 * white(seed=1), white(seed=2), white(seed=3), seed=0)
    assert measured["auc"] == pytest.approx(1, abs=0.001)
    assert measured["rescaled_auc"] == pytest.approx(0.5, abs=0.1)


def test_c6_fails_for_windows_that_fill_few_dimensions():
    draws = RNG(0).standard_normal((400, 16)) @ RNG(1).standard_normal((16, 100)) / 40
    measured = resemblance(draws, white(seed=2), white(seed=3), seed=0)
    assert {"auc_over_floor", "rank_ratio"} <= failed(measured)


@pytest.mark.parametrize(
    ("limit", "factor", "ends"),
    [
        (Limit("a", "", high=0.2), 0.5, (-np.inf, 0.1)),
        (Limit("a", "", low=0.8, high=1.25, ideal=1), 2, (0.6, 1.5)),
        (Limit("a", "", low=0.1, ideal=0.01), 2, (0.19, np.inf)),
        (Limit("a", "", high="b"), 0.5, (-np.inf, 0.3)),
    ],
)
def test_a_factor_multiplies_the_distance_of_both_ends_from_the_ideal(limit, factor, ends):
    assert limit.ends({"a": 0.0, "b": 0.6}, factor) == pytest.approx(ends)


@pytest.mark.parametrize(
    ("verdicts", "sign"),
    [
        ([REPRODUCED, REPRODUCED], "[Re]"),
        ([REPRODUCED, PARTLY], "[Re, in part]"),
        ([REPRODUCED, NOT_MEASURED], "[Re, in part]"),
        ([PARTLY, NOT_REPRODUCED], "[¬Re]"),
    ],
)
def test_the_sign_comes_from_the_claims_that_the_paper_tests(verdicts, sign):
    assert title(verdicts) == sign


@pytest.mark.parametrize(
    ("value", "is_named"),
    [(1.0, False), (2.0, False), (-0.05, False), (-0.15, True), (3.15, True), (None, True)],
)
def test_a_measurement_outside_the_widened_range_is_named(value, is_named):
    # the width of 1, and 5 % of 2, on each side
    records = [{"id": "C1", "measured": {} if value is None else {"nrmse": value}}]
    lines = outside(records, {"claims": {"C1": {"ranges": {"nrmse": [1.0, 2.0]}}}})
    assert [line.startswith("C1: nrmse") for line in lines] == [True] * is_named


@pytest.mark.parametrize("name", DETECTORS)
def test_each_detector_scores_windows_of_another_kind_higher(name):
    settings = tiny_settings(autoencoder_epochs=5)
    nominal, score = correlated(seed=1), DETECTORS[name](correlated(seed=2), settings)
    limit = threshold(score(correlated(seed=3)), 0.05)
    assert np.mean(score(nominal) > limit) < 0.12
    assert np.mean(score(3 * nominal) > limit) > 0.9


def test_the_threshold_is_the_score_of_the_conformal_rank():
    scores = np.arange(99.0)  # (99 + 1) * 0.95 = 95: the 95th smallest
    assert threshold(scores[::-1], 0.05) == 94
    assert threshold(scores[:5], 0.05) == 4
