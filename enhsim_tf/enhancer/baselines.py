"""Baselines for the enhancing network: estimates of telemetry windows from coarse windows without a network (section 2.2).

The baselines receive the same data as the network: the same pairs without the flat ones, in the units of the simulator. Their
estimates take the offset and the gain of each window, as the estimates of the network do.
"""

from collections.abc import Callable

import numpy as np

from enhsim_tf.coarse_simulator.square_waves import SquareWaveSimulator
from enhsim_tf.enhancer.ridge import choose_num_neighbours, fit_ridge, nearest_windows
from enhsim_tf.enhancer.training_pairs import Pairs, align_to_enhanced, apply_shift_and_gain

_NUM_PHASES = 400  # of a period, as for the alignment by the network
_ROUNDS = 3  # as for the network; the windows are aligned again between two rounds


def ridge_windows(training: Pairs, pairs: Pairs, interval_s: float) -> np.ndarray:
    """Predicts telemetry windows by ridge regression on coarse windows.

    Args:
        training: Training pairs. Flat windows are dropped, see `Pairs.drop_flat`.
        pairs: Pairs whose telemetry is predicted, from their coarse windows, shifts and gains.
        interval_s: Time between two samples, in seconds.

    Returns:
        Predicted telemetry, float32 of shape `(windows, samples)`.
    """
    return apply_shift_and_gain(_fit_ridge(training.drop_flat(), interval_s)(pairs.coarse), pairs.shift, pairs.gain)


def nearest_window_means(training: Pairs, pairs: Pairs, interval_s: float) -> np.ndarray:
    """Predicts telemetry windows as the mean of the telemetry of the nearest coarse training windows.

    Args:
        training: Training pairs. Flat windows are dropped.
        pairs: Pairs whose telemetry is predicted, from their coarse windows, shifts and gains.
        interval_s: Time between two samples, in seconds.

    Returns:
        Predicted telemetry, float32 of shape `(windows, samples)`.
    """
    training = training.drop_flat()
    number = choose_num_neighbours(training.coarse, training.target_in_unit, training.time_s / interval_s)
    predicted = nearest_windows(training.coarse, training.target_in_unit, pairs.coarse, number)
    return apply_shift_and_gain(predicted, pairs.shift, pairs.gain)


def ridge_aligned_by_its_shape(training: Pairs, pairs: Pairs, coarse: SquareWaveSimulator, interval_s: float) -> np.ndarray:
    """Predicts telemetry windows by ridge regression, whose own waveform sets phase, offset and gain of each window.

    This is the alignment that the network gets in `EnhancedSimulator.fit` with `follow`: after each round of training, the
    windows are aligned again with the estimated waveform instead of the square wave.

    Args:
        training: Training pairs, aligned with the coarse simulator.
        pairs: Pairs whose telemetry is predicted, aligned with the coarse simulator.
        coarse: The coarse simulator. One that is a sum of several waves is not periodic, and its pairs are not aligned again.
        interval_s: Time between two samples, in seconds.

    Returns:
        Predicted telemetry, float32 of shape `(windows, samples)`.
    """
    training = training.drop_flat()
    predict = _fit_ridge(training, interval_s)
    if len(coarse.waves) == 1:
        phases = coarse.waves[0].period_s * np.arange(_NUM_PHASES) / _NUM_PHASES
        at_phases = coarse.simulate(phases[:, None] + interval_s * np.arange(pairs.coarse.shape[1]))
        for _ in range(_ROUNDS - 1):
            training = align_to_enhanced(training, at_phases, predict(at_phases)).drop_flat()
            predict = _fit_ridge(training, interval_s)
        pairs = align_to_enhanced(pairs, at_phases, predict(at_phases))
    return apply_shift_and_gain(predict(pairs.coarse), pairs.shift, pairs.gain)


def _fit_ridge(training: Pairs, interval_s: float) -> Callable[[np.ndarray], np.ndarray]:
    return fit_ridge(training.coarse, training.target_in_unit, training.time_s / interval_s).predict
