"""The settings of the studies."""

import numpy as np
import pytest

from studies.common.example import draw_noise
from studies.common.settings import make_settings


@pytest.mark.parametrize("noise", ["shot", "signal_dependent"])
def test_noise_of_every_process_has_the_standard_deviation_of_the_settings(noise):
    time = np.arange(200_000)
    signal = 0.5 * np.sin(2 * np.pi * time / 480) + 0.25 * np.sin(2 * np.pi * time / 120)  # of the example telemetry
    drawn = draw_noise(noise, signal, 3.0, np.random.default_rng(0))
    assert np.std(drawn) == pytest.approx(3.0, rel=0.03)


def test_a_budget_and_changes_reach_their_groups(refused):
    made = make_settings("smoke", paper__seed=4, robustness__num_seeds=7)
    assert (made.seed, made.paper.epochs, made.robustness.num_seeds, made.robustness.num_windows) == (4, 2, 7, 200)
    assert made.of("shot", 9).noise == "shot" and made.of("shot", 9).seed == 9
    for name in ("robustness__nothing", "nothing__num_seeds", "paper__nothing"):
        with refused("nothing"):
            make_settings(**{name: 1})
