"""Errors of the coarse signal, ridge regression, the nearest windows and the enhancer on nominal windows of a channel's test part."""

from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.enhancer.baselines import nearest_window_means
from enhsim_tf.enhancer.ridge import fit_ridge
from enhsim_tf.enhancer.training_pairs import Pairs, apply_shift_and_gain, cut_pairs, window_errors
from enhsim_tf.telemetry.telemanom import LabelledChannel
from enhsim_tf.telemetry.windows import disjoint_starts, evenly_spaced_starts
from studies.spacecraft.matched import windows_that_meet
from studies.spacecraft.no_network import RidgeSimulator

if TYPE_CHECKING:
    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

METHODS = {
    "coarse": "the coarse signal, aligned by its edges",
    "ridge": "tuned ridge regression, aligned by the edges of the coarse signal",
    "ridge, own clock": "tuned ridge regression, aligned by its own waveform",
    "nearest windows": "the mean of the nearest training windows, aligned by the waveform of the regression",
    "ridge, network's clock": "tuned ridge regression, aligned by the waveform of the enhancer",
    "enhanced": "the enhancer, aligned by its own waveform",
}
"""Methods that are compared, with how their phase, offset and gain are found in each window."""


def errors_of_methods(simulator: "EnhancedSimulator", no_network: RidgeSimulator, channel: LabelledChannel) -> list[dict[str, Any]]:
    """Computes the error of each method on nominal test windows that share no sample.

    Args:
        simulator: The simulator of the channel, fitted to its train part.
        no_network: Ridge regression, fitted to the same part.
        channel: The channel.

    Returns:
        For each method, the quartiles of the normalised root-mean-square error (`lower`, `nrmse`, `upper`), and the number of
        windows.
    """
    window, train, test = simulator.window, channel.train, channel.test
    begins, starts = disjoint_starts(len(test), window), evenly_spaced_starts([train], window, len(no_network.residuals))
    begins = begins[~windows_that_meet(begins, window, len(test), channel.labels.sequences).any(axis=0)]
    by_edges = cut_pairs([test], simulator.coarse, begins, window, follow=True)
    by_shape, own_clock = simulator.pairs(test, begins), no_network.align(by_edges)
    train_by_edges = cut_pairs([train], simulator.coarse, starts, window, follow=True)

    def ridge(training: Pairs, pairs: Pairs) -> np.ndarray:
        training = training.drop_flat()
        fitted = fit_ridge(training.coarse, training.target_in_unit, (training.time_s - train.offset_s) / train.interval_s)
        return apply_shift_and_gain(fitted.predict(pairs.coarse), pairs.shift, pairs.gain)

    windows = {
        "coarse": by_edges.coarse_rescaled,
        "ridge": ridge(train_by_edges, by_edges),
        "ridge, own clock": no_network.follow(own_clock),
        "nearest windows": nearest_window_means(no_network.align(train_by_edges), own_clock, train.interval_s),
        "ridge, network's clock": ridge(simulator.pairs(train, starts), by_shape),
        "enhanced": simulator.follow(by_shape),
    }
    found = []
    for method, estimate in windows.items():
        errors = window_errors(estimate, by_edges.target)
        errors = errors[~np.isnan(errors)]
        quartiles = dict(zip(("lower", "nrmse", "upper"), np.quantile(errors, [0.25, 0.5, 0.75]).tolist(), strict=True))
        found.append({"method": method, **quartiles, "windows": len(errors)})
    return found
