"""Training and prediction of networks that map windows to windows, such as the enhancer of section 2.2 of the paper."""

from collections.abc import Callable, Sequence

import numpy as np

from enhsim_tf.common.backend import keras, tf
from enhsim_tf.common.blockwise_training import BlockwiseTraining, is_wide_dense_stack
from enhsim_tf.common.fused_adam import fused_adam


def seeded_initialiser(name: str, seed: int) -> keras.initializers.Initializer:
    """Creates a Keras initialiser with a seed.

    Args:
        name: Keras name of the initialiser, for example `he_uniform`.
        seed: The seed.
    """
    return type(keras.initializers.get(name))(seed=seed)


def dense_stack(window: int, units: Sequence[int], seed: int, name: str, initialiser: str = "he_uniform") -> keras.Sequential:
    """Builds a stack of Dense layers with relu activations, except for the last layer, which is linear.

    Args:
        window: Number of samples in an input window.
        units: Number of units of each layer.
        seed: Seed for the initial weights, from which each layer derives its own.
        name: Name of the model.
        initialiser: Keras name of the weight initialiser.

    Returns:
        An uncompiled Keras model.
    """
    model = keras.Sequential([keras.Input((window,))], name=name)
    for number, width in enumerate(units):
        last = number == len(units) - 1
        model.add(
            keras.layers.Dense(
                width,
                activation=None if last else "relu",
                kernel_initializer=seeded_initialiser(initialiser, seed * 1000 + number),
                name="Output" if last else f"Hidden_{number}" if number else "Input",
            )
        )
    return model


def fit_windows(
    model: keras.Model,
    inputs: np.ndarray,
    targets: np.ndarray,
    epochs: int,
    batch_size: int,
    seed: int,
    learning_rate: float | keras.optimizers.schedules.LearningRateSchedule = 0.001,
    validation: tuple[np.ndarray, np.ndarray] | None = None,
    callbacks: Sequence[keras.callbacks.Callback] = (),
    verbose: int | str = "auto",
    jit_compile: bool = False,
    loss: str = "mean_squared_error",
) -> dict[str, np.ndarray]:
    """Trains a model that maps windows to windows, by Adam. The windows are shuffled in each epoch.

    Args:
        model: A Keras model whose input and output have the shape `(windows, samples)`.
        inputs: Input windows, float32 of shape `(windows, samples)`.
        targets: Target windows of the same shape.
        epochs: Number of epochs.
        batch_size: Number of windows in each training step.
        seed: Seed for the shuffling.
        learning_rate: Adam's learning rate, or a schedule of it.
        validation: Held-out `(inputs, targets)`, or None.
        callbacks: Keras callbacks.
        verbose: Verbosity of Keras: 0 is silent, 1 shows a progress bar.
        jit_compile: Whether to compile the training step with XLA. This takes seconds and gains little, because the update of
            the weights is already fused.
        loss: Keras name of the loss.

    Returns:
        The history: `loss` and, with `validation`, `val_loss`, each of shape `(epochs,)`.
    """
    trained = BlockwiseTraining(model) if is_wide_dense_stack(model) and not jit_compile else model
    steps = -(-len(inputs) // batch_size)
    at_once = 1 if callbacks else steps  # steps between which nobody looks are one call of the graph
    trained.compile(fused_adam(learning_rate), loss=loss, jit_compile=jit_compile, steps_per_execution=at_once)
    rng = np.random.default_rng(seed)
    orders = np.stack([rng.permutation(len(inputs)) for _ in range(epochs)])
    held_out = None if validation is None else _without_autotuning(tf.data.Dataset.from_tensor_slices(validation).batch(256))
    history = trained.fit(
        batches(inputs, targets, orders, batch_size),
        epochs=epochs,
        steps_per_epoch=steps,
        validation_data=held_out,
        callbacks=list(callbacks),
        verbose=verbose,
        shuffle=False,  # `batches` has already shuffled the windows
    )
    if trained is not model:
        trained.write_back()
    return {key: np.array(values) for key, values in history.history.items()}


class EpochProgress(keras.callbacks.Callback):
    """Keras callback that reports the number of completed epochs, with fractions, after each training step.

    Args:
        on_progress: Function that receives the number.
    """

    def __init__(self, on_progress: Callable[[float], None]):
        super().__init__()
        self._on_progress, self._epoch = on_progress, 0

    def on_epoch_begin(self, epoch: int, logs: dict | None = None) -> None:
        """Stores the index of the epoch, which starts at 0."""
        self._epoch = epoch

    def on_train_batch_end(self, batch: int, logs: dict | None = None) -> None:
        """Reports the progress after a training step, whose index starts at 0."""
        self._on_progress(self._epoch + (batch + 1) / self.params["steps"])


def batches(inputs: np.ndarray, targets: np.ndarray, orders: np.ndarray, batch_size: int) -> tf.data.Dataset:
    """Creates a data set of batches of input and target windows, for all epochs.

    Args:
        inputs: Input windows, float32 of shape `(windows, samples)`.
        targets: Target windows of the same shape.
        orders: Order of the windows in each epoch, integers of shape `(epochs, windows)`.
        batch_size: Number of windows in a batch. The last batch of an epoch may be smaller.

    Returns:
        A data set of pairs `(inputs, targets)`.
    """
    inputs, targets = tf.constant(inputs), tf.constant(targets)
    rows = tf.data.Dataset.from_tensor_slices(orders).flat_map(lambda order: tf.data.Dataset.from_tensor_slices(order).batch(batch_size))
    return _without_autotuning(rows.map(lambda rows: (tf.gather(inputs, rows), tf.gather(targets, rows))).prefetch(2))


def _without_autotuning(data: tf.data.Dataset) -> tf.data.Dataset:
    """Disables autotuning of a data set. Its thread sleeps for up to a minute, and deleting the data set waits for the thread."""
    options = tf.data.Options()
    options.autotune.enabled = False
    return data.with_options(options)


def predict_windows(model: keras.Model, inputs: np.ndarray, batch_size: int) -> np.ndarray:
    """Returns the same as `model.predict`, but faster, because it slices the inputs instead of building a data pipeline.

    Args:
        model: A Keras model.
        inputs: float32 array, whose first axis is the batch axis.
        batch_size: Number of rows in each call of the model.

    Returns:
        The model's output for all rows.
    """
    if len(inputs) <= batch_size:
        return np.asarray(model.predict_on_batch(inputs)) if len(inputs) else np.empty((0, *model.output_shape[1:]), np.float32)
    outputs = np.empty(model.compute_output_shape(inputs.shape), np.float32)
    for first in range(0, len(inputs), batch_size):
        outputs[first : first + batch_size] = model.predict_on_batch(inputs[first : first + batch_size])
    return outputs
