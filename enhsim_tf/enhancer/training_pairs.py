"""Pairs of windows, steps 3 and 4 of the paper's pipeline: what the coarse simulator says and what the telemetry says.

In the paper both run on one clock and at one level for ever. A real channel drifts away from both; then the simulator
is set to each window, as one that runs beside a vehicle would be, and the pair says how.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from enhsim_tf.coarse_simulator.square_waves import SquareWaveSimulator
from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import cut_windows

MIN_GAIN = 0.1  # of the simulator's own amplitude: below it a window shows nothing that a network could learn a shape from


@dataclasses.dataclass(frozen=True)
class Pairs:
    """Windows of the coarse simulator and of the telemetry at the same times.

    Args:
        coarse: Coarse windows at the simulator's own level, float32 of shape `(windows, samples)`.
        target: The telemetry, same shape.
        shift: What is added to the simulator's level to meet each window, in the telemetry's unit, shape `(windows,)`.
        gain: By what its amplitude is multiplied, shape `(windows,)`.
        time_s: When each window begins on the series' clock, in seconds, shape `(windows,)`.
    """

    coarse: np.ndarray
    target: np.ndarray
    shift: np.ndarray
    gain: np.ndarray
    time_s: np.ndarray

    def __len__(self) -> int:
        return len(self.coarse)

    @property
    def coarse_rescaled(self) -> np.ndarray:
        """The coarse windows at the level and amplitude of the telemetry's."""
        return apply_shift_and_gain(self.coarse, self.shift, self.gain)

    @property
    def target_in_unit(self) -> np.ndarray:
        """The telemetry at the simulator's own level and amplitude: what the enhancer learns."""
        return ((self.target - self.shift[:, None]) / self.gain[:, None]).astype(np.float32)

    def drop_flat(self) -> "Pairs":
        """Those windows that follow the simulator: a window without its motion has no shape to learn.

        Raises:
            InputError: If there is none.
        """
        follows = self.gain >= MIN_GAIN
        if not follows.any():
            raise InputError(
                f"Expected windows that follow the coarse simulator. Received: none of {len(self)}. Give another simulator, or telemetry that moves."
            )
        return Pairs(**{field.name: getattr(self, field.name)[follows] for field in dataclasses.fields(self)})


def apply_shift_and_gain(windows: np.ndarray, shift: np.ndarray, gain: np.ndarray) -> np.ndarray:
    """Windows moved to a level and amplitude each, float32 of the same shape `(windows, samples)`.

    Args:
        windows: Windows at the simulator's own level.
        shift: What is added to each, shape `(windows,)`.
        gain: What each is multiplied by first, shape `(windows,)`.
    """
    return (shift[:, None] + gain[:, None] * windows).astype(np.float32)


def split_end(parts: Sequence[Telemetry], share: float) -> tuple[list[Telemetry], list[Telemetry]]:
    """Splits the end off a series.

    Args:
        parts: Stretches of one series, in the order of time.
        share: Share of the samples at the end, from 0 to below 1; 0 gives everything twice.

    Returns:
        The stretches without their last samples, and the stretches of those.
    """
    if not share:
        return list(parts), list(parts)
    left = sum(map(len, parts)) - round(share * sum(map(len, parts)))
    first, rest = [], []
    for part in parts:
        end = min(len(part), left)
        first += [part.part(0, end)] if end else []
        rest += [part.part(end, len(part))] if end < len(part) else []
        left -= end
    return first, rest


def num_window_starts(parts: Sequence[Telemetry], window: int) -> int:
    """At how many samples a whole window can begin."""
    return sum(max(0, len(part) - window + 1) for part in parts)


def random_window_starts(parts: Sequence[Telemetry], window: int, num_windows: int, rng: np.random.Generator) -> np.ndarray:
    """Random places for windows, every sample that begins a whole one as likely as any other.

    Args:
        parts: Stretches of one series.
        window: Samples of a window.
        num_windows: Number of windows.
        rng: Owner of the draws.

    Returns:
        Integers below `num_window_starts`, shape `(num_windows,)`.

    Raises:
        InputError: If no stretch is as long as a window.
    """
    places = num_window_starts(parts, window)
    if not places:
        longest = max((len(part) for part in parts), default=0)
        raise InputError(f"Expected at least one window of {window} samples in a piece. Received: {longest}. Give a longer series.")
    return rng.integers(0, places, num_windows)


def evenly_spaced_starts(parts: Sequence[Telemetry], window: int, num_windows: int) -> np.ndarray:
    """Places spread evenly over the stretches, in the order of time.

    Args:
        parts: Stretches of one series.
        window: Samples of a window.
        num_windows: Number of places, at most; none comes twice.
    """
    places = num_window_starts(parts, window)
    return np.unique(np.linspace(0, places - 1, min(num_windows, places)).astype(np.int64))


