"""The pairs of windows on which methods are tried in degraded modes."""

import numpy as np
import pytest

from enhsim_tf.common.stages import Stages
from studies.common.settings import make_settings
from studies.robustness.degraded_modes import DegradedModes
from studies.robustness.replicate import Replicate

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def modes(tmp_path_factory):
    return DegradedModes(Replicate(make_settings("smoke"), Stages(tmp_path_factory.mktemp("cache"))))


def test_the_error_of_the_coarse_signal_is_that_of_square_waves(modes):
    # of two sines of amplitudes a the square waves miss sqrt(1.5 - 4 / pi) a, each on its own; the signal is a / sqrt(2)
    coarse, truth = modes._pairs(None, 400, "nominal")
    assert np.sqrt(np.mean((coarse - truth) ** 2)) / np.std(truth) == pytest.approx(np.sqrt(3 - 8 / np.pi), rel=0.03)


def test_randomised_windows_have_the_noise_of_the_telemetry(modes):
    number = modes.settings.modes.num_learnt
    coarse, target = modes._randomised_pairs()
    assert coarse.shape == target.shape == (number - number % modes.settings.modes.windows_per_configuration, 500)
    second_difference = np.diff(target, 2)  # of white noise: variance times 1 + 4 + 1
    assert np.median(np.abs(second_difference)) / 0.6745 == pytest.approx(0.1 * np.sqrt(6), rel=0.05)
