"""The GAN: which weights change in which step, the recorded history, and reproducible random numbers."""

import inspect

import keras
import numpy as np
import pytest
import tensorflow as tf

from enhsim_tf.noise import gan as noise_gan
from enhsim_tf.noise.discriminator import build_discriminator
from enhsim_tf.noise.gan import GENERATED, REAL, NoiseGAN
from enhsim_tf.noise.generator import build_generator

WINDOW, LATENT, BATCH = 60, 4, 16
NOISE = (0.1 * np.random.default_rng(0).standard_normal((64, WINDOW))).astype(np.float32)


def small(cls=NoiseGAN, seed=0, width=20, stride=4, dropout=0.0, **arguments):
    generator = build_generator(WINDOW, LATENT, hidden_units=8, seed=seed)
    discriminator = build_discriminator(WINDOW, 12, width, stride, narrow_units=5, dropout=dropout, seed=seed)
    return cls(generator, discriminator, **{"batch_size": BATCH, "seed": seed, **arguments})


def fit(gan, num_iterations=6, windows=NOISE, compiled=False, **arguments):
    """Trains for a few steps, by default without compilation, which would take longer than the steps."""
    if not compiled:
        gan._step = gan.train_step
    return gan.fit(windows, num_iterations, **{"record_every": 3, "verbose": False, **arguments})


def rows_of(windows):
    return tf.constant(np.asarray(windows, np.float32)[:, :, None])


def weights_of(model):
    return [np.asarray(weight).copy() for weight in model.weights]


def moved(before, model):
    """For each weight of `model`, whether any of its numbers changed."""
    return [bool((old != np.asarray(new)).any()) for old, new in zip(before, model.weights, strict=True)]


def same(first, second):
    return first.keys() == second.keys() and all((first[key] == second[key]).all() for key in first)


def cross_entropy(tags, judged):
    return -np.mean(tags * np.log(judged) + (1 - tags) * np.log(1 - judged))


# the paper's networks


def test_generator_of_figure_9():
    generator = build_generator()
    assert (generator.input_shape, generator.output_shape) == ((None, 16), (None, 500, 1))
    dense, normalisation, output = 16 * 64 + 64, 4 * 64, 64 * 500 + 500
    assert [layer.count_params() for layer in generator.layers] == [dense, normalisation, output, 0]
    assert generator.count_params() == dense + normalisation + output == 33_844
    assert [type(layer).__name__ for layer in generator.layers] == ["Dense", "BatchNormalization", "Dense", "Reshape"]
    assert [generator.layers[number].activation.__name__ for number in (0, 2)] == ["relu", "tanh"]


def test_discriminator_of_figure_10():
    discriminator = build_discriminator()
    assert (discriminator.input_shape, discriminator.output_shape) == ((None, 500, 1), (None, 1))
    frames = (500 - 20) // 4 + 1
    assert [layer.output.shape for layer in discriminator.layers] == [(None, frames, 500), (None, 500), (None, 25), (None, 1)]
    assert [layer.count_params() for layer in discriminator.layers] == [20 * 500 + 500, 0, 500 * 25 + 25, 25 + 1]
    assert [layer.count_params() for layer in discriminator.layers] == [10_500, 0, 12_525, 26]
    assert [discriminator.layers[number].activation.__name__ for number in (0, 2, 3)] == ["relu", "relu", "sigmoid"]


def test_dropout_stands_after_the_convolution_and_after_the_narrow_layer():
    discriminator = build_discriminator(WINDOW, 12, dropout=0.3)
    kinds = [type(layer).__name__ for layer in discriminator.layers]
    assert kinds == ["Conv1D", "Dropout", "GlobalMaxPooling1D", "Dense", "Dropout", "Dense"]
    assert [discriminator.layers[number].rate for number in (1, 4)] == [0.3, 0.3]


def test_default_networks_and_counts_are_the_paper_s():
    gan = NoiseGAN()
    assert (gan.generator.count_params(), gan.discriminator.count_params()) == (33_844, 23_051)
    assert gan.combined.layers == [gan.generator, gan.discriminator]
    defaults = {name: parameter.default for name, parameter in inspect.signature(gan.fit).parameters.items()}
    assert (gan.batch_size, defaults["num_iterations"], defaults["record_every"]) == (200, 1_000, 100)
    assert (REAL, GENERATED) == (1.0, 0.0)
    assert gan.generate(2, seed=0).shape == (2, 500)


