"""What the claims are judged by, on windows whose answer is known beforehand."""

import dataclasses
import itertools
from types import SimpleNamespace

import numpy as np
import pytest

from enhsim_tf.coarse_simulator.degraded import MODES
from enhsim_tf.detection.autoencoders import DenseAutoencoder
from enhsim_tf.detection.detectors import IsolationForestOnFeatures, PCAResidual
from enhsim_tf.reproduce.paper import measurements
from enhsim_tf.reproduce.settings import DetectorSettings

WINDOW = 50
QUICK = dataclasses.replace(DetectorSettings(), num_trees=50, autoencoder_epochs=2, num_components=5)


def _normal(number, seed, sd=1.0, samples=WINDOW):
    return (sd * np.random.default_rng(seed).standard_normal((number, samples))).astype(np.float32)


# -- enhancement -----------------------------------------------------------------------------------------------------------


@pytest.fixture
def doubled():
    """A true signal that is twice the coarse one, and has no noise; each window with mean zero."""

    def part(number, seed):
        coarse = _normal(number, seed)
        coarse -= coarse.mean()
        return {"coarse": coarse, "target": 2 * coarse, "truth": 2 * coarse, "start": WINDOW * np.arange(number)}

    return part(200, 0), part(100, 1)


def test_a_perfect_enhancer_has_no_error(doubled):
    found = measurements.enhancement(lambda coarse: 2 * coarse, *doubled)
    assert found["nrmse"] == found["train_nrmse"] == 0
    assert found["identity_nrmse"] == pytest.approx(0.5, abs=1e-6)  # half of the signal is missing
    assert found["ridge_nrmse"] < 1e-4 and found["ridge_penalty_at_edge"] == 1, "a linear map without noise needs no penalty"
    assert found["ridge_nrmse"] < found["nearest_nrmse"] < 1.1, "random windows have no near ones"
    assert found["roughness"] == found["truth_roughness"] == found["target_roughness"] == pytest.approx(2 * found["coarse_roughness"])


def test_an_enhancer_that_says_nothing_has_error_one(doubled):
    found = measurements.enhancement(np.zeros_like, *doubled)
    assert found["nrmse"] == pytest.approx(1, abs=1e-6) and found["train_nrmse"] == pytest.approx(1, abs=1e-6)
    assert found["roughness"] == 0
    assert measurements.enhancement(lambda coarse: coarse, *doubled)["nrmse"] == pytest.approx(found["identity_nrmse"])


def test_errors_are_against_the_truth_and_ridge_learns_from_the_noisy_target(doubled):
    train, test = doubled
    rough = {"target": test["target"] + _normal(100, 2, sd=3)}
    found, noisy = measurements.enhancement(np.zeros_like, train, test), measurements.enhancement(np.zeros_like, train, test | rough)
    assert {key for key in found if found[key] != noisy[key]} == {"target_roughness"}
    worse = measurements.enhancement(np.zeros_like, train | {"target": train["target"] + _normal(200, 3, sd=3)}, test)
    assert worse["ridge_nrmse"] > 0.3 > found["ridge_nrmse"] and worse["ridge_penalty"] > found["ridge_penalty"]
    assert not worse["ridge_penalty_at_edge"] and worse["nearest_nrmse"] != found["nearest_nrmse"]


def test_windows_seen_in_training_are_counted(doubled):
    train, test = doubled
    train = {key: np.concatenate([values, values[:50]]) for key, values in train.items()}
    test = {key: np.concatenate([values[:75], train[key][:25]]) for key, values in test.items()}
    found = measurements.enhancement(np.zeros_like, train, test)
    assert found["distinct_coarse_windows"] == 200 and found["test_windows_seen"] == 0.25


# -- resemblance -----------------------------------------------------------------------------------------------------------


def test_real_windows_are_at_their_baseline():
    real, again = _normal(80, 0), _normal(90, 1)
    found = measurements.resemblance(again[:80], real, again, 0)
    floors = {key for key in found if key.startswith("floor_")}
    assert len(floors) == 6
    for key in floors:
        assert found[key.removeprefix("floor_")] == found[key]
    assert found["classifier_auc"] < 0.7 and found["num_windows"] == 80


def test_a_window_compared_with_itself_differs_in_nothing():
    real = _normal(80, 0)
    found = measurements.resemblance(real, real, _normal(80, 1), 0)
    assert [found[f"{name}_difference"] for name in ("scale", "lag_one")] == [0, 0] and found["marginal_distance"] == 0
    assert found["rank_ratio"] == found["roughness_ratio"] == 1 and found["rank"] == found["real_rank"]
    assert found["floor_scale_difference"] > 0, "the floor is of the other windows"


