import keras
import numpy as np
import pytest
import tensorflow as tf

from enhsim_tf.coarse_simulator.degraded import Degraded
from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.common import convolution_maximum as fast_path
from enhsim_tf.common.convolution_maximum import convolution_maximum, num_layers_computed
from enhsim_tf.common.fused_adam import fused_adam
from enhsim_tf.paper import noise as of_paper
from tests.known_simulators import of_waves
from tests.paper.conftest import tiny_settings

WINDOW, FILTERS, WIDTH, STRIDE = 63, 14, 20, 4  # the last sample lies under no filter


def arrays(num_rows, seed=0):
    rng = np.random.default_rng(seed)
    shapes = {"rows": (num_rows, WINDOW), "kernel": (WIDTH, FILTERS), "bias": (FILTERS,), "upstream": (num_rows, FILTERS)}
    return {name: rng.normal(0, 0.3, shape).astype(np.float32) for name, shape in shapes.items()}


def by_autodiff(rows, kernel, bias, kept=None, rate=0.0):
    products = tf.nn.relu(tf.nn.conv1d(rows[:, :, None], kernel[:, None], STRIDE, "VALID") + bias)
    if kept is not None:
        products = tf.where(kept, products / (1 - rate), 0.0)
    return tf.reduce_max(products, axis=1)


def compare(given, fast, plain, tolerance=2e-6):
    found = {}
    for name, function in (("fast", fast), ("plain", plain)):

        @tf.function
        def run(rows, kernel, bias, upstream, function=function):
            with tf.GradientTape() as tape:
                tape.watch([rows, kernel, bias])
                outputs = function(rows, kernel, bias)
            return outputs, *tape.gradient(outputs, [rows, kernel, bias], upstream)

        found[name] = [array.numpy() for array in run(*(tf.constant(given[key]) for key in ("rows", "kernel", "bias", "upstream")))]
    for of_fast, of_plain in zip(found["fast"], found["plain"], strict=True):
        np.testing.assert_allclose(of_fast, of_plain, rtol=0, atol=tolerance * max(1, np.abs(of_plain).max()))
    return found["plain"]


@pytest.mark.parametrize("rate", [0.3, 0.95])  # at 0.95 some filters lose every frame
def test_gradients_with_dropped_products(rate):
    given, seed = arrays(23), tf.constant([3, 4])
    seeds = tf.unstack(tf.random.split(seed, 3))
    shapes = [tf.TensorShape((number, 11, FILTERS)) for number in (10, 10, 3)]
    kept = tf.concat([fast_path._kept(shape, rate, each) for shape, each in zip(shapes, seeds, strict=True)], axis=0)
    if rate == 0.95:
        assert not kept.numpy().any(axis=1).all()
    compare(
        given,
        lambda *given: convolution_maximum(*given, STRIDE, rate, seed),
        lambda *given: by_autodiff(*given, kept, rate),
        tolerance=2e-6 / (1 - rate),
    )


def test_mean_under_dropout_is_that_of_the_keras_layers():
    row = arrays(1)["rows"]
    model = small_discriminator(dropout=0.3)
    by_keras = keras.Sequential(model.layers[:3])
    first, draws = model.layers[0], 4_000
    many = tf.constant(np.repeat(row, draws, axis=0))
    ours = convolution_maximum(many, tf.squeeze(tf.convert_to_tensor(first.kernel), 1), first.bias.value, STRIDE, 0.3, tf.constant([5, 6]))
    theirs = by_keras(many[:, :, None], training=True).numpy()
    error = np.sqrt((ours.numpy().var(0) + theirs.var(0)) / draws)
    assert (np.abs(ours.numpy().mean(0) - theirs.mean(0)) <= 5 * error + 1e-6).all()
    assert (ours.numpy().std(0) > 0).any()


def small_discriminator(dropout=0.0):
    return of_paper.build_discriminator(tiny_settings(window=WINDOW, filters=FILTERS, narrow_units=5, dropout=dropout))


