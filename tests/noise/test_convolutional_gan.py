"""The convolutional GAN: shapes, the discriminator's statistics, the rank of the generated windows, saving and training."""

import keras
import numpy as np
import pytest
from scipy.signal import lfilter

from enhsim_tf.noise.convolutional_gan import build_convolutional_generator, build_statistics_discriminator, convolutional_noise_gan
from enhsim_tf.noise.gan import NoiseGAN
from enhsim_tf.realism import measures

NOISE = np.random.default_rng(9).normal(0, 0.3, (50, 120)).astype(np.float32)


@pytest.fixture(scope="module")
def gan():
    return convolutional_noise_gan(NOISE, seed=2)


def test_any_length(gan):
    for length in (1, 50, 333):
        made = gan.generator(np.zeros((2, length + 40, 7), np.float32))
        assert made.shape == (2, length, 1)
    assert gan.generate(3, seed=0).shape == (3, 120)
    assert gan.generate_series(1_234, seed=0).shape == (1_234,)


def test_same_seed_same_noise(gan):
    np.testing.assert_array_equal(gan.generate(5, seed=1), gan.generate(5, seed=1))
    np.testing.assert_allclose(gan.generate(5, seed=1, batch_size=2), gan.generate(5, seed=1), atol=1e-6)
    assert np.abs(gan.generate(5, seed=1) - gan.generate(5, seed=2)).max() > 0.01
    again = convolutional_noise_gan(NOISE, seed=2)
    for mine, theirs in zip(gan.generator.weights, again.generator.weights, strict=True):
        np.testing.assert_array_equal(np.asarray(mine), np.asarray(theirs))


def test_every_sample_has_its_own_random_input(gan):
    # 600 windows from a 16-element latent vector fill at most 16 dimensions before a non-linearity; these fill most of 120
    windows = gan.generate(600, seed=3)
    assert measures.effective_rank(windows) > 60
    far = measures.autocorrelation(windows - windows.mean(axis=0), 60)[45:]  # beyond the 41 samples that two convolutions see
    assert np.abs(far).max() < 0.2


def test_a_series_has_no_seams(gan):
    series = gan.generate_series(120 * 400, seed=4).reshape(400, 120)
    by_place = series.std(axis=0)
    assert np.abs(by_place / by_place.mean() - 1).max() < 0.25  # 400 rows: the sd of an sd is 0.035 and more for slow scales
    steps = np.abs(np.diff(series.ravel()))
    at_seams, elsewhere = steps[119::120], np.delete(steps, np.arange(119, len(steps), 120))
    assert abs(at_seams.mean() / elsewhere.mean() - 1) < 0.15


def test_networks_load_in_safe_mode(gan, tmp_path):
    for name in ("generator", "discriminator"):
        getattr(gan, name).save(tmp_path / f"{name}.keras")
    networks = [
        keras.saving.load_model(tmp_path / f"{name}.keras", compile=False, safe_mode=True) for name in ("generator", "discriminator")
    ]
    loaded = NoiseGAN(*networks, **gan.get_config())
    np.testing.assert_array_equal(loaded.generate(4, seed=7), gan.generate(4, seed=7))
    rows = np.random.default_rng(0).normal(size=(3, 120, 1)).astype(np.float32)
    np.testing.assert_array_equal(np.asarray(loaded.discriminator(rows)), np.asarray(gan.discriminator(rows)))


def seen(discriminator):
    """Features that the discriminator concatenates before its Dense layers."""
    return keras.Model(discriminator.input, discriminator.get_layer("seen").output)


def statistics(rows):
    """The first statistics, computed with NumPy."""
    scale = np.sqrt(np.mean(rows**2, axis=1, keepdims=True))
    unit = rows / scale
    columns = [
        rows.mean(axis=1),
        np.log(scale[:, 0]),
        np.mean(unit**3, axis=1),
        np.log(np.mean(unit**4, axis=1)),
        np.log(np.mean(np.abs(unit), axis=1)),
        np.log(np.mean(np.diff(rows, axis=1) ** 2, axis=1)),
        np.log(np.mean(np.diff(rows, 2, axis=1) ** 2, axis=1)),
        np.log(np.abs(rows).max(axis=1)),
        np.log(np.abs(unit).max(axis=1)),
        np.log(np.abs(np.diff(rows, axis=1)).max(axis=1)),
        *[np.mean(unit[:, lag:] * unit[:, :-lag], axis=1) for lag in (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48)],
        *[np.mean(np.maximum(rows - threshold, 0), axis=1) for threshold in (0.5, 1, 2)],
    ]
    return np.stack(columns, axis=1)


