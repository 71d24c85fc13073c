"""A learnt noise model: a mixture density network for each sample of noise given the samples before
it.

The density of a window is the product of the densities of its samples, each given the samples
before it. The network receives the last samples one by one, averages of the noise and of its
magnitude over longer spans, and the enhanced signal around the sample, so that the noise may depend
on the signal. It returns a mixture of Student's t densities around a linear prediction, which is
fitted in closed form. The weights of the epoch that is best on held-out noise are kept.

Generated noise continues real noise of half a window that was followed by a similar signal. Slow
states of the noise, such as its loudness, are therefore distributed as in the telemetry. All
generated samples are new.

References:
    Bishop, "Mixture density networks", 1994. Uria, Murray and Larochelle, "RNADE: the real-valued
    neural autoregressive density-estimator", 2013: quantised values are dithered. Loshchilov and
    Hutter, "Decoupled weight decay regularization", 2019.
"""

import dataclasses
from collections.abc import Callable

import numpy as np
from scipy.special import gammaln

from enhsim_tf.common.backend import keras
from enhsim_tf.common.errors import InputError
from enhsim_tf.noise.window_bootstrap import WindowBootstrap
from enhsim_tf.telemetry.quantisation import Levels

# last samples that the linear prediction, and the hidden layers, see one by one
_NUM_LAGS = 64
_NUM_NEAR = 16
_SIGNAL_LAGS = np.array([-8, 0, 8])  # where it sees the enhanced signal, around the sample
_UNITS = 48
# of freedom of the components: three are nearly Gaussian, two have heavy tails
_DEGREES = np.array([100.0, 100.0, 100.0, 3.0, 3.0])
_FIRST_LOGITS = np.array([0.0, 0.0, 0.0, -3.0, -3.0])
_NUM_COMPONENTS = len(_DEGREES)
_CLIP = 6.0  # largest magnitude, in standard deviations, of an input of the hidden layers
# added to magnitudes before their logarithm is taken, in standard deviations of the noise
_TINY = 1e-3
_RIDGE = 1e-5  # penalty of the linear prediction, as a share of the variance of its inputs
_LOG_SCALES = (-5.0, 3.0)  # limits of a component, relative to the error of the linear prediction
_BATCH = 1_000
_RATE = 3e-3
_WEIGHT_DECAY = 1.0
_CHECK_EVERY = 50  # steps between two looks at held-out noise
# samples for the linear prediction, and on which weights are compared
_NUM_LINEAR = 100_000
_NUM_JUDGED = 30_000
_HELD_OUT = 0.15  # share of the time, at its end, on which epochs are compared
# generated samples stay within this multiple of the largest magnitude of the training windows
_LIMIT = 1.2
_ROWS = 1_024  # windows that are drawn at a time

ops = keras.ops
# of the densities
_LOG_CONSTANTS = (
    gammaln((_DEGREES + 1) / 2) - gammaln(_DEGREES / 2) - 0.5 * np.log(np.pi * _DEGREES)
)