def test_training_with_dropout_draws_anew_in_each_step_and_repeats():
    rows, trained = tf.constant(np.random.default_rng(0).normal(0, 0.1, (16, WINDOW)), tf.float32), []
    for _ in range(2):
        settings = tiny_settings(window=WINDOW, filters=FILTERS, narrow_units=5, dropout=0.3, rows=16, fast=True)
        gan = of_paper.NoiseGAN(of_paper.build_generator(settings), of_paper.build_discriminator(settings), settings)
        gan.compile()
        assert isinstance(gan.discriminator.layers[0], fast_path.ConvolutionMaximum)
        convolution, *_, narrow, _ = gan.discriminator.layers
        drops = [layer.seed_generator.state for layer in (convolution.dropout, narrow)]
        before = [each.numpy().copy() for each in drops]
        gan.train_discriminator(rows[:, :, None], of_paper.labels(16, of_paper.REAL))
        assert all((old != new.numpy()).any() for old, new in zip(before, drops, strict=True))
        trained.append([weight.numpy() for weight in gan.discriminator_weights])
    for one, other in zip(*trained, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(
    "layers",
    [
        [keras.layers.Conv1D(3, 20, 4, activation="tanh"), keras.layers.GlobalMaxPooling1D()],
        [keras.layers.Conv1D(3, 20, 4, activation="relu", padding="same"), keras.layers.GlobalMaxPooling1D()],
        [keras.layers.Conv1D(3, 20, 3, activation="relu"), keras.layers.GlobalMaxPooling1D()],
        [keras.layers.Conv1D(3, 20, 4, activation="relu", use_bias=False), keras.layers.GlobalMaxPooling1D()],
        [keras.layers.Conv1D(3, 20, 4, activation="relu"), keras.layers.GlobalAveragePooling1D()],
        [keras.layers.Flatten(), keras.layers.Dense(3)],
        [keras.layers.GlobalMaxPooling1D()],
    ],
)
def test_other_layers_are_left_to_keras(layers):
    model = keras.Sequential([keras.Input((WINDOW, 1)), *layers, keras.layers.Dense(1, activation="sigmoid")])
    assert num_layers_computed(model.layers) == 0
    assert num_layers_computed(small_discriminator().layers) == 2
    assert num_layers_computed(small_discriminator(dropout=0.3).layers) == 3


def test_fused_adam_moves_the_weights_as_adam_does():
    start, rng = np.linspace(-1, 1, 50).astype(np.float32), np.random.default_rng(1)
    gradients = rng.normal(0, 10.0 ** rng.uniform(-6, 2, 50), (200, 50)).astype(np.float32)  # from far below epsilon upwards
    moved = []
    for optimizer in (fused_adam(0.01), keras.optimizers.Adam(0.01)):
        weight = keras.Variable(start)
        optimizer.build([weight])
        for gradient in gradients:
            optimizer.apply([tf.constant(gradient)], [weight])
        moved.append(weight.numpy() - start)
    np.testing.assert_allclose(moved[0], moved[1], rtol=1e-4, atol=2e-6)
    assert np.abs(moved[0]).max() > 0.1


@pytest.mark.parametrize("mode", [None, "drift", "stuck"])
def test_generated_windows_do_not_depend_on_the_chunks(mode, monkeypatch):
    from enhsim_tf.simulator import simulator as module

    waves = [SquareWaveSimulator([SquareWave(period_s=period, low=-0.5, high=0.5)]) for period in (10.0, 17.0)]
    simulator, scenario = of_waves(waves, 24), mode and Degraded(mode)
    whole = simulator.generate(23, scenario, seed=5)
    monkeypatch.setattr(module, "_CHUNK_VALUES", 4 * 24 * 2)
    assert [len(chunk) for chunk, _ in simulator.generate_labelled_chunks(23, scenario, seed=5)] == [4] * 5 + [3]
    np.testing.assert_allclose(simulator.generate(23, scenario, seed=5), whole, atol=1e-6)
    if mode is None:
        noise = simulator.noise.generate(23, np.random.default_rng([5, 1]))
        np.testing.assert_allclose(whole, simulator.generate_clean(23, seed=5) + noise, atol=1e-6)
    assert np.abs(whole - simulator.generate(23, scenario, seed=6)).max() > 0.01
