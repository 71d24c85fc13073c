"""Training and prediction for networks from windows to windows, and the builders that both networks share."""

from collections.abc import Callable, Sequence

import numpy as np

from enhsim_tf.keras_tools.backend import keras, tf
from enhsim_tf.keras_tools.blockwise_training import BlockwiseTraining, is_wide_dense_stack
from enhsim_tf.keras_tools.fused_adam import fused_adam


def seeded_initialiser(name: str, seed: int) -> keras.initializers.Initializer:
    """An initialiser by its Keras name, for example `he_uniform`, that draws from `seed`."""
    return type(keras.initializers.get(name))(seed=seed)


def dense_stack(window: int, units: Sequence[int], seed: int, name: str, initialiser: str = "he_uniform") -> keras.Sequential:
    """A stack of Dense layers, relu on all but the last, each with an initialiser and a seed of its own.

    Args:
        window: Samples of an input window.
        units: Units of each layer.
        seed: Seed of the weights.
        name: Name of the model.
        initialiser: Keras name of the weights' initialiser.
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
    """Fits a model from windows to windows by Adam, with the mean squared error as loss.

    The order of the windows is drawn from `seed`, anew in each epoch.

    Args:
        model: A model from `(windows, samples)` to the same.
        inputs: Input windows, float32 of shape `(windows, samples)`.
        targets: Target windows of the same shape.
        epochs: Passes over the windows.
        batch_size: Windows a step.
        seed: Seed of the order.
        learning_rate: Adam's learning rate, or a schedule of it.
        validation: Held-out `(inputs, targets)`, or None.
        callbacks: Keras callbacks.
        verbose: Keras' progress bar: 0 none, 1 a bar.
        jit_compile: Whether XLA compiles the step. With the fused Adam there is little left for it to fuse, and it costs
            seconds of compilation.
        loss: Keras name of the loss.

    Returns:
        The history: `loss` and, with `validation`, `val_loss`, each of shape `(epochs,)`.
    """
    trained = BlockwiseTraining(model) if is_wide_dense_stack(model) and not jit_compile else model
    trained.compile(fused_adam(learning_rate), loss=loss, jit_compile=jit_compile)
    rng = np.random.default_rng(seed)
    orders = np.stack([rng.permutation(len(inputs)) for _ in range(epochs)])
    held_out = None if validation is None else _without_autotuning(tf.data.Dataset.from_tensor_slices(validation).batch(256))
    history = trained.fit(
        batches(inputs, targets, orders, batch_size),
        epochs=epochs,
        steps_per_epoch=-(-len(inputs) // batch_size),
        validation_data=held_out,
        callbacks=list(callbacks),
        verbose=verbose,
        shuffle=False,  # the data set shuffles, with its own seed
    )
    if trained is not model:
        trained.write_back()
    return {key: np.array(values) for key, values in history.history.items()}


class EpochProgress(keras.callbacks.Callback):
    """Calls a function with the epochs that are done, the part of the one under way included, after each step.

    Args:
        on_progress: The function.
    """

    def __init__(self, on_progress: Callable[[float], None]):
        super().__init__()
        self._on_progress, self._epoch = on_progress, 0

    def on_epoch_begin(self, epoch: int, logs: dict | None = None) -> None:
        """Notes which epoch it is, counted from 0."""
        self._epoch = epoch

    def on_train_batch_end(self, batch: int, logs: dict | None = None) -> None:
        """Says how far it is after a step, counted from 0."""
        self._on_progress(self._epoch + (batch + 1) / self.params["steps"])


def batches(inputs: np.ndarray, targets: np.ndarray, orders: np.ndarray, batch_size: int) -> tf.data.Dataset:
    """Pairs of input and target windows, batch after batch, epoch after epoch.

    Args:
        inputs: Input windows, float32 of shape `(windows, samples)`.
        targets: Target windows of the same shape.
        orders: Order of the windows in each epoch, integers of shape `(epochs, windows)`.
        batch_size: Windows a batch; the last of an epoch may have fewer.
    """
    inputs, targets = tf.constant(inputs), tf.constant(targets)
    rows = tf.data.Dataset.from_tensor_slices(orders).flat_map(lambda order: tf.data.Dataset.from_tensor_slices(order).batch(batch_size))
    return _without_autotuning(rows.map(lambda rows: (tf.gather(inputs, rows), tf.gather(targets, rows))).prefetch(2))


def _without_autotuning(data: tf.data.Dataset) -> tf.data.Dataset:
    """The data set without its tuning thread, whose naps double up to a minute: dropping the data set waits for the last one."""
    options = tf.data.Options()
    options.autotune.enabled = False
    return data.with_options(options)


def predict_windows(model: keras.Model, inputs: np.ndarray, batch_size: int) -> np.ndarray:
    """What `model.predict` gives, without its data pipeline: the batches are slices, written to where they belong.

    Args:
        model: A Keras model.
        inputs: float32 array whose first axis counts the rows.
        batch_size: Rows a call of the model.

    Returns:
        The model's output for all rows.
    """
    if len(inputs) <= batch_size:
        return np.asarray(model.predict_on_batch(inputs)) if len(inputs) else np.empty((0, *model.output_shape[1:]), np.float32)
    outputs = np.empty(model.compute_output_shape(inputs.shape), np.float32)
    for first in range(0, len(inputs), batch_size):
        outputs[first : first + batch_size] = model.predict_on_batch(inputs[first : first + batch_size])
    return outputs
