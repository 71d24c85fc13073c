"""The convolutional GAN learns a known process, and its windows have full rank."""

import numpy as np
import pytest

from enhsim_tf.common import measures
from studies.common.noise_processes import autoregressive
from studies.noise_models.networks.convolutional_gan import fit_convolutional_gan

pytestmark = pytest.mark.slow


def _noise(number: int, window: int) -> np.ndarray:
    return autoregressive(number * window, np.random.default_rng(9), coefficient=0.8, sd=0.3).reshape(number, window)


def test_a_known_process_is_recovered():
    gan = fit_convolutional_gan(_noise(100, 64), 100, seed=0)
    generated = gan.generate(500, np.random.default_rng(1))
    assert abs(generated.std() / 0.3 - 1) < 0.2
    assert abs(measures.autocorrelation(generated, 1)[1] - 0.8) < 0.1


def test_untrained_windows_have_full_rank():
    # windows from a latent vector of 16 elements fill at most 16 dimensions before a non-linearity
    windows = fit_convolutional_gan(_noise(50, 120), 0, seed=2).generate(600, np.random.default_rng(3))
    assert measures.effective_rank(windows) > 60