# which weights change


class DiscriminatorStandsStill(NoiseGAN):
    """Runs only the generator's part of the step."""

    def _update_discriminator(self, rows, tags):
        pass


def test_discriminator_step_moves_every_weight_of_the_discriminator_and_none_of_the_generator():
    gan = small()
    rows = {REAL: rows_of(NOISE[:BATCH]), GENERATED: gan.generator(tf.random.stateless_normal((BATCH, LATENT), (0, 0)))}
    for _ in range(4):
        for tag, batch in rows.items():
            discriminator, generator = weights_of(gan.discriminator), weights_of(gan.generator)
            gan._update_discriminator(batch, gan._tags(tag))
            assert all(moved(discriminator, gan.discriminator)) and not any(moved(generator, gan.generator))


def test_generator_step_moves_every_trainable_weight_of_the_generator_and_none_of_the_discriminator():
    gan = small(DiscriminatorStandsStill)
    trainable = [weight.trainable for weight in gan.generator.weights]
    assert trainable.count(False) == 2  # the moving mean and variance of the batch normalisation
    for _ in range(4):
        discriminator, generator = weights_of(gan.discriminator), weights_of(gan.generator)
        gan.train_step(rows_of(NOISE))
        assert not any(moved(discriminator, gan.discriminator))
        assert all(moved(generator, gan.generator))


def test_both_move_in_the_compiled_step():
    gan = small()
    discriminator, generator = weights_of(gan.discriminator), weights_of(gan.generator)
    fit(gan, 2, compiled=True)
    assert all(moved(discriminator, gan.discriminator)) and all(moved(generator, gan.generator))


def test_discriminator_step_makes_its_tags_likelier():
    gan = small()
    real, generated = rows_of(NOISE[:BATCH]), rows_of(0.5 + NOISE[:BATCH])

    def losses():
        return [cross_entropy(tag, np.asarray(gan.discriminator(rows))) for rows, tag in ((real, REAL), (generated, GENERATED))]

    before = losses()
    for _ in range(20):
        gan._update_discriminator(real, gan._tags(REAL))
        gan._update_discriminator(generated, gan._tags(GENERATED))
    assert (np.array(losses()) < 0.9 * np.array(before)).all()


def test_generator_step_makes_generated_rows_judged_real():
    gan = small(DiscriminatorStandsStill, learning_rate=0.01)

    def judged():
        return np.mean(gan.discriminator(gan.generator(tf.random.stateless_normal((200, LATENT), (0, 0)), training=True)))

    before = judged()
    for _ in range(20):
        gan.train_step(rows_of(NOISE))
    assert 1 - judged() < 0.5 * (1 - before)


@pytest.mark.filterwarnings("default::UserWarning")
def test_the_trap_of_compiling_freezing_and_stacking():
    """The author's training loop is correct in Keras 2, but in Keras 3 the discriminator never learns."""
    generator, discriminator = build_generator(WINDOW, LATENT, 8), build_discriminator(WINDOW, 12, narrow_units=5)
    discriminator.compile("adam", "binary_crossentropy")
    discriminator.trainable = False  # meant for the stack alone
    combined = keras.Sequential([generator, discriminator])
    combined.compile("adam", "binary_crossentropy")

    before, made = weights_of(discriminator), weights_of(generator)
    with pytest.warns(UserWarning, match="does not have any trainable weights"):
        for _ in range(3):
            discriminator.train_on_batch(rows_of(NOISE[:BATCH]), np.ones((BATCH, 1)))
            combined.train_on_batch(np.ones((BATCH, LATENT)), np.ones((BATCH, 1)))
    assert not any(moved(before, discriminator))
    assert any(moved(made, generator))  # and the curves go on


# what a step is made of


class Recording(NoiseGAN):
    """Stores the training data of the discriminator instead of training it."""

    def _update_discriminator(self, rows, tags):
        self.taught = [*getattr(self, "taught", []), (np.asarray(rows)[:, :, 0], np.asarray(tags).ravel())]


