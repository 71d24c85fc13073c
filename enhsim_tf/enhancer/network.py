"""The paper's enhancing network, a wide multilayer perceptron that maps coarse windows to smooth ones (section 2.2, Figure 3).

The functions work on arrays of windows. They do not depend on the noise, or on how the windows were obtained.
"""

import numpy as np

from enhsim_tf.common.backend import keras
from enhsim_tf.common.training import dense_stack, predict_windows


def build_enhancer(
    window: int = 500, hidden_units: int = 3_200, num_hidden: int = 2, seed: int = 0, initialiser: str = "he_uniform", columns: int = 1
) -> keras.Sequential:
    """Builds the paper's enhancing network, Figure 3: Dense layers of 500, 3,200, 3,200 and 500 units.

    Args:
        window: Number of samples in a window, which is the width of the first and of the last layer.
        hidden_units: Number of units in each hidden layer.
        num_hidden: Number of hidden layers.
        seed: Seed for the initial weights.
        initialiser: Keras name of the weight initialiser.
        columns: Number of coarse columns; the paper has one. The columns of one sample are adjacent in the input.

    Returns:
        An uncompiled Keras model whose input has the shape `(windows, window * columns)` and whose output has the shape
        `(windows, window)`. With the default arguments it
        has 13,697,400 parameters.
    """
    return dense_stack(window * columns, (window, *[hidden_units] * num_hidden, window), seed, "enhancer", initialiser)


def enhance(model: keras.Model, coarse: np.ndarray, batch_size: int = 1_024) -> np.ndarray:
    """Maps coarse windows to enhanced windows (step 5 of the paper's pipeline).

    Args:
        model: The enhancing network.
        coarse: Coarse windows, shape `(windows, samples)`.
        batch_size: Number of windows in each call of the network.

    Returns:
        float32 array of shape `(windows, samples)`.
    """
    return predict_windows(model, np.asarray(coarse, np.float32), batch_size)
