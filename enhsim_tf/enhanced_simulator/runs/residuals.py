"""Residuals of telemetry that the enhancer has not learnt from: what the noise model of a run model is fitted to."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from enhsim_tf.coarse_simulator.pairing import Pair
from enhsim_tf.enhancer.held_out_blocks import NUM_FOLDS, split_fold
from enhsim_tf.enhancer.ladder import Rung, fit_rung
from enhsim_tf.enhancer.overlapping import cut_run, enhance_run
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import cut_windows


def windows_of(pairs: Sequence[Pair], window: int, num_windows: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cuts evenly spaced windows out of pairs.

    Args:
        pairs: Pairs of telemetry and coarse run, each at least a window long.
        window: Length of a window in samples.
        num_windows: Maximum number of windows.

    Returns:
        Coarse windows of shape `(windows, samples, columns)`, telemetry windows of shape `(windows, samples)`, and the start
        of each window on the common clock in samples, in ascending order.
    """
    firsts = np.cumsum([0] + [len(pair) - window + 1 for pair in pairs])
    places = np.unique(np.linspace(0, firsts[-1] - 1, min(num_windows, firsts[-1])).astype(np.int64))
    inputs, targets, starts = [], [], []
    for number, pair in enumerate(pairs):
        here = places[(places >= firsts[number]) & (places < firsts[number + 1])] - firsts[number]
        inputs.append(cut_run(pair.coarse, here, window))
        targets.append(cut_windows(pair.telemetry.values, here, window))
        starts.append(pair.first + here)
    return np.concatenate(inputs), np.concatenate(targets), np.concatenate(starts)


def held_out_residuals(
    pairs: Sequence[Pair],
    windows: tuple[np.ndarray, np.ndarray, np.ndarray],
    edges: np.ndarray,
    first: Rung,
    seed: int,
    epochs: int,
) -> list[Telemetry]:
    """Returns the residuals of all blocks of time, each from an enhancer that was not fitted to that block.

    Residuals of the telemetry that an enhancer has learnt from are too small, because it has learnt part of their noise.

    Args:
        pairs: Pairs of telemetry and coarse run.
        windows: Coarse windows, telemetry windows and starts, as returned by `windows_of`.
        edges: Edges of the blocks of time.
        first: The rung that was fitted without the blocks of fold 0.
        seed: Random seed of the rungs of the other folds.
        epochs: Passes of their networks over the training windows.

    Returns:
        Contiguous residuals, each at least a window long.
    """
    inputs, targets, starts = windows
    window, parts = inputs.shape[1], []
    for fold in range(NUM_FOLDS):
        rung = first
        if fold:
            learnt, _ = split_fold(starts, window, edges, fold)
            rung = fit_rung(first.name, inputs[learnt], targets[learnt], starts[learnt], seed, epochs)
        for block in range(fold, len(edges) - 1, NUM_FOLDS):
            for pair in pairs:
                low, high = max(edges[block] - pair.first, 0), min(edges[block + 1] - pair.first, len(pair))
                if high - low >= window:
                    part = pair.part(int(low), int(high))
                    residual = part.telemetry.values - enhance_run(rung.predict, part.coarse, window)
                    parts.append(dataclasses.replace(part.telemetry, values=residual))
    return sorted(parts, key=lambda part: part.offset_s)
