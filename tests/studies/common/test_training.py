"""Networks that map windows to windows: their weights and what they compute. What training does is
compared in test_fast_keras.py.
"""

import numpy as np

from enhsim_tf.paper.enhancer import predict
from studies.common.training import dense_stack


def test_layers_and_seeds_are_independent():
    equal = dense_stack(50, (50, 50, 50), seed=0, name="equal")
    other = dense_stack(50, (50, 50), seed=1, name="other")
    first, *others = (np.ravel(layer.kernel) for layer in (*equal.layers[:2], other.layers[0]))
    for weights in others:
        assert abs(np.corrcoef(first, weights)[0, 1]) < 5 / 50


def test_a_dense_stack_is_relu_layers_and_a_linear_one():
    model = dense_stack(20, (20, 64, 64, 20), 0, "enhancer")
    coarse = np.random.default_rng(0).standard_normal((300, 20)).astype(np.float32)
    expected = coarse.astype(np.float64)
    for number, layer in enumerate(model.layers):
        expected = expected @ np.asarray(layer.kernel) + np.asarray(layer.bias)
        expected = np.maximum(expected, 0) if number < 3 else expected
    enhanced = predict(model, coarse)
    assert enhanced.dtype == np.float32
    np.testing.assert_allclose(enhanced, expected, rtol=1e-4, atol=1e-4)
