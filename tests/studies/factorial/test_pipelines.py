"""Tests that the cells have the signal and the noise that their names say, and those of the experiment on robustness where they agree."""

import dataclasses

import numpy as np
import pytest

from enhsim_tf.common.stages import Stages
from enhsim_tf.enhancer import network
from enhsim_tf.reproduce.settings import make_settings
from studies.factorial.cells import CELLS, PUBLISHED, Cell
from studies.factorial.pipelines import THRESHOLD, TRAINING, Pipelines
from studies.robustness.replicate import Replicate

SMALL = {"telemetry__num_windows": 40, "second__num_windows": 90, "robustness__num_windows": 30, "adversarial__num_iterations": 0}


@pytest.fixture(scope="module")
def without_networks(tmp_path_factory):
    return Pipelines(Replicate(make_settings("smoke", **SMALL), Stages(tmp_path_factory.mktemp("cache"))))


def test_whole_windows_of_the_residual_are_added_to_the_signal(without_networks):
    one, cell = without_networks, Cell("many", "residual", "ridge", "whole windows")
    coarse = one.data.windows("train", 30, TRAINING)["coarse"]
    noise = one.arm(cell, TRAINING) - one.enhancer("ridge", "many")(coarse)
    extracted = one.extracted(cell)
    assert extracted.shape == (90, 500)
    for window in noise:
        assert np.abs(extracted - window).max(axis=1).min() < 1e-5  # each is one of the extracted windows


def test_the_residual_is_telemetry_minus_the_signal_and_keeps_its_scale(without_networks):
    residual, averaged = (
        without_networks.extracted(Cell("many", kind, "ridge", "autoregression")) for kind in ("residual", "moving average")
    )
    assert np.std(residual) == pytest.approx(0.1, rel=0.1)  # the noise of the example telemetry
    assert np.std(averaged) == pytest.approx(0.1 * np.sqrt(1 - 1 / 25), rel=0.05)  # what a moving average of 25 samples leaves


def test_few_and_many_windows_are_those_of_the_two_pipelines(without_networks):
    one = without_networks
    assert [len(one.training_starts(windows)) for windows in ("few", "many")] == [40, 90]
    paper = one.data.windows("train", 40, "training windows")
    assert np.array_equal(one._pairs(one.training_starts("few"))[1], paper["target"])


def test_ridge_recovers_the_true_signal_from_the_coarse_one(without_networks):
    windows = without_networks.data.windows("test", None)
    error = [np.std(without_networks.enhancer("ridge", level)(windows["coarse"]) - windows["truth"]) for level in ("few", "many")]
    assert error[1] < error[0] < np.std(windows["coarse"] - windows["truth"])


def test_training_and_threshold_windows_differ_and_are_repeatable(without_networks):
    cell = Cell("few", "moving average", "ridge", "autoregression")
    first, other = (without_networks.arm(cell, purpose) for purpose in (TRAINING, THRESHOLD))
    assert first.shape == other.shape == (30, 500) and not np.allclose(first, other)
    again = Pipelines(without_networks.replicate)
    assert np.array_equal(again.arm(cell, TRAINING), first)


def test_arms_that_both_experiments_have_are_the_same(tmp_path, monkeypatch):
    wide = network.build_enhancer
    monkeypatch.setattr(network, "build_enhancer", lambda window, units=64, *more, **named: wide(window, units, *more, **named))
    settings = make_settings(
        "smoke", enhancer__hidden_units=64, **SMALL
    )  # untrained noise networks draw the same noise too, if their seeds agree
    settings = dataclasses.replace(settings, telemetry=dataclasses.replace(settings.telemetry, noise="shot"))
    replicate = Replicate(settings, Stages(tmp_path))
    one, arms = Pipelines(replicate), replicate.arms(TRAINING)
    for arm, name in PUBLISHED.items():
        assert np.array_equal(one.arm(CELLS.get(name, name), TRAINING), arms[arm]), arm
