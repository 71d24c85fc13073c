"""Fits a simulator to a user's channel and evaluates it on held-out telemetry.

The last part of the telemetry is held out. It is not used for training the networks, nor for the offsets and gains of
generated windows. `coarse_choice` decides which coarse simulator the channel gets.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from enhsim_tf.coarse_simulator.commands import CommandTraces
from enhsim_tf.common.console import SILENT, Progress
from enhsim_tf.common.errors import InputError
from enhsim_tf.enhanced_simulator.coarse_choice import COMMANDS, LEAST_SAMPLES, LEVEL, SQUARE_WAVES, CoarseChoice, choose_coarse
from enhsim_tf.enhanced_simulator.fit_options import FitOptions
from enhsim_tf.enhanced_simulator.report_measure import ChannelReport, report_on
from enhsim_tf.enhanced_simulator.runs.fitting import fit_run_model
from enhsim_tf.enhanced_simulator.runs.model import RunModel
from enhsim_tf.enhanced_simulator.runs.options import RunOptions
from enhsim_tf.enhanced_simulator.runs.report import RunReport
from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
from enhsim_tf.enhancer.training_pairs import split_end
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import num_window_starts


def fit_channel(
    parts: Sequence[Telemetry],
    options: FitOptions | None = None,
    verbose: int | str = "auto",
    progress: Progress = SILENT,
    commands: np.ndarray | None = None,
) -> tuple[EnhancedSimulator | RunModel, ChannelReport | RunReport]:
    """Fits a simulator to a channel and evaluates it on the held-out end of the telemetry.

    Args:
        parts: Regularly sampled parts of nominal telemetry on a common clock, as returned by `cleaning.clean`.
        options: Settings of the fit. None uses the defaults.
        verbose: Progress bars: 0 none, 1 always, "auto" on a terminal.
        progress: Reports the progress of the trainings as lines of text.
        commands: Commands of the samples, shape `(samples, commands)`, as returned by `commands.read_commands`. They are used if
            they explain more of the telemetry than a square wave does, or if the wave occurs too rarely. None: there are none.

    Returns:
        The simulator and the report. A channel whose coarse run are its commands gets a run model and its report.

    Raises:
        InputError: If the telemetry is too short or constant.
    """
    options = options or FitOptions()
    learnt, held_out, note = _split(parts, options.held_out)
    choice = choose_coarse(learnt, options.window, commands)
    if choice.kind == COMMANDS:
        said = f"{choice.said} {note}".strip()
        return _fit_commands(parts, choice, options, learnt is parts, said, commands)
    simulator = _fit(learnt, choice, options, verbose, progress, note)
    usable = [part for part in learnt if len(part) >= simulator.window]
    is_held_out = bool(options.held_out) and not note and num_window_starts(held_out, simulator.window) >= simulator.window
    return simulator, report_on(simulator, usable, held_out if is_held_out else usable, is_held_out, options.seed)


def fit_simulator(
    parts: Sequence[Telemetry], options: FitOptions, verbose: int | str = "auto", progress: Progress = SILENT
) -> EnhancedSimulator:
    """Fits an enhanced simulator to all of the given telemetry.

    The coarse simulator is one square wave, or a constant level for telemetry that is not periodic. It is aligned in time,
    offset and gain with each window. The noise is the difference between the telemetry and the enhanced signal.

    Args:
        parts: Regularly sampled parts of nominal telemetry on a common clock.
        options: Settings of the fit; `held_out` is not used.
        verbose: Progress bars: 0 none, 1 always, "auto" on a terminal.
        progress: Reports the progress of the trainings as lines of text.

    Returns:
        The trained simulator.

    Raises:
        InputError: If the telemetry is too short or constant.
    """
    return _fit(parts, choose_coarse(parts, options.window), options, verbose, progress)


def _split(parts: Sequence[Telemetry], share: float) -> tuple[Sequence[Telemetry], Sequence[Telemetry], str]:
    """Splits off the held-out end. Nothing is held out if the rest could not be learnt from; the text says so."""
    learnt, held_out = split_end(parts, share)
    values, whole = (np.concatenate([part.values for part in some]) for some in (learnt, parts))
    if share and len(values) < LEAST_SAMPLES <= len(whole):
        return parts, parts, f"Nothing is held out, because the record has only {len(whole):,} samples."
    if share and np.ptp(values) == 0 < np.ptp(whole):
        return parts, parts, f"Nothing is held out, because the first {1 - share:.0%} of the record is constant."
    return learnt, held_out, ""


def _fit(
    parts: Sequence[Telemetry], choice: CoarseChoice, options: FitOptions, verbose: int | str, progress: Progress, note: str = ""
) -> EnhancedSimulator:
    """Fits the chosen simulator; if nothing can be learnt with square waves, fits a constant level instead, and says so."""
    usable = [part for part in parts if len(part) >= choice.window]
    try:
        simulator = EnhancedSimulator.fit(
            usable,
            choice.coarse,
            seed=options.seed,
            num_windows=options.num_windows,
            epochs=options.epochs,
            window=choice.window,
            noise=options.noise,
            held_out=0.0,
            decay=True,
            follow=True,
            enhancer="coarse" if choice.kind == LEVEL else options.enhancer,
            verbose=verbose,
            progress=progress,
        )
    except InputError as error:
        if choice.kind != SQUARE_WAVES:
            raise
        reason = f"nothing can be learnt from its best square wave ({str(error).rstrip('.')})"
        return _fit(parts, choose_coarse(parts, options.window, refused=reason), options, verbose, progress, note)
    simulator.trained["coarse"] = {"kind": choice.kind, "said": f"{choice.said} {note}".strip()}
    return simulator


def _fit_commands(
    parts: Sequence[Telemetry],
    choice: CoarseChoice,
    options: FitOptions,
    learns_all: bool,
    said: str,
    commands: np.ndarray | None,
) -> tuple[RunModel, RunReport]:
    """Fits a run model whose coarse run are the traces of the commands."""
    traces: CommandTraces | None = choice.traces
    if traces is None or commands is None:
        raise InputError("Expected commands. Received: none. Give those of the telemetry.")
    run_options = RunOptions(
        choice.window,
        options.num_windows,
        options.epochs,
        options.noise,
        None if options.enhancer == "best" else options.enhancer,
        0.0,
        0.0 if learns_all else options.held_out,
        options.seed,
    )
    model, report = fit_run_model(parts, traces.recording(commands), run_options)
    model.trained |= {"coarse": {"kind": "commands", "name": "the commands", "config": traces.get_config()}}
    return model, dataclasses.replace(report, coarse=said)
