import numpy as np
import pytest

from enhsim_tf.common.fast_keras import is_wide_dense_stack
from enhsim_tf.paper.enhancer import Pairs, build_enhancer, enhance, train_enhancer
from enhsim_tf.paper.settings import make_settings
from tests.paper.conftest import tiny_settings


def test_the_network_is_that_of_figure_3():
    network = build_enhancer(make_settings())
    assert network.count_params() == 13_697_400
    assert [layer.units for layer in network.layers] == [500, 3_200, 3_200, 500]
    assert [layer.activation.__name__ for layer in network.layers] == [
        "relu",
        "relu",
        "relu",
        "linear",
    ]


@pytest.mark.parametrize(
    ("initialisers", "limit"),
    [("by layer", np.sqrt(6 / (100 + 32))), ("he_uniform", np.sqrt(6 / 100))],
)
def test_weights_begin_with_the_initialiser_asked_for(initialisers, limit):
    # 100 inputs, 32 units
    hidden = np.asarray(build_enhancer(tiny_settings(initialisers=initialisers)).layers[1].kernel)
    assert limit * 0.99 < np.abs(hidden).max() <= limit


def test_each_epoch_has_every_pair_once_in_another_order():
    source = np.arange(7.0)[:, None]
    pairs, orders = Pairs(source, 10 * source, 3, np.random.default_rng(0)), []
    for _ in range(2):
        batches = [pairs[number] for number in range(len(pairs))]
        orders.append(np.concatenate([batch[0] for batch in batches])[:, 0])
        assert sorted(orders[-1]) == list(range(7))
        assert all((10 * inputs == outputs).all() for inputs, outputs in batches)
        pairs.on_epoch_end()
    assert list(orders[0]) != list(orders[1])


def training(settings, num_windows=300):
    rng = np.random.default_rng(0)
    source = rng.standard_normal((num_windows, settings.window)).astype(np.float32)
    return source, 0.5 * source[:, ::-1] + 0.1 * rng.standard_normal(source.shape).astype(
        np.float32
    )


def test_the_network_learns_a_map_from_noisy_targets():
    settings = tiny_settings(
        window=8, filter_width=8, hidden_units=64, epochs=15, learning_rate=0.01
    )
    source, target = training(settings, 600)
    network = build_enhancer(settings)
    history = train_enhancer(network, source, target, settings, (source[:50], target[:50]))
    assert len(history["loss"]) == len(history["val_loss"]) == 15
    error = enhance(network, source) - 0.5 * source[:, ::-1]
    assert np.sqrt(np.mean(error**2)) < 0.1  # below the noise of the targets


def test_fast_training_gives_the_weights_of_plain_keras():
    trained = []
    for fast in (False, True):
        # a kernel of 5.8 MB is trained by blocks
        settings = tiny_settings(
            window=10, filter_width=10, hidden_units=1_200, epochs=2, fast=fast
        )
        source, target = training(settings, 45)
        network = build_enhancer(settings)
        assert is_wide_dense_stack(network)
        history = train_enhancer(network, source, target, settings)
        trained.append([*network.get_weights(), np.array(history["loss"])])
    for plain, quick in zip(*trained, strict=True):
        np.testing.assert_allclose(quick, plain, rtol=2e-3, atol=2e-5)