def test_planted_differences_are_found():
    real, again = _normal(80, 0), _normal(80, 1)
    twice = measurements.resemblance(2 * real, real, again, 0)
    assert twice["scale_difference"] == pytest.approx(np.log(2), abs=1e-6)
    assert twice["lag_one_difference"] == pytest.approx(0, abs=1e-6) and twice["rank_ratio"] == pytest.approx(1, abs=1e-4)
    assert twice["roughness_ratio"] == pytest.approx(2, abs=1e-4) and twice["classifier_auc"] > 0.95

    shifted = measurements.resemblance(real + 0.3 * real.std(), real, again, 0)
    assert shifted["marginal_distance"] == pytest.approx(0.3, abs=1e-4) and shifted["scale_difference"] == pytest.approx(0, abs=1e-5)

    smooth = np.repeat(_normal(80, 2, samples=WINDOW // 2), 2, axis=1)  # pairs of equal samples: lag-1 correlation one half
    assert measurements.resemblance(smooth, real, again, 0)["lag_one_difference"] == pytest.approx(0.5, abs=0.05)

    thin = _normal(80, 3, samples=2) @ _normal(2, 4)  # a sheet of two dimensions
    found = measurements.resemblance(thin, real, again, 0)
    assert found["rank"] <= 2.001 and found["rank_ratio"] == pytest.approx(found["rank"] / found["real_rank"])


# -- false alarms ----------------------------------------------------------------------------------------------------------


def test_false_alarms_of_planted_arms():
    arms = {
        "same": (_normal(1_000, 0), _normal(1_000, 1)),
        "too clean": (_normal(1_000, 2, sd=0.1), _normal(1_000, 3, sd=0.1)),
        "threshold elsewhere": (_normal(1_000, 4), _normal(1_000, 5, sd=4)),
    }
    degraded = {"nominal after all": _normal(1_000, 6), "loud": _normal(1_000, 7, sd=4)}
    found = measurements.false_alarms(arms, _normal(1_000, 8), degraded, QUICK, seed=0)
    rate, recall = found["false_alarm_rate"], found["recall"]
    assert list(found["arms"]) == list(arms) and len(found["detectors"]) == 3 and rate.shape == recall.shape == (3, 3)
    assert found["num_test_windows"] == 1_000
    # the threshold and the rate are binomial, 1 % of 1,000 each: five of their joint standard deviations
    spread = 5 * np.sqrt(2 * 0.01 * 0.99 / 1_000)
    assert (rate[0] > 0).all() and (np.abs(rate[0] - 0.01) < spread).all()
    assert (np.abs(recall[0] - (1 + 0.01) / 2) < spread).all(), "the mean of a mode nobody can see and one that everybody sees"
    assert (rate[1] > 0.99).all(), "trained too clean, everything real alarms"
    assert (rate[2] == 0).all(), "the threshold comes from the arm's held-out windows"


def test_the_rate_the_threshold_is_set_for():
    arms = {"same": (_normal(1_000, 0), _normal(1_000, 1))}
    found = measurements.false_alarms(arms, _normal(1_000, 2), {"x": _normal(20, 3)}, dataclasses.replace(QUICK, false_alarm_rate=0.2), 0)
    assert (np.abs(found["false_alarm_rate"] - 0.2) < 5 * np.sqrt(2 * 0.2 * 0.8 / 1_000)).all()


def test_detectors_are_made_from_the_settings():
    kinds = {"PCA residual": PCAResidual, "isolation forest": IsolationForestOnFeatures, "dense autoencoder": DenseAutoencoder}
    made = measurements.make_detectors(QUICK, seed=7)
    assert {name: type(detector) for name, detector in made.items()} == kinds
    pca, forest, autoencoder = made.values()
    assert (pca.num_components, forest.num_trees, autoencoder.epochs) == (5, 50, 2)
    assert pca.seed == forest.seed == autoencoder.seed == 7


# -- degraded modes and speed ----------------------------------------------------------------------------------------------


def test_degraded_error_is_zero_where_the_coarse_signal_is_the_truth():
    asked = []

    def windows(scenario):
        asked.append(scenario)
        return _normal(10, 0 if scenario is None else list(MODES).index(scenario.mode) + 1)

    found = measurements.degraded_error(lambda coarse: coarse, windows, windows, list(MODES), 0.3)
    assert list(found["modes"]) == ["nominal", *MODES]
    assert (found["nrmse"] == 0).all() and (found["identity_nrmse"] == 0).all()
    assert {(scenario.mode, scenario.severity) for scenario in asked if scenario is not None} == {(mode, 0.3) for mode in MODES}


def test_degraded_error_by_hand():
    def truth(scenario):
        return np.tile([1.0, -1.0], (4, 10)) * (1 if scenario is None else 2)

    found = measurements.degraded_error(lambda coarse: 0 * coarse, lambda scenario: np.tile([1.0, -1.0], (4, 10)), truth, ["stuck"], 1)
    assert found["nrmse"] == pytest.approx([1, 1]) and found["identity_nrmse"] == pytest.approx([0, 0.5])


def test_speed_with_a_fake_clock(monkeypatch):
    clock, calls = SimpleNamespace(now=0.0), []
    seconds = {"coarse": itertools.cycle([1.0, 2.0, 30.0, 2.0, 2.0]), "generate": itertools.cycle([8.0, 8.0, 90.0, 1.0, 8.0])}

    def work(name):
        def run(num_windows, seed):
            calls.append((name, num_windows))
            if (name, num_windows) != ("generate", 64) or len(calls) > 1:  # the first call is not timed
                clock.now += next(seconds[name])

        return run

    monkeypatch.setattr(measurements.time, "perf_counter", lambda: clock.now)
    simulator = SimpleNamespace(window=500, interval_s=2.0, generate=work("generate"), generate_coarse=work("coarse"))
    found = measurements.speed(simulator, 64)
    assert calls[0] == ("generate", 64) and len(calls) == 11
    assert found["coarse_rate"] == 64 * 500 * 2.0 / 2.0 and found["generate_rate"] == 64 * 500 * 2.0 / 8.0
    assert found["cost_ratio"] == 4


def test_speed_of_real_work_is_positive():
    simulator = SimpleNamespace(window=50, interval_s=1.0, generate=lambda number, seed: _normal(number, seed))
    simulator.generate_coarse = simulator.generate
    found = measurements.speed(simulator, 100)
    assert min(found.values()) > 0 and found["cost_ratio"] == found["coarse_rate"] / found["generate_rate"]
