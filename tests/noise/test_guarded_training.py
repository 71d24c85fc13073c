"""Tests of noise training that cannot end in networks that are not finite, and of the noise that replaces them."""

import numpy as np
import pytest

from enhsim_tf.noise import guarded_training
from enhsim_tf.noise.convolutional_gan import build_statistics_discriminator
from enhsim_tf.noise.discriminator import build_discriminator
from enhsim_tf.noise.gan import NoiseGAN
from enhsim_tf.noise.generator import build_generator
from enhsim_tf.noise.guarded_training import train_guarded
from enhsim_tf.noise.linear_noise import linear_noise
from enhsim_tf.noise.surrogates import GaussianAutoregression

WINDOW = 60
NOISE = (0.3 * np.random.default_rng(0).standard_normal((50, WINDOW))).astype(np.float32)


def build(rate=0.001):
    generator, discriminator = build_generator(WINDOW, 4, 8, seed=0), build_discriminator(WINDOW, 8, seed=0)
    return NoiseGAN(generator, discriminator, 10, rate, scale=3.0, seed=0)


@pytest.fixture
def often(monkeypatch):
    """Checks after every five iterations."""
    monkeypatch.setattr(guarded_training, "_RECORD_EVERY", 5)


def weights_of(gan):
    return [*gan.generator.get_weights(), *gan.discriminator.get_weights()]


def test_training_that_does_not_diverge_is_the_plain_training_to_the_bit(often):
    plain, notes = build(), []
    plain.fit(NOISE, 12, verbose=False)
    for one, other in zip(weights_of(plain), weights_of(train_guarded(build, NOISE, 12, False, note=notes.append)), strict=True):
        np.testing.assert_array_equal(one, other)
    assert notes == []


def breaking(gan, at):
    """Makes a weight NaN in the given iteration."""
    step, calls = gan._step, []

    def broken(noise):
        step(noise)
        calls.append(0)
        if len(calls) == at:
            gan.generator.trainable_variables[0].assign(gan.generator.trainable_variables[0] * np.nan)

    gan._step = broken
    return gan


def test_training_goes_on_from_the_last_good_state_with_a_smaller_rate(often, monkeypatch):
    built, notes, counted = [], [], []

    def build_one():
        built.append(breaking(build(), 8) if not built else build())
        return built[-1]

    gan = train_guarded(build_one, NOISE, 12, False, counted.append, notes.append)
    assert len(built) == 2 and gan is built[1] and all(np.isfinite(each).all() for each in weights_of(gan))
    assert float(gan.generator_optimizer.learning_rate) == pytest.approx(0.00025)
    assert notes == ["the training of the noise networks diverged before iteration 10 and went on from iteration 5 more slowly"]
    assert counted == [*range(1, 11), *range(6, 13)]
    # the same by hand: five plain iterations, then seven with the smaller rate
    first, rest = build(), build(0.00025)
    first.fit(NOISE, 5, verbose=False)
    rest.generator.set_weights(first.generator.get_weights())
    rest.discriminator.set_weights(first.discriminator.get_weights())
    rest.fit(NOISE, 7, verbose=False)
    for one, other in zip(weights_of(rest), weights_of(gan), strict=True):
        np.testing.assert_array_equal(one, other)


def test_networks_that_always_diverge_are_replaced(often):
    notes = []
    gan = train_guarded(lambda: breaking(build(), 3), NOISE, 12, False, note=notes.append)
    assert gan.latent.is_series and len(notes) == 4 and "Gaussian with the spectrum" in notes[-1]
    assert gan.generate(500, 0).std() == pytest.approx(0.3, rel=0.03)


def test_noise_that_is_much_too_large_is_no_result(often):
    notes = []

    def loud():
        gan = build()
        gan.scale = 3_000.0
        return gan

    train_guarded(loud, NOISE, 0, False, note=notes.append)
    assert len(notes) == 4 and "10 times too large" in notes[0]


def test_schedules_go_on_where_they_were():
    from enhsim_tf.keras_tools.backend import keras

    falling = keras.optimizers.schedules.PolynomialDecay(1.0, 10, 0.0)  # 1 - step / 10
    gan = build(falling)
    guarded_training._slow_down(gan, 0.25, 2)
    assert float(gan.generator_optimizer.learning_rate) == pytest.approx(0.25 * 0.8)
    assert float(gan.discriminator_optimizer.learning_rate) == pytest.approx(0.25 * 0.6)  # two steps in each iteration


def test_zero_noise_gives_zero_noise_and_noise_that_is_not_finite_is_refused(refused):
    notes = []
    gan = train_guarded(build, np.zeros((5, WINDOW), np.float32), 12, False, note=notes.append)
    assert not gan.generate(3, 0).any() and not gan.generate_series(200, 0).any() and "zero" in notes[0]
    with refused("NaN or infinity"):
        train_guarded(build, np.full((5, WINDOW), np.nan, np.float32), 12, False)


@pytest.mark.parametrize("coefficients", [[], [0.8], [1.2, -0.6]])
def test_linear_noise_has_the_spectrum_of_an_autoregression(coefficients):
    real = 2 + GaussianAutoregression(coefficients, 0.5, WINDOW).generate(400, 1)
    gan = linear_noise(real)
    generated, series = gan.generate(400, 2), gan.generate_series(400 * WINDOW, 3)

    def correlations(rows):
        centred = rows - rows.mean()
        return [np.mean(centred[..., lag:] * centred[..., : centred.shape[-1] - lag]) for lag in range(6)]

    scale = real.var()
    np.testing.assert_allclose(np.array(correlations(generated)) / scale, np.array(correlations(real)) / scale, atol=0.05)
    np.testing.assert_allclose(np.array(correlations(series)) / scale, np.array(correlations(real)) / scale, atol=0.05)
    assert generated.mean() == pytest.approx(2, abs=0.05)


def test_a_discriminator_of_windows_that_are_partly_zero_is_finite():
    windows = np.concatenate([NOISE / 0.3, np.zeros((10, WINDOW), np.float32)])
    discriminator = build_statistics_discriminator(windows, filters=4)
    assert all(np.isfinite(weight).all() for weight in discriminator.get_weights())
    assert np.isfinite(discriminator.predict_on_batch(windows[:, :, None])).all()