def cut_windows_from_parts(parts: Sequence[Telemetry], places: np.ndarray, window: int) -> tuple[np.ndarray, np.ndarray]:
    """Cuts windows out of the stretches of a series.

    Args:
        parts: Stretches of one series, on one clock.
        places: Where each window begins, counted over the stretches as `num_window_starts` counts.
        window: Samples of a window.

    Returns:
        The windows, float32 of shape `(windows, samples)`, and when each begins in seconds, shape `(windows,)`.

    Raises:
        InputError: If no whole window begins at one of the places.
    """
    places, usable = np.asarray(places), [part for part in parts if len(part) >= window]
    firsts = np.cumsum([0] + [len(part) - window + 1 for part in usable])
    if len(places) and not 0 <= places.min() <= places.max() < firsts[-1]:
        raise InputError(f"Expected places from 0 to before {firsts[-1]}. Received: from {places.min()} to {places.max()}.")
    which = np.searchsorted(firsts, places, "right") - 1
    windows, time_s = np.empty((len(places), window), np.float32), np.empty(len(places))
    for number, part in enumerate(usable):
        here = which == number
        offsets = places[here] - firsts[number]
        windows[here] = cut_windows(part.values, offsets, window)
        time_s[here] = part.offset_s + part.interval_s * offsets
    return windows, time_s


def cut_pairs(parts: Sequence[Telemetry], coarse: SquareWaveSimulator, places: np.ndarray, window: int, follow: bool = False) -> Pairs:
    """Cuts paired windows.

    Args:
        parts: Stretches of one series, on one clock.
        coarse: The coarse simulator.
        places: Where each window begins, counted over the stretches as `num_window_starts` counts.
        window: Samples of a window.
        follow: Whether the simulator is set to the clock, level and amplitude of each window, by correlation and least
            squares; else it runs on as it is configured.
    """
    target, time_s = cut_windows_from_parts(parts, places, window)
    times = time_s[:, None] + parts[0].interval_s * np.arange(window)
    if not follow:
        return Pairs(coarse.simulate(times), target, np.zeros(len(target)), np.ones(len(target)), time_s)
    windows = coarse.simulate(coarse.synchronise(times, target))
    return Pairs(windows, target, *_least_squares(windows, target), time_s)


def align_to_enhanced(pairs: Pairs, coarse: np.ndarray, shapes: np.ndarray) -> Pairs:
    """Sets the simulator to each window again, by what its windows look like once they are enhanced.

    A square wave tells the clock by its edges alone; the enhanced shape tells it by every sample.

    Args:
        pairs: Pairs that follow the telemetry.
        coarse: Coarse windows at every phase of a period, shape `(phases, samples)`.
        shapes: The same windows enhanced, same shape.

    Returns:
        Pairs of the same telemetry with the coarse windows, shifts and gains whose shapes correlate best with it.
    """
    centred = shapes - shapes.mean(axis=1, keepdims=True, dtype=np.float64)
    length = np.sqrt(np.sum(centred**2, axis=1, keepdims=True))
    agreement = pairs.target @ (centred / np.where(length > 0, length, 1.0)).T  # a centred shape sees no level
    best = np.argmax(agreement, axis=1)
    return Pairs(coarse[best], pairs.target, *_least_squares(shapes[best], pairs.target), pairs.time_s)


def ridge(learnt: Pairs, pairs: Pairs) -> np.ndarray:
    """Ridge regression from coarse windows to the telemetry, at the level of each window: the linear rival of the enhancer.

    Args:
        learnt: What it learns from; windows without the simulator's motion are left out.
        pairs: Whose coarse windows it takes.

    Returns:
        Its windows of the telemetry, float32 of shape `(windows, samples)`.
    """
    from sklearn.linear_model import Ridge

    learnt = learnt.drop_flat()
    predicted = Ridge().fit(learnt.coarse, learnt.target_in_unit).predict(pairs.coarse)
    return apply_shift_and_gain(predicted, pairs.shift, pairs.gain)


def window_errors(windows: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Root-mean-square error of each window in units of its target's standard deviation; NaN where that is flat, which says nothing.

    Args:
        windows: What should follow the target, shape `(windows, samples)`.
        target: The telemetry, same shape.
    """
    deviation = target.std(axis=1, dtype=np.float64)
    error = np.sqrt(np.mean((windows - target) ** 2, axis=1, dtype=np.float64))
    return error / np.where(deviation > 0, deviation, np.nan)


def _least_squares(coarse: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shift and gain of each coarse window that bring it nearest to its target; a window without an edge gets gain 0."""
    coarse_mean, target_mean = (each.mean(axis=1, dtype=np.float64) for each in (coarse, target))
    centred = coarse - coarse_mean[:, None]
    power = np.sum(centred**2, axis=1)
    gain = np.sum(centred * (target - target_mean[:, None]), axis=1) / np.where(power > 0, power, 1.0)
    gain = np.where(power > 0, gain, 0.0)
    return target_mean - gain * coarse_mean, gain


def paired_windows(telemetry: Telemetry, coarse: SquareWaveSimulator, offsets: np.ndarray, window: int) -> tuple[np.ndarray, np.ndarray]:
    """Coarse and true windows of the same times (steps 3 and 4).

    Args:
        telemetry: The true series.
        coarse: The coarse simulator.
        offsets: First sample of each window, shape `(windows,)`.
        window: Samples of a window.

    Returns:
        `(coarse, true)`, two float32 arrays of shape `(windows, window)`.
    """
    times = telemetry.offset_s + telemetry.interval_s * (np.asarray(offsets)[:, None] + np.arange(window))
    return coarse.simulate(times), cut_windows(telemetry.values, offsets, window)
