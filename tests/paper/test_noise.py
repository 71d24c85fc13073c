import numpy as np
import pytest
import tensorflow as tf

from enhsim_tf.paper import noise
from enhsim_tf.paper.settings import make_settings
from tests.paper.conftest import tiny_settings


def weights_of(network):
    return [np.array(weight) for weight in network.get_weights()]


def num_moved(network, before):
    return sum(
        not np.array_equal(old, new) for old, new in zip(before, weights_of(network), strict=True)
    )


def make_gan(**changed):
    settings = tiny_settings(**changed)
    return noise.connect(
        noise.build_generator(settings), noise.build_discriminator(settings), settings
    )


def real_rows(number=60, rng=None):
    rng = rng or np.random.default_rng(0)
    return (0.1 * rng.standard_normal((number, 100))).astype(np.float32)


def test_a_centred_average_leaves_nothing_of_a_straight_line_and_a_trailing_one_its_lag():
    line = 0.5 * np.arange(60.0)
    for average, left in (("centred", 0.0), ("trailing", 0.5 * 12)):
        extracted, mean = noise.extract_noise(line, 25, average)
        np.testing.assert_allclose(extracted, left, atol=1e-5)
        assert len(extracted) == len(mean) == 60 - 25 + 1


def test_extracted_white_noise_has_the_variance_of_the_closed_form():
    values = np.random.default_rng(0).standard_normal(200_000)
    assert np.var(noise.extract_noise(values, 25)[0]) == pytest.approx(1 - 1 / 25, rel=0.01)


def test_the_networks_are_those_of_figures_9_and_10():
    settings = make_settings()
    generator, discriminator = noise.build_generator(settings), noise.build_discriminator(settings)
    assert (generator.input_shape, generator.output_shape, generator.count_params()) == (
        (None, 16),
        (None, 500, 1),
        33_844,
    )
    assert (
        discriminator.input_shape,
        discriminator.output_shape,
        discriminator.count_params(),
    ) == ((None, 500, 1), (None, 1), 23_051)
    kinds = [type(layer).__name__ for layer in discriminator.layers]
    assert kinds == ["Conv1D", "Dropout", "GlobalMaxPooling1D", "Dense", "Dropout", "Dense"]
    assert [type(layer).__name__ for layer in generator.layers] == [
        "Dense",
        "BatchNormalization",
        "Dense",
        "Reshape",
    ]


@pytest.mark.parametrize("fast", [False, True])
def test_a_step_of_one_network_moves_it_alone(fast):
    gan = make_gan(fast=fast, filters=4, rows=10)
    before = weights_of(gan.discriminator), weights_of(gan.generator)
    gan.train_discriminator(tf.constant(real_rows(10)[:, :, None]), noise.labels(10, noise.REAL))
    # kernel and bias of the convolution and of both Dense layers
    assert num_moved(gan.discriminator, before[0]) == 6
    assert num_moved(gan.generator, before[1]) == 0
    before = weights_of(gan.discriminator), weights_of(gan.generator)
    gan.train_generator()
    assert num_moved(gan.discriminator, before[0]) == 0
    # two Dense layers; scale, shift, mean and variance of the normalisation
    assert num_moved(gan.generator, before[1]) == 8


def test_the_combined_model_can_train_the_weights_of_the_generator_alone_and_the_discriminator_still_learns():
    gan = make_gan()
    before = weights_of(gan.discriminator)
    noise.train_gan(gan, real_rows, 0, 5)
    assert num_moved(gan.discriminator, before) == 6
    assert [id(weight) for weight in gan.combined.trainable_weights] == [
        id(weight) for weight in gan.generator.trainable_weights
    ]


def cross_entropy(predicted, tag):
    return -np.mean(np.log(predicted if tag else 1 - predicted))


def test_the_losses_are_those_of_figure_11_with_the_label_reversed_for_the_generator():
    gan, rows = make_gan(dropout=0), real_rows(30)
    latent = np.random.default_rng(1).standard_normal((60, 16)).astype(np.float32)
    gan.draw_latent = lambda number: tf.constant(latent[:number])
    judge, generated = gan.discriminator, gan.generator(latent[:30], training=False)
    p_real, p_generated = (np.asarray(judge(each)) for each in (rows[:, :, None], generated))
    gan.train_generator = lambda: None  # so that the first update can be looked at
    gan.train_step(tf.constant(rows))
    expected = (cross_entropy(p_real, 1) + cross_entropy(p_generated, 0)) / 2
    assert float(gan.trackers["discriminator_loss"].result()) == pytest.approx(expected, rel=1e-5)
    del gan.train_generator
    p_told_real = np.asarray(judge(gan.generator(latent, training=True)))
    gan.train_generator()
    assert float(gan.trackers["generator_loss"].result()) == pytest.approx(
        cross_entropy(p_told_real, 1), rel=1e-5
    )


@pytest.mark.parametrize(
    ("update", "rows", "updates"),
    [("mixed 100 + 100", 30, 1), ("mixed 200 + 200", 60, 1), ("two of 200", 60, 2)],
)
def test_each_reading_of_the_update_has_its_number_of_rows_and_updates(update, rows, updates):
    gan, seen = make_gan(update=update), []
    gan.train_discriminator = lambda data, tags: seen.append(
        (len(data), float(tf.reduce_mean(tags)))
    )
    gan.train_step(tf.constant(real_rows(rows)))
    assert seen == ([(2 * rows, 0.5)] if updates == 1 else [(rows, 1.0), (rows, 0.0)])


def test_fast_training_gives_the_weights_of_plain_keras_where_nothing_is_dropped():
    trained = []
    for fast in (False, True):
        gan = make_gan(fast=fast, dropout=0, rows=20, filters=8)
        noise.train_gan(gan, real_rows, 0, 10)
        trained.append(weights_of(gan.generator) + weights_of(gan.discriminator))
    for plain, quick in zip(*trained, strict=True):
        np.testing.assert_allclose(quick, plain, rtol=1e-3, atol=1e-5)


@pytest.mark.slow
def test_the_gan_approaches_the_standard_deviation_of_white_noise():
    gan = make_gan(
        window=40,
        rows=64,
        iterations=600,
        record_every=100,
        dropout=0,
        seed=3,
        update="mixed 200 + 200",
    )
    sds = []

    def follow(iteration):
        sds.append(
            np.std(noise.generate_noise(gan.generator, 200, gan.settings, np.random.default_rng(1)))
        )

    follow(0)
    noise.train_gan(gan, lambda number, rng: real_rows(number, rng)[:, :40], 0, 600, follow)
    assert sds[0] > 0.4
    # processors round differently, and a GAN of one seed ends elsewhere
    assert 0.05 < np.mean(sds[-3:]) < 0.2


def test_the_normalisation_of_an_untrained_generator_removes_the_latent_scale():
    gans = [make_gan(latent_scale=scale) for scale in (1, 4)]
    latents = [gan.draw_latent(50) for gan in gans]
    np.testing.assert_allclose(latents[1], 4 * np.asarray(latents[0]), rtol=1e-6)
    rows = [
        np.asarray(gan.generator(latent, training=True))
        for gan, latent in zip(gans, latents, strict=True)
    ]
    np.testing.assert_allclose(rows[1], rows[0], atol=0.02)  # up to the normalisation's epsilon
