"""Errors of the coarse signal and of three enhancers on nominal windows of a channel's test part."""

from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.enhancer.baselines import nearest_window_means
from enhsim_tf.enhancer.training_pairs import cut_pairs, window_errors
from enhsim_tf.telemetry.telemanom import LabelledChannel
from enhsim_tf.telemetry.windows import disjoint_starts, evenly_spaced_starts
from studies.spacecraft.judging import windows_that_meet

if TYPE_CHECKING:
    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

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
    begins = disjoint_starts(len(test), window)
    begins = begins[~windows_that_meet(begins, window, channel.labels.sequences).any(axis=0)]
    pairs = cut_pairs([test], simulator.coarse, begins, window, follow=True)
    aligned = ridge.align_to_enhanced(pairs)
    starts = evenly_spaced_starts([train], window, num_windows)
    learnt = ridge.align_to_enhanced(cut_pairs([train], ridge.coarse, starts, window, follow=True))
    estimates = {
        "coarse": pairs.coarse_rescaled,
        "ridge": ridge.follow(aligned),
        "nearest windows": nearest_window_means(learnt, aligned, train.interval_s),
        "enhanced": simulator.follow(simulator.align_to_enhanced(pairs)),
    }
    rows = []
    for method in METHODS:
        errors = window_errors(estimates[method], pairs.target)
        errors = errors[~np.isnan(errors)]
        lower, median, upper = np.quantile(errors, [0.25, 0.5, 0.75]).tolist()
        rows.append({"method": method, "lower": lower, "nrmse": median, "upper": upper, "windows": len(errors)})
    return rows