def test_the_discriminator_standardises_statistics_by_their_variation_over_real_windows():
    rng = np.random.default_rng(1)
    real, rows = rng.normal(0.2, 0.7, (200, 400)), rng.normal(0.25, 0.8, (5, 400))
    found = np.asarray(seen(build_statistics_discriminator(real, filters=8))(rows[:, :, None].astype(np.float32)))
    of_real = statistics(real)
    expected = np.arcsinh((statistics(rows) - of_real.mean(axis=0)) / (of_real.std(axis=0) + 0.003))
    np.testing.assert_allclose(found[:, : expected.shape[1]], expected, atol=0.02)
    # twice as loud: the scale is seen, and the shape of the window apart from it
    louder = np.asarray(seen(build_statistics_discriminator(real, filters=8))(2 * rows[:, :, None].astype(np.float32)))
    moved = np.sinh(louder[:, 1]) - np.sinh(found[:, 1])
    np.testing.assert_allclose(moved, np.log(2) / (of_real[:, 1].std() + 0.003), rtol=0.01)
    np.testing.assert_allclose(louder[:, 2:5], found[:, 2:5], atol=0.01)


def test_learns_the_scale_and_the_correlation_of_coloured_noise():
    window, coefficient = 100, 0.7
    series = lfilter([1.0], [1.0, -coefficient], np.random.default_rng(0).normal(0, 0.02, 60_000)).astype(np.float32)
    real = series.reshape(-1, window)
    gan = NoiseGAN(
        build_convolutional_generator(channels=6, width=11, seed=1),
        build_statistics_discriminator(real / real.std(), filters=16, seed=1),
        batch_size=100,
        learning_rate=0.002,
        discriminator_learning_rate=0.001,
        beta_1=0.5,
        averaging=0.95,
        scale=float(real.std()),
        slow_samples=(500.0, 2_000.0, 8_000.0),
        seed=1,
    )
    before = gan.generate(300, seed=5)
    gan.fit(real, num_iterations=250, verbose=False)
    after = gan.generate(300, seed=5)
    off = [abs(measures.autocorrelation(windows, 1)[1] - coefficient) for windows in (before, after)]
    assert off[1] < 0.1 < off[0]
    assert measures.scale_difference(after, real) < 0.15
    assert measures.effective_rank(after) > 0.6 * measures.effective_rank(real[:300])


def test_the_weight_average_replaces_the_last_weights():
    noise = np.random.default_rng(0).normal(size=(40, 60)).astype(np.float32)

    def trained(averaging):
        gan = NoiseGAN(
            build_convolutional_generator(2, 5, num_slow=0, seed=1),
            build_statistics_discriminator(noise, 4, seed=1),
            batch_size=8,
            averaging=averaging,
            beta_1=0.5,
            seed=3,
        )
        steps = []
        gan._step = lambda rows: (gan.train_step(rows), steps.append([np.array(each) for each in gan.generator.trainable_variables]))
        gan.fit(noise, 4, verbose=False)
        return gan, steps

    plain, steps = trained(0.0)
    averaged, same_steps = trained(0.5)
    for last, weight in zip(steps[-1], plain.generator.trainable_variables, strict=True):
        np.testing.assert_array_equal(last, np.asarray(weight))
    for number, weight in enumerate(averaged.generator.trainable_variables):
        np.testing.assert_allclose(same_steps[-1][number], steps[-1][number], atol=1e-6)  # the steps themselves do not change
        expected = same_steps[0][number]
        for step in same_steps[1:]:
            expected = 0.5 * expected + 0.5 * step[number]
        np.testing.assert_allclose(np.asarray(weight), expected, atol=1e-6)


@pytest.mark.parametrize("num_iterations", [1, 2, 3, 10, 1_000])
def test_the_rates_are_constant_and_then_fall_along_a_cosine(num_iterations):
    gan = convolutional_noise_gan(NOISE, num_iterations)
    constant = min(round(0.6 * num_iterations), num_iterations - 1)
    for iteration in {0, constant, (constant + num_iterations) // 2, num_iterations}:
        fallen = max(0.0, (iteration - constant) / (num_iterations - constant))
        expected = 0.002 * (0.05 + 0.95 * (1 + np.cos(np.pi * fallen)) / 2)
        assert float(gan.generator_optimizer._learning_rate(iteration)) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("num_iterations", [0, 1])
def test_no_iteration_and_one(num_iterations):
    gan = convolutional_noise_gan(NOISE, num_iterations)
    before = gan.generate(2, seed=0)
    gan.fit(NOISE, num_iterations, verbose=False)
    assert np.array_equal(before, gan.generate(2, seed=0)) == (num_iterations == 0)
