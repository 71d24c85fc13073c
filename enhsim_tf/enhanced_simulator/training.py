"""Training of an enhanced simulator: the enhancer (section 2.2 of the paper), then the noise networks (section 2.3).

`EnhancedSimulator.fit` is the public entry point; this module contains the steps.
"""

import dataclasses
import itertools
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.coarse_simulator.square_waves import SquareWaveSimulator, level_offset_and_scale
from enhsim_tf.common.console import SILENT, Progress
from enhsim_tf.common.errors import InputError
from enhsim_tf.enhanced_simulator.checks import check_coarse, check_counts, check_parts, check_size, is_finite
from enhsim_tf.enhanced_simulator.choosing import choose_enhancer
from enhsim_tf.enhanced_simulator.noise_fitting import (
    JUDGED_SHARE,
    NoiseTraining,
    NoiseWindows,
    choose_noise,
    fit_noise,
    noise_windows,
)
from enhsim_tf.enhancer import network as enhancer_network
from enhsim_tf.enhancer.training_pairs import Pairs, cut_pairs, split_end
from enhsim_tf.keras_tools.backend import keras
from enhsim_tf.keras_tools.training import EpochProgress, fit_windows
from enhsim_tf.noise.extraction import extract_noise
from enhsim_tf.noise.rung_names import BEST, BY_OPTION, FOLLOWERS
from enhsim_tf.telemetry.quantisation import Levels
from enhsim_tf.telemetry.series import Telemetry, check_values
from enhsim_tf.telemetry.windows import cut_windows_from_parts, evenly_spaced_starts, first_samples, random_window_starts

if TYPE_CHECKING:
    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

_ROUNDS = 3  # with `follow`: rounds of enhancer training; the windows are aligned again between two rounds
_NUM_LEVELS = 500  # with `follow`: maximum number of windows whose shift and gain are stored in the simulator
_BATCH_SIZE, _LEARNING_RATE = 15, 0.001  # of the enhancer, as in the paper
_ATTEMPTS, _SLOWER = 3, 0.1  # trainings of the enhancer if they diverge, and the factor of the learning rate from one to the next
_MIN_WINDOWS = {"moving average": 2, "enhancer": 8}  # minimum length of the telemetry in windows, for each extraction


@dataclasses.dataclass(frozen=True)
class TrainingSettings:
    """Settings of `EnhancedSimulator.fit`.

    Args:
        seed: Random seed of the training.
        num_windows: Number of training windows, cut at random starts.
        epochs: Passes of the enhancer over the training windows.
        num_iterations: Adversarial iterations of a GAN of noise; the autoregressive network takes three times as many. 0 leaves networks
            untrained.
        moving_average: Width in samples of the moving average that separates the noise from the signal.
        normalise: Whether the paper's networks are trained on normalised values: the enhancer in units of the coarse simulator's
            levels, the GAN at the paper's noise amplitude. False passes the values unchanged, as in the paper. Other noise models always
            normalise.
        window: Length of a window in samples.
        noise: Model of the noise: `best`, the simplest that held-out telemetry does not tell from real noise (see `noise_choice`); or a key
            of `noise.rung_names.BY_OPTION`, for example the networks of the `paper`.
        extraction: How noise is separated from the signal. `moving average` subtracts a moving average from the
            telemetry, as in the paper; `enhancer` subtracts the enhanced signal.
        held_out: Share of the telemetry, from 0 to below 1 and taken from its end, that is used for noise extraction only
            and not for training the enhancer. It applies to extraction by the enhancer. 0 uses all telemetry for both.
        decay: Whether the enhancer's learning rate falls to zero along a cosine; False keeps it constant, as in the paper.
        follow: Whether the coarse simulator is aligned in time, offset and gain with each window before the enhancer
            learns from that window. This is for telemetry that drifts away from a fixed simulator.
        enhancer: `network`, the paper's; `best`, the simplest rung of `enhancer.ladder` that is not measurably worse than the
            best one on held-out time; or the name of a rung.

    Raises:
        InputError: If a count is too small, noise or extraction is unknown or `held_out` is out of range. An unknown enhancer is refused
            by the fit.
    """

    seed: int = 0
    num_windows: int = 15_000
    epochs: int = 2
    num_iterations: int = 1_000
    moving_average: int = 25
    normalise: bool = True
    window: int = 500
    noise: str = BEST
    extraction: str = "enhancer"
    held_out: float = 0.0
    decay: bool = True
    follow: bool = False
    enhancer: str = "network"

    def __post_init__(self):
        check_counts(
            window=(self.window, 2), num_windows=(self.num_windows, 1), epochs=(self.epochs, 1), num_iterations=(self.num_iterations, 0)
        )
        if self.noise not in (BEST, *BY_OPTION) or self.extraction not in _MIN_WINDOWS or not 0 <= self.held_out < 1:
            raise InputError(
                f"Expected noise among {BEST}, {', '.join(BY_OPTION)}; extraction to be moving average or enhancer; 0 <= held_out < 1. "
                f"Received: noise={self.noise!r}, extraction={self.extraction!r}, held_out={self.held_out}."
            )
        if self.noise in (BEST, *FOLLOWERS) and self.extraction != "enhancer":
            raise InputError(
                f"Expected noise={self.noise!r} with extraction by the enhancer, because it is judged with the enhanced signal. "
                f"Received: extraction={self.extraction!r}. Name another noise model, or another extraction."
            )


