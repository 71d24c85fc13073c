"""Fits a run model to telemetry and the coarse run of the same time, and evaluates it on held-out time."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from enhsim_tf.coarse_simulator.interface import CoarseSimulator, name_of
from enhsim_tf.coarse_simulator.pairing import Delay, Pair, estimate_delay, pair_with_recording
from enhsim_tf.coarse_simulator.recording import Recording, Run, record
from enhsim_tf.coarse_simulator.square_waves import SquareWaveSimulator
from enhsim_tf.common.errors import InputError
from enhsim_tf.enhanced_simulator.checks import check_parts, check_size
from enhsim_tf.enhanced_simulator.fit_options import LEAST_LEARNT, default_window
from enhsim_tf.enhanced_simulator.noise_fitting import JUDGED_SHARE, MOST_JUDGED, NoiseWindows, auc_of, choose_noise
from enhsim_tf.enhanced_simulator.runs.coverage import Coverage
from enhsim_tf.enhanced_simulator.runs.model import RunModel
from enhsim_tf.enhanced_simulator.runs.options import RunOptions
from enhsim_tf.enhanced_simulator.runs.report import RATE, RunReport, compare_noise
from enhsim_tf.enhanced_simulator.runs.residuals import held_out_residuals, windows_of
from enhsim_tf.enhanced_simulator.runs.scoring import ResidualDetector
from enhsim_tf.enhanced_simulator.scoring import ScoreOptions
from enhsim_tf.enhancer.ladder import COARSE, RUNGS, Ladder, fit_ladder, fit_rung
from enhsim_tf.enhancer.overlapping import enhance_run
from enhsim_tf.enhancer.training_pairs import split_end
from enhsim_tf.noise.candidates import NoiseModel
from enhsim_tf.noise.names import BEST
from enhsim_tf.telemetry.quantisation import Levels
from enhsim_tf.telemetry.series import Telemetry, check_values
from enhsim_tf.telemetry.windows import cut_windows_from_parts, evenly_spaced_starts, first_samples, random_window_starts

_EXAMPLE = 2  # length of the example for the figure, in windows
_NUM_NOISE = 50  # length of the generated noise that is compared with the real one, in windows


def fit_run_model(
    telemetry: Telemetry | Sequence[Telemetry],
    coarse: CoarseSimulator,
    options: RunOptions | None = None,
) -> tuple[RunModel, RunReport]:
    """Fits a run model and evaluates it on the held-out end of the telemetry.

    Args:
        telemetry: Nominal telemetry, or the parts between its gaps on a common clock.
        coarse: A recorded run of the same time, or a coarse simulator, which is run at the times of the telemetry.
        options: Settings of the fit. None uses the defaults.

    Returns:
        The model and the report.

    Raises:
        InputError: If telemetry and run share too little time, if either is constant, or if values are too large or small for networks.
    """
    options, parts = options or RunOptions(), check_parts(telemetry)
    values = np.concatenate([part.values for part in parts])
    check_values(values, parts[0].name)
    check_size(values, parts[0].name)
    recording, notes = _recorded(coarse, parts)
    samples = sum(map(len, parts))
    guess = options.window or default_window((1 - options.held_out) * samples)
    delay = _delay(parts, recording, options.delay_s, guess)
    pairs = pair_with_recording(parts, recording, delay.seconds)
    shared = sum(map(len, pairs))
    window = options.window or default_window((1 - options.held_out) * shared)
    notes += [_on_delay(delay, parts[0], options.delay_s is not None)]
    if shared < samples:
        notes.append(f"{shared:,} of {samples:,} samples of the telemetry have a coarse run of the same time; the others are not used")
    pairs, recording, left_out = _drop_constant(pairs, recording)
    notes += left_out
    learnt, end = split_pairs([pair for pair in pairs if len(pair) >= window], options.held_out)
    learnt, end = ([pair for pair in some if len(pair) >= window] for some in (learnt, end))
    if sum(map(len, learnt)) < LEAST_LEARNT * window:
        raise InputError(
            f"Expected at least {LEAST_LEARNT} windows of {window} samples to learn from. Received: {sum(map(len, learnt)):,} samples that "
            f"{parts[0].name} and {recording.name} share, in stretches at least as long as a window. Give longer runs or a smaller --window."
        )
    windows = windows_of(learnt, window, options.num_windows)
    ladder = fit_ladder(*windows, RUNGS, options.seed, options.epochs, refit="chosen", wanted=options.enhancer)
    rung = ladder.rungs[ladder.chosen]
    residuals = held_out_residuals(learnt, windows, ladder.edges, ladder.before_refit[ladder.chosen], options.seed, options.epochs)
    below = list(zip(residuals, _clean_below(residuals, learnt), strict=True))
    levels = Levels.find(np.concatenate([pair.telemetry.values for pair in learnt]))
    noise, judged_noise, noted = _fit_noise(below, levels, window, options)
    notes += noted
    coverage = Coverage.fit(windows[0], windows[2], rung.scaling)
    trained = {
        "telemetry": parts[0].name,
        "num_samples": sum(map(len, learnt)),
        "coarse": _kept(coarse),
        "rungs": {each.name: each.error for each in ladder.judged},
        "noise_candidates": judged_noise,
    } | dataclasses.asdict(options)
    nominal = dataclasses.replace(recording, parts=tuple(Run(pair.coarse, pair.telemetry.offset_s) for pair in learnt))
    nominal = dataclasses.replace(nominal, interval_s=parts[0].interval_s, start=parts[0].start)
    model = RunModel(
        rung, noise, coverage, nominal, window, delay.seconds, None if isinstance(coarse, Recording) else coarse, trained, levels
    )
    judged = end if options.held_out and end else learnt
    return model, _report(model, ladder, judged, bool(options.held_out and end), below, notes, options, windows)


def _recorded(coarse: CoarseSimulator, parts: Sequence[Telemetry]) -> tuple[Recording, list[str]]:
    """Returns the recording, or the simulator's run at the times of the telemetry, and what is to be reported about it."""
    if isinstance(coarse, Recording):
        return coarse, list(coarse.notes)
    interval_s, begin = parts[0].interval_s, parts[0].offset_s
    number = round((parts[-1].time_s[-1] - begin) / interval_s) + 1
    recording = record(coarse, begin + interval_s * np.arange(number), start=parts[0].start)
    return recording, [f"{name_of(coarse)}: simulated at the times of the telemetry, {number:,} samples"]


