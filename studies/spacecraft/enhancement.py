"""Errors of the coarse signal and of three enhancers on nominal windows of a channel's test part."""

from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.simulator.alignment import Waves
from enhsim_tf.telemetry.windows import cut_windows, evenly_spaced_starts
from studies.common.nearest_windows import fit_nearest_windows
from studies.spacecraft.judging import windows_that_meet
from studies.spacecraft.telemanom import LabelledChannel

if TYPE_CHECKING:
    from enhsim_tf.simulator.simulator import EnhancedSimulator

METHODS = ("coarse", "ridge", "nearest windows", "enhanced")


def error_rows(
    simulator: "EnhancedSimulator", ridge: "EnhancedSimulator", channel: LabelledChannel, num_windows: int
) -> list[dict[str, Any]]:
    """Computes the error of each of `METHODS` on nominal test windows that share no sample.

    The phase, offset and gain of each window are found with the square wave for `coarse`, with the waveform of the network for
    `enhanced`, and with that of the regression for the other two.

    Args:
        simulator: A simulator that was fitted to the train part, with the paper's network.
        ridge: The same without a network.
        channel: The channel.
        num_windows: Number of training windows, among which the nearest are looked for.

    Returns:
        For each method the quartiles of the normalised root-mean-square error (`lower`, `nrmse`, `upper`), and the number of windows.
    """
    window, train, test = simulator.window, channel.train, channel.test
    begins = np.arange(len(test) // window) * window
    begins = begins[~windows_that_meet(begins, window, channel.labels.sequences).any(axis=0)]
    targets = cut_windows(test.values, begins, window)[:, :, None]
    square, aligned = _waves(simulator, False).align(targets), _waves(ridge, True).align(targets)
    estimates = {
        "coarse": square.shift[:, None] + square.gain[:, None] * square.coarse,
        "ridge": ridge.enhance(*aligned),
        "nearest windows": aligned.shift[:, None] + aligned.gain[:, None] * _nearest(ridge, train.values, num_windows, aligned.coarse),
        "enhanced": simulator.enhance(*_waves(simulator, True).align(targets)),
    }
    deviation = targets.std(axis=(1, 2), dtype=np.float64)
    deviation = np.where(deviation > 0, deviation, np.nan)  # the quotient is undefined for constant targets
    rows = []
    for method in METHODS:
        errors = np.sqrt(np.mean((estimates[method] - targets) ** 2, axis=(1, 2), dtype=np.float64)) / deviation
        errors = errors[~np.isnan(errors)]
        lower, median, upper = np.quantile(errors, [0.25, 0.5, 0.75]).tolist()
        rows.append({"method": method, "lower": lower, "nrmse": median, "upper": upper, "windows": len(errors)})
    return rows


def _waves(simulator: "EnhancedSimulator", is_enhanced: bool) -> Waves:
    """The alignment by the square wave itself, or by its waveform as the simulator enhances it."""
    waves = simulator.alignment
    waveforms = [simulator.enhance(waves.phases(0)[:, :, None])[:, :, 0]] if is_enhanced else None
    return Waves(waves.simulators, waves.channels, waves.interval_s, waves.window, waveforms)


def _nearest(ridge: "EnhancedSimulator", train: np.ndarray, num_windows: int, coarse: np.ndarray) -> np.ndarray:
    """The means of the train windows, in units of the wave, whose coarse windows are nearest."""
    starts = evenly_spaced_starts([train], ridge.window, num_windows)
    windows, waves = cut_windows(train, starts, ridge.window)[:, :, None], _waves(ridge, True)
    learnt, shift, gain = waves.align(windows)
    kept = ~waves.is_flat(gain).any(axis=1)
    inputs, targets = learnt[kept], ((windows - shift[:, None])[kept] / gain[kept][:, None])[:, :, 0].astype(np.float32)
    return fit_nearest_windows(inputs, targets, starts[kept])(coarse)[:, :, None]
