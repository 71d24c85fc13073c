"""From telemetry of one's own to a trained simulator and an honest report: every choice that the paper leaves to its reader.

The end of the telemetry is held out: neither network, nor the levels that windows are drawn at, have seen it.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from enhsim_tf.channel_report import ChannelReport, report_on
from enhsim_tf.enhanced_simulator import EnhancedSimulator
from enhsim_tf.errors import InputError
from enhsim_tf.pairs import num_places, split_off
from enhsim_tf.simulator import SquareWaveSimulator
from enhsim_tf.telemetry import Telemetry

LEAST_WINDOW, MOST_WINDOW = 64, 500  # samples of the window that is chosen; the paper's is 500
FEWEST_SAMPLES = 32  # of a window that is asked for: the discriminator's filters are 20 wide
_LEAST_EXPLAINED = 0.05  # of the variance, by one square wave that runs free; of white noise the best explains one per cent
_LEAST_LEARNT = 8  # windows that the networks learn from, at least


@dataclasses.dataclass(frozen=True)
class FitOptions:
    """How a simulator is fitted to a channel.

    Args:
        window: Samples of a window. None: two periods, from 64 to 500 samples.
        num_windows: Training windows, cut at random places.
        epochs: Passes of the enhancer over them, at a learning rate that falls to zero.
        num_iterations: Adversarial iterations of the noise.
        noise: `convolutional`, or the networks of the `paper`.
        held_out: Share of the telemetry, its end, that is kept for the report; 0 learns from all and reports on the same.
        seed: Seed of everything drawn.
    """

    window: int | None = None
    num_windows: int = 2_500
    epochs: int = 6
    num_iterations: int = 1_000
    noise: str = "convolutional"
    held_out: float = 0.2
    seed: int = 0

    def __post_init__(self):
        if not 0 <= self.held_out <= 0.5:
            raise InputError(f"Expected held_out from 0 to 0.5. Received: held_out={self.held_out}.")
        if self.window is not None and self.window < FEWEST_SAMPLES:
            raise InputError(f"Expected a window of at least {FEWEST_SAMPLES} samples. Received: window={self.window}.")


def fit_channel(
    parts: Sequence[Telemetry], options: FitOptions | None = None, verbose: int | str = "auto"
) -> tuple[EnhancedSimulator, ChannelReport]:
    """Fits an enhanced simulator to a channel and reports on what was held out.

    Args:
        parts: Regular stretches of nominal telemetry on one clock, as `cleaning.clean` makes them.
        options: Every choice.
        verbose: Progress bars: 0 none, 1 always, "auto" on a terminal.

    Returns:
        The simulator and the report.

    Raises:
        InputError: If the telemetry is too short, constant or not periodic.
    """
    options = options or FitOptions()
    learnt, held_out = split_off(parts, options.held_out)
    simulator = fit_simulator(learnt, options, verbose)
    usable = [part for part in learnt if len(part) >= simulator.window]
    is_held_out = bool(options.held_out) and num_places(held_out, simulator.window) >= simulator.window
    return simulator, report_on(simulator, usable, held_out if is_held_out else usable, is_held_out, options.seed)


def fit_simulator(parts: Sequence[Telemetry], options: FitOptions, verbose: int | str = "auto") -> EnhancedSimulator:
    """Fits an enhanced simulator to all that is given.

    The coarse simulator is one square wave, set to the clock and the levels of each window; the noise is what the
    enhancer leaves of the telemetry.

    Args:
        parts: Regular stretches of nominal telemetry on one clock.
        options: Every choice but `held_out`.
        verbose: Progress bars: 0 none, 1 always, "auto" on a terminal.

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
    )


def window_of(coarse: SquareWaveSimulator, interval_s: float) -> int:
    """Two periods of a coarse simulator in samples, within what the networks are made for."""
    longest_s = max(wave.period_s for wave in coarse.waves)
    return int(np.clip(round(2 * longest_s / interval_s), LEAST_WINDOW, MOST_WINDOW))
