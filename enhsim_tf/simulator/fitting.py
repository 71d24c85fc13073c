"""Fits an enhanced simulator to nominal telemetry, and measures it on the held-out end (sections 2.2 and 2.3)."""

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from enhsim_tf.coarse_simulator.commands import CommandTraces
from enhsim_tf.coarse_simulator.interface import CoarseSimulator, name_of
from enhsim_tf.coarse_simulator.pairing import Delay, estimate_delay, pair_recordings
from enhsim_tf.coarse_simulator.recording import Recording, Run, record
from enhsim_tf.coarse_simulator.square_waves import ConstantLevel
from enhsim_tf.common.console import SILENT, Progress
from enhsim_tf.common.errors import InputError
from enhsim_tf.enhancer.candidates import NUM_FOLDS, Choice, Training, choose_enhancer, split_fold
from enhsim_tf.enhancer.model import Enhancer
from enhsim_tf.enhancer.names import COARSE, RIDGE
from enhsim_tf.noise.names import MATCHED, RESIDUAL_WINDOWS
from enhsim_tf.noise.window_bootstrap import fit_noise
from enhsim_tf.simulator.alignment import Runs, Waves
from enhsim_tf.simulator.coarse_choice import LEAST_SAMPLES, CoarseChoice, choose_coarse, too_short
from enhsim_tf.simulator.detector_choice import choose_detector, judge_detectors
from enhsim_tf.simulator.joint import (
    join_channels,
    long_enough,
    split_end,
    telemetry_of,
    times_of,
    windows_of,
)
from enhsim_tf.simulator.options import LEAST_LEARNT, FitOptions, default_window
from enhsim_tf.simulator.report import Report, make_report
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.quantisation import Levels
from enhsim_tf.telemetry.series import Telemetry, check_values
from enhsim_tf.telemetry.windows import evenly_spaced_starts, random_window_starts

_ALIGNMENTS = (
    2  # rounds in which windows are aligned with the waveform that ridge regression has learnt
)
_NUM_WAVEFORM = 1_000  # most windows from which a waveform is learnt
_NUM_LEVELS = 500  # most windows whose offset and gain are kept
_LEAST_FOLLOWED = (
    0.1  # share of the windows that have to follow a square wave for a shape to be learnt from them
)
_MOST_VALUES = (
    1_500_000  # of all training windows, which bounds time and memory of a fit of many channels
)
_LEAST_WINDOWS = 300  # training windows, however many channels
_SHORT = "a window of {:,} samples is shorter than a period of {:,.0f}: level and gain are fitted to each window, so a slow fault can look nominal"
_LEAST_SPAN, _MOST_SIZE = (
    1e-12,
    1e15,
)  # beyond them, squares of the noise or of the values leave the range of float32


@threadpool_limits.wrap(
    limits=1
)  # several threads take longer for arrays of this size, and round differently
def fit(
    telemetry: Telemetry | Sequence[Telemetry] | Mapping[str, Sequence[Telemetry]] | Recording,
    coarse: CoarseSimulator | None = None,
    options: FitOptions | None = None,
    progress: Progress = SILENT,
    commands: np.ndarray | None = None,
) -> tuple[EnhancedSimulator, Report]:
    """Fits an enhanced simulator to nominal telemetry of one or several channels.

    Args:
        telemetry: Nominal telemetry: a series, the parts between its gaps, the parts of several channels by name, or a recording.
        coarse: The coarse simulator: a recorded run of the same time, or an object that is run at the times of the telemetry. None: square
            waves, or a constant level for a channel that is not periodic.
        options: Options of the fit. None uses the defaults.
        progress: Reports the progress as lines of text.
        commands: Commands of the samples of a single channel, shape `(samples, commands)`. They are used if they explain more of the telemetry
            than a square wave does.

    Returns:
        The simulator and the report.

    Raises:
        InputError: If the telemetry is constant or too short, if channels share too little time, or if the coarse run does not fit.
    """
    options, recording = options or FitOptions(), _recording_of(telemetry)
    for name, values in zip(recording.columns, recording.values.T, strict=True):
        check_values(values, name)
        low, high = float(np.min(values)), float(np.max(values))
        if not (max(-low, high) <= _MOST_SIZE and high - low >= _LEAST_SPAN):
            raise InputError(
                f"Expected values up to {_MOST_SIZE:g} that span at least {_LEAST_SPAN:g}. Received: {name}, from {low:g} to {high:g}. "
                "Give it in another unit."
            )
    if coarse is not None:
        return _fit_runs(recording, coarse, options, progress)
    return _fit_waves(recording, options, progress, commands)