@pytest.mark.parametrize("mixed", [False, True])
def test_equal_amounts_of_real_and_generated_rows_with_their_tags(mixed):
    gan = small(Recording, mixed_batch=mixed)
    gan.train_step(rows_of(NOISE))
    assert len(gan.taught) == (1 if mixed else 2)
    rows, tags = (np.concatenate(parts) for parts in zip(*gan.taught, strict=True))
    assert tags.tolist() == [REAL] * BATCH + [GENERATED] * BATCH
    known = {row.tobytes() for row in NOISE}
    assert [row.tobytes() in known for row in rows] == [True] * BATCH + [False] * BATCH
    assert len({row.tobytes() for row in rows}) > 1.5 * BATCH  # not one row over and over


@pytest.mark.parametrize("training_mode", [False, True])
def test_latent_span_and_mode_of_the_batch_normalisation(training_mode):
    # doubling the latent vector doubles what the first layer says; batch normalisation in training mode divides it out
    # again, in inference mode, before any training, it changes next to nothing
    single, double = (small(Recording, latent_span=span, generated_in_training_mode=training_mode) for span in (1.0, 2.0))
    for gan in (single, double):
        gan.generator.layers[2].set_weights([0.1 * weight for weight in gan.generator.layers[2].get_weights()])  # far from tanh's ends
        gan.train_step(rows_of(NOISE))
    before_tanh = [np.arctanh(gan.taught[1][0]) for gan in (single, double)]
    np.testing.assert_allclose(before_tanh[1], (1 if training_mode else 2) * before_tanh[0], rtol=0.05, atol=0.01)
    assert np.std(before_tanh[0]) > 0.05


def test_loss_is_binary_cross_entropy():
    rng = np.random.default_rng(0)
    tags, judged = rng.integers(0, 2, (50, 1)).astype(np.float32), rng.uniform(0.01, 0.99, (50, 1)).astype(np.float32)
    assert float(small().loss(tags, judged)) == pytest.approx(cross_entropy(tags, judged), rel=1e-5)


@pytest.mark.parametrize(("width", "stride"), [(20, 4), (20, 8), (21, 4), (3, 7)])
def test_training_sees_the_discriminator_that_was_built(width, stride):
    gan = small(width=width, stride=stride)
    for weight in gan.discriminator.weights:  # biases that are zero would hide a mistake
        weight.assign(np.random.default_rng(0).normal(0, 0.3, weight.shape))
    np.testing.assert_allclose(gan._discriminate(rows_of(NOISE)), gan.discriminator(rows_of(NOISE)), rtol=1e-5)


def test_training_drops_in_both_places_and_judging_in_none():
    gan, rows = small(dropout=0.3), rows_of(NOISE)
    convolution, _, _, narrow, _, last = gan.discriminator.layers
    narrow.set_weights([np.ones((12, 5)), np.zeros(5)])
    assert np.ptp(gan._discriminate(tf.repeat(rows[:1], 64, axis=0))) > 0  # equal rows with different outputs
    convolution.set_weights([np.zeros((20, 1, 12)), np.ones(12)])  # every product is 1: its maximum survives what is dropped
    last.set_weights([np.arange(5.0)[:, None] / 100, np.zeros(1)])
    judged = np.ravel(gan._discriminate(rows))
    assert 3 < len(set(np.round(judged, 5))) <= 2**4  # what is left of the four units with a weight
    assert np.ptp(gan.discriminator(rows)) < 1e-6


@pytest.mark.parametrize(
    "convolution",
    [
        {"activation": "tanh"},
        {"activation": "relu", "padding": "same"},
        {"activation": "relu", "use_bias": False},
        {"activation": "relu", "dilation_rate": 2},
    ],
    ids=str,
)
def test_training_sees_a_discriminator_of_another_make(convolution):
    strides = 1 if "dilation_rate" in convolution else 4
    layers = [keras.layers.Conv1D(6, 20, strides=strides, **convolution), keras.layers.GlobalMaxPooling1D()]
    discriminator = keras.Sequential([keras.Input((WINDOW, 1)), *layers, keras.layers.Dense(1, activation="sigmoid")])
    gan = NoiseGAN(build_generator(WINDOW, LATENT, 8), discriminator, batch_size=BATCH)
    for weight in discriminator.weights:
        weight.assign(np.random.default_rng(0).normal(0, 0.3, weight.shape))
    np.testing.assert_allclose(gan._discriminate(rows_of(NOISE)), discriminator(rows_of(NOISE)), rtol=1e-5)


class PlainPath(NoiseGAN):
    """Uses only the Keras layers of the discriminator."""

    def _discriminate(self, rows):
        return self.discriminator(rows, training=True)


