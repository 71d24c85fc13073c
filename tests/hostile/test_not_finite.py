"""Tests that no channel ends in a model that is not finite, and that such a model is refused wherever it comes from."""

import copy
import dataclasses
import warnings

import numpy as np
import pytest
from enhsim_tf.enhanced_simulator import training
from enhsim_tf.enhanced_simulator.fit_options import FitOptions
from enhsim_tf.enhanced_simulator.fitting import fit_simulator
from enhsim_tf.enhanced_simulator.runs.fitting import fit_run_model
from enhsim_tf.enhanced_simulator.runs.options import RunOptions
from enhsim_tf.enhanced_simulator.runs.scoring import score_run
from enhsim_tf.enhanced_simulator.scoring import ScoreOptions, score_channel
from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
from enhsim_tf.keras_tools.backend import keras

from enhsim_tf.coarse_simulator.recording import Recording, Run
from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.datasets.mix import Mix
from enhsim_tf.datasets.plan import Model, Plan
from enhsim_tf.datasets.shard import make_windows
from enhsim_tf.enhancer.network import build_enhancer
from enhsim_tf.noise.surrogates import GaussianNoise
from enhsim_tf.telemetry.series import Telemetry

pytestmark = pytest.mark.usefixtures("narrow_enhancer")
TINY = FitOptions(window=64, num_windows=40, epochs=1, noise="residual windows", enhancer="network")
PLACES = np.arange(1_500)
WAVE = np.sin(2 * np.pi * PLACES / 60)
NOISE = 0.1 * np.random.default_rng(0).standard_normal(1_500)
SPIKE = np.where(PLACES == 900, 1.0, 0.0)


def channel(values):
    return [Telemetry(np.asarray(values, np.float32), name="volts")]


FITTED = {
    "a constant stretch": np.where((PLACES > 400) & (PLACES < 1_100), WAVE[400], WAVE),
    "a wave below a spike": WAVE + NOISE + 1e5 * SPIKE,
}
REFUSED = {
    "values of 1e-30": (1e-30 * (WAVE + NOISE), "another unit"),
    "values of 1e30": (1e30 * (WAVE + NOISE), "another unit"),
    "one value of 1e30": (WAVE + NOISE + 1e30 * SPIKE, "another unit"),
    "one value": (np.ones(1_500), "constant"),
}


@pytest.mark.parametrize("name", FITTED)
def test_a_hostile_channel_gets_a_finite_model_without_a_warning(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        simulator = fit_simulator(channel(FITTED[name]), TINY, 0)
        series, windows = simulator.generate_series(300, seed=1), simulator.generate(5, seed=1)
    assert np.isfinite(series).all() and np.isfinite(windows).all()


@pytest.mark.parametrize("name", REFUSED)
def test_a_channel_that_no_network_can_learn_is_refused_in_one_line(name, refused):
    values, word = REFUSED[name]
    with warnings.catch_warnings(), refused(word):
        warnings.simplefilter("error", RuntimeWarning)
        fit_simulator(channel(values), TINY, 0)


@pytest.mark.parametrize(("failures", "is_fitted"), [(1, True), (3, False)])
def test_an_enhancer_that_diverges_is_trained_again_more_slowly(monkeypatch, failures, is_fitted):
    rates, plain = [], training.fit_windows

    def fit_windows(model, *arguments, **options):
        rate = arguments[5]
        rates.append(float(rate(0) if callable(rate) else rate))
        if len(rates) <= failures:
            return model.set_weights([weight * np.nan for weight in model.get_weights()])
        return plain(model, *arguments, **options)

    monkeypatch.setattr(training, "fit_windows", fit_windows)
    simulator = fit_simulator(channel(WAVE + NOISE), TINY, 0)
    assert np.isfinite(simulator.generate(5)).all()
    kind, said = simulator.trained["coarse"]["kind"], simulator.trained["coarse"]["said"]
    assert (kind == "square waves") == is_fitted
    if not is_fitted:  # a constant level needs no enhancer
        assert kind == "constant level" and "3 trainings that diverged" in said
    assert rates[:3] == pytest.approx([1e-3, 1e-4, 1e-5][: len(rates)])


def broken(which):
    """A simulator whose enhancer or noise has a NaN."""
    noise = GaussianNoise(np.nan if which == "noise" else 0.1, 60)
    simulator = EnhancedSimulator(SquareWaveSimulator([SquareWave(40)]), build_enhancer(60, 8, seed=0), noise)
    if which == "enhancer":
        *others, last = simulator.enhancer.get_weights()
        simulator.enhancer.set_weights([*others, last * np.nan])
    return simulator


@pytest.mark.parametrize("which", ["enhancer", "noise"])
def test_what_is_not_finite_is_neither_generated_nor_scored_nor_written(which, refused, tmp_path):
    simulator = broken(which)
    for use in (
        lambda: simulator.generate(3),
        lambda: simulator.generate_series(200),
        lambda: simulator.generate_to_parquet(tmp_path / "x.parquet", 3),
        lambda: score_channel(simulator, channel(WAVE), ScoreOptions(num_windows=20)),
        lambda: make_windows(Plan(Mix(), (Model("volts", tmp_path, 1.0, "", 60, 1.0),), 0, 5, 5), [simulator], 0),
    ):
        with refused("finite", "Fit it again"):
            use()
    assert not list(tmp_path.iterdir())


RUN = Recording((Run(np.random.default_rng(1).standard_normal((1_500, 1)).astype(np.float32)),), ("watts",))


@pytest.fixture(scope="module")
def run_model():
    """A run model whose enhancer is ridge regression."""
    values = np.convolve(RUN.parts[0].values[:, 0], [0.3, 0.4, 0.3], "same") + NOISE
    options = RunOptions(window=64, num_windows=60, noise="autoregression", enhancer="ridge", epochs=1)
    return fit_run_model(channel(values), RUN, options)[0]


@pytest.mark.parametrize("which", ["enhancer", "noise"])
def test_a_run_model_that_is_not_finite_is_neither_used_nor_saved(which, run_model, refused, tmp_path):
    model = copy.copy(run_model)
    if which == "enhancer":
        network = keras.models.clone_model(model.rung.network)
        network.set_weights([weight * np.nan for weight in model.rung.network.get_weights()])
        model.rung = dataclasses.replace(model.rung, network=network)
    else:
        model.noise = GaussianNoise(np.nan, 64)
    for use in (
        lambda: list(model.generate_copies(RUN, 1)),
        lambda: model.generate(3),
        lambda: model.generate_series(200),
        lambda: score_run(model, channel(WAVE), RUN, ScoreOptions(num_windows=20)),
    ):
        with refused("finite", "Fit it again"):
            use()
    with refused(which, "not saved"):
        model.save(tmp_path / "model")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["values of 1e-30", "one value of 1e30"])
def test_a_run_model_learns_no_channel_that_is_too_large_or_small(name, refused):
    values, word = REFUSED[name]
    with refused(word):
        fit_run_model(channel(values), RUN, RunOptions(window=64))


@pytest.mark.parametrize("which", ["enhancer", "noise"])
def test_what_is_not_finite_is_not_saved(which, refused, tmp_path):
    with refused(which, "not saved"):
        broken(which).save(tmp_path / "model")
    assert not list(tmp_path.iterdir())
