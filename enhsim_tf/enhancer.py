"""Network one, step 3 of the paper's pipeline: the wide MLP that maps coarse windows to smooth ones (section 2.2).

It knows windows and nothing of noise or of where windows come from.
"""

from collections.abc import Sequence

import keras
import numpy as np
import tensorflow as tf

from enhsim_tf.fused_adam import fused_adam


def dense_stack(window: int, units: Sequence[int], seed: int, name: str) -> keras.Sequential:
    """A stack of Dense layers, relu on all but the last, each with its own seeded He initialiser.

    Args:
        window: Samples of an input window.
        units: Units of each layer.
        seed: Seed of the weights.
        name: Name of the model.
    """
    model = keras.Sequential([keras.Input((window,))], name=name)
    for number, width in enumerate(units):
        last = number == len(units) - 1
        model.add(
            keras.layers.Dense(
                width,
                activation=None if last else "relu",
                kernel_initializer=keras.initializers.HeUniform(seed=seed * 1000 + number),
                name="Output" if last else f"Hidden_{number}" if number else "Input",
            )
        )
    return model


def build_enhancer(window: int = 500, hidden_units: int = 3_200, num_hidden: int = 2, seed: int = 0) -> keras.Sequential:
    """Builds the paper's enhancing network, Figure 3: Dense layers of 500, 3,200, 3,200 and 500 units.

    Args:
        window: Samples of a window, the width of the first and the last layer.
        hidden_units: Units of each hidden layer.
        num_hidden: Number of hidden layers.
        seed: Seed of the weights.

    Returns:
        An uncompiled Keras model from shape `(windows, window)` to the same; 13,697,400 parameters by default.
    """
    return dense_stack(window, (window, *[hidden_units] * num_hidden, window), seed, "enhancer")


def fit_windows(
    model: keras.Model,
    inputs: np.ndarray,
    targets: np.ndarray,
    epochs: int,
    batch_size: int,
    seed: int,
    learning_rate: float = 0.001,
    validation: tuple[np.ndarray, np.ndarray] | None = None,
    callbacks: Sequence[keras.callbacks.Callback] = (),
    verbose: int | str = "auto",
    jit_compile: bool = False,
) -> dict[str, np.ndarray]:
    """Fits a model from windows to windows by mean squared error and Adam.

    The order of the windows is drawn from `seed`, anew in each epoch.

    Args:
        model: A model from `(windows, samples)` to the same.
        inputs: Input windows, float32 of shape `(windows, samples)`.
        targets: Target windows of the same shape.
        epochs: Passes over the windows.
        batch_size: Windows a step.
        seed: Seed of the order.
        learning_rate: Adam's learning rate.
        validation: Held-out `(inputs, targets)`, or None.
        callbacks: Keras callbacks.
        verbose: Keras' progress bar: 0 none, 1 a bar.
        jit_compile: Whether XLA compiles the step. With the fused Adam there is little left for it to fuse, and it costs
            seconds of compilation.

    Returns:
        The history: `loss` and, with `validation`, `val_loss`, each of shape `(epochs,)`.
    """
    # ten steps a call of the compiled function: same steps, less of Python between them
    model.compile(fused_adam(learning_rate), loss="mean_squared_error", jit_compile=jit_compile, steps_per_execution=10)
    order = tf.data.Dataset.from_tensor_slices((inputs, targets)).shuffle(len(inputs), seed=seed)
    held_out = None if validation is None else tf.data.Dataset.from_tensor_slices(validation).batch(256)
    history = model.fit(
        order.batch(batch_size).prefetch(2),
        epochs=epochs,
        validation_data=held_out,
        callbacks=list(callbacks),
        verbose=verbose,
        shuffle=False,  # the data set shuffles, with its own seed
    )
    return {key: np.array(values) for key, values in history.history.items()}


def enhance(model: keras.Model, coarse: np.ndarray, batch_size: int = 1_024) -> np.ndarray:
    """Maps coarse windows to enhanced ones (step 5), float32 of shape `(windows, samples)`."""
    return predict_windows(model, np.asarray(coarse, np.float32), batch_size)


def predict_windows(model: keras.Model, inputs: np.ndarray, batch_size: int) -> np.ndarray:
    """What `model.predict` gives, without its data pipeline: the batches are slices, written to where they belong."""
    if len(inputs) <= batch_size:
        return np.asarray(model.predict_on_batch(inputs)) if len(inputs) else np.empty((0, *model.output_shape[1:]), np.float32)
    outputs = np.empty((len(inputs), *model.output_shape[1:]), np.float32)
    for first in range(0, len(inputs), batch_size):
        outputs[first : first + batch_size] = model.predict_on_batch(inputs[first : first + batch_size])
    return outputs
