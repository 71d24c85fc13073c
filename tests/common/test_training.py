"""Training of networks that map windows to windows: known maps to known errors, and reproducible random numbers."""

import keras
import numpy as np
import pytest

from enhsim_tf.common.training import dense_stack, fit_windows
from enhsim_tf.paper.enhancer import predict


def windows(number, samples=20, seed=0):
    return np.random.default_rng(seed).standard_normal((number, samples)).astype(np.float32)


def small(seed=0):
    return dense_stack(20, (20, 64, 64, 20), seed, "enhancer")


def test_layers_of_one_seed_are_independent():
    first, second = dense_stack(50, (50, 50, 50), seed=0, name="equal").layers[:2]
    assert abs(np.corrcoef(np.ravel(first.kernel), np.ravel(second.kernel))[0, 1]) < 5 / 50


def test_a_dense_stack_is_relu_layers_and_a_linear_one():
    model, coarse = small(), windows(300)
    expected = coarse.astype(np.float64)
    for number, layer in enumerate(model.layers):
        expected = expected @ np.asarray(layer.kernel) + np.asarray(layer.bias)
        expected = np.maximum(expected, 0) if number < 3 else expected
    enhanced = predict(model, coarse, batch_size=128)
    assert enhanced.dtype == np.float32
    np.testing.assert_allclose(enhanced, expected, rtol=1e-4, atol=1e-4)


def test_known_linear_map_is_learnt_to_a_known_error():
    # the target is a linear map of the source plus noise that nobody can learn: the held-out error is the noise's variance
    noise_sd, (basis, _) = 0.3, np.linalg.qr(windows(20, seed=1))

    def pairs(number, seed):
        factors = 2 * windows(number, 3, seed=seed)
        clean = factors @ basis[3:6]
        return factors @ basis[:3], clean, clean + noise_sd * windows(number, seed=seed + 100)

    source, _, target = pairs(3_000, 2)
    held_out, clean, noisy = pairs(1_000, 3)
    model = small()
    untrained = np.mean((predict(model, held_out) - noisy) ** 2)
    losses = fit_windows(model, source, target, 15, 50, seed=0)
    enhanced = predict(model, held_out)
    error = np.mean((enhanced - noisy) ** 2)
    assert untrained > np.var(clean) > 5 * noise_sd**2  # the untrained error is far above the noise
    assert error == pytest.approx(np.mean((noisy - clean) ** 2), rel=0.1)
    assert np.mean((enhanced - clean) ** 2) < 0.1 * noise_sd**2  # the noise is averaged away, not learnt
    assert losses.shape == (15,) and losses[-1] < losses[0]


def test_every_window_is_seen_once_an_epoch_in_an_order_drawn_anew():
    # a network that answers the sum of its weight and moves not at all: the batch losses tell the order of the targets
    class Order(keras.callbacks.Callback):
        losses = []

        def on_train_batch_end(self, batch, logs=None):
            self.losses.append(logs["loss"] * (batch + 1))  # Keras gives the mean so far

    model = keras.Sequential([keras.Input((1,)), keras.layers.Dense(1, kernel_initializer="zeros")])
    targets = np.sqrt(np.arange(12, dtype=np.float32))[:, None]
    fit_windows(model, targets, targets, 3, 1, seed=0, learning_rate=0.0, callbacks=[Order()])
    sums = np.array(Order.losses).reshape(3, 12)
    orders = np.round(np.diff(sums, axis=1, prepend=0)).astype(int)
    assert np.sort(orders, axis=1).tolist() == [list(range(12))] * 3
    assert len({tuple(order) for order in orders}) == 3 and list(range(12)) not in orders.tolist()


@pytest.mark.slow
def test_all_random_numbers_depend_on_the_seeds_only():
    def run(global_seed, weights_seed, order_seed):
        keras.utils.set_random_seed(global_seed)  # must not matter
        model, inputs = small(weights_seed), windows(150)
        losses = fit_windows(model, inputs, np.cumsum(inputs, axis=1), 3, 15, seed=order_seed)
        return losses, np.concatenate([weight.ravel() for weight in model.get_weights()])

    first, again, other_weights, other_order = run(1, 0, 0), run(2, 0, 0), run(1, 5, 0), run(1, 0, 5)
    for values, same, *others in zip(first, again, other_weights, other_order, strict=True):
        assert (values == same).all() and all((values != other).any() for other in others)
