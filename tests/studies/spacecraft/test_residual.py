"""The residual detector on labelled channels: the table, its summary, and which simulators are read."""

import dataclasses
import json

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
from enhsim_tf.keras_tools.backend import keras
from enhsim_tf.noise.surrogates import GaussianNoise
from enhsim_tf.noise.window_bootstrap import WindowBootstrap
from enhsim_tf.reproduce.settings import make_settings
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.telemanom import LabelledChannel, Labels
from studies.spacecraft import residual

WINDOW = 64
COARSE = SquareWaveSimulator([SquareWave(50, low=-1, high=1)])


@pytest.fixture(scope="module")
def rows():
    """Rows of a channel that is simulated exactly, with a fault that stands still for three windows."""
    enhancer = keras.Sequential([keras.Input((WINDOW,)), keras.layers.Dense(WINDOW)])
    enhancer.layers[0].set_weights([np.eye(WINDOW), np.zeros(WINDOW)])
    simulator = EnhancedSimulator(COARSE, enhancer, GaussianNoise(0.1, WINDOW), levels=[[0.0, 1.0], [0.05, 1.05], [-0.05, 0.95]])
    train, test = (simulator.generate_series(number, seed=seed) for number, seed in ((1_500, 1), (3_000, 2)))
    test[2_000:2_200] = test[2_000]
    none = np.zeros((0, 0), np.float32)
    channel = LabelledChannel(Labels("W-1", ((2_000, 2_200),), ("point",)), Telemetry(train), Telemetry(test), none, none)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(residual, "_SERIES", 100)
        return residual.judge_channel(
            channel, {residual.NETWORK: simulator, residual.RIDGE: simulator}, dataclasses.replace(make_settings("smoke"), seed=4)
        )


def test_each_detector_has_a_row_and_the_residual_finds_the_fault(rows):
    table = pd.DataFrame(rows).set_index("detector")
    assert set(table.index) == {*residual.RESIDUALS, *residual.CONTROLS, residual.DISCORD}
    assert (table["seed"] == 4).all() and (table["sequences"] == 1).all()
    for ending in residual.BOUNDS:  # both residuals are those of one simulator here
        alike = table.drop(columns=["seed", "channel"])
        pd.testing.assert_series_equal(alike.loc[residual.NETWORK + ending], alike.loc[residual.RIDGE + ending], check_names=False)
    for name in residual.RESIDUALS:
        assert table.loc[name, "found_at_0.01"] == 1 and table.loc[name, "false_alarms"] < 0.15 and table.loc[name, "auc_pr"] > 0.8
    assert (table["found_at_0.01"] <= table["found_at_0.05"]).all() and (table["found_at_0.05"] <= table["found_at_0.1"]).all()


def test_the_summary_is_a_median_over_channels_and_a_mean_over_seeds():
    rows = [
        {"seed": seed, "channel": channel, "detector": "residual", "false_alarms": rate, "found_at_0.01": found, "sequences": 2}
        | {"auc_pr": rate, "vus_pr": 1.0}
        for seed, channel, rate, found in [
            (0, "a", 0.0, 2),
            (1, "a", 0.2, 1),
            (0, "b", 0.5, 0),
            (1, "b", 0.5, 1),
            (0, "c", 0.9, 2),
            (1, "c", 0.7, 0),
        ]
    ]
    (found,) = residual.summarise(pd.DataFrame(rows)).to_dict("records")
    assert found["median_false_alarms"] == pytest.approx(0.5) and found["mean_false_alarms"] == pytest.approx(2.8 / 6)
    assert found["found_at_0.01"] == (4 + 2) / 2 and found["sequences"] == 6


def test_channels_ahead_are_those_where_both_scores_of_one_line_have_a_smaller_area():
    areas = {"residual": (0.9, 0.5, 0.7), "largest step": (0.8, 0.6, 0.2), "moving deviation": (0.1, 0.1, 0.8)}
    rows = [
        {
            "seed": 0,
            "channel": channel,
            "detector": name,
            "false_alarms": 0.0,
            "found_at_0.01": 1,
            "sequences": 1,
            "auc_pr": area,
            "vus_pr": 1,
        }
        for name, each in areas.items()
        for channel, area in zip("abc", each, strict=True)
    ]
    found = residual.summarise(pd.DataFrame(rows)).set_index("detector")
    assert found.loc["residual", "channels_ahead"] == 1 and found.loc["residual", "channels"] == 3


def test_the_latest_fit_of_the_channel_and_the_seed_is_read(tmp_path):
    for name, seed in (("fit A-1-aa", 0), ("fit A-1-bb", 1), ("fit A-10-cc", 1)):
        folder = tmp_path / name / "simulator"
        folder.mkdir(parents=True)
        (folder / "settings.json").write_text(json.dumps({"trained": {"seed": seed}}))
    assert residual.saved_simulator(tmp_path, "A-1", 1) == tmp_path / "fit A-1-bb" / "simulator"
    assert residual.saved_simulator(tmp_path, "A-1", 2) is None


def test_options_that_cannot_be_used_are_refused_in_one_line(capsys, tmp_path):
    for words, expected in ((["--data", str(tmp_path), "--seeds", "x"], "seeds"), (["--data", str(tmp_path)], "labeled_anomalies.csv")):
        assert residual.main([*words, "--out", str(tmp_path / "out")]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert expected in line


def test_the_simulator_without_a_network_is_fitted_by_ridge_regression():
    values = np.sin(2 * np.pi * np.arange(2_000) / 50) + 0.1 * np.random.default_rng(0).standard_normal(2_000)
    none = np.zeros((0, 0), np.float32)
    channel = LabelledChannel(Labels("W-1", (), ()), Telemetry(values.astype(np.float32)), Telemetry(values.astype(np.float32)), none, none)
    simulator = residual.ridge_simulator(channel, make_settings("smoke"))
    assert simulator.trained["enhancer"] == "ridge" and type(simulator.noise) is WindowBootstrap
    assert simulator.noise_sd == pytest.approx(0.1, rel=0.2)