def _recording_of(telemetry: Any) -> Recording:
    if isinstance(telemetry, Recording):
        return telemetry
    if not isinstance(telemetry, Mapping):
        parts = [telemetry] if isinstance(telemetry, Telemetry) else list(telemetry)
        name = parts[0].name if parts and isinstance(parts[0], Telemetry) else "telemetry"
        telemetry = {name: parts}
    groups = join_channels(telemetry)
    if len(groups) > 1:
        raise InputError(
            f"Expected channels of one sampling interval that share most of their time. Received: {len(groups)} groups: "
            f"{'; '.join(each.name for each in groups)[:160]}. Fit each group on its own."
        )
    return groups[0]


# square waves


def _fit_waves(
    recording: Recording, options: FitOptions, progress: Progress, commands: np.ndarray | None
) -> tuple[EnhancedSimulator, Report]:
    learnt, held_out, note = _split(recording, options.held_out)
    channels, refused = recording.columns, {}
    commands = commands if len(channels) == 1 else None
    while True:
        choices, said = [], []
        for channel, name in enumerate(channels):
            choices.append(
                choose_coarse(
                    telemetry_of(learnt, channel), options.window, commands, refused.get(channel)
                )
            )
            said.append(choices[-1].said if len(channels) == 1 else f"{name}: {choices[-1].said}")
        said = " ".join([*said, note]).strip()
        traces = choices[0].traces
        if traces is not None:
            chosen = dataclasses.replace(
                options,
                window=choices[0].window,
                held_out=options.held_out if learnt is not recording else 0.0,
            )
            return _fit_runs(recording, traces.recording(commands), chosen, progress, said, traces)
        window = max(each.window for each in choices)
        usable = long_enough(learnt, window)
        if usable is None or len(usable) < LEAST_LEARNT * window:
            raise too_short(window, recording.name, learnt.parts)
        try:
            simulator, report = _fit_aligned(
                usable, long_enough(held_out, window), choices, window, options, progress, said
            )
            simulator.nominal = long_enough(
                recording, window
            )  # thresholds know all nominal telemetry that was given
            return simulator, report
        except _FlatError as error:
            refused[error.channel] = (
                "nothing can be learnt from its best square wave, which its windows do not follow"
            )


class _FlatError(Exception):
    """Too few windows follow the square waves; the channel is that whose wave is followed least."""

    def __init__(self, is_flat: np.ndarray):
        super().__init__()
        self.channel = int(np.argmax(is_flat.mean(axis=0)))


def _split(recording: Recording, share: float) -> tuple[Recording, Recording | None, str]:
    """Splits off the held-out end. Nothing is held out if the rest could not be learnt from; the text says so."""
    learnt, held_out = split_end(recording, share)
    if share and len(learnt) < LEAST_SAMPLES:
        return (
            recording,
            None,
            f"Nothing is held out, because the record has only {len(recording):,} samples.",
        )
    if share and (np.ptp(learnt.values, axis=0) == 0).any():
        return (
            recording,
            None,
            f"Nothing is held out, because the first {1 - share:.0%} of the record is constant.",
        )
    return learnt, held_out, ""


