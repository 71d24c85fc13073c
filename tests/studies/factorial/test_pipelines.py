"""The cells have the signal and the noise that their names say, and those of the study of robustness where they agree."""

import numpy as np
import pytest

from enhsim_tf.common.stages import Stages
from studies.common.settings import make_settings
from studies.factorial.cells import CELLS, DETECTORS, PAPER_CELL, REFERENCES, Cell
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
    extracted = one.extracted(*cell.source)
    assert extracted.shape == (90, 500)
    for window in noise:
        assert np.abs(extracted - window).max(axis=1).min() < 1e-5  # each is one of the extracted windows


def test_the_residual_is_telemetry_minus_the_signal_and_keeps_its_scale(without_networks):
    residual, averaged = (
        without_networks.extracted(*Cell("many", kind, "ridge", "autoregression").source) for kind in ("residual", "moving average")
    )
    assert np.std(residual) == pytest.approx(0.1, rel=0.1)  # the noise of the example telemetry
    assert np.std(averaged) == pytest.approx(0.1 * np.sqrt(1 - 1 / 25), rel=0.05)  # what a moving average of 25 samples leaves


def test_few_and_many_windows_are_those_of_the_two_pipelines(without_networks):
    one = without_networks
    assert [len(one.training_starts(windows)) for windows in ("few", "many")] == [40, 90]
    paper = one.data.windows("train", 40, "training windows")
    assert np.array_equal(one.pairs(one.training_starts("few"))[1], paper["target"])


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


def test_every_cell_is_judged_once_by_every_detector(tmp_path, monkeypatch):
    one = Pipelines(Replicate(make_settings("smoke", **SMALL), Stages(tmp_path)))
    monkeypatch.setattr(one, "judged", lambda cell: [{"detector": name, "alarms": 1, "windows": 2} for name in DETECTORS])
    table = one.tables()["cells"]
    assert sorted(set(table["cell"])) == sorted([*REFERENCES, *CELLS]) and len(table) == 34 * len(DETECTORS)
    assert not table.duplicated(["cell", "detector"]).any() and set(table["environment"]) == {"white"}


SAME = {
    "coarse": "coarse",
    "real": "real",
    "enhanced + GAN": PAPER_CELL,
    "enhanced + AR": Cell("few", "moving average", "network", "autoregression"),
    "residual + convolutional GAN": Cell("many", "residual", "network", "convolutional GAN"),
    "residual + AR": Cell("many", "residual", "network", "autoregression"),
}


@pytest.mark.usefixtures("narrow_networks")
def test_cells_that_both_studies_have_are_the_same(tmp_path):
    settings = make_settings("smoke", telemetry__noise="shot", **SMALL)
    replicate = Replicate(settings, Stages(tmp_path))
    one, arms = Pipelines(replicate), replicate.arms(TRAINING)
    for arm, cell in SAME.items():
        assert np.array_equal(one.arm(cell, TRAINING), arms[arm]), arm
