from types import SimpleNamespace

import numpy as np
import pytest

from enhsim_tf.paper.claims import (
    BASIC,
    CLAIMS,
    NOT_MEASURED,
    NOT_REPRODUCED,
    OURS,
    PARTLY,
    REPRODUCED,
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
def test_basic_limits_decide_first_and_our_hurdles_never(measured, expected):
    limits = tuple(
        Limit(name, name, high=1, decides=kind)
        for name, kind in (("a", BASIC), ("b", WHOLE), ("c", OURS))
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
    assert binomial_interval(0.5, 100) == pytest.approx(
        (0.4038, 0.5962), abs=1e-4
    )  # Wilson's, of a textbook
    assert verdict(LIMITS["C5"], balance(of_history(**history))) == expected


@pytest.mark.parametrize(
    ("settles", "expected"),
    [(100, PARTLY), (500, REPRODUCED), (1_500, REPRODUCED), (1_600, NOT_REPRODUCED)],
)
@pytest.mark.parametrize("scale", [0.1, 0.3])  # whether the scale is right is the question of C6
def test_c4_asks_when_the_noise_stops_changing(settles, expected, scale):
    iteration = np.arange(100, 2_001, 100)
    measured = settling(of_history(sd=np.where(iteration < settles, 5 * scale, scale), lag_one=0.0))
    assert (measured["settled_at"], verdict(LIMITS["C4"], measured)) == (settles, expected)
    assert measured["final_sd_ratio"] == pytest.approx(scale / 0.1)


def test_c4_fails_noise_that_never_settles():
    flips = np.where(np.arange(20) % 2, 0.05, 0.2)
    assert verdict(LIMITS["C4"], settling(of_history(sd=flips, lag_one=0.0))) == NOT_REPRODUCED
    assert verdict(LIMITS["C4"], settling(of_history(sd=0.1, lag_one=flips))) == NOT_REPRODUCED


def test_c6_passes_noise_of_the_same_process():
    measured = resemblance(correlated(seed=1), correlated(seed=2), correlated(seed=3), seed=0)
    assert measured["real_lag_one"] == pytest.approx(0.5, abs=0.02)
    assert verdict(LIMITS["C6"], measured) == REPRODUCED


def failed(measured):
    return {limit.name for limit in LIMITS["C6"] if not limit.holds(measured)}


@pytest.mark.parametrize("lag", [0.5, -0.042])
def test_c6_fails_white_noise_where_the_noise_is_not_white(lag):
    draws = RNG(2).standard_normal((600, 501))
    weight = (1 - np.sqrt(1 - 4 * lag**2)) / (
        2 * lag
    )  # of a moving average of two samples with this lag-1 correlation
    real = (draws[:, 1:] + weight * draws[:, :-1])[:, :200] / np.sqrt(1 + weight**2)
    generated = RNG(3).standard_normal(real.shape)
    assert "lag_one_error" in failed(resemblance(generated, real, real[::-1], seed=0))


@pytest.mark.parametrize(
    ("factor", "fails"), [(1.10, set()), (1.2, {"scale_difference", "auc", "marginal_distance"})]
)
def test_c6_allows_real_noise_that_is_ten_per_cent_louder_by_every_measure(factor, fails):
    again = white(seed=3)
    assert failed(resemblance(factor * again, white(seed=2), again, seed=0)) == fails


def test_c6_fails_wholly_for_windows_that_fill_few_dimensions():
    draws = RNG(0).standard_normal((400, 16)) @ RNG(1).standard_normal((16, 100)) / 40
    assert "rank_ratio" in failed(resemblance(draws, white(seed=2), white(seed=3), seed=0))


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
    records = [{"verdict": verdict, "is_tested": True} for verdict in verdicts]
    assert title([*records, {"verdict": "does not hold", "is_tested": False}]) == sign


@pytest.mark.parametrize(
    ("value", "is_named"),
    [(1.0, False), (2.0, False), (-0.05, False), (-0.15, True), (3.15, True), (None, True)],
)
def test_a_measurement_outside_the_widened_range_is_named(value, is_named):
    records = [
        {"id": "C1", "measured": {} if value is None else {"nrmse": value}}
    ]  # the width of 1, and 5 % of 2, on each side
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
