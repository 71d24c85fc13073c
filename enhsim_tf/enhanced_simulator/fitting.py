"""From telemetry of one's own to a trained simulator and an honest report: every choice that the paper leaves to its reader.

The end of the telemetry is held out: neither network, nor the levels that windows are drawn at, have seen it.
"""

from collections.abc import Sequence

import numpy as np

from enhsim_tf.coarse_simulator.square_waves import SquareWaveSimulator
from enhsim_tf.common.console import SILENT, Progress
from enhsim_tf.common.errors import InputError
from enhsim_tf.enhanced_simulator.fit_options import FitOptions
from enhsim_tf.enhanced_simulator.report_measure import ChannelReport, report_on
from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
from enhsim_tf.enhancer.training_pairs import num_places, split_off
from enhsim_tf.telemetry.series import Telemetry

LEAST_WINDOW, MOST_WINDOW = 64, 500  # samples of the window that is chosen; the paper's is 500
_LEAST_EXPLAINED = 0.05  # of the variance, by one square wave that runs free; of white noise the best explains one per cent
_LEAST_LEARNT = 8  # windows that the networks learn from, at least


def fit_channel(
    parts: Sequence[Telemetry], options: FitOptions | None = None, verbose: int | str = "auto", progress: Progress = SILENT
) -> tuple[EnhancedSimulator, ChannelReport]:
    """Fits an enhanced simulator to a channel and reports on what was held out.

    Args:
        parts: Regular stretches of nominal telemetry on one clock, as `cleaning.clean` makes them.
        options: Every choice.
        verbose: Progress bars: 0 none, 1 always, "auto" on a terminal.
        progress: Tells in lines how far the trainings are.

    Returns:
        The simulator and the report.

    Raises:
        InputError: If the telemetry is too short, constant or not periodic.
    """
    options = options or FitOptions()
    learnt, held_out = split_off(parts, options.held_out)
    simulator = fit_simulator(learnt, options, verbose, progress)
    usable = [part for part in learnt if len(part) >= simulator.window]
    is_held_out = bool(options.held_out) and num_places(held_out, simulator.window) >= simulator.window
    return simulator, report_on(simulator, usable, held_out if is_held_out else usable, is_held_out, options.seed)


def fit_simulator(
    parts: Sequence[Telemetry], options: FitOptions, verbose: int | str = "auto", progress: Progress = SILENT
) -> EnhancedSimulator:
    """Fits an enhanced simulator to all that is given.

    The coarse simulator is one square wave, set to the clock and the levels of each window; the noise is what the
    enhancer leaves of the telemetry.

    Args:
        parts: Regular stretches of nominal telemetry on one clock.
        options: Every choice but `held_out`.
        verbose: Progress bars: 0 none, 1 always, "auto" on a terminal.
        progress: Tells in lines how far the trainings are.

    Raises:
        InputError: If the telemetry is too short, constant or not periodic.
    """
    longest = max(parts, key=len)
    coarse = SquareWaveSimulator.fit(longest)
    period, samples = coarse.waves[0].period_s / longest.interval_s, len(longest)
    explained = 1 - np.var(longest.values - coarse(longest.time_s)) / np.var(longest.values, dtype=np.float64)
    if period > samples / 2 or explained < _LEAST_EXPLAINED:
        raise InputError(
            f"Expected something periodic, at least two periods long. Received: {longest.name}, whose best square wave has a period of {period:.0f} "
            f"of {samples} samples and explains {explained:.1%} of its variance. Give more telemetry or another channel."
        )
    window = options.window or window_of(coarse, parts[0].interval_s)
    usable = [part for part in parts if len(part) >= window]
    samples = sum(map(len, usable))
    if samples < _LEAST_LEARNT * window:
        raise InputError(
            f"Expected at least {_LEAST_LEARNT} windows of {window} samples to learn from. Received: {samples} samples of {parts[0].name} "
            "in pieces as long as a window. Give more telemetry or a smaller window."
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
        verbose=verbose,
        progress=progress,
    )


def window_of(coarse: SquareWaveSimulator, interval_s: float) -> int:
    """Two periods of a coarse simulator in samples, within what the networks are made for."""
    longest_s = max(wave.period_s for wave in coarse.waves)
    return int(np.clip(round(2 * longest_s / interval_s), LEAST_WINDOW, MOST_WINDOW))