def train(
    create: Callable[..., "EnhancedSimulator"],
    telemetry: Telemetry | Sequence[Telemetry],
    coarse: SquareWaveSimulator | None,
    settings: TrainingSettings,
    verbose: int | str = "auto",
    progress: Progress = SILENT,
) -> "EnhancedSimulator":
    """Trains an enhanced simulator on nominal telemetry.

    Args:
        create: The simulator's class, called with the arguments of `EnhancedSimulator`.
        telemetry: Nominal telemetry, or the parts between its gaps on a common clock.
        coarse: The coarse simulator. None fits square waves to the longest part.
        settings: Settings of the training.
        verbose: Progress bars: 0 none, 1 always, "auto" on a terminal.
        progress: Reports the progress of both trainings.

    Returns:
        The trained simulator.

    Raises:
        InputError: If the telemetry is invalid, constant or too short.
    """
    parts = check_parts(telemetry)
    values = np.concatenate([part.values for part in parts])
    check_values(values, parts[0].name, _MIN_WINDOWS[settings.extraction] * settings.window)
    check_size(values, parts[0].name)
    by_enhancer = settings.extraction == "enhancer"
    averaged = [] if by_enhancer else _subtract_moving_average(parts, settings)  # before training, so that a wrong width fails early
    simulator = _build(create, parts, coarse, settings)
    learnt, rest = split_end(parts, settings.held_out if by_enhancer else 0.0)
    ladder = None
    if settings.enhancer == "network":
        _train_enhancer(simulator, learnt, settings, verbose, progress)
    else:
        ladder = choose_enhancer(simulator, learnt, settings)
        if not is_finite(simulator.enhancer.get_weights()):
            raise InputError(
                f"Expected telemetry from which the enhancer can learn. Received: {parts[0].name}, on which no rung of the ladder is finite. "
                "Look for values far from all others, or give another channel."
            )
    if settings.follow:
        seen = simulator.pairs(parts, evenly_spaced_starts(parts, settings.window, _NUM_LEVELS)).drop_flat()
        simulator.levels = np.stack([seen.shift, seen.gain], axis=1)
    simulator.quantisation = Levels.find(values)
    simulator.trained = _training_record(parts[0].name, len(values), settings)
    if ladder is not None:
        simulator.trained |= {"enhancer": settings.enhancer, "ladder": ladder}
    notes: list[str] = []
    training = _noise_training(simulator, settings, verbose, progress)
    rng = np.random.default_rng([settings.seed, 1])
    if by_enhancer:
        windows = noise_windows(simulator, rest, random_window_starts(rest, settings.window, settings.num_windows, rng))
    else:
        starts = random_window_starts(averaged, settings.window, settings.num_windows, rng)
        noise, _ = cut_windows_from_parts(averaged, starts, settings.window)
        windows = NoiseWindows(noise, np.zeros_like(noise), first_samples(averaged, starts, settings.window))
    if settings.noise == BEST:
        halves = [_evenly_spaced(simulator, some, settings) for some in split_end(rest, JUDGED_SHARE)]
        simulator.noise, simulator.trained["noise_ladder"] = choose_noise(*halves, windows, training, notes)
    else:
        simulator.noise = fit_noise(settings.noise, windows, training, notes)
    simulator.trained |= {"notes": notes} if notes else {}
    return simulator


def _noise_training(simulator: "EnhancedSimulator", settings: TrainingSettings, verbose: int | str, progress: Progress) -> NoiseTraining:
    unit = None if settings.normalise else 1.0
    return NoiseTraining(
        settings.num_iterations, settings.seed, simulator.in_unit, simulator.quantisation, unit=unit, verbose=verbose, progress=progress
    )


def _evenly_spaced(simulator: "EnhancedSimulator", parts: Sequence[Telemetry], settings: TrainingSettings) -> NoiseWindows:
    """Returns windows of noise in the order of time, or none if no part is long enough."""
    parts = [part for part in parts if len(part) >= settings.window]
    if not parts:
        return NoiseWindows(*np.zeros((2, 0, settings.window), np.float32), np.zeros(0, int))
    return noise_windows(simulator, parts, evenly_spaced_starts(parts, settings.window, settings.num_windows))


