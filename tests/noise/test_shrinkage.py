"""Outputs that follow chance are shrunk to a constant, and outputs that follow the truth are kept."""

import numpy as np
import pytest

from enhsim_tf.keras_tools.backend import tf
from enhsim_tf.noise.shrinkage import _nearly_least, shrink

NUMBER = 4_000


def squares(targets, outputs, weights):
    """Half the squared error of the sum of both outputs; the weight adds a constant of its own, which costs something."""
    return tf.reduce_mean((targets[:, 0] - tf.reduce_sum(outputs, axis=1)) ** 2) / 2 + tf.reduce_sum((weights - 3) ** 2)


def data(trusted, seed):
    """Targets, and two outputs: the first tells a share of what the target varies, the second is chance."""
    rng = np.random.default_rng(seed)
    told, chance = rng.standard_normal((2, NUMBER))
    targets = 5 + trusted * told + 0.5 * rng.standard_normal(NUMBER)
    return tf.constant(np.stack([told, chance], axis=1), tf.float32), tf.constant(targets[:, None], tf.float32)


@pytest.mark.parametrize("trusted", [0.25, 0.8])
def test_the_trust_is_the_regression_coefficient_of_held_out_data(trusted):
    learnt, held_out = data(1.0, 1), data(trusted, 2)
    found = shrink(squares, learnt, held_out, (1, 1), np.zeros(1, np.float32))
    outputs = held_out[0].numpy()
    design = np.column_stack([outputs, np.ones(NUMBER)])
    expected = np.linalg.lstsq(design, held_out[1].numpy()[:, 0], rcond=None)[0][:2]
    assert found.trust[0] == pytest.approx(expected[0], abs=0.02)
    assert found.trust[1] == pytest.approx(max(expected[1], 0), abs=0.02)
    # the constants are those of the training data: with them, the mean of the targets is met
    assert np.mean(outputs @ found.trust) + found.offset.sum() == pytest.approx(5, abs=0.05)
    assert found.weights[0] == pytest.approx(3, abs=0.01)


def test_constants_that_held_out_data_contradict_are_left():
    learnt, held_out = data(1.0, 1), data(1.0, 2)
    moved = (held_out[0], held_out[1] - 5)  # the outputs fit the held-out data as they are
    found = shrink(squares, learnt, moved, (1, 1), np.full(1, 3, np.float32))
    assert found.offset.sum() == pytest.approx(float(np.mean(learnt[0]) * (1 - found.trust[0])), abs=0.02)


def test_constants_are_preferred_where_they_are_as_good():
    chance = data(0.0, 1), data(0.0, 2)  # neither output tells anything
    found = shrink(squares, *chance, (1, 1), np.zeros(1, np.float32))
    assert (found.trust == 0).all() and found.offset.sum() == pytest.approx(5, abs=0.03)
    simplest = np.array([2.5, 2.5, 3.0])
    found = shrink(squares, *chance, (1, 1), np.zeros(1, np.float32), simplest)
    np.testing.assert_allclose([*found.offset, *found.weights], simplest, rtol=1e-6)
    worse = np.array([2.0, 2.5, 3.0])
    assert shrink(squares, *chance, (1, 1), np.zeros(1, np.float32), worse).offset.sum() == pytest.approx(5, abs=0.03)
    assert shrink(squares, data(1.0, 1), data(1.0, 2), (1, 1), np.zeros(1, np.float32), simplest).trust[0] > 0.9


def test_constants_that_the_training_data_contradict_are_not_preferred():
    outputs, targets = data(1.0, 1)
    learnt = outputs, targets - 5  # the constants are right as they are
    centre = tf.reduce_mean(outputs, axis=0, keepdims=True)
    alike = tf.repeat(centre, NUMBER, axis=0), tf.zeros((NUMBER, 1))  # held-out data that say nothing about trust
    simplest = np.array([0.0, 0.0, 3.0])
    assert shrink(squares, learnt, alike, (1, 1), np.full(1, 3, np.float32), simplest).trust[0] > 0.9
    assert shrink(squares, alike, alike, (1, 1), np.full(1, 3, np.float32), simplest).trust[0] == 0


@pytest.mark.parametrize(("told_in", "is_trusted"), [(range(10), True), ((0, 5), False)])
def test_outputs_are_trusted_if_they_help_in_more_than_a_few_blocks_of_time(told_in, is_trusted):
    """The first output tells as much of the targets in the mean over ten blocks, but either in each block, or in two of them only."""
    rng = np.random.default_rng(3)
    told, chance = rng.standard_normal((2, 10, NUMBER // 10))
    share = np.isin(np.arange(10), told_in) / len(told_in)  # its mean over the blocks is a tenth
    targets = 5 + share[:, None] * told + 0.02 * rng.standard_normal(told.shape)
    held_out = tf.constant(np.stack([told, chance], axis=2).reshape(-1, 2), tf.float32), tf.constant(targets.reshape(-1, 1), tf.float32)
    learnt = held_out[0], tf.constant(targets.reshape(-1, 1)[rng.permutation(NUMBER)], tf.float32)  # in which nothing is told
    found = shrink(squares, learnt, held_out, (1, 1), np.zeros(1, np.float32))
    assert (found.trust[0] > 0.05) == is_trusted
    assert (found.trust[0] == 0) == (not is_trusted)


def test_a_difference_is_sure_from_two_standard_errors_on():
    differences = np.array([0.0, 0.006] * 5)  # mean 0.003, standard deviation 0.003 * sqrt(10 / 9), standard error 0.001
    assert _nearly_least(differences - 0.00101) and not _nearly_least(differences - 0.00099)
    assert _nearly_least(np.full(10, 0.00009)) and not _nearly_least(np.full(10, 0.0002))  # without an error, one ten-thousandth


def test_a_trust_is_never_beyond_one():
    assert shrink(squares, data(1.0, 1), data(1.6, 2), (1, 1), np.zeros(1, np.float32)).trust[0] == 1


def test_rare_large_samples_are_fitted_too():
    """Constants are the logarithms of two scales: a sample in two hundred is forty times larger. Closed form: the root mean squares."""
    rng = np.random.default_rng(7)
    is_rare = rng.random(40_000) < 0.005
    values = rng.standard_normal(40_000) * np.where(is_rare, 40.0, 1.0)
    targets = tf.constant(np.stack([values, is_rare], axis=1), tf.float32)
    outputs = tf.constant(0.01 * rng.standard_normal((40_000, 2)), tf.float32)

    def loss(targets, outputs, weights):
        log_scale = tf.where(targets[:, 1] > 0.5, outputs[:, 1], outputs[:, 0])
        return tf.reduce_mean((targets[:, 0] * tf.exp(-log_scale)) ** 2 / 2 + log_scale) + tf.reduce_sum(weights**2)

    halves = [(outputs[:20_000], targets[:20_000]), (outputs[20_000:], targets[20_000:])]
    found = shrink(loss, *halves, (1, 1), np.zeros(1, np.float32))
    learnt, rare = values[:20_000], is_rare[:20_000]
    expected = [np.sqrt(np.mean(learnt[which] ** 2)) for which in (~rare, rare)]
    np.testing.assert_allclose(np.exp(found.offset), expected, rtol=0.01)
