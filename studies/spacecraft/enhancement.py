"""Errors of the coarse signal and of both enhancers on nominal windows of a channel's test part."""

from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.paper.telemetry import cut_windows
from enhsim_tf.simulator.alignment import Waves
from studies.spacecraft.judging import windows_that_meet
from studies.spacecraft.telemanom import LabelledChannel

if TYPE_CHECKING:
    from enhsim_tf.simulator.simulator import EnhancedSimulator


def error_rows(
    simulator: "EnhancedSimulator", ridge: "EnhancedSimulator", channel: LabelledChannel
) -> list[dict[str, Any]]:
    """Computes the errors of the square wave, `coarse`, and of both enhancers on nominal test windows that share no sample.

    The phase, offset and gain of each window are found with the waveform whose error is computed.

    Args:
        simulator: A simulator that was fitted to the train part, with the paper's network: `enhanced`.
        ridge: The same without a network.
        channel: The channel.

    Returns:
        For each method the median of the normalised root-mean-square error, and the number of windows.
    """
    window = simulator.window
    begins = window * np.arange(len(channel.test) // window)
    begins = begins[~windows_that_meet(begins, window, channel.sequences).any(axis=0)]
    targets = cut_windows(channel.test.values, begins, window)[:, :, None]
    coarse, shift, gain = _waves(simulator, False).align(targets)
    estimates = {
        "coarse": shift[:, None] + gain[:, None] * coarse,
        "ridge": ridge.enhance(*_waves(ridge, True).align(targets)),
        "enhanced": simulator.enhance(*_waves(simulator, True).align(targets)),
    }
    deviation = targets.std(axis=(1, 2), dtype=np.float64)
    deviation = np.where(
        deviation > 0, deviation, np.nan
    )  # the quotient is undefined for constant targets
    rows = []
    for method, estimate in estimates.items():
        errors = (
            np.sqrt(np.mean((estimate - targets) ** 2, axis=(1, 2), dtype=np.float64)) / deviation
        )
        rows.append(
            {
                "method": method,
                "nrmse": float(np.nanmedian(errors)),
                "windows": int(np.sum(~np.isnan(errors))),
            }
        )
    return rows


def _waves(simulator: "EnhancedSimulator", is_enhanced: bool) -> Waves:
    """The alignment by the square wave itself, or by its waveform as the simulator enhances it."""
    waves = simulator.alignment
    waveforms = [simulator.enhance(waves.phases(0)[:, :, None])[:, :, 0]] if is_enhanced else None
    return Waves(waves.simulators, waves.channels, waves.interval_s, waves.window, waveforms)
