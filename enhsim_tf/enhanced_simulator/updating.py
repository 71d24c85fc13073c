"""Updates a fitted simulator with newer nominal telemetry (step 3 of the pipeline, "respond to situations on the vehicle").

The update goes on from what was fitted: the enhancer keeps its weights unless a few further epochs reduce its error on telemetry that they
were not trained on, and the square wave keeps its duty and levels. Level, gain, period, phase and the size of the noise are measured again.
The end of the new telemetry is held out, and errors and alarms before and after the update are measured there.
"""

import copy
import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from enhsim_tf.coarse_simulator.square_waves import SquareWaveSimulator
from enhsim_tf.common.backend import keras
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.training import fit_windows
from enhsim_tf.detection import metrics
from enhsim_tf.enhanced_simulator.checks import check_parts, is_finite
from enhsim_tf.enhanced_simulator.residual_detector import AlignedResidual
from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
from enhsim_tf.enhanced_simulator.update_options import UpdateOptions
from enhsim_tf.enhanced_simulator.update_report import RATE, State, UpdateReport
from enhsim_tf.enhancer.training_pairs import split_end, window_errors
from enhsim_tf.noise.states import state_of
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import cut_windows_from_parts, evenly_spaced_starts, num_window_starts, random_window_starts

_LEAST_LEARNT = 8  # minimum length of the new telemetry without its held-out end, in windows
_TUNED_ON = 0.75  # share of that telemetry on which the enhancer is trained; on the rest it is decided whether it is used
_RATE, _BATCH_SIZE = 1e-4, 15  # initial learning rate, a tenth of that of the first training, and batch size
_NUM_LEVELS, _NUM_JUDGED, _NUM_NOISE = 500, 200, 1_000  # maximum numbers of windows for levels, for judgements and for the noise
_MOST_CHANGE = 0.2  # a period that differs by more is another wave, and the old one is kept
_NEGLIGIBLE = 1e-3  # relative change of the period that is below what a record can show
_THRESHOLD_WINDOWS = 200  # generated windows that set the threshold of alarms


