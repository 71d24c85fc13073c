"""Simulator without a network: tuned ridge regression, and whole windows of its own residuals (the baseline for sections 2.2 and 2.3)."""

import dataclasses

import numpy as np

from enhsim_tf.coarse_simulator.square_waves import SquareWaveSimulator
from enhsim_tf.enhancer.ridge import Ridge, fit_ridge
from enhsim_tf.enhancer.training_pairs import Pairs, align_to_enhanced, apply_shift_and_gain, cut_pairs
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import evenly_spaced_starts

_NUM_ROUNDS = 3  # ridge regression is fitted, and windows are aligned with its waveform, as often as in the training of the network
_NUM_PHASES = 400  # phases of one period at which a window is compared with the waveform
_START_RANGE = 1_000_000  # windows begin at a random sample below this one, so that every phase of the wave occurs


@dataclasses.dataclass(frozen=True)
class RidgeSimulator:
    """Maps coarse windows to telemetry by ridge regression, and adds residual windows that are drawn again.

    Args:
        coarse: The coarse simulator, one square wave.
        ridge: The regression, in units of the coarse simulator's level and amplitude.
        interval_s: Sampling interval in seconds.
        levels: Offset and gain of training windows, shape `(windows, 2)`; generated windows use one of these rows.
        residuals: Telemetry minus prediction in training windows, shape `(windows, samples)`.
    """

    coarse: SquareWaveSimulator
    ridge: Ridge
    interval_s: float
    levels: np.ndarray
    residuals: np.ndarray

    @classmethod
    def fit(cls, telemetry: Telemetry, coarse: SquareWaveSimulator, window: int, num_windows: int) -> "RidgeSimulator":
        """Fits ridge regression to windows of telemetry. No draw is involved.

        The phase, offset and gain of each window are found with the square wave first, and with the regression's own waveform
        after that.

        Args:
            telemetry: Nominal telemetry.
            coarse: The coarse simulator.
            window: Length of a window in samples.
            num_windows: Maximum number of windows, spread evenly.

        Returns:
            The simulator.

        Raises:
            InputError: If no window follows the coarse simulator.
        """
        starts = evenly_spaced_starts([telemetry], window, num_windows)
        pairs = cut_pairs([telemetry], coarse, starts, window, follow=True)
        for _ in range(_NUM_ROUNDS):
            learnt = pairs.drop_flat()
            ridge = fit_ridge(learnt.coarse, learnt.target_in_unit, (learnt.time_s - telemetry.offset_s) / telemetry.interval_s)
            pairs = _aligned(pairs, coarse, ridge, telemetry.interval_s)
        learnt = pairs.drop_flat()
        residuals = pairs.target - apply_shift_and_gain(ridge.predict(pairs.coarse), pairs.shift, pairs.gain)
        return cls(coarse, ridge, telemetry.interval_s, np.stack([learnt.shift, learnt.gain], axis=1), residuals)

    def align(self, pairs: Pairs) -> Pairs:
        """Finds the phase, offset and gain of pairs with the regression's waveform."""
        return _aligned(pairs, self.coarse, self.ridge, self.interval_s)

    def follow(self, pairs: Pairs) -> np.ndarray:
        """Predicts the telemetry of pairs from their coarse windows, float32 of shape `(windows, samples)`."""
        return apply_shift_and_gain(self.ridge.predict(pairs.coarse), pairs.shift, pairs.gain)

    def generate(self, num_windows: int, seed: int) -> np.ndarray:
        """Generates windows at random phases, each at a level and with a whole residual window of the training telemetry.

        Args:
            num_windows: Number of windows.
            seed: Random seed. The same seed gives the same windows.

        Returns:
            float32 array of shape `(num_windows, samples)`, in the unit of the telemetry.
        """
        rng = np.random.default_rng(seed)
        begins = rng.integers(0, _START_RANGE, num_windows)
        coarse = self.coarse.simulate(self.interval_s * (begins[:, None] + np.arange(self.residuals.shape[1])))
        levels = self.levels[rng.integers(0, len(self.levels), num_windows)]
        noise = self.residuals[rng.integers(0, len(self.residuals), num_windows)]
        return apply_shift_and_gain(self.ridge.predict(coarse), *levels.T) + noise


def _aligned(pairs: Pairs, coarse: SquareWaveSimulator, ridge: Ridge, interval_s: float) -> Pairs:
    phases = coarse.waves[0].period_s * np.arange(_NUM_PHASES) / _NUM_PHASES
    windows = coarse.simulate(phases[:, None] + interval_s * np.arange(pairs.target.shape[1]))
    return align_to_enhanced(pairs, windows, ridge.predict(windows))
