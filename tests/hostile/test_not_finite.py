"""Tests that no channel ends in a model that is not finite, and that such a model is refused
wherever it comes from.
"""

import copy
import dataclasses
import warnings

import numpy as np
import pytest

from enhsim_tf.coarse.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.datasets.labelled_windows import Plan, write_windows
from enhsim_tf.fitting.fit import fit
from enhsim_tf.fitting.options import FitOptions
from enhsim_tf.noise.window_bootstrap import WindowBootstrap
from enhsim_tf.scoring.score import score
from tests.fitted_simulators import recorded
from tests.known_simulators import of_waves

TINY = FitOptions(window=64, num_windows=40, enhancer="ridge", noise="residual windows")
PLACES = np.arange(1_500)
WAVE = np.sin(2 * np.pi * PLACES / 60)
NOISE = 0.1 * np.random.default_rng(0).standard_normal(1_500)
SPIKE = np.where(PLACES == 900, 1.0, 0.0)


FITTED = {
    "a constant stretch": np.where((PLACES > 400) & (PLACES < 1_100), WAVE[400], WAVE),
    "a wave below a spike": WAVE + NOISE + 1e5 * SPIKE,
    "one value": np.ones(1_500),
    "two values": (PLACES % 97 == 0) * 3.0,
}
REFUSED = {
    "values of 1e-30": (1e-30 * (WAVE + NOISE), "another unit"),
    "values of 1e30": (1e30 * (WAVE + NOISE), "another unit"),
    "one value of 1e30": (WAVE + NOISE + 1e30 * SPIKE, "another unit"),
}


@pytest.mark.parametrize("name", FITTED)
def test_a_hostile_channel_gets_a_finite_model_without_a_warning(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        simulator = fit(recorded(FITTED[name]), options=TINY)[0]
        series, windows = simulator.generate_series(300, seed=1), simulator.generate(5, seed=1)
    assert np.isfinite(series).all() and np.isfinite(windows).all()


@pytest.mark.parametrize("name", REFUSED)
def test_a_channel_that_no_network_can_learn_is_refused_in_one_line(name, refused):
    values, word = REFUSED[name]
    with warnings.catch_warnings(), refused(word):
        warnings.simplefilter("error", RuntimeWarning)
        fit(recorded(values), options=TINY)


def broken(simulator, which):
    """The simulator with a NaN in its enhancer or its noise."""
    simulator = copy.copy(simulator)
    if which == "noise":
        simulator.noise = WindowBootstrap(np.zeros((1, simulator.window, 1)))
        simulator.noise.windows[:] = np.nan
    else:
        simulator.enhancer = dataclasses.replace(
            simulator.enhancer, bias=simulator.enhancer.bias * np.nan
        )
    return simulator


RUN = recorded(np.random.default_rng(1).standard_normal(1_500), "watts")


@pytest.fixture(scope="module")
def of_run():
    """A simulator of recorded runs whose enhancer is ridge regression."""
    values = np.convolve(RUN.values[:, 0], [0.3, 0.4, 0.3], "same") + NOISE
    return fit(recorded(values), RUN, dataclasses.replace(TINY, num_windows=60))[0]


@pytest.mark.parametrize("which", ["enhancer", "noise"])
@pytest.mark.parametrize("kind", ["waves", "runs"])
def test_what_is_not_finite_is_neither_generated_nor_scored(kind, which, of_run, refused, tmp_path):
    waves = of_waves([SquareWaveSimulator([SquareWave(40)])], 64)
    simulator = broken(waves if kind == "waves" else of_run, which)
    uses = [
        lambda: simulator.generate(3),
        lambda: simulator.generate_series(200),
        lambda: write_windows(
            tmp_path / "x.parquet",
            Plan((), 1.0, tmp_path, "", 64, 1.0, ("volts",), 0, 5, 5),
            simulator,
        ),
    ]
    if kind == "runs":
        uses.append(lambda: list(simulator.generate_copies(RUN, 1)))
    if (kind, which) == ("runs", "enhancer"):  # the noise is not scored
        uses.append(lambda: score(simulator, recorded(WAVE), RUN))
    for use in uses:
        with refused("finite", "Fit it again"):
            use()
    assert not list(tmp_path.iterdir())