def _build(
    create: Callable[..., "EnhancedSimulator"], parts: Sequence[Telemetry], coarse: SquareWaveSimulator | None, settings: TrainingSettings
) -> "EnhancedSimulator":
    """Builds a simulator whose enhancer is untrained and whose noise networks are missing."""
    coarse = SquareWaveSimulator.fit(max(parts, key=len)) if coarse is None else coarse
    check_coarse(coarse, settings.follow)
    network = enhancer_network.build_enhancer(settings.window, seed=settings.seed)
    offset, scale = level_offset_and_scale(coarse) if settings.normalise else (0.0, 1.0)
    levels = [[0.0, 1.0]] if settings.follow else None  # replaced once the enhancer is trained
    return create(coarse, network, None, parts[0].interval_s, offset, scale, levels)


def _train_enhancer(
    simulator: "EnhancedSimulator", parts: Sequence[Telemetry], settings: TrainingSettings, verbose: int | str, progress: Progress
) -> None:
    """Trains the enhancer in one round, or with `follow` in several rounds with the windows aligned again in between."""
    starts = random_window_starts(parts, settings.window, settings.num_windows, np.random.default_rng(settings.seed))
    pairs = cut_pairs(parts, simulator.coarse, starts, settings.window, settings.follow)
    show_bars = int(sys.stdout.isatty()) if verbose == "auto" else verbose  # Keras' own "auto" writes its bars into files too
    rounds = min(_ROUNDS, settings.epochs) if settings.follow else 1
    ends = np.linspace(0, settings.epochs, rounds + 1).astype(int).tolist()
    report_epoch = progress.loop("enhancer, epoch", settings.epochs)
    for number, (begin, end) in enumerate(itertools.pairwise(ends)):
        pairs = simulator.align_to_enhanced(pairs) if number else pairs
        pairs = pairs.drop_flat() if settings.follow else pairs
        callbacks = [EpochProgress(report_epoch.within(begin))]
        _train_round(simulator, pairs, end - begin, settings.seed + number, settings.decay, callbacks, show_bars)


def _train_round(
    simulator: "EnhancedSimulator",
    pairs: Pairs,
    epochs: int,
    seed: int,
    decay: bool,
    callbacks: list[keras.callbacks.Callback],
    verbose: int,
) -> None:
    """Trains the enhancer on pairs of windows for some epochs, in the units of the network.

    If the training diverges, it is repeated from the weights before it with a smaller learning rate.
    """
    num_steps = epochs * -(-len(pairs) // _BATCH_SIZE)
    source, target = ((windows - simulator.offset) / simulator.scale for windows in (pairs.coarse, pairs.target_in_unit))
    before = simulator.enhancer.get_weights()
    for attempt in range(_ATTEMPTS):
        rate = _LEARNING_RATE * _SLOWER**attempt
        schedule = keras.optimizers.schedules.CosineDecay(rate, num_steps) if decay else rate
        fit_windows(simulator.enhancer, source, target, epochs, _BATCH_SIZE, seed, schedule, callbacks=callbacks, verbose=verbose)
        if is_finite(simulator.enhancer.get_weights()):
            return
        simulator.enhancer.set_weights(before)
    raise InputError(
        f"Expected telemetry from which the enhancer can learn. Received: {_ATTEMPTS} trainings that diverged, the last one at a learning rate "
        f"of {rate:.2g}. Look for values far from all others, or give another channel."
    )


def _subtract_moving_average(parts: Sequence[Telemetry], settings: TrainingSettings) -> list[Telemetry]:
    """Returns the noise of each part: its difference from a moving average. Parts too short for a window of noise are dropped."""
    window, width = settings.window, settings.moving_average
    long_enough = [part for part in parts if len(part) >= window + width - 1]
    if not long_enough:
        raise InputError(
            f"Expected a part of at least {window + width - 1} samples: a window of {window}, and what a moving average of width {width} cuts off. "
            f"Received: {max(map(len, parts))} samples. Give a longer part."
        )
    return [dataclasses.replace(part, values=extract_noise(part.values, width)[0]) for part in long_enough]


def _training_record(name: str, num_samples: int, settings: TrainingSettings) -> dict[str, object]:
    """Returns what is saved with the model about its training. The networks and their units show the window and `normalise`."""
    chosen = {key: value for key, value in dataclasses.asdict(settings).items() if key not in ("window", "normalise", "enhancer")}
    return {"telemetry": name, "num_samples": num_samples} | chosen