def _num_windows(options: FitOptions, window: int, channels: int) -> int:
    return min(options.num_windows, max(_LEAST_WINDOWS, _MOST_VALUES // (window * channels)))


def _fit_aligned(
    learnt: Recording,
    held_out: Recording | None,
    choices: Sequence[CoarseChoice],
    window: int,
    options: FitOptions,
    progress: Progress,
    said: str,
) -> tuple[EnhancedSimulator, Report]:
    channels = learnt.columns
    number = _num_windows(options, window, len(channels))
    starts = random_window_starts(learnt.parts, window, number, np.random.default_rng(options.seed))
    targets, times = windows_of(learnt, starts, window), times_of(learnt, starts, window)
    waves = Waves(
        [each.coarse for each in choices], channels, learnt.interval_s, window
    ).on_one_clock(targets)
    waves, coarse, wanted, kept = _learn_waveforms(waves, targets, times)
    is_level = all(isinstance(each, ConstantLevel) for each in waves.simulators)
    enhancer = COARSE if is_level else options.enhancer
    choice = choose_enhancer(
        coarse, wanted, times[kept], enhancer, options.seed, options.epochs, progress
    )
    places = evenly_spaced_starts(learnt.parts, window, _NUM_LEVELS)
    _, shift, gain = waves.align(windows_of(learnt, places, window))
    is_flat = waves.is_flat(gain)
    followed = ~is_flat.any(axis=1)
    if not followed.any():
        raise _FlatError(is_flat)
    step = max(1.0, (places[-1] - places[0]) / max(1, len(places) - 1))
    levels = np.stack([shift, gain], axis=2)[followed]
    simulator = EnhancedSimulator(
        waves,
        choice.enhancer,
        None,
        channels,
        learnt.interval_s,
        levels=levels,
        nominal=learnt,
        level_step=step,
    )
    notes = [_SHORT.format(window, waves.longest_period)] if window < waves.longest_period else []

    some = windows_of(
        learnt,
        random_window_starts(
            learnt.parts, window, number, np.random.default_rng([options.seed, 1])
        ),
        window,
    )
    clean = simulator.enhance(*waves.align(some))
    return _finish(
        simulator, choice, some - clean, clean, options, held_out, None, said, notes, progress
    )


def _learn_waveforms(
    waves: Waves, targets: np.ndarray, times: np.ndarray
) -> tuple[Waves, np.ndarray, np.ndarray, np.ndarray]:
    """Aligns windows with the waveform that ridge regression learns from each channel's own wave.

    Returns:
        The waves with their waveforms; the coarse windows and the targets in units of the waves; and which windows are kept.
    """
    for number in itertools.count():
        coarse, shift, gain = waves.align(targets)
        is_flat = waves.is_flat(gain)
        kept = ~is_flat.any(axis=1)
        if kept.mean() < _LEAST_FOLLOWED:
            raise _FlatError(is_flat)
        safe = np.where(gain != 0, gain, 1.0)
        wanted = ((targets - shift[:, None]) / safe[:, None]).astype(np.float32)
        if number == _ALIGNMENTS or all(each.is_constant for each in waves.simulators):
            return waves, coarse[kept], wanted[kept], kept
        waveforms = []
        for channel, simulator in enumerate(waves.simulators):
            waveforms.append(None)
            if not simulator.is_constant:
                some = np.flatnonzero(kept)[:_NUM_WAVEFORM]
                ridge = Training(
                    coarse[some][:, :, [channel]], wanted[some][:, :, [channel]], times[some]
                ).fit(RIDGE)
                waveforms[-1] = ridge.predict(waves.phases(channel)[:, :, None])[:, :, 0]
        waves = Waves(waves.simulators, waves.channels, waves.interval_s, waves.window, waveforms)


# runs of the user's simulator


def _fit_runs(
    recording: Recording,
    coarse: CoarseSimulator,
    options: FitOptions,
    progress: Progress,
    said: str = "",
    commands: CommandTraces | None = None,
) -> tuple[EnhancedSimulator, Report]:
    run, notes = _run_of(coarse, recording)
    guess = options.window or default_window((1 - options.held_out) * len(recording))
    delay = (
        Delay(options.delay_s) if options.delay_s is not None else _delay_of(recording, run, guess)
    )
    paired, run_there = pair_recordings(recording, run, delay.seconds, 2)
    window = options.window or default_window((1 - options.held_out) * len(paired))
    notes.append(_on_delay(delay, telemetry_of(recording)[0], options.delay_s is not None))
    if len(paired) < len(recording):
        notes.append(
            f"{len(paired):,} of {len(recording):,} samples of the telemetry have a coarse run of the same time; the others are not used"
        )
    run_there, left_out = _without_constant(run_there)
    whole, whole_run = (long_enough(each, window) for each in (paired, run_there))
    (learnt, held_out), (learnt_run, held_out_run) = (
        [long_enough(each, window) for each in split_end(some, options.held_out)]
        for some in (whole, whole_run)
    )
    if learnt is None or len(learnt) < LEAST_LEARNT * window:
        raise too_short(
            window, f"{recording.name} with {run.name}", () if learnt is None else learnt.parts
        )
    number = _num_windows(options, window, len(recording.columns))
    starts = evenly_spaced_starts(learnt.parts, window, number)
    (inputs, targets), times = (
        (windows_of(each, starts, window) for each in (learnt_run, learnt)),
        times_of(learnt, starts, window),
    )
    choice = choose_enhancer(
        inputs, targets, times, options.enhancer, options.seed, options.epochs, progress
    )
    alignment = Runs(learnt_run, window, delay.seconds, name_of(coarse), commands)
    simulator = EnhancedSimulator(
        alignment, choice.enhancer, None, recording.columns, recording.interval_s, nominal=learnt
    )
    residuals = _held_out_residuals(simulator, choice, inputs, targets, times, options)

    noise, clean = np.split(
        windows_of(residuals, evenly_spaced_starts(residuals.parts, window, number), window),
        2,
        axis=2,
    )
    simulator, report = _finish(
        simulator,
        choice,
        noise,
        clean,
        options,
        held_out,
        held_out_run,
        said,
        [*notes, *left_out],
        progress,
    )
    simulator.nominal, alignment.nominal = (
        whole,
        whole_run,
    )  # thresholds know all nominal telemetry that was given
    vars(simulator).pop("_nominal_clean", None)
    return simulator, report


def _run_of(coarse: CoarseSimulator, recording: Recording) -> tuple[Recording, list[str]]:
    """Returns the recording, or the simulator's run at the times of the telemetry, and what is to be reported about it."""
    if isinstance(coarse, Recording):
        return coarse, list(coarse.notes)
    begin, last = recording.parts[0].offset_s, recording.parts[-1]
    number = round((last.offset_s - begin) / recording.interval_s) + len(last)
    run = record(coarse, begin + recording.interval_s * np.arange(number), start=recording.start)
    return run, [f"{name_of(coarse)}: simulated at the times of the telemetry, {number:,} samples"]


def _delay_of(recording: Recording, run: Recording, window: int) -> Delay:
    """Estimates the delay from the channel that is most correlated with a coarse column."""
    found = [
        estimate_delay(telemetry_of(recording, channel), run, window)
        for channel in range(len(recording.columns))
    ]
    clear = [each for each in found if each.column is not None]
    return max(clear, key=lambda each: abs(each.correlation)) if clear else found[0]


def _on_delay(delay: Delay, telemetry: Telemetry, was_given: bool) -> str:
    unit, samples = telemetry.time_unit, delay.seconds / telemetry.interval_s
    if was_given:
        return f"delay: {delay.seconds:g} {unit} as given, {samples:g} samples"
    if delay.column is None:
        return "delay: none could be estimated, because no coarse column is correlated with the telemetry; 0 is used"
    if not delay.seconds:
        return f"delay: none found; the correlation with {delay.column!r} is largest without one ({delay.correlation:.3f})"
    return (
        f"delay: the telemetry is {abs(delay.seconds):g} {unit} ({abs(samples):g} samples) {'later' if samples > 0 else 'earlier'} than the coarse run; "
        f"the correlation with {delay.column!r} is {delay.correlation:.3f} there and {delay.undelayed:.3f} without the delay"
    )


def _without_constant(run: Recording) -> tuple[Recording, list[str]]:
    """Leaves out coarse columns that never vary, because an enhancer learns nothing from them."""
    varies = np.ptp(run.values, axis=0) > 0
    kept, gone = (
        [name for name, does in zip(run.columns, varies, strict=True) if does == wanted]
        for wanted in (True, False)
    )
    if not kept:
        raise InputError(
            f"Expected a coarse column that varies. Received: only constant ones in {run.name}: {', '.join(gone)[:120]}."
        )
    return run.select(kept), [
        f"coarse columns left out, because they never vary: {', '.join(gone)}"
    ] if gone else []


def _held_out_residuals(
    simulator: EnhancedSimulator,
    choice: Choice,
    inputs: np.ndarray,
    targets: np.ndarray,
    times: np.ndarray,
    options: FitOptions,
) -> Recording:
    """Returns residual and enhanced run of all blocks of time, side by side, each from an enhancer that was not fitted to that block.

    Residuals of the telemetry that an enhancer has learnt from are too small, because it has learnt part of their noise.
    """
    learnt, run = simulator.nominal, simulator.nominal_run
    window, found = simulator.window, []
    for fold in range(NUM_FOLDS):
        enhancer: Enhancer = choice.without_fold
        if fold:
            kept, _ = split_fold(times, window, choice.edges, fold)
            training = Training(inputs[kept], targets[kept], times[kept], choice.penalties)
            enhancer = training.fit(enhancer.name, options.seed, options.epochs)
        other = EnhancedSimulator(
            simulator.alignment, enhancer, None, simulator.channels, simulator.interval_s
        )
        for block in range(fold, len(choice.edges) - 1, NUM_FOLDS):
            for part, coarse in zip(learnt.parts, run.parts, strict=True):
                first = round(part.offset_s / learnt.interval_s)
                low, high = (
                    int(np.clip(edge - first, 0, len(part)))
                    for edge in choice.edges[block : block + 2]
                )
                if high - low >= window:
                    clean = other.enhance_run(coarse.values[low:high])
                    both = np.concatenate([part.values[low:high] - clean, clean], axis=1)
                    found.append(Run(both, (first + low) * learnt.interval_s))
    if not found:
        raise InputError(
            f"Expected stretches of at least a window of {window} samples without a gap. Received: none in any of {len(choice.edges) - 1} blocks of "
            "time. Give longer runs or a smaller --window."
        )
    columns = tuple(
        f"{what} of {name}" for what in ("residual", "enhanced run") for name in learnt.columns
    )
    return dataclasses.replace(
        learnt, parts=tuple(sorted(found, key=lambda each: each.offset_s)), columns=columns
    )


# both


def _finish(
    simulator: EnhancedSimulator,
    choice: Choice,
    noise: np.ndarray,
    clean: np.ndarray,
    options: FitOptions,
    held_out: Recording | None,
    held_out_run: Recording | None,
    said: str,
    notes: list[str],
    progress: Progress,
) -> tuple[EnhancedSimulator, Report]:
    """Fits the noise to windows of it and the enhanced signal below them, and chooses the detector by held-out time."""
    learnt, run = simulator.nominal, simulator.nominal_run
    simulator.quantisation = tuple(map(Levels.find, learnt.values.T))
    progress.step("noise")
    name = options.noise or (
        MATCHED if run is None else RESIDUAL_WINDOWS
    )  # the signal of a run seldom repeats: its neighbours are few
    simulator.noise = fit_noise(name, noise, clean)
    progress.step("detectors")
    judged_on, judged_run = (learnt, run) if held_out is None else (held_out, held_out_run)
    detectors = judge_detectors(simulator, judged_on, judged_run, options.seed)
    chosen = choose_detector(detectors)
    simulator.trained = {
        "telemetry": learnt.name,
        "num_samples": len(learnt),
        "options": dataclasses.asdict(options),
        "noise": name,
        "detector": chosen.name,
        "keeps_promise": bool(chosen.keeps),
        "false_alarms": chosen.false_alarms,
    }
    return simulator, make_report(
        simulator,
        choice,
        detectors,
        judged_on,
        judged_run,
        held_out is not None,
        said,
        notes,
        options.seed,
    )
