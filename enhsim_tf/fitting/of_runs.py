"""Fits the enhancer to a recorded run of the user's simulator and telemetry of the same time."""

import itertools

import numpy as np

from enhsim_tf.coarse.alignment import Paired
from enhsim_tf.coarse.interface import CoarseSimulator, name_of, record
from enhsim_tf.coarse.pairing import Delay, estimate_delay, pair_recordings
from enhsim_tf.coarse.runs import Runs
from enhsim_tf.common.console import Progress
from enhsim_tf.common.errors import InputError
from enhsim_tf.enhancer.candidates import NUM_FOLDS, Choice, Training, choose_enhancer, split_fold
from enhsim_tf.enhancer.model import Enhancer
from enhsim_tf.fitting.coarse_choice import on_short_parts, too_short, usual_length
from enhsim_tf.fitting.fitted import Fitted, num_training_windows
from enhsim_tf.fitting.options import LEAST_LEARNT, FitOptions, default_window
from enhsim_tf.noise.registry import RESIDUAL_WINDOWS
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import cut, evenly_spaced_starts, times_of, windows_of


def fit_runs(
    recording: Telemetry,
    coarse: CoarseSimulator,
    options: FitOptions,
    progress: Progress,
) -> Fitted:
    """Fits the enhancer to runs of a coarse simulator; see `fit.fit`.

    Args:
        recording: Nominal telemetry.
        coarse: The simulator, or a run of it.
        options: Options of the fit.
        progress: Reports the progress.
    """
    learnable = len(recording) - round(options.held_out * len(recording))
    guess = options.window or default_window(learnable)
    if learnable < LEAST_LEARNT * guess:
        raise too_short(guess, recording.name, recording.parts)
    run, notes = _run_of(coarse, recording)
    is_given = options.delay_s is not None
    delay = Delay(options.delay_s) if is_given else _delay_of(recording, run, guess)
    paired, run_there = pair_recordings(recording, run, delay.seconds, 2)
    wanted = default_window((1 - options.held_out) * len(paired))
    window = options.window or min(wanted, usual_length(paired.parts))
    notes.append(_on_delay(delay, recording, is_given))
    if len(paired) < len(recording):
        notes.append(
            f"{len(paired):,} of {len(recording):,} samples of the telemetry have a coarse run of "
            "the same time; the others are not used"
        )
    notes += on_short_parts(paired, window)
    run_there, left_out = _without_constant(run_there)
    whole = Paired(paired, run_there).long_enough(window)
    halves = (None, None) if whole is None else whole.split_end(options.held_out)
    learnt, held_out = [half and half.long_enough(window) for half in halves]
    if learnt is None or len(learnt) < LEAST_LEARNT * window:
        lengths = () if learnt is None else learnt.telemetry.parts
        raise too_short(window, f"{recording.name} with {run.name}", lengths)
    number = num_training_windows(options, window, len(recording.columns))
    starts = evenly_spaced_starts(learnt.telemetry.parts, window, number)
    inputs = windows_of(learnt.run, starts, window)
    targets = windows_of(learnt.telemetry, starts, window)
    times = times_of(learnt.telemetry, starts, window)
    choice = choose_enhancer(
        inputs, targets, times, options.enhancer, options.seed, options.epochs, progress
    )
    residuals = _held_out_residuals(learnt, choice, inputs, targets, times, options)
    places = evenly_spaced_starts(residuals, window, number)
    noise, clean = np.split(cut(residuals, places, window), 2, axis=2)
    unlearnt = [stretch[:, : len(recording.columns)] for stretch in residuals]
    alignment = Runs(learnt.run, recording.columns, window, delay.seconds)
    late = []
    if held_out is not None:
        enhanced = alignment.explained(choice.enhancer, held_out)
        parts = zip(held_out.telemetry.parts, enhanced, strict=True)
        late = [part.values - explained for part, explained in parts]
    return Fitted(
        alignment=alignment,
        choice=choice,
        noise=noise,
        clean=clean,
        noise_name=RESIDUAL_WINDOWS,  # the signal of a run seldom repeats: its neighbours are few
        nominal=whole,
        learnt=learnt,
        held_out=held_out,
        learnt_series=unlearnt,
        nominal_series=[*unlearnt, *late],
        options=options,
        coarse="",
        notes=[*notes, *left_out],
    )


