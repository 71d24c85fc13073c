"""A domain-adversarial network (Ganin et al. 2016) that learns anomalies from a simulator and adapts to real windows.

A classifier separates generated nominal windows from generated windows with injected anomalies. With adaptation, a second head tries to
tell generated from real nominal windows, and the features are trained against it, with a reversed gradient. The classifier knows the kinds
of anomalies on which it is judged, which the detectors of the other arms do not.
"""

import numpy as np

from enhsim_tf.common.backend import keras, tf
from enhsim_tf.common.training import predict_windows, seeded_initialiser

_FILTERS, _WIDTHS, _STRIDE = (24, 32), (15, 9), 4  # of both convolutions
_UNITS = 64
_BATCH = 64
_LEARNING_RATE = 1e-3


class AnomalyClassifier:
    """A classifier of anomalous windows, with or without adaptation to real windows.

    Args:
        window: Length of a window in samples.
        adaptation: Largest weight of the reversed gradient; 0 is a classifier without adaptation.
        seed: Seed of weights and batches.
    """

    def __init__(self, window: int, adaptation: float = 0.0, seed: int = 0):
        self.adaptation, self.seed = adaptation, seed

        def kernel(number: int) -> keras.Initializer:
            return seeded_initialiser("he_uniform", seed * 1000 + number)

        def dense(units: int, number: int, activation: str | None = None) -> keras.layers.Layer:
            return keras.layers.Dense(units, activation, kernel_initializer=kernel(number))

        windows = keras.Input((window,))
        hidden = keras.ops.expand_dims(windows, -1)
        for number, (filters, width) in enumerate(zip(_FILTERS, _WIDTHS, strict=True)):
            convolution = keras.layers.Conv1D(filters, width, _STRIDE, "same", activation="relu", kernel_initializer=kernel(700 + number))
            hidden = convolution(hidden)
        placed = dense(_UNITS, 702, "relu")(keras.layers.Flatten()(hidden))
        anywhere = keras.layers.GlobalMaxPooling1D()(hidden)
        features = dense(_UNITS, 703, "relu")(keras.layers.Concatenate()([placed, anywhere]))
        self.features = keras.Model(windows, features)
        self.label = keras.Sequential([keras.Input((_UNITS,)), dense(1, 710)])
        self.domain = keras.Sequential([keras.Input((_UNITS,)), dense(32, 711, "relu"), dense(1, 712)])

    def fit(self, nominal: np.ndarray, anomalous: np.ndarray, real: np.ndarray, num_steps: int) -> "AnomalyClassifier":
        """Trains the classifier with Adam.

        The weight of the reversed gradient grows from 0 to `adaptation` as in the reference.

        Args:
            nominal: Generated nominal windows, shape `(windows, samples)`.
            anomalous: Generated windows with anomalies.
            real: Real nominal windows, whose label is used for the domain only.
            num_steps: Number of steps.
        """
        self._mean, self._scale = float(np.mean(nominal)), float(np.std(nominal)) or 1.0
        groups = [tf.constant(self._scaled(windows)) for windows in (nominal, anomalous, real)]
        parts = [self.features, self.label, self.domain]
        variables = [variable for part in parts for variable in part.trainable_variables]
        optimizer = keras.optimizers.Adam(_LEARNING_RATE)
        optimizer.build(variables)
        loss = keras.losses.BinaryCrossentropy(from_logits=True)

        @tf.function
        def step(seed: tf.Tensor, weight: tf.Tensor) -> None:
            rows = [
                tf.gather(group, tf.random.stateless_uniform((_BATCH,), seed + number, 0, len(group), tf.int32))
                for number, group in enumerate(groups)
            ]
            with tf.GradientTape() as tape:
                features = self.features(tf.concat(rows, 0), training=True)
                labelled = self.label(features[: 2 * _BATCH], training=True)
                against = reverse_gradient(features, weight)
                both = tf.concat([against[:_BATCH], against[2 * _BATCH :]], 0)  # nominal windows of both domains
                total = loss(_halves(), labelled) + loss(_halves(), self.domain(both, training=True))
            optimizer.apply_gradients(zip(tape.gradient(total, variables), variables, strict=True))

        rng = np.random.default_rng([self.seed, 72])
        for number in range(num_steps):
            weight = self.adaptation * (2 / (1 + np.exp(-10 * number / num_steps)) - 1)
            step(tf.constant(rng.integers(0, 2**30, 2), tf.int32), tf.constant(weight, tf.float32))
        return self

    def score(self, windows: np.ndarray) -> np.ndarray:
        """Returns the logit of each window, which is higher for anomalies."""
        features = predict_windows(self.features, self._scaled(windows), 1_024)
        return np.asarray(self.label(features))[:, 0]

    def _scaled(self, windows: np.ndarray) -> np.ndarray:
        return ((windows - self._mean) / self._scale).astype(np.float32)


def reverse_gradient(values: tf.Tensor, weight: tf.Tensor | float) -> tf.Tensor:
    """Returns the values unchanged; their gradient is multiplied by `-weight`."""
    return tf.stop_gradient(values * (1 + weight)) - weight * values


def _halves() -> tf.Tensor:
    """Labels of a batch: 0 for its first half and 1 for its second."""
    return tf.concat([tf.zeros((_BATCH, 1)), tf.ones((_BATCH, 1))], 0)