@dataclasses.dataclass
class MixtureDensityNoise:
    """Noise whose samples are drawn one after the other from the densities that a network predicts.

    Args:
        seed: Seed of the weights and of everything that is drawn in training.
        num_steps: Steps of the training.
    """

    seed: int = 0
    num_steps: int = 600

    def fit(
        self, noise: np.ndarray, signal: np.ndarray | None = None, starts: np.ndarray | None = None
    ) -> "MixtureDensityNoise":
        """Trains the network by maximum likelihood.

        Args:
            noise: Windows of noise of shape `(windows, samples)`, in the unit of the telemetry.
            signal: Enhanced signal of the same shape, or None for noise that does not depend on it.
            starts: First sample of each window, shape `(windows,)`. None: no two windows overlap,
                and they are in the order of time.

        Raises:
            InputError: If the noise is not finite, constant or too short.
        """
        noise = np.asarray(noise, np.float64)
        rng = np.random.default_rng([self.seed, 61])
        self.window = noise.shape[1]
        self.scale = float(np.std(noise))
        if not (
            np.isfinite(noise).all() and self.scale > 0 and len(noise) >= 2 and self.window >= 8
        ):
            raise InputError(
                "Expected finite noise that varies, in windows of at least 8 samples. Received: "
                f"shape {noise.shape}."
            )
        self._levels = Levels.find(noise)
        self._past = self.window // 2
        self._spans = 2 ** np.arange(1, int(np.log2(self._past)) + 1)
        self._limit = _LIMIT * float(np.max(np.abs(noise))) / self.scale
        if self._levels is not None:
            noise = noise + self._levels.step * (rng.random(noise.shape) - 0.5)
        self._signal_scale = (
            None if signal is None else (float(np.mean(signal)), float(np.std(signal)) or 1.0)
        )
        values = (noise / self.scale).astype(np.float32)
        below = self._standardised(signal)
        self._pasts = self._real_pasts(values, below)
        learnt, held_out = _split(
            self.window * np.arange(len(noise)) if starts is None else np.asarray(starts),
            self.window,
        )
        judged = self._examples(values, below, held_out, _NUM_JUDGED, rng)
        self.network = _build(
            *self._examples(values, below, learnt, _NUM_LINEAR, rng),
            len(self._spans),
            max(0, min(_NUM_LAGS, self._past) - _NUM_NEAR),
            self.seed,
        )
        self._train(lambda: self._examples(values, below, learnt, _BATCH, rng), judged)
        return self

    def generate(
        self, number: int, rng: np.random.Generator, signal: np.ndarray | None = None
    ) -> np.ndarray:
        """Generates windows of noise, float32 of shape `(number, samples)`, in the unit of the
        telemetry.

        Args:
            number: Number of windows.
            rng: Random generator.
            signal: The signal that the noise is added to, shape `(number, samples)`; required if
                the noise depends on it.
        """
        below = self._standardised(signal)
        noise = np.empty((number, self.window))
        for first in range(0, number, _ROWS):
            rows = slice(first, min(first + _ROWS, number))
            noise[rows] = self._draw(rows.stop - first, rng, None if below is None else below[rows])
        noise *= self.scale
        return noise.astype(np.float32) if self._levels is None else self._levels.round(noise)

    def _draw(self, number: int, rng: np.random.Generator, below: np.ndarray | None) -> np.ndarray:
        """Continues real noise sample by sample, in standard deviations."""
        past = self._past
        rows = np.arange(number)
        seen = np.empty((number, past + self.window), np.float32)
        seen[:, :past] = self._pasts.generate(
            number, rng, None if below is None else below[:, :past]
        )
        for place in range(self.window):
            inputs = self._inputs(seen[:, place : place + past], below, rows, place)
            logits, means, log_scales = np.split(
                self.network.predict_on_batch(inputs).astype(np.float64), 3, axis=1
            )
            shares = np.cumsum(np.exp(logits - logits.max(axis=1, keepdims=True)), axis=1)
            chosen = (rng.random((number, 1)) * shares[:, -1:] > shares).sum(axis=1)
            drawn = means[rows, chosen] + np.exp(log_scales[rows, chosen]) * rng.standard_t(
                _DEGREES[chosen]
            )
            seen[:, past + place] = np.clip(drawn, -self._limit, self._limit)
        return seen[:, past:]

    def _train(
        self,
        draw: Callable[[], tuple[np.ndarray, np.ndarray]],
        judged: tuple[np.ndarray, np.ndarray],
    ) -> None:
        """Trains the network on batches, and keeps the weights that are best on held-out noise."""
        rate = keras.optimizers.schedules.CosineDecay(_RATE, max(1, self.num_steps), 0.01)
        optimizer = keras.optimizers.AdamW(rate, weight_decay=_WEIGHT_DECAY, global_clipnorm=1.0)
        self.network.compile(optimizer, negative_log_likelihood, jit_compile=False)
        self.losses = []
        best = []
        for step in range(self.num_steps + 1):
            if step % _CHECK_EVERY == 0 or step == self.num_steps:
                self.losses.append(float(self.network.test_on_batch(*judged)))
                best = self.network.get_weights() if self.losses[-1] == min(self.losses) else best
            if step < self.num_steps:
                self.network.train_on_batch(*draw())
        self.network.set_weights(best)

    def _standardised(self, signal: np.ndarray | None) -> np.ndarray | None:
        """The signal at mean 0 and standard deviation 1, or None for noise that does not depend on
        it.
        """
        if self._signal_scale is None:
            return None
        if signal is None:
            raise InputError(
                "Expected the enhanced signal, on which this noise depends. Received: none. Give "
                "the windows below the noise."
            )
        mean, deviation = self._signal_scale
        return ((np.asarray(signal, np.float64) - mean) / deviation).astype(np.float32)

    def _real_pasts(self, values: np.ndarray, below: np.ndarray | None) -> WindowBootstrap:
        """Draws first halves of windows, whose signal in the second half is similar to that of a
        generated window in the first.
        """
        first = values[:, : self._past]
        return (
            WindowBootstrap(first)
            if below is None
            else WindowBootstrap.fit(first, below[:, self._past : 2 * self._past])
        )

    def _examples(
        self,
        values: np.ndarray,
        below: np.ndarray | None,
        rows: np.ndarray,
        number: int,
        rng: np.random.Generator,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Inputs of the network and the sample that follows, at random places of some windows."""
        rows = rng.choice(rows, number)
        places = rng.integers(self._past, self.window, number)
        inputs = []
        for first in range(0, number, _ROWS):
            some = slice(first, first + _ROWS)
            seen = values[rows[some, None], places[some, None] + np.arange(-self._past, 0)]
            inputs.append(self._inputs(seen, below, rows[some], places[some]))
        return np.concatenate(inputs), values[rows, places, None]

    def _inputs(
        self, seen: np.ndarray, below: np.ndarray | None, rows: np.ndarray, places: np.ndarray | int
    ) -> np.ndarray:
        """What the network sees before samples at places of windows, from the samples `seen` before
        each and the signal `below`.

        Returns:
            float32 array of shape `(samples, inputs)`: what the linear prediction sees, the oldest
            samples first, then the logarithms of magnitudes.
        """
        backwards = seen[:, ::-1]
        spans = self._spans
        means = np.cumsum(backwards, axis=1)[:, spans - 1] / spans
        magnitudes = np.cumsum(np.abs(backwards), axis=1)[:, spans - 1] / spans
        linear = [seen[:, -_NUM_LAGS:], means]
        if below is not None:
            around = np.clip(np.reshape(places, (-1, 1)) + _SIGNAL_LAGS, 0, self.window - 1)
            linear.append(below[rows[:, None], around])
        return np.concatenate([*linear, np.log(magnitudes + _TINY)], axis=1).astype(np.float32)


def _split(starts: np.ndarray, window: int) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the windows to learn from and of those at the end of the time, which share no
    sample with them.
    """
    border = np.quantile(starts, 1 - _HELD_OUT)
    learnt = np.flatnonzero(starts + window <= border)
    held_out = np.flatnonzero(starts >= border)
    return (learnt, held_out) if len(learnt) else (np.flatnonzero(starts < border), held_out)


def _build(
    inputs: np.ndarray, targets: np.ndarray, num_magnitudes: int, num_far: int, seed: int
) -> keras.Model:
    """Builds the network, which starts as one density around the linear prediction of least
    squares.

    The linear prediction does not see the last `num_magnitudes` inputs, and the hidden layers do
    not see the first `num_far`. The output, of shape `(samples, 3 * components)`, holds logits,
    means and logarithms of the scales.
    """
    num_linear = inputs.shape[1] - num_magnitudes
    mean = inputs.mean(axis=0, dtype=np.float64)
    deviation = inputs.std(axis=0, dtype=np.float64) + 1e-6
    known = np.column_stack(
        [
            (inputs[:, :num_linear] - mean[:num_linear]) / deviation[:num_linear],
            np.ones(len(inputs)),
        ]
    )
    gram = known.T @ known + _RIDGE * len(known) * np.eye(num_linear + 1)
    coefficients = np.linalg.solve(gram, known.T @ targets)
    error = float(np.std(targets - known @ coefficients)) + 1e-6

    given = keras.Input((inputs.shape[1],))
    standard = keras.layers.Normalization(
        mean=mean.tolist(), variance=np.square(deviation).tolist()
    )(given)
    line = keras.layers.Dense(1, name="linear")
    linear = line(standard[:, :num_linear])
    line.set_weights([coefficients[:-1], coefficients[-1]])
    hidden = ops.clip(standard[:, num_far:], -_CLIP, _CLIP)
    for number in (1, 2):
        hidden = keras.layers.Dense(
            _UNITS,
            "swish",
            kernel_initializer=keras.initializers.HeUniform(seed * 1000 + number),
        )(hidden)
    # nearly one density at first
    small = keras.initializers.VarianceScaling(0.01, seed=seed * 1000 + 3)
    apart = np.linspace(-0.3, 0.3, _NUM_COMPONENTS)  # components differ a little in mean and scale
    bias = keras.initializers.Constant(np.concatenate([_FIRST_LOGITS, apart, apart[::-1]]))
    mixture = keras.layers.Dense(
        3 * _NUM_COMPONENTS, kernel_initializer=small, bias_initializer=bias
    )(hidden)
    logits, shifts, log_scales = ops.split(mixture, 3, axis=1)
    log_scales = float(np.log(error)) + ops.clip(log_scales, *_LOG_SCALES)
    return keras.Model(
        given,
        ops.concatenate([logits, linear + error * shifts, log_scales], axis=1),
        name="mixture_density",
    )


def negative_log_likelihood(
    targets: keras.KerasTensor, mixture: keras.KerasTensor
) -> keras.KerasTensor:
    """Mean negative logarithm of the density of samples of shape `(samples, 1)`, by the output of
    the network.
    """
    logits, means, log_scales = ops.split(mixture, 3, axis=1)
    squares = ops.square((targets - means) * ops.exp(-log_scales))
    logs = _LOG_CONSTANTS - log_scales - (_DEGREES + 1) / 2 * ops.log1p(squares / _DEGREES)
    return -ops.mean(ops.logsumexp(ops.log_softmax(logits, axis=1) + logs, axis=1))
