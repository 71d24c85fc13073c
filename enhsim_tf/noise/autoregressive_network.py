"""A network for the distribution of each sample of noise given the samples before it (an alternative to the GAN of section 2.3).

The probability density of a window is the product of the densities of its samples, each given all samples before it. A network
that predicts these conditional densities can represent any stationary noise, up to its capacity: no correlation time, no period
and no pulse is built into the network. The network receives the last samples one by one, and the whole past of the window as
averages of the value and of its magnitude over the last 2, 4, 8, ... samples, as magnitudes of its changes at several resolutions
(`changes`), and as linear predictions of the value and of the size of its error, which are fitted in closed form (`linear_prediction`).
The density of a sample is a mixture of Student's t distributions around the linear prediction, so that it can have several modes, a skew and
heavy tails.

Training maximises the likelihood. A network with thousands of weights finds a little structure in any noise, even in white noise,
whose samples then get heavier tails than they have. What the density takes from the past is therefore shrunk after training, as far
as the likelihood of held-out windows asks for it (`shrinkage`). If one normal distribution around the linear prediction is as likely, the
density becomes that. What is left of the difference between predicted and true shape is counted on the training data (`calibration`). And
where whole generated windows differ from real ones, one of several is drawn in proportion to how much more often such windows are real
(`selection`).

Generated noise continues real noise of half a window, unless windows have fewer than eight samples. This noise is drawn at random; where
the noise may follow the signal, it is drawn from the windows in which the most similar signal came next. Slow states of the noise, such as
its loudness or the amplitude of a period, are therefore distributed as in the telemetry, and nothing has to be learnt of how noise begins.
All generated samples are new.

References:
    Bishop, "Mixture density networks", 1994.
    van den Oord et al., "WaveNet: a generative model for raw audio", 2016.
    Loshchilov and Hutter, "Decoupled weight decay regularization", 2019.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.keras_tools.backend import keras, tf
from enhsim_tf.keras_tools.training import seeded_initialiser
from enhsim_tf.noise import ladder
from enhsim_tf.noise.calibration import Calibration, mixture_probabilities
from enhsim_tf.noise.changes import LEAST_WINDOW, Changes
from enhsim_tf.noise.linear_prediction import LinearPrediction
from enhsim_tf.noise.selection import NUM_CANDIDATES, Selection
from enhsim_tf.noise.shrinkage import shrink
from enhsim_tf.noise.window_bootstrap import MatchedWindowBootstrap, WindowBootstrap
from enhsim_tf.telemetry.quantisation import Levels

NUM_LAGS = 64  # samples that the network sees one by one
TAILS = "logarithm"  # what is trained of the degrees of freedom
_CLIP = 6.0  # largest magnitude, in standard deviations, with which a sample enters the non-linear part
_TINY = 1e-3  # added to magnitudes before their logarithm is taken
_LOG_SCALES = (-6.0, 3.0)  # limits of the logarithm of a component's scale, in standard deviations
_NUM_NODES = 5  # at which the density over a step is evaluated (Gauss-Legendre quadrature)
_LEAST_SCALE = 0.25  # of a component of quantised noise, in steps (not in errors of the prediction): a narrower one lies between the nodes
_LEAST_DEGREES = 2.1  # degrees of freedom of a component; at 2 its variance is infinite
_LIMIT = 1.2  # generated samples stay within this multiple of the largest magnitude of the training windows: the tails of t distributions have no end
_WEIGHT_DECAY = 1.0  # of all layers: with 0.3 the network learns windows by heart, with 3 it learns too little
_LOG_DEGREES = (2.0, 7.0)  # initial logarithms of the degrees of freedom above the least: of the two components with tails, of the others
_MAX_LOG_DEGREES = 8.0  # no telemetry tells more degrees of freedom from a normal distribution
_LOG_UNIT = 10.0  # of the weights of the degrees of freedom, so that the optimiser moves them by powers of ten, not by parts of one
_PREDICTED = (0, 1, 2, 4, 8, 16, 32)  # samples before the present one whose linear prediction the network sees
_EARLY = (25, 50, 75)  # iterations after which the weights are also compared on held-out windows: few windows are soon learnt by heart
_LEAST_PAST = 4  # samples of real noise that generated noise continues
_MOST_ROWS = 1_024 * NUM_CANDIDATES  # that are drawn at a time
_NUM_STANDARDISED, _NUM_PLACES = 1_000, 40  # windows, and places in each, whose inputs are standardised
_CONSTANT = 1e-6  # standard deviation up to which an input counts as constant
_MOST_SHRUNK = 400_000  # samples that the shrinkage and the calibration learn from
_SIGNAL_LAGS = (-32, -8, -1, 0, 1, 8, 32)  # where the network sees the enhanced signal, around the sample


class AutoregressiveNetwork:
    """Noise whose samples are drawn one after the other from the density that a network predicts.

    Args:
        window: Number of samples of a window, which is also the longest past that the network sees.
        scale: Standard deviation of the noise, in the unit of the telemetry.
        limit: Largest magnitude of a generated sample, in units of `scale`.
        step: Distance of two levels if the noise is quantised, in the unit of the telemetry, and 0 otherwise.
        origin: One of the levels of quantised noise, in the unit of the telemetry.
        follows_signal: Whether the density depends on the enhanced signal, too.
        num_components: Number of components of the mixture.
        num_rare: Number of those that start with a small share; networks that were saved before have 2.
        units: Number of units of both hidden layers.
        sees_predictions: Whether the density starts from linear predictions. Networks that were saved before do not.
        sees_changes: Whether the network sees magnitudes of changes at several resolutions, and its inputs are standardised. Networks that were
            saved before do not.
        seed: Seed for the initial weights and for all random numbers in training.
    """

    def __init__(
        self,
        window: int,
        scale: float,
        limit: float = 20.0,
        step: float = 0.0,
        origin: float = 0.0,
        follows_signal: bool = False,
        num_components: int = 8,
        num_rare: int = 4,
        units: int = 64,
        sees_predictions: bool = True,
        sees_changes: bool = True,
        seed: int = 0,
    ):
        self.window, self.scale, self.limit, self.seed = int(window), float(scale), float(limit), int(seed)
        self.step, self.origin = float(step), float(origin)
        self.follows_signal, self.units = bool(follows_signal), int(units)
        self.num_components, self.num_rare = int(num_components), int(num_rare)
        self.lags = np.arange(1, min(NUM_LAGS, window) + 1)
        self.octaves = 2 ** np.arange(1, int(math.log2(window)) + 1)
        self.sees_predictions = bool(sees_predictions)
        self.prediction = LinearPrediction.of_white_noise(self.window) if self.sees_predictions else None
        self.sees_changes = bool(sees_changes)
        self.changes = Changes(self.window) if self.sees_changes and self.window >= LEAST_WINDOW else None
        self.pasts: WindowBootstrap | MatchedWindowBootstrap | None = None
        self.calibration: Calibration | None = None
        self.selection: Selection | None = None
        self.start_logits = np.where(np.arange(self.num_components) < self.num_rare, -6.0, 0.0).astype(np.float32)
        self.network = self._build()

    @classmethod
    def untrained(
        cls,
        noise_windows: np.ndarray,
        signal_windows: np.ndarray | None = None,
        seed: int = 0,
        sees_predictions: bool = True,
        sees_changes: bool = True,
    ) -> "AutoregressiveNetwork":
        """Creates an untrained network for noise windows of shape `(windows, samples)`, with their scale, limit and step.

        Args:
            noise_windows: Noise of mean zero, in the unit of the telemetry.
            signal_windows: Enhanced signal of the same shape, if the noise may depend on it.
            seed: Seed for the initial weights and for all random numbers in training.
            sees_predictions: Whether the density starts from linear predictions.
            sees_changes: Whether the network sees changes at several resolutions, and its inputs are standardised.
        """
        noise = np.asarray(noise_windows, np.float64)
        scale = float(np.std(noise))
        if not (np.isfinite(noise).all() and scale > 0):
            raise InputError("Expected finite noise that varies. Received: windows with a NaN or an infinity, or of one value.")
        limit = _LIMIT * float(np.max(np.abs(noise))) / scale
        levels = Levels.find(noise)
        step, origin = (0.0, 0.0) if levels is None else (levels.step, levels.origin)
        return cls(
            noise.shape[1],
            scale,
            limit,
            step,
            origin,
            signal_windows is not None,
            sees_predictions=sees_predictions,
            sees_changes=sees_changes,
            seed=seed,
        )

    def _build(self) -> keras.Model:
        """Builds the network: features of the past to logits, means and logarithms of the scales of the components."""
        num_linear = len(self.lags) + len(self.octaves)
        num_predicted = (len(_PREDICTED) + 1) * self.sees_predictions
        num_others = 0 if self.changes is None else self.changes.size
        features = keras.Input((num_linear + len(self.octaves) + 2 + num_predicted + num_others + len(_SIGNAL_LAGS) * self.follows_signal,))
        linear = keras.layers.Dense(1, kernel_initializer="zeros", name="linear")(features[:, :num_linear])
        loudness = 0.0
        if self.sees_predictions:  # the logarithm of the predicted magnitude is the last of the predictions
            place = num_linear + len(self.octaves) + 2 + len(_PREDICTED)
            loudness = keras.layers.Dense(1, kernel_initializer="ones", name="loudness")(features[:, place : place + 1])
        standardised = features
        if self.sees_changes:
            standardised = _Standardise(name="standardise")(features)
        hidden = keras.ops.clip(standardised, -_CLIP, _CLIP)
        for name, number in (("first", 600), ("second", 601)):
            kernel = seeded_initialiser("he_uniform", self.seed * 1000 + number)
            hidden = keras.layers.Dense(self.units, "swish", kernel_initializer=kernel, name=name)(hidden)
        small = keras.initializers.VarianceScaling(0.01, "fan_avg", "uniform", seed=self.seed * 1000 + 602)  # nearly Gaussian at first
        hidden = keras.layers.Dense(3 * self.num_components, kernel_initializer=small, name="last")(hidden)
        logits, shifts, log_scales = keras.ops.split(hidden, 3, axis=1)
        logits = logits + self.start_logits
        degrees = _Degrees(self.num_components, name="degrees")
        return keras.Model(
            features,
            [logits, linear + shifts, keras.ops.clip(loudness + log_scales, *_LOG_SCALES), degrees(logits)],
            name="density",
        )

    def fit(
        self,
        noise_windows: np.ndarray,
        num_iterations: int = 3_000,
        signal_windows: np.ndarray | None = None,
        starts: np.ndarray | None = None,
        batch_size: int = 200,
        positions: int = 50,
        learning_rate: float = 3e-3,
        held_out: float = 0.1,
        averaging: float = 0.99,
        on_iteration: Callable[[int], None] | None = None,
    ) -> "AutoregressiveNetwork":
        """Trains the network by maximum likelihood, and keeps the weights that are best on the held-out windows.

        The optimiser is Adam with decoupled weight decay (Loshchilov and Hutter 2019). The weights are averaged over the iterations with
        exponentially falling weights, and the learning rate falls along a cosine. The averaged weights are compared on the last windows
        every hundred iterations, and after some of the first hundred.

        Args:
            noise_windows: Noise of shape `(windows, samples)`, in the unit of the telemetry.
            num_iterations: Number of iterations.
            signal_windows: Enhanced signal of the same shape, for a network that follows the signal.
            starts: Start of each window in samples, shape `(windows,)`. None: no two windows overlap, and they are in the order of time.
            batch_size: Windows of an iteration.
            positions: Positions of an iteration, the same in all of its windows.
            learning_rate: Initial learning rate.
            held_out: Share of windows, the last ones, that are not used for training.
            averaging: Decay of the weighted average of the weights.
            on_iteration: Called after each iteration with the number of completed iterations.
        """
        values = (np.asarray(noise_windows, np.float64) / self.scale).astype(np.float32)
        starts = None if starts is None else np.asarray(starts)
        self.calibration = self.selection = None
        rng = np.random.default_rng([self.seed, 61])
        signal = self._signal(signal_windows, values.shape)
        first, last = _split(starts, len(values), self.window, held_out)
        if self.sees_predictions:
            self.prediction = LinearPrediction.fit(values[first], values[last])
            self.pasts = self._pasts(values, signal, starts)
        data = (values, signal, self._derived(values))
        training, judged = (tuple(tf.constant(each[rows]) for each in data) for rows in (first, last[:500]))
        if self.sees_changes:
            self._standardise(tuple(each[:: max(1, len(first) // _NUM_STANDARDISED)] for each in training))
        judged_positions = tf.constant(self._places(min(100, self.window)))
        schedule = keras.optimizers.schedules.CosineDecay(learning_rate, max(1, num_iterations), 0.02)
        optimizer = keras.optimizers.AdamW(schedule, weight_decay=_WEIGHT_DECAY, global_clipnorm=1.0)
        optimizer.exclude_from_weight_decay(var_names=["bias", "degrees"])  # names of variables, not of layers: all kernels decay
        optimizer.build(self.network.trainable_variables)
        averages = [tf.Variable(each) for each in self.network.trainable_variables]
        number = len(first)

        @tf.function
        def iterate(seed: tf.Tensor) -> tf.Tensor:
            rows = tf.random.stateless_uniform((min(batch_size, number),), seed, 0, number, tf.int32)
            where = tf.random.stateless_uniform((min(positions, self.window),), seed + 1, 0, self.window, tf.int32)
            with tf.GradientTape() as tape:
                loss = self._loss(*(tf.gather(each, rows) for each in training), where)
            variables = self.network.trainable_variables
            optimizer.apply_gradients(zip(tape.gradient(loss, variables), variables, strict=True))
            for average, variable in zip(averages, variables, strict=True):
                average.assign(averaging * average + (1 - averaging) * variable)
            return loss

        evaluate = tf.function(lambda: self._loss(*judged, judged_positions))
        best, kept, self.losses = np.inf, None, []
        for iteration in range(1, num_iterations + 1):
            loss = iterate(tf.constant(rng.integers(0, 2**30, 2), tf.int32))
            if iteration % 100 == 0 or iteration in (*_EARLY, num_iterations):
                current = [each.numpy() for each in self.network.trainable_variables]
                self._assign([each.numpy() for each in averages])
                held = float(evaluate())
                self.losses.append((iteration, float(loss), held))
                if held < best:
                    best, kept = held, [each.numpy() for each in averages]
                self._assign(current)
            if on_iteration is not None:
                on_iteration(iteration)
        if kept is not None:
            self._assign(kept)
        self._shrink(training, judged)
        if first is not last:  # otherwise there is nothing that the calibration could be judged on
            self._calibrate(training, judged)
            self._select(values, signal, starts)
        self.held_out_loss = float(evaluate())
        return self

    def _standardise(self, training: tuple[tf.Tensor, ...]) -> None:
        """Gives each input of the hidden layers the mean 0 and the standard deviation 1: small differences of slow ones count, too."""
        features, _ = self._features(*training, tf.constant(self._places(_NUM_PLACES)))
        spread = np.std(features, axis=0, dtype=np.float64)
        layer = self.network.get_layer("standardise")
        layer.set_weights([np.mean(features, axis=0, dtype=np.float64), np.where(spread > _CONSTANT, spread, 1)])

    def _shrink(self, training: tuple[tf.Tensor, ...], judged: tuple[tf.Tensor, ...]) -> None:
        """Shrinks what the density takes from the past, and fits what does not depend on it again; see `shrinkage`."""
        parts, (degrees,) = self.num_components, self.network.get_layer("degrees").get_weights()
        names = ("linear", "loudness", "last") if self.sees_predictions else ("linear", "last")
        layers = [self.network.get_layer(name) for name in names]
        sizes = (*(1 for _ in names[:-1]), parts, parts, parts)  # of the first layers, and of the logits, shifts and scales of the last one
        outputs = keras.Model(self.network.input, keras.ops.concatenate([each.output for each in layers], axis=1))

        def loss(targets: tf.Tensor, outputs: tf.Tensor, weights: tf.Tensor) -> tf.Tensor:
            linear, *loudness, logits, shifts, log_scales = tf.split(outputs, sizes, axis=1)
            log_scales = tf.clip_by_value(sum(loudness, log_scales), *_LOG_SCALES)
            logits += self.start_logits.astype(logits.dtype.as_numpy_dtype)
            return self._negative_log_likelihood(targets, logits, linear + shifts, log_scales, _degrees(weights)[None])

        learnt, held_out = (self._outputs(outputs, data) for data in (training, judged))
        targets = learnt[1][:, 0].numpy().astype(np.float64)
        level = np.repeat([np.mean(targets), *[0.0] * (len(sizes) - 2), np.log(max(np.std(targets), _TINY))], sizes)
        normal = np.concatenate(
            [level, np.full(parts, _MAX_LOG_DEGREES / _LOG_UNIT)]
        )  # one normal distribution around the linear prediction
        found = shrink(loss, learnt, held_out, sizes, degrees, normal)
        begin = 0
        for layer in layers:
            kernel, bias = layer.get_weights()
            own = slice(begin, begin + len(bias))
            layer.set_weights([kernel * found.trust[own], found.trust[own] * bias + found.offset[own]])
            begin += len(bias)
        self.network.get_layer("degrees").set_weights([found.weights])

    def _outputs(self, model: keras.Model, data: tuple[tf.Tensor, ...]) -> tuple[tf.Tensor, tf.Tensor]:
        """Computes the outputs of a model of the features, and the targets, at places that are spread over all windows."""
        where = tf.constant(self._places(max(1, _MOST_SHRUNK // len(data[0]))))

        @tf.function
        def compute(rows: tuple[tf.Tensor, ...]) -> tuple[tf.Tensor, tf.Tensor]:
            features, targets = self._features(*rows, where)
            return model(features), targets

        found = [compute(tuple(part[begin : begin + 200] for part in data)) for begin in range(0, len(data[0]), 200)]
        return tuple(tf.concat(parts, 0) for parts in zip(*found, strict=True))

    def _calibrate(self, training: tuple[tf.Tensor, ...], judged: tuple[tf.Tensor, ...]) -> None:
        """Counts how often samples are below the quantiles of the predicted densities; see `calibration`."""
        if self.step or not self.sees_predictions:  # of a level, only the probability of its whole step is known
            return
        logits, means, log_scales, _ = self.network.outputs
        model, degrees = keras.Model(self.network.input, keras.ops.concatenate([logits, means, log_scales], axis=1)), self.degrees

        def probabilities(data: tuple[tf.Tensor, ...]) -> np.ndarray:
            outputs, targets = (each.numpy().astype(np.float64) for each in self._outputs(model, data))
            return mixture_probabilities(targets[:, 0], *np.split(outputs, 3, axis=1), degrees)

        self.calibration = Calibration.fit(probabilities(training), probabilities(judged))

    def _select(self, values: np.ndarray, signal: np.ndarray, starts: np.ndarray | None) -> None:
        """Learns by what whole windows differ from generated ones; see `selection`."""
        self.selection = None  # what it learns from must not be selected

        def generate(rows: np.ndarray) -> np.ndarray:
            return self._draw(len(rows), self.window, signal[rows], np.random.default_rng([self.seed, 62])) / np.float32(self.scale)

        self.selection = Selection.fit(values, generate, starts)

    def _pasts(self, values: np.ndarray, signal: np.ndarray, starts: np.ndarray | None) -> WindowBootstrap | MatchedWindowBootstrap | None:
        """Returns real noise that generated noise continues: the samples before the last half of each window, and the signal after them."""
        half = self.window // 2
        if half < _LEAST_PAST:
            return None
        before = values[:, self.window - 2 * half : self.window - half]
        if self.follows_signal:
            return MatchedWindowBootstrap.fit(before, signal[:, self.window - half :], starts)
        return WindowBootstrap.fit(before, starts)

    def _places(self, number: int) -> np.ndarray:
        """Returns places of a window, evenly spaced, that have as long a past as generated samples have."""
        first = 0 if self.pasts is None else self.pasts.windows.shape[1]
        return np.linspace(first, self.window - 1, min(number, self.window - first)).astype(np.int32)

    def _derived(self, values: np.ndarray) -> np.ndarray:
        """Returns what is computed once for each sample of windows, as far as the network sees it.

        These are the linear predictions of the value and of the logarithm of the magnitude, and the sums of changes before the sample.
        """
        parts = [] if self.prediction is None else [self.prediction.predict(values)]
        parts += [] if self.changes is None else [self.changes.sums(values)]
        return np.concatenate([np.zeros((*values.shape, 0), np.float32), *parts], axis=2)

    @property
    def _errors(self) -> np.ndarray:
        """Standard deviation around the linear prediction at each place of a window: the unit of the density."""
        return np.ones(self.window, np.float32) if self.prediction is None else self.prediction.errors

    def _assign(self, weights: list[np.ndarray]) -> None:
        for variable, value in zip(self.network.trainable_variables, weights, strict=True):
            variable.assign(value)

    def _signal(self, signal_windows: np.ndarray | None, shape: tuple[int, int]) -> np.ndarray:
        """Returns the signal at unit scale, or an empty one if the noise does not follow it."""
        if not self.follows_signal:
            return np.zeros((shape[0], 0), np.float32)
        if signal_windows is None or np.shape(signal_windows) != shape:
            raise InputError(
                f"Expected the enhanced signal of shape {shape}, which this noise follows. Received: {np.shape(signal_windows)}."
            )
        return np.asarray(signal_windows, np.float32)

    def _loss(self, values: tf.Tensor, signal: tf.Tensor, derived: tf.Tensor, where: tf.Tensor) -> tf.Tensor:
        """Computes the mean negative log-likelihood of the samples at the given positions of each window."""
        features, targets = self._features(values, signal, derived, where)
        return self._negative_log_likelihood(targets, *self.network(features))

    def _features(self, values: tf.Tensor, signal: tf.Tensor, derived: tf.Tensor, where: tf.Tensor) -> tuple[tf.Tensor, tf.Tensor]:
        """Computes what the network sees before the samples at the given positions of each window, and what it is to predict.

        Returns:
            The features, a row for each sample; and each sample minus its linear prediction, in units of the error of this prediction
            at this position, which is the second column.
        """
        num_lags, num_rows = len(self.lags), tf.shape(values)[0]
        padded = tf.pad(values, [[0, 0], [num_lags, 0]])
        lags = tf.gather(padded, where[:, None] + num_lags - tf.constant(self.lags, tf.int32)[None, :], axis=1)
        begin = tf.maximum(where[:, None] - tf.constant(self.octaves, tf.int32)[None, :], 0)
        length = tf.cast(tf.maximum(where[:, None] - begin, 1), tf.float32)
        means, magnitudes = (
            (tf.gather(sums, where, axis=1)[:, :, None] - tf.gather(sums, begin, axis=1)) / length
            for sums in (tf.pad(tf.cumsum(each, axis=1), [[0, 0], [1, 0]]) for each in (values, tf.abs(values)))
        )
        place = tf.cast(where, tf.float32)[:, None]
        ages = tf.concat([place / self.window, 1 / tf.sqrt(1 + place)], 1)
        parts = [lags, means, tf.math.log(magnitudes + _TINY), tf.repeat(ages[None], num_rows, axis=0)]
        targets = tf.gather(values, where, axis=1)
        errors = tf.repeat(tf.gather(tf.constant(self._errors), where)[None], num_rows, axis=0)
        if self.sees_predictions:
            before = where[:, None] - tf.constant(_PREDICTED, tf.int32)[None, :]
            earlier = tf.gather(derived[:, :, 0], tf.maximum(before, 0), axis=1) * tf.cast(before >= 0, tf.float32)
            parts += [earlier, tf.gather(derived[:, :, 1], where, axis=1)[:, :, None]]
            targets = (targets - earlier[:, :, 0]) / errors
        if self.changes is not None:
            parts.append(self.changes.features(derived[:, :, 2 * self.sees_predictions :], where))
        if self.follows_signal:
            around = tf.clip_by_value(where[:, None] + tf.constant(_SIGNAL_LAGS, tf.int32)[None, :], 0, self.window - 1)
            parts.append(tf.gather(signal, around, axis=1))
        features = tf.concat(parts, 2)
        return tf.reshape(features, (-1, features.shape[2])), tf.reshape(tf.stack([targets, errors], axis=2), (-1, 2))

    def _negative_log_likelihood(
        self, targets: tf.Tensor, logits: tf.Tensor, means: tf.Tensor, log_scales: tf.Tensor, degrees: tf.Tensor
    ) -> tf.Tensor:
        """Computes the mean negative log-likelihood of targets as returned by `_features`.

        The likelihood of a level of quantised noise is the mean density over its step.
        """
        targets, errors = targets[:, :1], targets[:, 1:]
        if self.step:  # a level stands for all values that are rounded to it
            half = self.step / self.scale / 2 / errors
            log_scales = tf.maximum(log_scales, tf.math.log(2 * _LEAST_SCALE * half))
            terms = [
                math.log(weight / 2) + self._log_density(targets + half * node, means, log_scales, degrees)
                for node, weight in zip(*np.polynomial.legendre.leggauss(_NUM_NODES), strict=True)
            ]
            log_density = tf.reduce_logsumexp(tf.stack(terms), axis=0)
        else:
            log_density = self._log_density(targets, means, log_scales, degrees)
        return -tf.reduce_mean(tf.reduce_logsumexp(tf.nn.log_softmax(logits) + log_density - tf.math.log(errors), axis=1))

    @staticmethod
    def _log_density(targets: tf.Tensor, means: tf.Tensor, log_scales: tf.Tensor, degrees: tf.Tensor) -> tf.Tensor:
        """Computes the logarithm of the density of each component, shape `(samples, components)`."""
        standardised = (targets - means) * tf.exp(-log_scales)
        own = tf.cast(degrees[:1], tf.float64)  # the same for all samples; the difference below loses four digits
        constant = tf.math.lgamma((own + 1) / 2) - tf.math.lgamma(own / 2) - 0.5 * tf.math.log(math.pi * own)
        return tf.cast(constant, log_scales.dtype) - log_scales - (degrees + 1) / 2 * tf.math.log1p(standardised**2 / degrees)

    def generate(self, num_windows: int, seed: int | np.random.Generator, signal_windows: np.ndarray | None = None) -> np.ndarray:
        """Generates windows of noise. The same seed gives the same noise.

        Args:
            num_windows: Number of windows.
            seed: Seed, or a random number generator, whose state advances.
            signal_windows: Enhanced signal of the windows, for noise that follows it.

        Returns:
            float32 array of shape `(num_windows, samples)`, in the unit of the telemetry.
        """
        signal = self._signal(signal_windows, (num_windows, self.window))
        return self._draw(num_windows, self.window, signal, np.random.default_rng(seed))

    def generate_series(self, num_samples: int, seed: int | np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Generates one series of any length, without seams: each sample depends on a window of samples before it.

        Args:
            num_samples: Length of the series.
            seed: Seed, or a random number generator, whose state advances.
            signal: Enhanced signal of shape `(num_samples,)`, for noise that follows it.

        Returns:
            float32 array of shape `(num_samples,)`, in the unit of the telemetry.
        """
        signal = self._signal(None if signal is None else signal[None], (1, num_samples))
        return self._draw(1, num_samples, signal, np.random.default_rng(seed))[0]

    def _draw(self, num_rows: int, num_samples: int, signal: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Draws rows in the unit of the telemetry; candidates in batches, which bound the memory.

        Each candidate of a first window continues a past of its own.
        """
        each = 1 if self.selection is None else NUM_CANDIDATES
        whole = num_samples if each == 1 else -(-num_samples // self.window) * self.window  # whole windows are selected
        if self.follows_signal and num_samples:
            signal = np.repeat(signal[:, np.minimum(np.arange(whole), num_samples - 1)], each, axis=0)
        else:
            signal = np.zeros((each * num_rows, 0), np.float32)
        past, drawn = self._draw_pasts(each * num_rows, whole, signal, rng), [np.zeros((0, whole), np.float32)]
        most = _MOST_ROWS if each > 1 else max(1, num_rows)  # without candidates, saved models draw what they have always drawn
        for begin in range(0, each * num_rows, most):
            rows = slice(begin, begin + most)
            drawn.append(self._continue(past[rows], whole, signal[rows], each, rng))
        return np.concatenate(drawn)[:, :num_samples]

    def _continue(self, past: np.ndarray, num_samples: int, signal: np.ndarray, each: int, rng: np.random.Generator) -> np.ndarray:
        """Continues rows sample by sample, with the network's layers in NumPy: a call of a model takes longer than its products.

        Args:
            past: Real noise that is continued, in units of the standard deviation, shape `(rows, samples)`.
            num_samples: Number of samples to draw; whole windows if there are several candidates.
            signal: The signal below them, shape `(rows, num_samples)`.
            each: Number of neighbouring rows that are candidates for one. After each window, one of them is chosen, and all go on from it.
            rng: Random numbers.

        Returns:
            float32 array of shape `(rows / each, num_samples)`, in the unit of the telemetry.
        """
        layers = ("linear", "first", "second", "last")
        (linear, linear_bias), first_layer, second_layer, last_layer = (self.network.get_layer(name).get_weights() for name in layers)
        degrees, prediction, changes, errors = self.degrees, self.prediction, self.changes, self._errors
        centre, spread = self.network.get_layer("standardise").get_weights() if self.sees_changes else (0.0, 1.0)
        num_lags, num_linear = len(self.lags), len(linear)
        (num_rows, known), reach = past.shape, max(self.window - 1, num_lags)
        begun = reach + known
        series, loudness = np.zeros((2, num_rows, begun + num_samples), np.float32)
        series[:, reach:begun] = past
        predicted = np.zeros((num_rows, _PREDICTED[-1] + known + num_samples), np.float32)
        sums = np.zeros((2, num_rows, known + num_samples + 1))
        sums[:, :, 1 : known + 1] = np.cumsum([past, np.abs(past)], axis=2, dtype=np.float64)
        if prediction is not None:
            slope, level = self.network.get_layer("loudness").get_weights()
        if prediction is not None and known:
            predicted[:, _PREDICTED[-1] : _PREDICTED[-1] + known] = past_predicted = prediction.predict(past)[:, :, 0]
            loudness[:, reach:begun] = prediction.loudness(past, past_predicted)
        changed = np.zeros((0 if changes is None else len(changes.lengths), num_rows, known + num_samples + 1))
        if changes is not None:
            changed[:, :, 1 : known + 1] = np.cumsum(
                [changes.magnitudes(sums[0], np.arange(1, known + 1), length) for length in changes.lengths], axis=2
            )
        features = np.zeros((num_rows, len(first_layer[0])), np.float32)
        for place in range(known, known + num_samples):
            begin, now = np.maximum(place - self.octaves, 0), reach + place
            means, magnitudes = (sums[:, :, place, None] - sums[:, :, begin]) / np.maximum(place - begin, 1)
            age = min(place, self.window - 1)
            parts_seen = [series[:, now - num_lags : now][:, ::-1], means, np.log(magnitudes + _TINY)]
            parts_seen.append(np.full((num_rows, 2), (age / self.window, 1 / math.sqrt(1 + age))))
            if prediction is not None:
                latest = _PREDICTED[-1] + place
                predicted[:, latest], loud = prediction.next(series[:, place:now], loudness[:, place:now], place)
                parts_seen += [predicted[:, latest - np.array(_PREDICTED)], loud[:, None]]
            if changes is not None:
                parts_seen.append(changes.before(changed, place))
            if self.follows_signal:
                parts_seen.append(signal[:, np.clip(place - known + np.array(_SIGNAL_LAGS), 0, num_samples - 1)])
            np.concatenate(parts_seen, axis=1, out=features)
            hidden = np.clip((features - centre) / spread, -_CLIP, _CLIP)
            for layer, bias in (first_layer, second_layer):
                hidden = hidden @ layer + bias
                hidden /= 1 + np.exp(-np.maximum(hidden, -80))
            logits, shifts, log_scales = np.split(hidden @ last_layer[0] + last_layer[1], 3, axis=1)
            centres = shifts + (features[:, :num_linear] @ linear + linear_bias)
            if prediction is not None:
                log_scales = log_scales + (level + slope[0] * loud[:, None])
            log_scales = np.clip(log_scales, *_LOG_SCALES)
            if self.step:
                log_scales = np.maximum(log_scales, math.log(_LEAST_SCALE * self.step / self.scale / errors[age]))
            value = self._sample(logits + self.start_logits, centres, log_scales, degrees, rng)
            if prediction is not None:
                value = predicted[:, latest] + errors[age] * value
            value = self._to_level(np.clip(value, -self.limit, self.limit))
            series[:, now] = value
            if prediction is not None:
                loudness[:, now] = prediction.loudness(value[:, None], predicted[:, latest, None], age)[:, 0]
            sums[:, :, place + 1] = sums[:, :, place] + (value, np.abs(value))
            if changes is not None:
                changed[:, :, place + 1] = changed[:, :, place] + changes.magnitudes(sums[0], place + 1, changes.lengths).T
            if each > 1 and (place + 1 - known) % self.window == 0:
                chosen = self.selection.choose(series[:, now + 1 - self.window : now + 1].reshape(-1, each, self.window), rng)
                chosen = np.repeat(np.arange(0, num_rows, each) + chosen, each)
                for state, end in (
                    (series, now),
                    (loudness, now),
                    (predicted, _PREDICTED[-1] + place),
                    (sums, place + 1),
                    (changed, place + 1),
                ):
                    seen = state[..., max(end - self.window, 0) : end + 1]  # what later samples depend on
                    seen[...] = seen[..., chosen, :]
        return series[::each, begun:] * np.float32(self.scale)

    def _sample(
        self, logits: np.ndarray, means: np.ndarray, log_scales: np.ndarray, degrees: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        """Draws a sample from each row's mixture, until all are accepted by the calibration."""
        shares = np.cumsum(np.exp(logits - logits.max(axis=1, keepdims=True)), axis=1)
        values, rows = np.empty(len(logits)), np.arange(len(logits))
        while len(rows):
            chosen = (rng.random(len(rows))[:, None] * shares[rows, -1:] > shares[rows]).sum(axis=1).clip(max=self.num_components - 1)
            draw = rng.standard_normal(len(rows)) / np.sqrt(2 * rng.standard_gamma(degrees[chosen] / 2) / degrees[chosen])
            values[rows] = means[rows, chosen] + np.exp(log_scales[rows, chosen]) * draw
            if self.calibration is None:
                break
            probabilities = mixture_probabilities(values[rows], logits[rows], means[rows], log_scales[rows], degrees)
            rows = rows[~self.calibration.accept(probabilities, rng)]
        return values

    def _draw_pasts(self, num_rows: int, num_samples: int, signal: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Draws the real noise that is continued, from windows in which a similar signal followed; none for networks saved before."""
        if self.pasts is None or not num_samples:
            return np.zeros((num_rows, 0), np.float32)
        after = signal[:, np.minimum(np.arange(self.pasts.windows.shape[1]), num_samples - 1)] if self.follows_signal else None
        return ladder.generate(self.pasts, num_rows, rng, after)

    def _to_level(self, values: np.ndarray) -> np.ndarray:
        """Rounds values, in units of the scale, to the levels of quantised noise; other noise stays as it is."""
        if not self.step:
            return values
        return (self.origin + self.step * np.rint((values * self.scale - self.origin) / self.step)) / self.scale

    @property
    def degrees(self) -> np.ndarray:
        """Degrees of freedom of the components, shape `(components,)`; many of them are a normal distribution."""
        (weights,) = self.network.get_layer("degrees").get_weights()
        return np.asarray(_degrees(weights.astype(np.float64)))

    def get_config(self) -> dict:
        """Returns the settings that rebuild the network, as JSON types."""
        names = ("window", "scale", "limit", "step", "origin", "follows_signal", "num_components", "num_rare", "units", "sees_predictions")
        return {name: getattr(self, name) for name in (*names, "sees_changes", "seed")}

    def set_weights(self, weights: Sequence[np.ndarray], tails: str = TAILS) -> None:
        """Sets the weights of the network, as `network.get_weights` returned them.

        Args:
            weights: The weights.
            tails: What the weights of the degrees of freedom are: `TAILS`, or `softplus` in models that were saved before.

        Raises:
            ValueError: If the shapes or `tails` do not belong to this network, or inputs are divided by a spread that is not positive.
        """
        if tails not in (TAILS, "softplus"):
            raise ValueError(f"unknown tails {tails[:40]!r}")
        self.network.set_weights(weights)
        if self.sees_changes and not (self.network.get_layer("standardise").get_weights()[1] > 0).all():
            raise ValueError("a noise network whose inputs have no spread")
        if tails == "softplus":
            (degrees,) = self.network.get_layer("degrees").get_weights()
            self.network.get_layer("degrees").set_weights([np.log(np.logaddexp(0, degrees.astype(np.float64))) / _LOG_UNIT])


@keras.saving.register_keras_serializable("enhsim_tf")
class _Standardise(keras.layers.Layer):
    """Subtracts a constant from each input and divides it by another; both are set before the training."""

    def build(self, input_shape: tuple) -> None:
        shape = input_shape[-1:]
        self.centre = self.add_weight(name="centre", shape=shape, initializer="zeros", trainable=False)
        self.spread = self.add_weight(name="spread", shape=shape, initializer="ones", trainable=False)

    def call(self, features: keras.KerasTensor) -> keras.KerasTensor:
        return (features - self.centre) / self.spread


@keras.saving.register_keras_serializable("enhsim_tf")
class _Degrees(keras.layers.Layer):
    """Degrees of freedom of each component: trainable, the same for all samples.

    The weight is the logarithm of what they are above the least, in units of `_LOG_UNIT`: one step of the optimiser changes few and many
    degrees by the same factor.
    """

    def __init__(self, num_components: int, **settings: object):
        super().__init__(**settings)
        self.num_components = num_components

    def build(self, input_shape: tuple) -> None:
        start = np.where(np.arange(self.num_components) < 2, *_LOG_DEGREES) / _LOG_UNIT
        self.degrees = self.add_weight(
            name="degrees", shape=(self.num_components,), initializer=lambda shape, dtype: start.astype("float32")
        )

    def call(self, logits: keras.KerasTensor) -> keras.KerasTensor:
        return _degrees(self.degrees) + 0 * logits


def _degrees(weights: tf.Tensor | np.ndarray) -> tf.Tensor:
    """Returns the degrees of freedom for the weights of `_Degrees`."""
    return _LEAST_DEGREES + keras.ops.exp(keras.ops.minimum(_LOG_UNIT * weights, _MAX_LOG_DEGREES))


def _split(starts: np.ndarray | None, number: int, window: int, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Returns the rows that train the network, and the rows of the last windows, which share no sample with them.

    If there are too few windows, both are all rows.
    """
    order = np.arange(number) if starts is None else np.argsort(starts, kind="stable")
    num_kept = max(1, round(share * number))
    first, last = order[: number - num_kept], order[number - num_kept :]
    if starts is not None:
        first = first[np.asarray(starts)[first] + window <= np.min(np.asarray(starts)[last])]
    return (first, last) if len(first) else (order, order)