def _run_of(coarse: CoarseSimulator, recording: Telemetry) -> tuple[Telemetry, list[str]]:
    """Returns the recording, or the simulator's run at the times of the telemetry, and what is to
    be reported about it.
    """
    if isinstance(coarse, Telemetry):
        return coarse, list(coarse.notes)
    begin = recording.parts[0].offset_s
    last = recording.parts[-1]
    number = round((last.offset_s - begin) / recording.interval_s) + len(last)
    run = record(coarse, begin + recording.interval_s * np.arange(number), start=recording.start)
    return run, [f"{name_of(coarse)}: simulated at the times of the telemetry, {number:,} samples"]


def _delay_of(recording: Telemetry, run: Telemetry, window: int) -> Delay:
    """Estimates the delay from the channel that is most correlated with a coarse column."""
    delays = [estimate_delay(recording.select([name]), run, window) for name in recording.columns]
    clear = [delay for delay in delays if delay.column is not None]
    return max(clear, key=lambda delay: abs(delay.correlation)) if clear else delays[0]


def _on_delay(delay: Delay, telemetry: Telemetry, was_given: bool) -> str:
    unit = telemetry.clock.unit
    samples = delay.seconds / telemetry.interval_s
    if was_given:
        return f"delay: {delay.seconds:g} {unit} as given, {samples:g} samples"
    if delay.column is None:
        return (
            "delay: none could be estimated, because no coarse column is correlated with the "
            "telemetry; 0 is used"
        )
    if not delay.seconds:
        return (
            f"delay: none found; the correlation with {delay.column!r} is largest without one "
            f"({delay.correlation:.3f})"
        )
    return (
        f"delay: the telemetry is {abs(delay.seconds):g} {unit} ({abs(samples):g} samples) "
        f"{'later' if samples > 0 else 'earlier'} than the coarse run; "
        f"the correlation with {delay.column!r} is {delay.correlation:.3f} there and "
        f"{delay.undelayed:.3f} without the delay"
    )


def _without_constant(run: Telemetry) -> tuple[Telemetry, list[str]]:
    """Leaves out coarse columns that never vary, because an enhancer learns nothing from them."""
    varies = np.ptp(run.values, axis=0) > 0
    kept = list(itertools.compress(run.columns, varies))
    gone = list(itertools.compress(run.columns, ~varies))
    if not kept:
        raise InputError(
            f"Expected a coarse column that varies. Received: only constant ones in {run.name}: "
            f"{', '.join(gone)[:120]}."
        )
    return run.select(kept), [
        f"coarse columns left out, because they never vary: {', '.join(gone)}"
    ] if gone else []


def _held_out_residuals(
    learnt: Paired,
    choice: Choice,
    inputs: np.ndarray,
    targets: np.ndarray,
    times: np.ndarray,
    options: FitOptions,
) -> list[np.ndarray]:
    """Returns residual and enhanced run of all blocks of time, side by side, each from an enhancer
    that was not fitted to that block: stretches of shape `(samples, 2 * channels)`, in the order of
    time.

    Residuals of the telemetry that an enhancer has learnt from are too small, because it has learnt
    part of their noise.
    """
    telemetry = learnt.telemetry
    window = inputs.shape[1]
    stretches = []
    for fold in range(NUM_FOLDS):
        enhancer: Enhancer = choice.without_fold
        if fold:
            kept, _ = split_fold(times, window, choice.edges, fold)
            training = Training(inputs[kept], targets[kept], times[kept], choice.penalties)
            enhancer = training.fit(enhancer.name, options.seed, options.epochs)
        for block in range(fold, len(choice.edges) - 1, NUM_FOLDS):
            for part, coarse in zip(telemetry.parts, learnt.run.parts, strict=True):
                first = round(part.offset_s / telemetry.interval_s)
                edges = choice.edges[block : block + 2] - first
                low, high = np.clip(edges, 0, len(part)).astype(int).tolist()
                if high - low >= window:
                    clean = enhancer.enhance_run(coarse.values[low:high])
                    both = np.concatenate([part.values[low:high] - clean, clean], axis=1)
                    stretches.append((first + low, both))
    if not stretches:
        raise InputError(
            f"Expected stretches of at least a window of {window} samples without a gap. Received: "
            f"none in any of {len(choice.edges) - 1} blocks of time. Give longer runs or a smaller "
            "--window."
        )
    stretches.sort(key=lambda stretch: stretch[0])
    return [both for _, both in stretches]