def test_fast_path_and_plain_path_give_equal_training_curves(monkeypatch):
    calls = []

    def counted(*arguments):
        calls.append(arguments)
        return noise_gan.__dict__["original"](*arguments)

    monkeypatch.setattr(noise_gan, "original", noise_gan.convolution_maximum, raising=False)
    monkeypatch.setattr(noise_gan, "convolution_maximum", counted)
    fast, plain = small(), small(PlainPath)
    fast_history = fit(fast, 20, record_every=5, compiled=True)
    assert calls  # the fast path was taken
    calls.clear()
    plain_history = fit(plain, 20, record_every=5, compiled=True)
    assert not calls
    for key, values in plain_history.items():
        np.testing.assert_allclose(fast_history[key], values, rtol=1e-4, err_msg=key)
    for mine, theirs in zip(weights_of(fast.combined), weights_of(plain.combined), strict=True):
        np.testing.assert_allclose(mine, theirs, atol=1e-5)


# what is recorded


def judging(probability_of_positive, probability_of_negative):
    """A discriminator with two outputs: one for rows whose first sample is positive, the other for all other rows."""
    low, high = (np.log(p / (1 - p)) for p in (probability_of_negative, probability_of_positive))
    model = keras.Sequential(
        [
            keras.Input((WINDOW, 1)),
            keras.layers.Flatten(),
            keras.layers.Dense(1, activation=lambda first: tf.where(first > 0, 1.0, 0.0)),
            keras.layers.Dense(1, activation="sigmoid"),
        ]
    )
    first, answer = model.layers[1:]
    first.set_weights([np.eye(WINDOW, 1), np.zeros(1)])
    answer.set_weights([np.array([[high - low]]), np.array([low])])
    return model


def generating(value):
    """A generator with a constant output."""
    generator = build_generator(WINDOW, LATENT, 8)
    generator.layers[2].set_weights([np.zeros((8, WINDOW)), np.full(WINDOW, np.arctanh(value))])
    return generator


@pytest.mark.parametrize(
    ("real", "generated", "accuracies"),
    [
        (0.9, 0.2, (1, 1)),  # right about both
        (0.9, 0.6, (1, 0)),
        (0.4, 0.2, (0, 1)),
        (0.4, 0.6, (0, 0)),
    ],
)
def test_recorded_accuracy_and_loss_of_a_discriminator_whose_answers_are_known(real, generated, accuracies):
    gan = NoiseGAN(generating(-0.5), judging(real, generated), batch_size=BATCH)
    history = fit(gan, 0, np.full((5, WINDOW), 0.5, np.float32))
    assert (history["accuracy_real"].tolist(), history["accuracy_generated"].tolist()) == ([accuracies[0]], [accuracies[1]])
    assert history["loss_real"] == pytest.approx([-np.log(real)], rel=1e-5)
    assert history["loss_generated"] == pytest.approx([-np.log(1 - generated)], rel=1e-5)


def test_recorded_accuracy_is_the_share_judged_rightly():
    windows = np.where(np.arange(1_000)[:, None] < 750, 0.5, -0.5) * np.ones((1, WINDOW))
    gan = NoiseGAN(generating(-0.5), judging(0.9, 0.2), batch_size=4_000)
    history = fit(gan, 0, windows)
    assert history["accuracy_real"][0] == pytest.approx(0.75, abs=5 * np.sqrt(0.75 * 0.25 / 4_000))
    assert history["loss_real"][0] == pytest.approx(-0.75 * np.log(0.9) - 0.25 * np.log(0.2), rel=0.1)


def test_records_are_of_the_discriminator_without_dropout():
    gan, row = small(dropout=0.9), np.linspace(-0.5, 0.5, WINDOW)
    judged = np.asarray(gan.discriminator(rows_of([row])))
    history = fit(gan, 0, np.tile(row, (5, 1)))
    assert history["loss_real"] == pytest.approx(cross_entropy(REAL, judged), rel=1e-5)


def test_history_every_so_many_iterations_the_first_before_training():
    seen = []

    def on_record(iteration, gan):
        seen.append((iteration, weights_of(gan.generator)[0].sum()))

    gan = small()
    history = fit(gan, 7, record_every=3, on_record=on_record)
    assert set(history) == {"iteration", "accuracy_real", "accuracy_generated", "loss_real", "loss_generated"}
    assert history["iteration"].tolist() == [0, 3, 6, 7] == [iteration for iteration, _ in seen]
    assert {len(values) for values in history.values()} == {4}
    assert len({total for _, total in seen}) == 4
    untrained = fit(small(), 0)
    assert untrained["iteration"].tolist() == [0]
    assert all(untrained[key][0] == history[key][0] for key in history)


