"""Chooses the coarse simulator of a channel: a square wave, or a constant level.

A square wave needs a period that occurs at least twice. A constant level is what remains: it knows
nothing of what comes when, and says so.
"""

from collections.abc import Sequence, Sized
from typing import NamedTuple

import numpy as np

from enhsim_tf.coarse.square_waves import ConstantLevel, SquareWaveSimulator
from enhsim_tf.common.errors import InputError
from enhsim_tf.fitting.options import (
    FEWEST_SAMPLES,
    LEAST_LEARNT,
    LEAST_WINDOW,
    MOST_WINDOW,
    default_window,
)
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import longest_window

LEAST_SAMPLES = LEAST_LEARNT * FEWEST_SAMPLES  # a shorter record is refused
_LEAST_EXPLAINED = 0.05  # minimum share of the variance that the coarse simulator explains
# divided by the number of samples: the share of the variance of white noise that the best of all
# square waves may explain
_CHANCE = 30.0


class CoarseChoice(NamedTuple):
    """The coarse simulator of a channel, and in a sentence or two why, and how little it knows."""

    window: int
    said: str
    coarse: SquareWaveSimulator


def choose_coarse(
    telemetry: Telemetry, window: int | None = None, refused: str | None = None
) -> CoarseChoice:
    """Chooses the coarse simulator of a channel.

    Args:
        telemetry: Nominal telemetry of the channel.
        window: Length of a window in samples. None: chosen, short enough that the record has eight
            windows and that parts with half of its samples have one.
        refused: Why square waves are not to be used; None if they may be.

    Raises:
        InputError: If the telemetry is shorter than eight windows.
    """
    (name,) = telemetry.columns
    parts = telemetry.parts
    longest = max(telemetry.pieces(), key=len)
    usual = usual_length(parts)
    values = telemetry.values[:, 0].astype(np.float64)
    if len(values) < LEAST_SAMPLES:
        raise too_short(FEWEST_SAMPLES, name, parts)
    coarse, about_wave = (None, refused) if refused else _square_wave(longest)
    if coarse is not None:
        period = coarse.period_s / telemetry.interval_s
        two_periods = min(round(2 * period), usual)
        wanted = window or int(np.clip(two_periods, LEAST_WINDOW, MOST_WINDOW))
        # a window shorter than half a period shows no edge of the wave most of the time
        least = wanted if window else max(FEWEST_SAMPLES, min(wanted, int(np.ceil(period / 2))))
        fitting = longest_window(parts, wanted, least, LEAST_LEARNT)
        if fitting:
            return CoarseChoice(fitting, f"coarse simulator: {about_wave}.", coarse)
        about_wave = (
            f"{LEAST_LEARNT} windows of half the period of its best square wave, {period:.0f} "
            f"samples, do not fit into {len(values):,} samples"
        )
    wanted = window or min(default_window(len(values)), usual)
    fitting = longest_window(parts, wanted, wanted if window else FEWEST_SAMPLES, LEAST_LEARNT)
    if not fitting:
        raise too_short(window or FEWEST_SAMPLES, name, parts)
    said = (
        f"coarse simulator: none, only a constant level, because {about_wave}. The simulator knows "
        "no shape and no times: it generates noise around levels of the record. Of the degraded "
        "modes, only drift and dropout change it, and in a series stuck."
    )
    # of a channel that never varies, any spread does
    spread = values.std() or 1.0
    level = ConstantLevel(values.mean(), spread, 2 * fitting * longest.interval_s)
    return CoarseChoice(fitting, said, level)


def usual_length(parts: Sequence[Sized]) -> int:
    """Returns the length that parts with half of all samples have at least, but no less than the
    fewest samples of a window.
    """
    lengths = np.sort([len(part) for part in parts])[::-1]
    usual = lengths[np.searchsorted(np.cumsum(lengths), lengths.sum() / 2)]
    return max(FEWEST_SAMPLES, int(usual))


def on_short_parts(telemetry: Telemetry, window: int) -> list[str]:
    """Returns what is to be reported about parts that are shorter than a window."""
    lengths = [len(part) for part in telemetry.parts]
    short = [length for length in lengths if length < window]
    if not short:
        return []
    return [
        f"{len(short):,} of {len(lengths):,} parts are shorter than a window of {window:,} samples "
        f"and not used, {sum(short):,} of {sum(lengths):,} samples; a smaller --window uses more"
    ]


def too_short(window: int, name: str, parts: Sequence[Sized]) -> InputError:
    """Makes the error about parts that do not have enough windows to learn from."""
    lengths = [len(part) for part in parts]
    least = LEAST_LEARNT * window
    smaller = ", or a smaller --window or --held-out" if window > FEWEST_SAMPLES else ""
    return InputError(
        f"Expected at least {least:,} samples to learn from, {LEAST_LEARNT} windows of {window}. "
        f"Received: {sum(lengths):,} samples of {name} that are "
        f"not held out, the longest part {max(lengths, default=0):,}. Give more telemetry{smaller}."
    )


def _square_wave(telemetry: Telemetry) -> tuple[SquareWaveSimulator | None, str]:
    """Fits a square wave: the wave, or None if it is not to be used, and what is to be said."""
    if not np.ptp(telemetry.values):
        return None, "it never varies there, so that any other value is an anomaly"
    try:
        coarse = SquareWaveSimulator.fit(telemetry)
    except InputError:  # there is no peak in the periodogram
        return None, "nothing in it is periodic"
    samples = len(telemetry)
    values = telemetry.values[:, 0]
    period = coarse.period_s / telemetry.interval_s
    explained = 1 - np.var(values - coarse(telemetry.time_s)) / np.var(values, dtype=np.float64)
    if explained < max(_LEAST_EXPLAINED, _CHANCE / samples):
        return None, f"the best square wave explains only {max(explained, 0):.1%} of its variance"
    if period > samples / 2:
        return None, f"the best square wave has a period of {period:.0f} of {samples:,} samples"
    return coarse, (
        f"a square wave with a period of {coarse.period_s:.5g} {telemetry.clock.unit}, "
        f"which occurs {samples / period:.1f} times in the longest "
        f"part without a gap and explains {explained:.0%} of the variance there"
    )
