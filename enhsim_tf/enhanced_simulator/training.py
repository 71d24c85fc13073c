"""Training of an enhanced simulator: the enhancer (section 2.2 of the paper), then the noise (section 2.3).

`EnhancedSimulator.fit` is the public entry point; this module contains the steps.
"""

import dataclasses
import itertools
import sys
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from enhsim_tf.coarse_simulator.square_waves import SquareWaveSimulator, level_offset_and_scale
from enhsim_tf.common.backend import keras
from enhsim_tf.common.console import SILENT, Progress
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.training import EpochProgress, fit_windows
from enhsim_tf.enhanced_simulator.checks import check_coarse, check_counts, check_parts, check_size, is_finite
from enhsim_tf.enhanced_simulator.choosing import choose_enhancer
from enhsim_tf.enhanced_simulator.noise_fitting import JUDGED_SHARE, NoiseWindows, choose_noise
from enhsim_tf.enhancer import network as enhancer_network
from enhsim_tf.enhancer.training_pairs import Pairs, cut_pairs, split_end
from enhsim_tf.noise.names import BEST, CANDIDATES
from enhsim_tf.telemetry.quantisation import Levels
from enhsim_tf.telemetry.series import Telemetry, check_values
from enhsim_tf.telemetry.windows import evenly_spaced_starts, random_window_starts

Simulator = Any  # an `EnhancedSimulator`, whose module imports this one
_ROUNDS = 3  # with `follow`: rounds of enhancer training; the windows are aligned again between two rounds
_NUM_LEVELS = 500  # with `follow`: maximum number of windows whose shift and gain are stored in the simulator
_BATCH_SIZE, _LEARNING_RATE = 15, 0.001  # of the enhancer, as in the paper
_ATTEMPTS, _SLOWER = 3, 0.1  # trainings of the enhancer if they diverge, and the factor of the learning rate from one to the next
_MIN_WINDOWS = 8  # minimum length of the telemetry


@dataclasses.dataclass(frozen=True)
class TrainingSettings:
    """Settings of `EnhancedSimulator.fit`.

    Args:
        seed: Random seed of the training.
        num_windows: Number of training windows, cut at random starts.
        epochs: Passes of the enhancer over the training windows.
        window: Length of a window in samples.
        noise: `best`, the simplest noise model that held-out telemetry does not tell from real noise (see `noise_choice`); or one of
            `noise.names.CANDIDATES`.
        held_out: Share of the telemetry, from 0 to below 1 and taken from its end, that is used for the noise only
            and not for training the enhancer. 0 uses all telemetry for both.
        decay: Whether the enhancer's learning rate falls to zero along a cosine; False keeps it constant, as in the paper.
        follow: Whether the coarse simulator is aligned in time, offset and gain with each window before the enhancer
            learns from that window. This is for telemetry that drifts away from a fixed simulator.
        enhancer: `network`, the paper's; `best`, the simplest rung of `enhancer.ladder` that is not measurably worse than the
            best one on held-out time; or the name of a rung.

    Raises:
        InputError: If a count is too small, the noise is unknown or `held_out` is out of range. An unknown enhancer is refused
            by the fit.
    """

    seed: int = 0
    num_windows: int = 15_000
    epochs: int = 2
    window: int = 500
    noise: str = BEST
    held_out: float = 0.0
    decay: bool = True
    follow: bool = False
    enhancer: str = "network"

    def __post_init__(self):
        check_counts(window=(self.window, 2), num_windows=(self.num_windows, 1), epochs=(self.epochs, 1))
        if self.noise not in (BEST, *CANDIDATES) or not 0 <= self.held_out < 1:
            raise InputError(
                f"Expected noise among {BEST}, {', '.join(CANDIDATES)}; 0 <= held_out < 1. "
                f"Received: noise={self.noise!r}, held_out={self.held_out}."
            )


def train(
    create: Callable[..., Simulator],
    telemetry: Telemetry | Sequence[Telemetry],
    coarse: SquareWaveSimulator | None,
    settings: TrainingSettings,
    verbose: int | str = "auto",
    progress: Progress = SILENT,
) -> Simulator:
    """Trains an enhanced simulator on nominal telemetry.

    Args:
        create: The simulator's class, called with the arguments of `EnhancedSimulator`.
        telemetry: Nominal telemetry, or the parts between its gaps on a common clock.
        coarse: The coarse simulator. None fits square waves to the longest part.
        settings: Settings of the training.
        verbose: Progress bars: 0 none, 1 always, "auto" on a terminal.
        progress: Reports the progress of the training.

    Returns:
        The trained simulator.

    Raises:
        InputError: If the telemetry is invalid, constant or too short.
    """
    parts = check_parts(telemetry)
    values = np.concatenate([part.values for part in parts])
    check_values(values, parts[0].name, _MIN_WINDOWS * settings.window)
    check_size(values, parts[0].name)
    simulator = _build(create, parts, coarse, settings)
    learnt, rest = split_end(parts, settings.held_out)
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
    rng = np.random.default_rng([settings.seed, 1])
    windows = simulator.noise_windows(rest, random_window_starts(rest, settings.window, settings.num_windows, rng))
    if settings.noise == BEST:
        halves = [_evenly_spaced(simulator, some, settings) for some in split_end(rest, JUDGED_SHARE)]
        simulator.noise, judged = choose_noise(*halves, windows, settings.seed, notes, simulator.quantisation)
        simulator.trained["noise_candidates"] = judged
    else:
        simulator.noise = windows.fit(settings.noise)
    simulator.trained |= {"notes": notes} if notes else {}
    return simulator


def _evenly_spaced(simulator: Simulator, parts: Sequence[Telemetry], settings: TrainingSettings) -> NoiseWindows:
    """Returns windows of noise in the order of time, or none if no part is long enough."""
    parts = [part for part in parts if len(part) >= settings.window]
    if not parts:
        return NoiseWindows(*np.zeros((2, 0, settings.window), np.float32), np.zeros(0, int))
    return simulator.noise_windows(parts, evenly_spaced_starts(parts, settings.window, settings.num_windows))


def _build(
    create: Callable[..., Simulator], parts: Sequence[Telemetry], coarse: SquareWaveSimulator | None, settings: TrainingSettings
) -> Simulator:
    """Builds a simulator whose enhancer is untrained and whose noise is missing."""
    coarse = SquareWaveSimulator.fit(max(parts, key=len)) if coarse is None else coarse
    check_coarse(coarse, settings.follow)
    network = enhancer_network.build_enhancer(settings.window, seed=settings.seed)
    offset, scale = level_offset_and_scale(coarse)
    levels = [[0.0, 1.0]] if settings.follow else None  # replaced once the enhancer is trained
    return create(coarse, network, None, parts[0].interval_s, offset, scale, levels)


def _train_enhancer(
    simulator: Simulator, parts: Sequence[Telemetry], settings: TrainingSettings, verbose: int | str, progress: Progress
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
    simulator: Simulator,
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


def _training_record(name: str, num_samples: int, settings: TrainingSettings) -> dict[str, object]:
    """Returns what is saved with the model about its training. The networks show the window."""
    chosen = {key: value for key, value in dataclasses.asdict(settings).items() if key not in ("window", "enhancer")}
    return {"telemetry": name, "num_samples": num_samples} | chosen
