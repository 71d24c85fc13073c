"""Training pairs of the enhancer: coarse windows and telemetry windows of the same times (section 2.2, steps 3 and 4 of the pipeline).

In the paper, the simulator and the telemetry have the same clock and the same level at all times. The clock and the level of a
real channel drift. For such a channel, the simulator's clock, level and amplitude are fitted to each window, as they would
be for a simulator that runs beside a vehicle. The fitted values are stored with the pair.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from enhsim_tf.coarse_simulator.square_waves import SquareWaveSimulator
from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import cut_windows, cut_windows_from_parts

MIN_GAIN = 0.1  # in units of the simulator's amplitude; windows with a smaller fitted gain are too flat to train on


@dataclasses.dataclass(frozen=True)
class Pairs:
    """Windows of the coarse simulator and windows of the telemetry at the same times.

    Args:
        coarse: Coarse windows at the simulator's own level and amplitude, float32 of shape `(windows, samples)`.
        target: Telemetry windows, same shape.
        shift: Offset that is added to the simulator's output to match each telemetry window, in the unit of the telemetry,
            shape `(windows,)`.
        gain: Factor that multiplies the simulator's output to match each telemetry window, shape `(windows,)`.
        time_s: Start time of each window on the clock of the series, in seconds, shape `(windows,)`.
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
        """The coarse windows, rescaled to the level and amplitude of the telemetry windows."""
        return apply_shift_and_gain(self.coarse, self.shift, self.gain)

    @property
    def target_in_unit(self) -> np.ndarray:
        """The telemetry windows, rescaled to the simulator's level and amplitude. These are the enhancer's training targets."""
        return ((self.target - self.shift[:, None]) / self.gain[:, None]).astype(np.float32)

    def drop_flat(self) -> "Pairs":
        """Drops the windows whose fitted gain is below `MIN_GAIN` (0.1), because flat telemetry shows no shape to learn.

        Returns:
            The remaining pairs.

        Raises:
            InputError: If no pair remains.
        """
        follows = self.gain >= MIN_GAIN
        if not follows.any():
            raise InputError(
                "Expected windows that follow the coarse simulator. "
                f"Received: none of {len(self)} with a gain of {MIN_GAIN} or more. Use another simulator, or telemetry that is not constant."
            )
        return Pairs(**{field.name: getattr(self, field.name)[follows] for field in dataclasses.fields(self)})


def apply_shift_and_gain(windows: np.ndarray, shift: np.ndarray, gain: np.ndarray) -> np.ndarray:
    """Multiplies each window by its gain and then adds its shift.

    Args:
        windows: Windows at the simulator's own level and amplitude, shape `(windows, samples)`.
        shift: Offset of each window, shape `(windows,)`.
        gain: Factor of each window, shape `(windows,)`.

    Returns:
        float32 array of shape `(windows, samples)`.
    """
    return (shift[:, None] + gain[:, None] * windows).astype(np.float32)


def split_end(parts: Sequence[Telemetry], share: float) -> tuple[list[Telemetry], list[Telemetry]]:
    """Splits a series into its beginning and its end.

    Args:
        parts: Contiguous parts of one series, in the order of time.
        share: Share of the samples that belong to the end, at least 0 and below 1. With 0, both returned lists hold the
            whole series.

    Returns:
        The parts of the beginning, and the parts of the end.
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


def cut_pairs(parts: Sequence[Telemetry], coarse: SquareWaveSimulator, starts: np.ndarray, window: int, follow: bool = False) -> Pairs:
    """Cuts telemetry windows out of a series, and simulates the coarse windows of the same times.

    Args:
        parts: Contiguous parts of one series, on one clock.
        coarse: The coarse simulator.
        starts: Start of each window, as an index into the `num_window_starts` possible starts, counted over all parts.
        window: Number of samples in a window.
        follow: Whether to fit the simulator to each telemetry window: its clock by cross-correlation, its level and
            amplitude by least squares. If False, the simulator runs as configured.
    """
    target, time_s = cut_windows_from_parts(parts, starts, window)
    times = time_s[:, None] + parts[0].interval_s * np.arange(window)
    if not follow:
        return Pairs(coarse.simulate(times), target, np.zeros(len(target)), np.ones(len(target)), time_s)
    windows = coarse.simulate(coarse.synchronise(times, target))
    if getattr(coarse, "is_constant", False):  # there is no shape to which a gain could be fitted
        return Pairs(windows, target, (target - windows).mean(axis=1, dtype=np.float64), np.ones(len(target)), time_s)
    return Pairs(windows, target, *_least_squares(windows, target), time_s)


def align_to_enhanced(pairs: Pairs, coarse: np.ndarray, enhanced: np.ndarray) -> Pairs:
    """Realigns phase, offset and gain of each pair, using the enhanced waveform instead of the square wave.

    A square wave carries phase information only at its edges, whereas the enhanced waveform carries it at every sample.

    Args:
        pairs: Pairs whose simulator was fitted to the telemetry.
        coarse: Coarse windows at every phase of a period, shape `(phases, samples)`.
        enhanced: The same windows after enhancement, same shape.

    Returns:
        Pairs with the same telemetry. Each has the coarse window whose enhanced waveform correlates best with the telemetry,
        and the shift and gain of that waveform by least squares.
    """
    centred = enhanced - enhanced.mean(axis=1, keepdims=True, dtype=np.float64)
    length = np.sqrt(np.sum(centred**2, axis=1, keepdims=True))
    agreement = (
        pairs.target @ (centred / np.where(length > 0, length, 1.0)).T
    )  # the waveforms are centred, so the level of the telemetry has no effect
    best = np.argmax(agreement, axis=1)
    return Pairs(coarse[best], pairs.target, *_least_squares(enhanced[best], pairs.target), pairs.time_s)


def window_errors(windows: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Computes the normalised root-mean-square error (NRMSE) of each window.

    Args:
        windows: Predicted windows, shape `(windows, samples)`.
        target: Telemetry windows, same shape.

    Returns:
        The root-mean-square error of each window, divided by the standard deviation of its target, shape `(windows,)`. It is
        NaN for constant targets, for which the quotient is undefined.
    """
    deviation = target.std(axis=1, dtype=np.float64)
    error = np.sqrt(np.mean((windows - target) ** 2, axis=1, dtype=np.float64))
    return error / np.where(deviation > 0, deviation, np.nan)


def _least_squares(coarse: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns the shift and the gain of each coarse window by least squares. A constant coarse window gets a gain of 0."""
    coarse_mean, target_mean = (each.mean(axis=1, dtype=np.float64) for each in (coarse, target))
    centred = coarse - coarse_mean[:, None]
    power = np.sum(centred**2, axis=1)
    gain = np.sum(centred * (target - target_mean[:, None]), axis=1) / np.where(power > 0, power, 1.0)
    gain = np.where(power > 0, gain, 0.0)
    return target_mean - gain * coarse_mean, gain


def paired_windows(telemetry: Telemetry, coarse: SquareWaveSimulator, starts: np.ndarray, window: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns the coarse windows and the telemetry windows of the same times (steps 3 and 4 of the paper's pipeline).

    Args:
        telemetry: The telemetry.
        coarse: The coarse simulator.
        starts: First sample of each window, shape `(windows,)`.
        window: Number of samples in a window.

    Returns:
        `(coarse, target)`, two float32 arrays of shape `(windows, window)`.
    """
    times = telemetry.offset_s + telemetry.interval_s * (np.asarray(starts)[:, None] + np.arange(window))
    return coarse.simulate(times), cut_windows(telemetry.values, starts, window)