def _delay(parts: Sequence[Telemetry], recording: Recording, given_s: float | None, window: int) -> Delay:
    return estimate_delay(parts, recording, window) if given_s is None else Delay(given_s)


def _on_delay(delay: Delay, telemetry: Telemetry, was_given: bool) -> str:
    unit, samples = telemetry.time_unit, delay.seconds / telemetry.interval_s
    if was_given:
        return f"delay: {delay.seconds:g} {unit} as given, {samples:g} samples"
    if delay.column is None:
        return "delay: none could be estimated, because no coarse column is correlated with the telemetry; 0 is used"
    later = "later than" if delay.seconds >= 0 else "earlier than"
    if not delay.seconds:
        return f"delay: none found; the correlation with {delay.column!r} is largest without one ({delay.correlation:.3f})"
    return (
        f"delay: the telemetry is {abs(delay.seconds):g} {unit} ({abs(samples):g} samples) {later} the coarse run; the correlation with "
        f"{delay.column!r} is {delay.correlation:.3f} there and {delay.undelayed:.3f} without the delay"
    )


def _drop_constant(pairs: list[Pair], recording: Recording) -> tuple[list[Pair], Recording, list[str]]:
    """Leaves out coarse columns that never vary, because an enhancer learns nothing from them."""
    values = np.concatenate([pair.coarse for pair in pairs])
    varies = np.ptp(values, axis=0) > 0
    if varies.all():
        return pairs, recording, []
    gone = [name for name, does in zip(recording.columns, varies, strict=True) if not does]
    if not varies.any():
        raise InputError(
            f"Expected a coarse column that varies. Received: only constant ones in {recording.name}: {', '.join(gone)[:120]}."
        )
    kept = [name for name, does in zip(recording.columns, varies, strict=True) if does]
    pairs = [Pair(pair.telemetry, np.ascontiguousarray(pair.coarse[:, varies])) for pair in pairs]
    return pairs, recording.select(kept), [f"coarse columns left out, because they never vary: {', '.join(gone)}"]