def test_recording_more_often_does_not_change_what_is_trained():
    often, seldom = small(), small()
    fit(often, 4, record_every=1)
    fit(seldom, 4, record_every=4)
    assert not any(moved(weights_of(often.combined), seldom.combined))


# reproducible random numbers, variants, output


@pytest.mark.parametrize(("dropout", "compiled"), [(0.0, False), (0.3, True)])
def test_all_random_numbers_depend_on_the_seed_only(dropout, compiled):
    def run(global_seed, seed):
        keras.utils.set_random_seed(global_seed)  # must not matter
        gan = small(seed=seed, dropout=dropout)
        return fit(gan, compiled=compiled), gan.generate(3, seed=1)

    (history, noise), (history_again, noise_again), (history_other, noise_other) = run(1, 0), run(2, 0), run(1, 5)
    assert same(history, history_again) and not same(history, history_other)
    assert (noise == noise_again).all() and (noise != noise_other).all()


def test_seed_of_the_training_alone_changes_the_training():
    first, other = (NoiseGAN(build_generator(WINDOW, LATENT, 8), build_discriminator(WINDOW, 12), BATCH, seed=seed) for seed in (0, 1))
    assert not any(moved(weights_of(first.combined), other.combined))
    fit(first, 2), fit(other, 2)
    assert all(moved(weights_of(first.combined), other.combined))


def test_same_seed_same_noise():
    gan = small()
    noise = gan.generate(30, seed=3)
    assert noise.shape == (30, WINDOW) and noise.dtype == np.float32
    assert (noise == gan.generate(30, seed=3)).all()
    assert (noise != gan.generate(30, seed=4)).all()
    np.testing.assert_allclose(gan.generate(30, seed=3, batch_size=7), noise, rtol=1e-4, atol=1e-6)
    assert len({row.tobytes() for row in noise}) == 30


def test_generated_noise_spans_the_latent_vector():
    # untrained, the batch normalisation of inference mode changes next to nothing: twice the vector, twice what tanh gets
    before_tanh = []
    for span in (1.0, 2.0):
        gan = small(latent_span=span)
        gan.generator.layers[2].set_weights([0.1 * weight for weight in gan.generator.layers[2].get_weights()])
        before_tanh.append(np.arctanh(gan.generate(20, seed=0)))
    np.testing.assert_allclose(before_tanh[1], 2 * before_tanh[0], rtol=1e-3, atol=1e-4)


def test_variants_run_and_differ():
    variants = {
        "paper": {},
        "dropout": {"dropout": 0.3},
        "mixed batch": {"mixed_batch": True},
        "training mode": {"generated_in_training_mode": True},
        "latent span": {"latent_span": 4.0},
    }
    histories = {}
    for name, arguments in variants.items():
        histories[name] = fit(small(**arguments), 4)
        assert all(np.isfinite(values).all() for values in histories[name].values())
    assert len({history["loss_real"].tobytes() for history in histories.values()}) == len(variants)


def test_scale_scales():
    gan, scaled = small(), small(scale=4.0)
    assert (scaled.generate(9, seed=0) == 4 * gan.generate(9, seed=0)).all()
    # a power of two is exact: training on noise four times as large at four times the scale is the same training
    assert same(fit(gan), fit(scaled, windows=4 * NOISE))
    assert (scaled.generate(9, seed=0) == 4 * gan.generate(9, seed=0)).all()


def test_generated_noise_stays_within_the_scale():
    gan = small(scale=3.0)
    last = gan.generator.layers[2]
    last.set_weights([100 * weight for weight in last.get_weights()])
    noise = np.abs(gan.generate(50, seed=0))
    assert noise.max() == 3.0 and np.median(noise) > 2.9


def test_configuration_is_what_generate_needs():
    gan = small(latent_span=2.0, scale=0.5)
    fit(gan, 3)
    twin = NoiseGAN(gan.generator, gan.discriminator, **gan.get_config())
    assert (twin.generate(4, seed=1) == gan.generate(4, seed=1)).all()
