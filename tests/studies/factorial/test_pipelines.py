"""The cells have the signal and the noise that their names say, and those of the study of
robustness where they agree.
"""

import argparse
import json

import numpy as np
import pytest

from enhsim_tf.common.stages import Stages
from studies.common.settings import make_settings
from studies.factorial.__main__ import command
from studies.factorial.cells import CELLS, DETECTORS, REFERENCES, Cell
from studies.factorial.pipelines import THRESHOLD, TRAINING, Pipelines
from studies.factorial.summary import KEPT

SMALL = {"paper__num_windows": 40, "second__num_windows": 90, "robustness__num_windows": 30}
SMALL |= {"paper__iterations": 2, "paper__record_every": 1}


@pytest.fixture(scope="module")
def without_networks(tmp_path_factory):
    return Pipelines(make_settings("smoke", **SMALL), Stages(tmp_path_factory.mktemp("cache")))


def test_whole_windows_of_the_residual_are_added_to_the_signal(without_networks):
    one, cell = without_networks, Cell("many", "residual", "ridge", "whole windows")
    coarse = one.example.windows("train", 30, TRAINING)["coarse"]
    noise = one.arm(cell, TRAINING) - one.enhancer("ridge", "many")(coarse)
    extracted = one.extracted(*cell.source)
    assert extracted.shape == (90, 500)
    for window in noise:
        # each is one of the extracted windows
        assert np.abs(extracted - window).max(axis=1).min() < 1e-5


def test_the_residual_is_telemetry_minus_the_signal_and_keeps_its_scale(without_networks):
    residual, averaged = (
        without_networks.extracted(*Cell("many", kind, "ridge", "autoregression").source)
        for kind in ("residual", "moving average")
    )
    assert np.std(residual) == pytest.approx(0.1, rel=0.1)  # the noise of the example telemetry
    # what a moving average of 25 samples leaves
    assert np.std(averaged) == pytest.approx(0.1 * np.sqrt(1 - 1 / 25), rel=0.05)


def test_training_windows_are_those_of_the_two_pipelines_and_arms_are_repeatable(without_networks):
    one, cell = without_networks, Cell("few", "moving average", "ridge", "autoregression")
    assert [len(one.training_starts(windows)) for windows in ("few", "many")] == [40, 90]
    assert np.array_equal(
        one.pairs(one.training_starts("few"))[1],
        one.example.windows("train", 40, "training windows")["target"],
    )
    first, other = (one.arm(cell, purpose) for purpose in (TRAINING, THRESHOLD))
    assert first.shape == other.shape == (30, 500) and not np.allclose(first, other)
    assert np.array_equal(Pipelines(one.settings, one.stages).arm(cell, TRAINING), first)


def test_a_run_judges_every_cell_once_and_writes_table_findings_and_figure(tmp_path, monkeypatch):
    def judged(self, cell):
        alarms = {"coarse": 50, "real": 1}.get(cell, 9)
        row = {"alarms": alarms, "windows": 59, "recall": 0.5, "recall_at_real_rate": 0.25}
        return [row | {"detector": name} for name in DETECTORS]

    monkeypatch.setattr(Pipelines, "judged", judged)
    options = argparse.Namespace(cache=tmp_path / "cache", environments=("shot",), fresh=False)
    found = command.run(options, make_settings("smoke", **SMALL), tmp_path)
    table = KEPT.read(tmp_path)["cells"]
    assert set(table["cell"]) == {*REFERENCES, *CELLS} and len(table) == 26 * len(DETECTORS)
    assert not table.duplicated(["environment", "cell", "detector"]).any()
    assert found["cells"]["coarse"]["false_alarms"]["mean"] == pytest.approx(50 / 59)
    assert json.loads((tmp_path / "findings.json").read_text(encoding="utf-8")) == found
    assert 'id="watermark"' in (tmp_path / "contributions.svg").read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.usefixtures("narrow_enhancer")
def test_a_cell_of_each_network_is_its_signal_and_noise_on_the_windows_of_the_coarse_reference(
    tmp_path,
):
    settings = make_settings("smoke", paper__hidden_units=64, **SMALL).of("shot", 0)
    one = Pipelines(settings, Stages(tmp_path))
    coarse = one.arm("coarse", TRAINING)
    for cell, enhance in (
        (Cell("few", "moving average", "network", "paper's GAN"), one.example.enhance),
        (Cell("many", "residual", "network", "autoregression"), one.second_network),
    ):
        rng = np.random.default_rng(int(one.example.draw(TRAINING).integers(2**31)))
        noise = one.generator(cell).generate(len(coarse), rng)
        assert np.array_equal(one.arm(cell, TRAINING), enhance(coarse) + noise)
