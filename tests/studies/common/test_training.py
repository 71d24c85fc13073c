"""Networks that map windows to windows: their weights and what they compute. What training does is compared in test_fast_keras.py."""

import numpy as np

from enhsim_tf.paper.enhancer import predict
from studies.common.training import dense_stack


def test_layers_and_seeds_are_independent():
    first, second = (
        np.ravel(layer.kernel)
        for layer in dense_stack(50, (50, 50, 50), seed=0, name="equal").layers[:2]
    )
    other = np.ravel(dense_stack(50, (50, 50), seed=1, name="other").layers[0].kernel)
    for each in (second, other):
        assert abs(np.corrcoef(first, each)[0, 1]) < 5 / 50


def test_a_dense_stack_is_relu_layers_and_a_linear_one():
    model, coarse = (
        dense_stack(20, (20, 64, 64, 20), 0, "enhancer"),
        np.random.default_rng(0).standard_normal((300, 20)).astype(np.float32),
    )
    expected = coarse.astype(np.float64)
    for number, layer in enumerate(model.layers):
        expected = expected @ np.asarray(layer.kernel) + np.asarray(layer.bias)
        expected = np.maximum(expected, 0) if number < 3 else expected
    enhanced = predict(model, coarse, batch_size=128)
    assert enhanced.dtype == np.float32
    np.testing.assert_allclose(enhanced, expected, rtol=1e-4, atol=1e-4)