def split_pairs(pairs: Sequence[Pair], share: float) -> tuple[list[Pair], list[Pair]]:
    """Splits pairs into the beginning and the end of the time.

    Args:
        pairs: Pairs in the order of time.
        share: Share of the samples that belong to the end. With 0, both lists hold all pairs.
    """
    if not share:
        return list(pairs), list(pairs)
    left = sum(map(len, pairs)) - round(share * sum(map(len, pairs)))
    first, rest = [], []
    for pair in pairs:
        stop = min(len(pair), left)
        first += [pair.part(0, stop)] if stop else []
        rest += [pair.part(stop, len(pair))] if stop < len(pair) else []
        left -= stop
    return first, rest


def _fit_noise(
    residuals: Sequence[tuple[Telemetry, Telemetry]], levels: Levels | None, window: int, options: RunOptions
) -> tuple[NoiseModel, list[dict[str, Any]], list[str]]:
    """Fits the noise model to held-out residuals, each with the enhanced run below it.

    Returns:
        The noise model, the judgements of all candidates, and what is to be said about it.
    """
    notes: list[str] = []
    noise = [each for each, _ in residuals]
    everything = _cut(residuals, random_window_starts(noise, window, options.num_windows, np.random.default_rng([options.seed, 1])), window)
    if not np.std(everything.noise, dtype=np.float64) > 0:  # noise of size 0 cannot be judged
        return everything.fit("residual windows"), [], notes
    if options.noise != BEST:
        return everything.fit(options.noise), [], notes
    halves = [
        _evenly_spaced(list(zip(*some, strict=True)), window, options.num_windows)
        for some in zip(*(split_end(each, JUDGED_SHARE) for each in zip(*residuals, strict=True)), strict=True)
    ]
    # `score --coarse` judges the difference from the enhanced run, so the detectors see the noise alone
    return *choose_noise(*halves, everything, options.seed, notes, levels, with_signal=False), notes


def _clean_below(residuals: Sequence[Telemetry], pairs: Sequence[Pair]) -> list[Telemetry]:
    """Returns the enhanced run below each residual: the telemetry of the same time minus the residual."""
    found = []
    for part in residuals:
        for pair in pairs:
            first = round((part.offset_s - pair.telemetry.offset_s) / part.interval_s)
            if 0 <= first and first + len(part) <= len(pair):
                values = pair.telemetry.values[first : first + len(part)] - part.values
                found.append(dataclasses.replace(part, values=values))
                break
    return found


def _kept(coarse: CoarseSimulator) -> dict[str, Any]:
    """Returns what is saved of the coarse simulator."""
    if isinstance(coarse, Recording):
        return {"kind": "recorded", "name": coarse.name}
    if isinstance(coarse, SquareWaveSimulator):
        return {"kind": "square waves", "name": name_of(coarse), "config": coarse.get_config()}
    return {"kind": "given again", "name": name_of(coarse)}


