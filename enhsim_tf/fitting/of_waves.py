"""Fits square waves, or constant levels, and the enhancer to telemetry (section 2.2)."""

import dataclasses
import functools
import itertools
from collections.abc import Sequence

import numpy as np

from enhsim_tf.coarse.alignment import Paired
from enhsim_tf.coarse.square_waves import ConstantLevel
from enhsim_tf.coarse.waves import Waves
from enhsim_tf.common.console import Progress
from enhsim_tf.common.errors import MANY, spoken
from enhsim_tf.enhancer.candidates import Choice, Training, choose_enhancer
from enhsim_tf.enhancer.names import COARSE, RIDGE
from enhsim_tf.fitting.coarse_choice import (
    LEAST_SAMPLES,
    CoarseChoice,
    choose_coarse,
    on_short_parts,
    too_short,
)
from enhsim_tf.fitting.fitted import Fitted, num_training_windows
from enhsim_tf.fitting.options import LEAST_LEARNT, FitOptions
from enhsim_tf.noise.registry import MATCHED
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import (
    evenly_spaced_starts,
    random_window_starts,
    times_of,
    windows_of,
)

# rounds in which windows are aligned with the waveform that ridge regression has learnt
_ALIGNMENTS = 2
_NUM_WAVEFORM = 1_000  # most windows from which a waveform is learnt
_NUM_LEVELS = 500  # most windows whose offset and gain are kept
# share of the windows that have to follow a square wave for a shape to be learnt from them
_LEAST_FOLLOWED = 0.1


def fit_waves(recording: Telemetry, options: FitOptions, progress: Progress) -> Fitted:
    """Fits one square wave or constant level to each channel; see `fit.fit`."""
    learnt, held_out, note = _split(recording, options.held_out)
    channels = recording.columns
    refused: dict[int, str] = {}
    told = progress.loop("coarse simulator", len(channels))

    @functools.cache  # those of the other channels stay where one is refused
    def chosen(channel: int, why: str | None) -> CoarseChoice:
        told(channel)
        return choose_coarse(learnt.select([channels[channel]]), options.window, why)

    while True:
        choices = [chosen(channel, refused.get(channel)) for channel in range(len(channels))]
        reasons = [choice.said for choice in choices]
        if len(channels) > 1:
            reasons = [f"{name}: {said}" for name, said in zip(channels, reasons, strict=True)]
        if len(channels) > MANY:
            reasons[MANY:] = [f"And {len(channels) - MANY:,} channels more."]
        window = max(choice.window for choice in choices)
        usable = learnt.long_enough(window)
        if usable is None or len(usable) < LEAST_LEARNT * window:
            raise too_short(window, recording.name, learnt.parts)
        try:
            waves, choice, noise, clean = _fit_aligned(usable, choices, window, options, progress)
        except _FlatError as error:
            refused[error.channel] = (
                "nothing can be learnt from its best square wave, which its windows do not follow"
            )
        else:
            break
    longest = waves.longest_period
    slow = (
        f"a window of {window:,} samples is shorter than a period of {longest:,.0f}: level and "
        "gain are fitted to each window, so a slow fault can look nominal"
    )
    return Fitted(
        alignment=waves,
        choice=choice,
        noise=noise,
        clean=clean,
        noise_name=MATCHED,
        nominal=Paired(recording).long_enough(window),
        learnt=Paired(usable),
        held_out=held_out and Paired(held_out).long_enough(window),
        learnt_series=[part.values for part in learnt.parts],
        nominal_series=[part.values for part in recording.parts],
        options=options,
        coarse=" ".join([*reasons, note]).strip(),
        notes=[*on_short_parts(recording, window), *([slow] if window < longest else [])],
    )


class _FlatError(Exception):
    """Too few windows follow the square waves; the channel is that whose wave is followed least."""

    def __init__(self, is_flat: np.ndarray):
        super().__init__()
        self.channel = int(np.argmax(is_flat.mean(axis=0)))


def _split(recording: Telemetry, share: float) -> tuple[Telemetry, Telemetry | None, str]:
    """Splits off the held-out end. Nothing is held out if the rest could not be learnt from; the
    text says so.
    """
    learnt, held_out = recording.split_end(share)
    if share and len(learnt) < LEAST_SAMPLES:
        return (
            recording,
            None,
            f"Nothing is held out, because the record has only {len(recording):,} samples.",
        )
    begins_still = (np.ptp(learnt.values, axis=0) == 0) & (np.ptp(recording.values, axis=0) > 0)
    if share and begins_still.any():
        still = spoken(list(itertools.compress(recording.columns, begins_still)))
        return (
            recording,
            None,
            f"Nothing is held out, because the first {1 - share:.0%} of {still} is constant.",
        )
    return learnt, held_out, ""


def _fit_aligned(
    learnt: Telemetry,
    choices: Sequence[CoarseChoice],
    window: int,
    options: FitOptions,
    progress: Progress,
) -> tuple[Waves, Choice, np.ndarray, np.ndarray]:
    """Fits the waves and the enhancer; returns them, and windows of noise and the enhanced signal
    below them.
    """
    number = num_training_windows(options, window, len(learnt.columns))
    starts = random_window_starts(learnt.parts, window, number, np.random.default_rng(options.seed))
    targets = windows_of(learnt, starts, window)
    times = times_of(learnt, starts, window)
    simulators = [choice.coarse for choice in choices]
    waves = Waves(simulators, learnt.columns, learnt.interval_s, window).on_one_clock(targets)
    waves, coarse, wanted, kept = _learn_waveforms(waves, targets, times)
    is_level = all(isinstance(wave, ConstantLevel) for wave in waves.simulators)
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
    waves = dataclasses.replace(
        waves,
        levels=np.stack([shift, gain], axis=2)[followed],
        level_step=max(1.0, (places[-1] - places[0]) / max(1, len(places) - 1)),
    )
    other_starts = random_window_starts(
        learnt.parts, window, number, np.random.default_rng([options.seed, 1])
    )
    others = windows_of(learnt, other_starts, window)
    clean = choice.enhancer.enhance(*waves.align(others))
    return waves, choice, others - clean, clean


def _learn_waveforms(
    waves: Waves, targets: np.ndarray, times: np.ndarray
) -> tuple[Waves, np.ndarray, np.ndarray, np.ndarray]:
    """Aligns windows with the waveform that ridge regression learns from each channel's own wave.

    Returns:
        The waves with their waveforms; the coarse windows and the targets in units of the waves;
        and which windows are kept.
    """
    for number in itertools.count():
        coarse, shift, gain = waves.align(targets)
        is_flat = waves.is_flat(gain)
        kept = ~is_flat.any(axis=1)
        if kept.mean() < _LEAST_FOLLOWED:
            raise _FlatError(is_flat)
        safe = np.where(gain != 0, gain, 1.0)
        wanted = ((targets - shift[:, None]) / safe[:, None]).astype(np.float32)
        if number == _ALIGNMENTS or all(simulator.is_constant for simulator in waves.simulators):
            return waves, coarse[kept], wanted[kept], kept
        waveforms = []
        for channel, simulator in enumerate(waves.simulators):
            waveforms.append(None)
            if not simulator.is_constant:
                rows = np.flatnonzero(kept)[:_NUM_WAVEFORM]
                ridge = Training(
                    coarse[rows][:, :, [channel]], wanted[rows][:, :, [channel]], times[rows]
                ).fit(RIDGE)
                waveforms[-1] = ridge.predict(waves.phases(channel)[:, :, None])[:, :, 0]
        waves = dataclasses.replace(waves, waveforms=waveforms)