def update_simulator(
    simulator: EnhancedSimulator, telemetry: Telemetry | Sequence[Telemetry], options: UpdateOptions | None = None
) -> tuple[EnhancedSimulator, UpdateReport]:
    """Updates a simulator with newer nominal telemetry.

    Args:
        simulator: The fitted simulator. It is not changed.
        telemetry: Newer nominal telemetry, or the parts between its gaps, at the sampling interval of the fit.
        options: Settings of the update. None uses the defaults.

    Returns:
        The updated simulator, and the report on what changed.

    Raises:
        InputError: If the simulator is a run model or does not follow levels, or if the telemetry has another interval or is
            shorter than eight windows without its held-out end.
    """
    options, parts = options or UpdateOptions(), check_parts(telemetry)
    _check(simulator, parts)
    window = simulator.window
    learnt, held_out = ([part for part in some if len(part) >= window] for some in split_end(parts, options.held_out))
    if sum(map(len, learnt)) < _LEAST_LEARNT * window or not held_out:
        raise InputError(
            f"Expected at least {_LEAST_LEARNT} windows of {window} samples to learn from, and one to judge. "
            f"Received: {sum(map(len, learnt))} and {sum(map(len, held_out))} samples of {parts[0].name}. Give more telemetry."
        )
    new = copy.copy(simulator)
    vars(new).pop("noise_sd", None)  # it is computed again
    notes: list[str] = []
    new.coarse = _updated_clock(simulator, learnt, notes)
    first, rest = ([part for part in some if len(part) >= window] for some in split_end(learnt, 1 - _TUNED_ON))
    if new.coarse is not simulator.coarse and rest and _error(new, rest) > _error(simulator, rest):
        new.coarse = simulator.coarse
        notes.append("the new period does not reduce the error, so the old one is kept")
    if options.epochs and first and rest and not getattr(new.coarse, "is_constant", False):
        _tune_enhancer(new, first, rest, options, notes)
    seen = new.pairs(learnt, evenly_spaced_starts(learnt, window, _NUM_LEVELS)).drop_flat()
    new.levels = np.stack([seen.shift, seen.gain], axis=1)
    _update_noise(new, learnt, options.seed)
    num_judged = min(_NUM_JUDGED, num_window_starts(held_out, window))
    report = UpdateReport(
        parts[0].name,
        sum(map(len, parts)),
        num_judged,
        min(num_judged, sum(len(part) // window for part in held_out)),
        _state(simulator, held_out, options.seed),
        _state(new, held_out, options.seed),
        tuple(notes),
        parts[0].unit,
        parts[0].time_unit,
    )
    made = {"telemetry": parts[0].name, "num_samples": report.num_samples} | dataclasses.asdict(options) | {"notes": notes}
    new.trained = simulator.trained | {"updates": [*simulator.trained.get("updates", ()), made]}
    return new, report


def _check(simulator: Any, parts: Sequence[Telemetry]) -> None:
    if not isinstance(simulator, EnhancedSimulator):
        raise InputError(
            "Expected a simulator of square waves or of a constant level. Received: a model of recorded runs. "
            "Fit it again with newer telemetry and its run: fit new.csv --coarse run.csv."
        )
    if simulator.levels is None:
        raise InputError("Expected a simulator that follows levels, as made by fit. Received: one without levels. Fit it again.")
    if abs(parts[0].interval_s - simulator.interval_s) > 1e-3 * simulator.interval_s:
        raise InputError(
            f"Expected a sample every {simulator.interval_s:g} s, as in the telemetry of the fit. Received: every {parts[0].interval_s:g} s. "
            "Give telemetry with the same sampling interval, or --interval."
        )


def _updated_clock(simulator: EnhancedSimulator, parts: Sequence[Telemetry], notes: list[str]) -> SquareWaveSimulator:
    """Returns the coarse simulator with period and phase of the new telemetry; the old one if there is nothing to update."""
    old, longest = simulator.coarse, max(parts, key=len)
    if getattr(old, "is_constant", False) or len(old.waves) > 1:
        return old
    try:
        found = SquareWaveSimulator.fit(longest).waves[0].period_s
    except InputError:
        notes.append("nothing in the new telemetry is periodic, so the old period is kept")
        return old
    wave = old.waves[0]
    if abs(found / wave.period_s - 1) > _MOST_CHANGE:
        notes.append(f"the best square wave of the new telemetry has a period of {found:.6g}, another wave, so the old period is kept")
        return old
    period_s = found if abs(found / wave.period_s - 1) > _NEGLIGIBLE else wave.period_s
    moved = SquareWaveSimulator([dataclasses.replace(wave, period_s=period_s)])
    shift_s = float((moved.synchronise(longest.time_s[None], longest.values[None]) - longest.time_s)[0, 0])
    phase = float(np.mod(wave.phase + shift_s / period_s, 1.0))
    return SquareWaveSimulator([dataclasses.replace(wave, period_s=period_s, phase=phase)])


def _tune_enhancer(
    simulator: EnhancedSimulator, first: Sequence[Telemetry], rest: Sequence[Telemetry], options: UpdateOptions, notes: list[str]
) -> None:
    """Trains a copy of the enhancer on the first part and uses it if its error on the rest is lower."""
    starts = random_window_starts(first, simulator.window, options.num_windows, np.random.default_rng(options.seed))
    pairs = simulator.pairs(first, starts).drop_flat()
    source, target = ((windows - simulator.offset) / simulator.scale for windows in (pairs.coarse, pairs.target_in_unit))
    before, error = simulator.enhancer, _error(simulator, rest)
    simulator.enhancer = keras.models.clone_model(before)
    simulator.enhancer.set_weights(before.get_weights())
    falling = keras.optimizers.schedules.CosineDecay(_RATE, options.epochs * -(-len(source) // _BATCH_SIZE))
    fit_windows(simulator.enhancer, source, target, options.epochs, _BATCH_SIZE, options.seed, falling, verbose=0)
    if not is_finite(simulator.enhancer.get_weights()) or not _error(simulator, rest) < error:
        simulator.enhancer = before
        notes.append("further training does not reduce the error of the enhancer, so its weights are kept")


def _update_noise(simulator: EnhancedSimulator, parts: Sequence[Telemetry], seed: int) -> None:
    """Fits the noise model to new residuals."""
    starts = random_window_starts(parts, simulator.window, _NUM_NOISE, np.random.default_rng([seed, 1]))
    simulator.noise = simulator.noise_windows(parts, starts).fit(state_of(simulator.noise).settings["kind"])
    vars(simulator).pop("noise_sd", None)


def _error(simulator: EnhancedSimulator, parts: Sequence[Telemetry]) -> float:
    """Returns the median error over windows (NRMSE); infinite if no window moves."""
    pairs = simulator.pairs(parts, evenly_spaced_starts(parts, simulator.window, _NUM_JUDGED))
    errors = window_errors(simulator.follow(pairs), pairs.target)
    return float(np.nanmedian(errors)) if np.isfinite(errors).any() else float("inf")


def _state(simulator: EnhancedSimulator, held_out: Sequence[Telemetry], seed: int) -> State:
    """Measures a simulator before or after the update."""
    window, waves = simulator.window, simulator.coarse.waves
    middle = sum(simulator.coarse.levels) / 2
    shift, gain = simulator.levels.T
    has_period = not getattr(simulator.coarse, "is_constant", False)
    detector = AlignedResidual(simulator).fit(simulator.generate(_THRESHOLD_WINDOWS, seed=seed))
    scores = detector.sizes(simulator.generate(_THRESHOLD_WINDOWS, seed=seed + 1))
    threshold, _ = metrics.finite_threshold(scores, RATE)
    windows, _ = cut_windows_from_parts(held_out, evenly_spaced_starts(held_out, window, _NUM_JUDGED), window)
    return State(
        float(np.median(shift + gain * middle)),
        float(np.median(gain)),
        waves[0].period_s if has_period else None,
        waves[0].phase if has_period else None,
        simulator.noise_sd,
        _error(simulator, held_out),
        float(np.mean(detector.sizes(windows) > threshold)),
    )