def _report(
    model: RunModel,
    ladder: Ladder,
    judged: Sequence[Pair],
    is_held_out: bool,
    residuals: Sequence[tuple[Telemetry, Telemetry]],
    notes: Sequence[str],
    options: RunOptions,
    windows: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> RunReport:
    enhanced = [model.enhance(pair.coarse) for pair in judged]
    coarse_rung = fit_rung(COARSE, *windows)
    coarse = [enhance_run(coarse_rung.predict, pair.coarse, model.window) for pair in judged]
    target = np.concatenate([pair.telemetry.values for pair in judged])
    deviation = float(np.std(target, dtype=np.float64)) or 1.0
    left = [pair.telemetry.values - each for pair, each in zip(judged, enhanced, strict=True)]
    detector = ResidualDetector(model, ScoreOptions(false_alarm_rate=RATE, seed=options.seed))
    alarms = np.concatenate([detector.score(each) > 1 for each in left])
    outside = np.concatenate([model.coverage.score(pair.coarse) > 1 for pair in judged])
    generated = model.draw_noise(model.nominal_series(_NUM_NOISE * model.window), np.random.default_rng([options.seed, 5]))
    shown = min(len(judged[0]), _EXAMPLE * model.window)
    (copy,) = next(model.generate_copies(_one_run(model, judged[0].part(0, shown)), 1, options.seed))
    return RunReport(
        judged[0].telemetry.name,
        model.window,
        model.columns,
        tuple(notes),
        tuple(
            {"name": e.name, "error": e.error, "standard_error": e.standard_error, "is_within": bool(e.is_within)} for e in ladder.judged
        ),
        ladder.num_stretches,
        ladder.chosen,
        options.enhancer is not None,
        is_held_out,
        len(target),
        {name: _rms(np.concatenate(each) - target) / deviation for name, each in (("coarse", coarse), ("enhanced", enhanced))},
        compare_noise([part.values for part, _ in residuals], generated),
        float(np.mean(alarms)),
        float(np.mean(outside)),
        tuple(model.trained["noise_candidates"]),
        options.noise,
        _noise_auc(model, residuals, list(zip(map(Telemetry, left), map(Telemetry, enhanced), strict=True)), options.seed),
        judged[0].telemetry.unit,
        {"coarse": coarse[0][:shown], "enhanced": enhanced[0][:shown], "real": judged[0].telemetry.values[:shown], "generated": copy},
    )


def _noise_auc(
    model: RunModel, learnt: Sequence[tuple[Telemetry, Telemetry]], left: Sequence[tuple[Telemetry, Telemetry]], seed: int
) -> dict[str, float]:
    """Returns the AUC of a classifier of generated, and of learnt, against held-out residuals; empty if there are too few windows."""
    real = [_evenly_spaced(residuals, model.window, MOST_JUDGED) for residuals in (learnt, left)]
    clean, rng = np.concatenate([*model.nominal_chunks(MOST_JUDGED, np.random.default_rng([seed, 8]))]), np.random.default_rng([seed, 9])
    return auc_of(lambda windows: model.add_noise(windows, rng), clean, *real, seed)


def _evenly_spaced(residuals: Sequence[tuple[Telemetry, Telemetry]], window: int, num_windows: int) -> NoiseWindows:
    """Returns windows of residuals in the order of time, or none if no part is long enough."""
    usable = [each for each in residuals if len(each[0]) >= window]
    if not usable:
        return NoiseWindows(*np.zeros((2, 0, window), np.float32), np.zeros(0, int))
    return _cut(usable, evenly_spaced_starts([each for each, _ in usable], window, num_windows), window)


def _cut(residuals: Sequence[tuple[Telemetry, Telemetry]], starts: np.ndarray, window: int) -> NoiseWindows:
    noise, clean = (list(each) for each in zip(*residuals, strict=True))
    windows = (cut_windows_from_parts(parts, starts, window)[0] for parts in (noise, clean))
    return NoiseWindows(*windows, first_samples(noise, starts, window))


def _one_run(model: RunModel, pair: Pair) -> Recording:
    return dataclasses.replace(model.nominal, parts=(Run(pair.coarse),))


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2, dtype=np.float64)))
