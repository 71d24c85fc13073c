"""Chooses the coarse simulator of a channel: square waves, the commands that its file holds, or a constant level.

Square waves need a period that occurs at least twice. Commands need no period. A constant level is what remains: it knows nothing of
what comes when, and says so.
"""

from collections.abc import Sequence, Sized
from typing import NamedTuple

import numpy as np

from enhsim_tf.coarse_simulator.commands import CommandTraces
from enhsim_tf.coarse_simulator.square_waves import ConstantLevel, SquareWaveSimulator
from enhsim_tf.common.errors import InputError
from enhsim_tf.enhancer.ridge import RidgeSolution
from enhsim_tf.simulator.options import (
    FEWEST_SAMPLES,
    LEAST_LEARNT,
    LEAST_WINDOW,
    MOST_WINDOW,
    default_window,
)
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import time_blocks

LEAST_SAMPLES = LEAST_LEARNT * FEWEST_SAMPLES  # a shorter record is refused
_LEAST_EXPLAINED = 0.05  # minimum share of the variance that the coarse simulator explains
_CHANCE = 30.0  # divided by the number of samples: the share of the variance of white noise that the best of all square waves may explain
_FEW_PERIODS = 8  # a wave that occurs less often is used only if no commands explain the telemetry
_NUM_BLOCKS = 5  # of time, on which it is measured what commands explain
_NUM_SHIFTS = 19  # of the commands in time, which show what they explain by chance
_PENALTIES = (
    0.01,
    0.1,
    1.0,
    10.0,
)  # of the ridge regression on traces, relative to the number of samples
_NEGLIGIBLE = 1e-6  # standard deviation of a trace


class CoarseChoice(NamedTuple):
    """The coarse simulator of a channel, or the traces of its commands, and in a sentence or two why, and how little it knows."""

    window: int
    said: str
    coarse: SquareWaveSimulator | None = None
    traces: CommandTraces | None = None


def choose_coarse(
    parts: Sequence[Telemetry],
    window: int | None = None,
    commands: np.ndarray | None = None,
    refused: str | None = None,
) -> CoarseChoice:
    """Chooses the coarse simulator of a channel.

    Args:
        parts: Regularly sampled parts of nominal telemetry on a common clock.
        window: Length of a window in samples. None: chosen, short enough that the record has eight windows.
        commands: Commands of the samples from sample 0 on, shape `(samples, commands)`; None if there are none.
        refused: Why square waves are not to be used; None if they may be.

    Raises:
        InputError: If the telemetry is shorter than eight windows.
    """
    name, longest = parts[0].name, max(parts, key=len)
    values = np.concatenate([part.values for part in parts]).astype(np.float64)
    if len(values) < LEAST_SAMPLES:
        raise too_short(FEWEST_SAMPLES, name, parts)
    coarse, about_wave, period, by_wave = (
        (None, refused, np.nan, 0.0) if refused else _square_wave(longest)
    )
    traces, by_commands = (
        (None, 0.0) if commands is None else _explained_by_commands(parts, commands)
    )
    is_wave_sure = (
        by_commands <= by_wave and len(longest) >= _FEW_PERIODS * period
    )  # few periods may be found in any slow telemetry
    if coarse is not None and (is_wave_sure or not by_commands):
        wanted = window or int(np.clip(round(2 * period), LEAST_WINDOW, MOST_WINDOW))  # two periods
        # a window shorter than half a period shows no edge of the wave most of the time
        fitting = _fitting_window(
            parts,
            wanted,
            wanted if window else max(FEWEST_SAMPLES, min(wanted, int(np.ceil(period / 2)))),
        )
        if fitting:
            return CoarseChoice(fitting, f"coarse simulator: {about_wave}.", coarse)
        about_wave = f"{LEAST_LEARNT} windows of half the period of its best square wave, {period:.0f} samples, do not fit into {len(values):,} samples"
    wanted = window or default_window(len(values))
    fitting = _fitting_window(parts, wanted, wanted if window else FEWEST_SAMPLES)
    if not fitting:
        raise too_short(window or FEWEST_SAMPLES, name, parts)
    if traces is not None and by_commands:
        said = (
            f"coarse simulator: traces of {len(traces.chosen)} of the commands, which explain {by_commands:.0%} of the variance on held-out time; "
            f"{about_wave}. It knows only what the commands tell."
        )
        return CoarseChoice(fitting, said, traces=traces)
    said = (
        f"coarse simulator: none, only a constant level, because {about_wave}, and no command explains it. The simulator knows no shape and no times: "
        f"it generates noise around levels of the record. Of the degraded modes, only drift and dropout change it, and in a series stuck."
    )
    level = ConstantLevel(values.mean(), values.std(), 2 * fitting * longest.interval_s)
    return CoarseChoice(fitting, said, level)


