"""The same pipeline on real telemetry: two channels of NASA's SMAP satellite, where they are at hand."""

import functools
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from enhsim_tf.common.stages import Stages
from enhsim_tf.reproduce.paper.data import Source
from enhsim_tf.reproduce.paper.figures import FIGURES
from enhsim_tf.reproduce.paper.pipeline import Experiment
from enhsim_tf.reproduce.settings import make_settings

ROOT = Path(__file__).parents[3]
SMAP = ROOT / ".." / "shared" / "data" / "smap" / "train"
PERIODS = {"T-1": 98.5, "A-3": 93.5}  # samples; known from the orbit

pytestmark = pytest.mark.skipif(not (SMAP / "T-1.npy").is_file(), reason="needs ../shared/data/smap beside the repository")


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Runs a channel at smoke budget, once."""

    @functools.cache
    def run(name):
        folder = tmp_path_factory.mktemp(name)
        path = SMAP / f"{name}.npy"
        arguments = [
            "--budget",
            "smoke",
            "--telemetry",
            path,
            "--column",
            "0",
            "--out",
            folder / "out",
            "--cache",
            folder / "cache",
            "--arrays",
        ]
        # in a process of its own: what TensorFlow keeps of wide networks after their training goes with it
        done = subprocess.run([sys.executable, "-m", "enhsim_tf.reproduce", *map(str, arguments)], cwd=ROOT, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        experiment = Experiment(make_settings("smoke"), Stages(folder / "cache", tell=lambda line: None), Source(path, "0"))
        return folder / "out", experiment

    return run


@pytest.mark.parametrize("name", PERIODS)
def test_every_figure_is_drawn_and_every_claim_that_can_be_is_judged(run, name):
    out, _ = run(name)
    for figure in FIGURES:
        assert (out / f"{figure}.png").read_bytes().startswith(b"\x89PNG")
        assert (out / f"{figure}.svg").stat().st_size > 0
    found = json.loads((out / "results.json").read_text(encoding="utf-8"))
    assert found["source"] == f"{name}.npy"
    measured = {claim["id"]: claim for claim in found["claims"] if claim["verdict"] != "not measured"}
    assert list(measured) == ["C1", "C2", "C4", "C5", "C6", "C7"]
    assert all(claim["value"] is None or np.isfinite(claim["value"]) for claim in measured.values())  # C4 may have no iteration
    errors = measured["C1"]["details"]
    assert 0 < errors["ridge_nrmse"] < errors["identity_nrmse"] < 1.5
    assert errors["synchronised_identity_nrmse"] < errors["identity_nrmse"], "a clock that is set is nearer than one that runs free"


@pytest.mark.parametrize("name", PERIODS)
def test_the_coarse_simulator_is_fitted_to_the_channel(run, name):
    _, experiment = run(name)
    (channel,) = experiment.data.channels
    values = np.load(SMAP / f"{name}.npy")[:, 0].astype(np.float32)
    assert np.array_equal(channel.telemetry.values, values), "the store keeps it as it is"
    assert np.array_equal(
        np.concatenate([channel.train.values, channel.test.values]), np.delete(values, np.arange(500) + len(channel.train))
    )
    (wave,) = channel.coarse.waves
    assert abs(wave.period_s / PERIODS[name] - 1) < 0.01
    assert channel.train.values.min() <= wave.low < wave.high <= channel.train.values.max()
    coarse = channel.coarse(channel.train.time_s)
    assert np.corrcoef(coarse, channel.train.values)[0, 1] > 0.7


@pytest.mark.parametrize("name", PERIODS)
def test_the_figures_show_the_channel(run, name):
    out, experiment = run(name)
    arrays = {figure: np.load(out / f"{figure}.npz", allow_pickle=False) for figure in FIGURES}
    values = np.load(SMAP / f"{name}.npy")[:, 0].astype(np.float32)
    pairs = arrays["fig02_source_target"]
    for begin, target in zip(pairs["begin"].astype(int), pairs["target"], strict=True):
        assert np.array_equal(values[begin : begin + 500], target)
    (wave,) = experiment.data.channels[0].coarse.waves
    np.testing.assert_allclose(np.unique(pairs["source"]), [wave.low, wave.high], rtol=1e-6)
    store = arrays["fig14_telemetry_store"]
    assert np.array_equal(store["values"], values[: len(store["values"])]) and store["num_samples"] == len(values)
    assert not arrays["fig04_enhanced_simulation"]["truth_is_known"]


def test_nothing_of_the_test_part_reaches_what_is_fitted(tmp_path):
    counts = {"telemetry__num_windows": 12, "enhancer__hidden_units": 4, "enhancer__epochs": 1, "noise__filters": 4}
    counts |= {"adversarial__batch_size": 8, "adversarial__num_iterations": 2, "adversarial__record_every": 1}
    values = np.load(SMAP / "A-3.npy")[:, 0]
    other, later = values.copy(), int(0.7 * len(values)) - 400  # from inside the gap after the training part
    other[later:] = 3 + np.random.default_rng(0).standard_normal(len(values) - later)
    fitted = []
    for folder, series in (("as it is", values), ("perturbed", other)):
        (tmp_path / folder).mkdir()
        np.save(tmp_path / folder / "channel.npy", series)
        stages = Stages(tmp_path / folder / "cache", tell=lambda line: None)
        fitted.append(Experiment(make_settings("full", **counts), stages, Source(tmp_path / folder / "channel.npy")))
    first, second = fitted
    assert not np.array_equal(first.data.windows("test", None)["target"], second.data.windows("test", None)["target"])
    assert first.data.channels[0].coarse.get_config() == second.data.channels[0].coarse.get_config()
    assert first.data.units == second.data.units
    for key, windows in first.data.windows("train", 40, "x").items():
        assert np.array_equal(windows, second.data.windows("train", 40, "x")[key])
    assert not np.array_equal(first.enhancer_history["val_loss"], second.enhancer_history["val_loss"]), "the test part is only looked at"
    for network in ("enhancer", "noise.generator", "noise.discriminator"):
        weights = [functools.reduce(getattr, network.split("."), experiment.simulator).get_weights() for experiment in fitted]
        assert all(np.array_equal(*pair) for pair in zip(*weights, strict=True)) and len(weights[0]) > 3
    assert np.array_equal(first.simulator.generate(3, seed=1), second.simulator.generate(3, seed=1))
