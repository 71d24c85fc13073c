"""Fits an enhanced simulator to a user's channel and evaluates it on held-out telemetry.

The last part of the telemetry is held out. It is not used for training the networks, nor for the offsets and gains of
generated windows.
"""

from collections.abc import Sequence

import numpy as np

from enhsim_tf.coarse_simulator.square_waves import SquareWaveSimulator
from enhsim_tf.common.console import SILENT, Progress
from enhsim_tf.common.errors import InputError
from enhsim_tf.enhanced_simulator.fit_options import FitOptions
from enhsim_tf.enhanced_simulator.report_measure import ChannelReport, report_on
from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
from enhsim_tf.enhancer.training_pairs import split_end
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import num_window_starts

LEAST_WINDOW, MOST_WINDOW = 64, 500  # limits of the default window length in samples; the paper uses 500
_LEAST_EXPLAINED = 0.05  # minimum share of the variance that one square wave explains; for white noise, the best fit explains about 0.01
_LEAST_LEARNT = 8  # minimum length of the training telemetry, in windows


def fit_channel(
    parts: Sequence[Telemetry], options: FitOptions | None = None, verbose: int | str = "auto", progress: Progress = SILENT
) -> tuple[EnhancedSimulator, ChannelReport]:
    """Fits an enhanced simulator to a channel and evaluates it on the held-out end of the telemetry.

    Args:
        parts: Regularly sampled parts of nominal telemetry on a common clock, as returned by `cleaning.clean`.
        options: Settings of the fit. None uses the defaults.
        verbose: Progress bars: 0 none, 1 always, "auto" on a terminal.
        progress: Reports the progress of the trainings as lines of text.

    Returns:
        The simulator and the report.

    Raises:
        InputError: If the telemetry is too short, constant or not periodic.
    """
    options = options or FitOptions()
    learnt, held_out = split_end(parts, options.held_out)
    simulator = fit_simulator(learnt, options, verbose, progress)
    usable = [part for part in learnt if len(part) >= simulator.window]
    is_held_out = bool(options.held_out) and num_window_starts(held_out, simulator.window) >= simulator.window
    return simulator, report_on(simulator, usable, held_out if is_held_out else usable, is_held_out, options.seed)


def fit_simulator(
    parts: Sequence[Telemetry], options: FitOptions, verbose: int | str = "auto", progress: Progress = SILENT
) -> EnhancedSimulator:
    """Fits an enhanced simulator to all of the given telemetry.

    The coarse simulator is one square wave. It is aligned in time, offset and gain with each window. The noise is the
    difference between the telemetry and the enhanced signal.

    Args:
        parts: Regularly sampled parts of nominal telemetry on a common clock.
        options: Settings of the fit; `held_out` is not used.
        verbose: Progress bars: 0 none, 1 always, "auto" on a terminal.
        progress: Reports the progress of the trainings as lines of text.

    Returns:
        The trained simulator.

    Raises:
        InputError: If the telemetry is too short, constant or not periodic.
    """
    longest = max(parts, key=len)
    coarse = SquareWaveSimulator.fit(longest)
    period, samples = coarse.waves[0].period_s / longest.interval_s, len(longest)
    explained = 1 - np.var(longest.values - coarse(longest.time_s)) / np.var(longest.values, dtype=np.float64)
    if period > samples / 2 or explained < _LEAST_EXPLAINED:
        raise InputError(
            f"Expected periodic telemetry, at least two periods long. Received: {longest.name}, whose best square wave has a period of {period:.0f} "
            f"of {samples} samples and explains {explained:.1%} of its variance. Give more telemetry or another channel."
        )
    window = options.window or window_of(coarse, parts[0].interval_s)
    usable = [part for part in parts if len(part) >= window]
    samples = sum(map(len, usable))
    if samples < _LEAST_LEARNT * window:
        raise InputError(
            f"Expected at least {_LEAST_LEARNT} windows of {window} samples to learn from. Received: {samples} samples of {parts[0].name} "
            "in parts at least as long as a window. Give more telemetry or a smaller window."
        )
    return EnhancedSimulator.fit(
        usable,
        coarse,
        options.seed,
        options.num_windows,
        options.epochs,
        options.num_iterations,
        window=window,
        noise=options.noise,
        extraction="enhancer",
        held_out=0.0,
        decay=True,
        follow=True,
        enhancer=options.enhancer,
        verbose=verbose,
        progress=progress,
    )


def window_of(coarse: SquareWaveSimulator, interval_s: float) -> int:
    """Returns the default window length: two periods of the coarse simulator in samples, limited to the networks' range.

    Args:
        coarse: The coarse simulator.
        interval_s: Sampling interval in seconds.
    """
    longest_s = max(wave.period_s for wave in coarse.waves)
    return int(np.clip(round(2 * longest_s / interval_s), LEAST_WINDOW, MOST_WINDOW))