def too_short(window: int, name: str, parts: Sequence[Sized]) -> InputError:
    """Makes the error about parts that do not have enough windows to learn from."""
    lengths, least = [len(part) for part in parts], LEAST_LEARNT * window
    return InputError(
        f"Expected at least {least:,} samples to learn from, {LEAST_LEARNT} windows of {window}. Received: {sum(lengths):,} samples of {name} that are "
        f"not held out, the longest part {max(lengths, default=0):,}. Give more telemetry, or a smaller --window or --held-out."
    )


def _square_wave(telemetry: Telemetry) -> tuple[SquareWaveSimulator | None, str, float, float]:
    """Fits a square wave: the wave or None, what is to be said of it, its period in samples, and the share of the variance it explains."""
    try:
        coarse = SquareWaveSimulator.fit(telemetry)
    except InputError:  # there is no peak in the periodogram
        return None, "nothing in it is periodic", np.nan, 0.0
    samples, values = len(telemetry), telemetry.values
    period = coarse.waves[0].period_s / telemetry.interval_s
    explained = 1 - np.var(values - coarse(telemetry.time_s)) / np.var(values, dtype=np.float64)
    said = (
        f"a square wave with a period of {coarse.waves[0].period_s:.5g} {telemetry.time_unit}, which occurs {samples / period:.1f} times in the longest "
        f"part without a gap and explains {explained:.0%} of the variance there"
    )
    if explained < max(_LEAST_EXPLAINED, _CHANCE / samples):
        return (
            None,
            f"the best square wave explains only {max(explained, 0):.1%} of its variance",
            period,
            explained,
        )
    if period > samples / 2:
        return (
            None,
            f"the best square wave has a period of {period:.0f} of {samples:,} samples",
            period,
            explained,
        )
    return coarse, said, period, explained


def _fitting_window(parts: Sequence[Telemetry], most: int, least: int) -> int | None:
    """Returns the longest window of which the parts hold eight, or None. Parts shorter than a window do not count."""
    lengths = np.array([len(part) for part in parts])
    return next(
        (
            window
            for window in range(most, least - 1, -1)
            if lengths[lengths >= window].sum() >= LEAST_LEARNT * window
        ),
        None,
    )


def _explained_by_commands(
    parts: Sequence[Telemetry], commands: np.ndarray
) -> tuple[CommandTraces | None, float]:
    """Returns the traces of the commands, and the share of the variance that they explain on held-out blocks of time; 0 if by chance."""
    rows = np.concatenate([round(part.offset_s) + np.arange(len(part)) for part in parts])
    values = np.concatenate([part.values for part in parts]).astype(np.float64)
    if len(commands) <= rows.max():
        raise InputError(
            f"Expected commands for {rows.max() + 1:,} samples. Received: {len(commands):,}. Give those of the same file."
        )
    commands = commands[rows]
    traces = CommandTraces.fit(values, commands)
    if traces is None:
        return None, 0.0
    explained = _held_out_share(values, commands)
    shifts = np.linspace(0, len(values), _NUM_SHIFTS + 2)[1:-1].astype(int)
    # slow traces of unrelated commands may follow slow telemetry
    by_chance = (_held_out_share(values, np.roll(commands, shift, axis=0)) for shift in shifts)
    is_real = explained >= _LEAST_EXPLAINED and all(explained > share for share in by_chance)
    return traces, explained if is_real else 0.0


def _held_out_share(values: np.ndarray, commands: np.ndarray) -> float:
    """Returns the share of the variance that the traces explain on held-out blocks of time, with the best of several penalties of ridge."""
    left = np.zeros(len(_PENALTIES))
    for training, held_out in time_blocks(np.arange(len(values)), _NUM_BLOCKS, 1):
        chosen = CommandTraces.fit(values, commands, training)
        if chosen is None:
            return 0.0
        inputs, targets = chosen.traces(commands)[:, None].astype(np.float64), values[:, None]
        inputs *= (
            inputs[training].std(axis=0) > _NEGLIGIBLE
        )  # a trace that training does not show has no weight
        solution = RidgeSolution(inputs[training], targets[training])
        centred, inner = (
            targets[held_out] - solution.target_mean,
            solution.project(inputs[held_out]),
        )
        for number, penalty in enumerate(_PENALTIES):
            left[number] += np.sum(
                (centred - inner @ solution.coefficients(penalty * len(training))) ** 2
            )
    return float(1 - left.min() / (len(values) * np.var(values)))
