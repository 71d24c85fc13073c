"""Adam as one fused operation, for training the networks of sections 2.2 and 2.3 of the paper.

Memory bandwidth limits a training step of the enhancer with its 13.7 million weights. Adam in Keras consists of about ten
operations, each of which reads and writes arrays of that size. TensorFlow has a fused operation, which reads the gradient,
the moments and the weights once, and writes the moments and the weights once. The mathematics is the same:

    m += (1 - beta_1) * (g - m)      v += (1 - beta_2) * (g^2 - v)
    w -= learning_rate * sqrt(1 - beta_2^t) / (1 - beta_1^t) * m / (sqrt(v) + epsilon)

There is one difference. The fused operation computes 1 - beta_2 from beta_2 in float32, which for beta_2 = 0.999 gives
0.001 times 0.99998713. The factor scales v. The learning rate and epsilon are corrected for it, so that the weights change as with
Adam in Keras.
"""

from typing import NamedTuple

import numpy as np

from enhsim_tf.common.backend import keras, tf


def fused_adam(learning_rate: float | keras.optimizers.schedules.LearningRateSchedule, **settings: object) -> keras.optimizers.Adam:
    """Creates a Keras Adam optimiser that updates each variable by one fused operation.

    Only the update method of this object is replaced. Keras treats and saves it as a standard Adam optimiser.

    Args:
        learning_rate: The learning rate, or a schedule of it.
        **settings: Further arguments of `keras.optimizers.Adam`.

    Returns:
        The optimiser.
    """
    adam = keras.optimizers.Adam(learning_rate, **settings)

    def update_step(gradient: tf.Tensor, variable: tf.Variable, learning_rate: tf.Tensor) -> None:
        index = adam._get_variable_index(variable)
        # the fused operation needs the handles of the TensorFlow variables, which Keras wraps
        held = (getattr(each, "_value", each) for each in (variable, adam._momentums[index], adam._velocities[index]))
        apply_adam(adam, *held, gradient, adam_step(adam, learning_rate))

    adam.update_step = update_step
    return adam


class AdamStep(NamedTuple):
    """Scalars of one step of Adam, which are the same for all weights."""

    learning_rate: tf.Tensor
    beta1_power: tf.Tensor
    beta2_power: tf.Tensor
    epsilon: float


def adam_step(adam: keras.optimizers.Adam, learning_rate: tf.Tensor | None = None) -> AdamStep:
    """Computes the scalars of the optimiser's next step.

    Args:
        adam: The optimiser, whose settings and iteration counter are used.
        learning_rate: The learning rate. None uses the optimiser's learning rate at the current iteration.

    Returns:
        The scalars for `apply_adam`.
    """
    # corrects for the rounding of beta_2 to float32, see the docstring of this module
    rounding = float(np.sqrt((1 - np.float32(adam.beta_2)) / (1 - adam.beta_2)))
    step = tf.cast(adam.iterations + 1, tf.float32)
    rate = adam.learning_rate if learning_rate is None else learning_rate
    powers = tf.pow(adam.beta_1, step), tf.pow(adam.beta_2, step)
    return AdamStep(tf.cast(rate, tf.float32) * rounding, *powers, adam.epsilon * rounding)


def apply_adam(
    adam: keras.optimizers.Adam,
    weight: tf.Variable,
    momentum: tf.Variable,
    velocity: tf.Variable,
    gradient: tf.Tensor,
    step: AdamStep,
) -> tf.Operation:
    """Updates a variable and its two moments by one fused operation. It does not advance the optimiser's iteration counter.

    Args:
        adam: The optimiser, whose settings are used.
        weight: The variable.
        momentum: First moment of the gradient.
        velocity: Second moment of the gradient.
        gradient: The gradient.
        step: The scalars of this step, from `adam_step`.

    Returns:
        The operation.
    """
    return tf.raw_ops.ResourceApplyAdam(
        var=weight.handle,
        m=momentum.handle,
        v=velocity.handle,
        beta1_power=step.beta1_power,
        beta2_power=step.beta2_power,
        lr=step.learning_rate,
        beta1=adam.beta_1,
        beta2=adam.beta_2,
        epsilon=step.epsilon,
        grad=gradient,
    )
