"""Network one, step 3 of the paper's pipeline: the wide MLP that maps coarse windows to smooth ones (section 2.2).

It knows windows and nothing of noise or of where windows come from.
"""

import numpy as np

from enhsim_tf.keras_tools.backend import keras
from enhsim_tf.keras_tools.training import dense_stack, predict_windows


def build_enhancer(
    window: int = 500, hidden_units: int = 3_200, num_hidden: int = 2, seed: int = 0, initialiser: str = "he_uniform"
) -> keras.Sequential:
    """Builds the paper's enhancing network, Figure 3: Dense layers of 500, 3,200, 3,200 and 500 units.

    Args:
        window: Samples of a window, the width of the first and the last layer.
        hidden_units: Units of each hidden layer.
        num_hidden: Number of hidden layers.
        seed: Seed of the weights.
        initialiser: Keras name of the weights' initialiser.

    Returns:
        An uncompiled Keras model from shape `(windows, window)` to the same; 13,697,400 parameters by default.
    """
    return dense_stack(window, (window, *[hidden_units] * num_hidden, window), seed, "enhancer", initialiser)


def enhance(model: keras.Model, coarse: np.ndarray, batch_size: int = 1_024) -> np.ndarray:
    """Maps coarse windows to enhanced ones (step 5).

    Args:
        model: The enhancing network.
        coarse: Coarse windows, shape `(windows, samples)`.
        batch_size: Windows a call of the network.

    Returns:
        float32 array of shape `(windows, samples)`.
    """
    return predict_windows(model, np.asarray(coarse, np.float32), batch_size)
