"""Adam in one pass over memory.

A step of the wide enhancer is bound by how often its 13.7 million weights travel between memory and processor. Keras'
Adam is about ten operations, each a pass over arrays of that size; TensorFlow has one that reads gradient, moments and
weights once and writes moments and weights once. The mathematics is the same:

    m += (1 - beta_1) * (g - m)      v += (1 - beta_2) * (g^2 - v)
    w -= learning_rate * sqrt(1 - beta_2^t) / (1 - beta_1^t) * m / (sqrt(v) + epsilon)

The one difference is that the operation computes 1 - beta_2 from a float32 beta_2, which gives 0.99998713 of 0.001.
That scales v and is taken out of the learning rate and epsilon, so the weights move as under Keras' Adam.
"""

import numpy as np

from enhsim_tf.keras_tools.backend import keras, tf


def fused_adam(learning_rate: float | keras.optimizers.schedules.LearningRateSchedule, **settings: object) -> keras.optimizers.Adam:
    """Keras' Adam, whose update of a variable is one operation.

    The update is replaced on this one object: for Keras, and in a saved model, it stays a plain Adam.

    Args:
        learning_rate: The learning rate, or a schedule of it.
        **settings: Other settings of Keras' Adam, where they are not its defaults.
    """
    adam = keras.optimizers.Adam(learning_rate, **settings)

    def update_step(gradient: tf.Tensor, variable: tf.Variable, learning_rate: tf.Tensor) -> None:
        index = adam._get_variable_index(variable)
        # Keras wraps TensorFlow's variables; the operation wants the handles of those
        held = (getattr(each, "_value", each) for each in (variable, adam._momentums[index], adam._velocities[index]))
        apply_adam(adam, *held, gradient, learning_rate)

    adam.update_step = update_step
    return adam


def apply_adam(
    adam: keras.optimizers.Adam,
    weight: tf.Variable,
    momentum: tf.Variable,
    velocity: tf.Variable,
    gradient: tf.Tensor,
    learning_rate: tf.Tensor | None = None,
) -> tf.Operation:
    """Updates a variable and its two moments by one operation; the optimiser's count of iterations stays as it is.

    Args:
        adam: The optimiser whose settings and count of iterations are used.
        weight: The variable.
        momentum: Its first moment.
        velocity: Its second moment.
        gradient: Its gradient.
        learning_rate: The learning rate; None takes the optimiser's at this iteration.
    """
    # beta_2 as float32 gives another 1 - beta_2, see above
    rounding = float(np.sqrt((1 - np.float32(adam.beta_2)) / (1 - adam.beta_2)))
    step = tf.cast(adam.iterations + 1, tf.float32)
    rate = adam.learning_rate if learning_rate is None else learning_rate
    return tf.raw_ops.ResourceApplyAdam(
        var=weight.handle,
        m=momentum.handle,
        v=velocity.handle,
        beta1_power=tf.pow(adam.beta_1, step),
        beta2_power=tf.pow(adam.beta_2, step),
        lr=tf.cast(rate, tf.float32) * rounding,
        beta1=adam.beta_1,
        beta2=adam.beta_2,
        epsilon=adam.epsilon * rounding,
        grad=gradient,
    )
