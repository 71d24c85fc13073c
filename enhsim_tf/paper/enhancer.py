"""Section 2.2: the first network, which maps the output of the simple simulator to the waveform of
the telemetry.

"For this example, we developed a wide, shallow Multi-Layer Perceptron (MLP) network."
"""

import math
from collections.abc import Sequence

import numpy as np

from enhsim_tf.common.backend import keras
from enhsim_tf.common.fast_keras import fit_blockwise, is_wide_dense_stack
from enhsim_tf.paper.settings import Settings

BATCH = 1_024  # windows that a trained network is given at a time


def initialiser(settings: Settings, of_author: str, number: int) -> keras.initializers.Initializer:
    """The initialiser of one layer: the author's, or he_uniform for all layers. `number` makes its
    seed different from all others.
    """
    name = of_author if settings.initialisers == "by layer" else settings.initialisers
    classes = {
        "glorot_uniform": keras.initializers.GlorotUniform,
        "he_uniform": keras.initializers.HeUniform,
    }
    return classes[name](seed=1_000 * settings.seed + number)


def build_enhancer(settings: Settings, num_inputs: int | None = None) -> keras.Sequential:
    """The network of Figure 3, read as Dense 500, two hidden layers of 3,200, and Dense 500:
    13,697,400 parameters.

    "The input and output layers are the size of the time series. The inner layers are wider, at
    3,200 neurons."

    Args:
        settings: All settings.
        num_inputs: Number of inputs, for the tool, whose coarse simulators can have several
            columns; None: `window`.

    Returns:
        An uncompiled network from `(windows, num_inputs)` to `(windows, window)`.
    """
    names = ["Input", *(f"Hidden_{number + 1}" for number in range(settings.num_hidden)), "Output"]
    units = [settings.window, *[settings.hidden_units] * settings.num_hidden, settings.window]
    network = keras.Sequential([keras.Input((num_inputs or settings.window,))], name="enhancer")
    for number, (name, width) in enumerate(zip(names, units, strict=True)):
        activation = "linear" if name == "Output" else "relu"
        kernel = initialiser(settings, "glorot_uniform", number)
        network.add(keras.layers.Dense(width, activation, kernel_initializer=kernel, name=name))
    return network


class Pairs(keras.utils.PyDataset):
    """Batches of source windows and their targets, float32 of shape `(windows, samples)`; `rng`,
    and not the global generator of Keras, shuffles them before each epoch.
    """

    def __init__(
        self, source: np.ndarray, target: np.ndarray, batch_size: int, rng: np.random.Generator
    ):
        super().__init__()
        self.source = source
        self.target = target
        self.batch_size = batch_size
        self.rng = rng
        self.order = rng.permutation(len(source))

    def __len__(self) -> int:
        return math.ceil(len(self.source) / self.batch_size)

    def __getitem__(self, index: int) -> tuple[np.ndarray, np.ndarray]:
        rows = self.order[self.batch_size * index : self.batch_size * (index + 1)]
        return self.source[rows], self.target[rows]

    def on_epoch_end(self) -> None:
        """Shuffles the windows for the next epoch."""
        self.order = self.rng.permutation(len(self.source))


def train_enhancer(
    network: keras.Sequential,
    source: np.ndarray,
    target: np.ndarray,
    settings: Settings,
    validation: tuple[np.ndarray, np.ndarray] | None = None,
    callbacks: Sequence[keras.callbacks.Callback] = (),
) -> dict[str, list[float]]:
    """Step 3: trains the network "to map low-fidelity to high-fidelity data".

    "The model is trained by matching a large number of source time series with a corresponding set
    of high-fidelity target time series": 40 epochs with a batch size of 15. The target here is the
    telemetry with its noise, which least squares averages out.

    Args:
        network: The network of `build_enhancer`.
        source: Coarse windows, float32 of shape `(windows, window)`.
        target: Telemetry windows of the same times.
        settings: All settings.
        validation: Held-out `(source, target)`, or None.
        callbacks: Keras callbacks.

    Returns:
        The history of Keras.
    """
    pairs = Pairs(source, target, settings.batch_size, np.random.default_rng(settings.seed))
    options = {
        "epochs": settings.epochs,
        "validation_data": validation,
        "callbacks": list(callbacks),
        "shuffle": False,
        "verbose": 0,
    }
    if not (settings.fast and is_wide_dense_stack(network)):
        adam = keras.optimizers.Adam(settings.learning_rate)
        network.compile(adam, settings.loss, jit_compile=False)
        return network.fit(pairs, **options).history
    # the same updates; the columns of a wide kernel are updated in blocks that fit into the cache
    return fit_blockwise(network, settings.learning_rate, settings.loss, pairs, **options)


def enhance(network: keras.Sequential, coarse: np.ndarray) -> np.ndarray:
    """Step 5: converts "simulation to accurate, clean data", windows of shape `(windows, window)`,
    by the trained enhancer.
    """
    return predict(network, np.asarray(coarse, np.float32))


def predict(network: keras.Model, inputs: np.ndarray) -> np.ndarray:
    """`network.predict` without the seconds that its data pipeline costs, batch by batch."""
    batches = [
        network.predict_on_batch(inputs[first : first + BATCH])
        for first in range(0, len(inputs), BATCH)
    ]
    return np.concatenate(batches)
