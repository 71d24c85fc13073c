"""How a window of telemetry finds its coarse window: by the clock of a recorded run, or by phase, offset and gain of fitted square waves."""

import dataclasses
import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from enhsim_tf.coarse_simulator.commands import CommandTraces
from enhsim_tf.coarse_simulator.degraded import Degraded, held_samples
from enhsim_tf.coarse_simulator.pairing import pair_recordings
from enhsim_tf.coarse_simulator.recording import SAME_RATE, Recording
from enhsim_tf.coarse_simulator.square_waves import SquareWaveSimulator, level_offset_and_scale
from enhsim_tf.common.errors import InputError
from enhsim_tf.simulator.joint import cut, long_enough, windows_of
from enhsim_tf.telemetry.windows import num_window_starts

MIN_GAIN = 0.1  # of the amplitude of the square wave; a window with a smaller gain is too flat to learn a shape from
START_RANGE = 1_000_000  # windows begin at a random sample below this one, so that every phase of the waves occurs
_NUM_PHASES = 400  # phases of one period at which a window is compared with the waveform
_SAME_PERIOD = 0.02  # largest relative difference of periods that are one clock


class Drawn(NamedTuple):
    """Coarse windows for generated telemetry."""

    coarse: np.ndarray  # float32 of shape `(windows, samples, columns)`
    nominal: np.ndarray  # the same without a degraded mode
    held: np.ndarray | None = (
        None  # of each sample the one whose value it has: the first of a mechanism that is stuck; None if nothing is
    )


class Waves:
    """One square wave or constant level for each channel, aligned with each window in phase, offset and gain.

    Coarse windows are in units of the wave: -1 is its lowest level, 1 its highest. A square wave shows its phase only at its edges, the enhanced
    waveform of a channel at every sample: `waveforms` has it at `_NUM_PHASES` phases, shape `(phases, samples)`, or None.
    """

    def __init__(
        self,
        simulators: Sequence[SquareWaveSimulator],
        channels: Sequence[str],
        interval_s: float,
        window: int,
        waveforms: Sequence[np.ndarray | None] | None = None,
    ):
        self.simulators, self.channels = tuple(simulators), tuple(channels)
        self.interval_s, self.window = float(interval_s), int(window)
        self.waveforms = (
            tuple(waveforms) if waveforms is not None else (None,) * len(self.simulators)
        )
        self._series = [np.zeros((0, 1), np.float32)] * len(self.simulators)

    @property
    def longest_period(self) -> float:
        """The longest period of a wave in samples; 0 if nothing is periodic."""
        return (
            max(
                (each.waves[0].period_s for each in self.simulators if not each.is_constant),
                default=0.0,
            )
            / self.interval_s
        )

    def phases(self, channel: int) -> np.ndarray:
        """Coarse windows of a channel at all phases of its period, float32 of shape `(phases, samples)`."""
        period_s = max(wave.period_s for wave in self.simulators[channel].waves)
        starts = period_s * np.arange(_NUM_PHASES) / _NUM_PHASES
        return self._in_unit(
            channel,
            self.simulators[channel].simulate(
                starts[:, None] + self.interval_s * np.arange(self.window)
            ),
        )

    def align(self, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Finds phase, offset and gain of each channel in telemetry windows of shape `(windows, samples, channels)`.

        Returns coarse windows of the same times, float32, and offset and gain of each window and channel, float64.
        """
        coarse = np.zeros(targets.shape, np.float32)
        shift, gain = np.zeros((2, len(targets), targets.shape[2]))
        for channel, simulator in enumerate(self.simulators):
            target = targets[:, :, channel]
            if (
                simulator.is_constant
            ):  # there is no shape to which a phase or a gain could be fitted
                shift[:, channel], gain[:, channel] = (
                    target.mean(axis=1, dtype=np.float64),
                    simulator.spread,
                )
                continue
            best = self.best_phases(targets, channel)
            coarse[:, :, channel] = self.phases(channel)[best]
            shift[:, channel], gain[:, channel] = least_squares(
                self._waveform(channel)[best], target
            )
        return coarse, shift, gain

    def _waveform(self, channel: int) -> np.ndarray:
        return self.phases(channel) if self.waveforms[channel] is None else self.waveforms[channel]

    def best_phases(self, targets: np.ndarray, channel: int) -> np.ndarray:
        """Returns the number of the phase at which the waveform of a channel is most correlated with each window, shape `(windows,)`."""
        waveform, target = self._waveform(channel), targets[:, :, channel]
        centred = waveform - waveform.mean(axis=1, keepdims=True, dtype=np.float64)
        length = np.sqrt(np.sum(centred**2, axis=1, keepdims=True))
        # the waveforms are centred, so the level of the telemetry has no effect
        agreement = (target - target.mean(axis=1, keepdims=True)) @ (
            centred / np.where(length > 0, length, 1.0)
        ).T.astype(np.float32)
        return np.argmax(agreement, axis=1)

    def on_one_clock(self, targets: np.ndarray) -> "Waves":
        """Returns the waves with one period where periods are nearly equal, at the distance in phase that telemetry windows show.

        Periods that are fitted to each channel alone differ a little, and over a long time every relation of their phases would occur.
        """
        simulators = list(self.simulators)
        moving = [number for number, each in enumerate(simulators) if not each.is_constant]
        for first, other in itertools.combinations(moving, 2):
            wave, old = simulators[first].waves[0], simulators[other].waves[0]
            if 0 < abs(old.period_s / wave.period_s - 1) < _SAME_PERIOD:
                moved = (
                    (self.best_phases(targets, other) - self.best_phases(targets, first))
                    / _NUM_PHASES
                    + old.phase
                    - wave.phase
                )
                apart = np.angle(np.mean(np.exp(2j * np.pi * moved))) / (2 * np.pi)
                phase = float(np.mod(wave.phase + apart, 1.0))
                simulators[other] = SquareWaveSimulator(
                    [dataclasses.replace(old, period_s=wave.period_s, phase=phase)]
                )
        return Waves(simulators, self.channels, self.interval_s, self.window)

    def is_flat(self, gain: np.ndarray) -> np.ndarray:
        """Whether windows are too flat for the wave of a channel; `gain` is that of `align`, of shape `(windows, channels)` as the result."""
        waves = np.array(
            [
                0.0 if each.is_constant else level_offset_and_scale(each)[1]
                for each in self.simulators
            ]
        )
        return gain < MIN_GAIN * waves

    def draw(
        self, starts: np.ndarray, scenarios: Sequence[Degraded | None], rng: np.random.Generator
    ) -> Drawn:
        """Simulates coarse windows that begin at these samples of the clock of the waves, each with its scenario or None."""
        starts, rows_of = np.asarray(starts), {}
        for row, scenario in enumerate(scenarios):
            if scenario is not None:
                rows_of.setdefault(scenario, []).append(row)
        nominal = np.concatenate(
            [self._nominal(channel, starts) for channel in range(len(self.simulators))], axis=2
        )
        changes = [
            (channel, rows, scenario, 0, self.window)
            for scenario, rows in rows_of.items()
            for channel in self._concerned(scenario)
        ]
        return self._degraded(nominal, starts, changes, rng) if changes else Drawn(nominal, nominal)

    def draw_series(
        self,
        num_samples: int,
        events: Sequence[tuple[Degraded, int, int]],
        rng: np.random.Generator,
    ) -> Drawn:
        """Simulates one coarse series, as a single window of `num_samples`; each event is a mode, its first sample and its end."""
        times, numbers = (
            (self.interval_s * np.arange(num_samples))[None],
            range(len(self.simulators)),
        )
        nominal = np.stack(
            [
                self._in_unit(channel, self.simulators[channel].simulate(times))
                for channel in numbers
            ],
            axis=2,
        )
        changes = [
            (channel, [0], *event)
            for channel in numbers
            for event in events
            if channel in self._concerned(event[0])
        ]
        return self._degraded(nominal, np.zeros(1, int), changes, rng)

    def _degraded(
        self,
        nominal: np.ndarray,
        starts: np.ndarray,
        changes: Sequence[tuple[int, list[int], Degraded, int, int]],
        rng: np.random.Generator,
    ) -> Drawn:
        """Puts degraded modes into coarse windows; each change is a channel, its windows, the mode, its first sample and its end."""
        coarse, is_stuck = nominal.copy(), False
        held = np.broadcast_to(np.arange(nominal.shape[1])[:, None], nominal.shape).copy()
        for channel, rows, scenario, begin, end in changes:
            times = self.interval_s * (starts[rows][:, None] + np.arange(begin, end))
            coarse[rows, begin:end, channel] = self._in_unit(
                channel, self.simulators[channel].simulate(times, scenario, rng)
            )
            stuck = held_samples(scenario, end - begin)
            if stuck is not None:
                held[rows, begin + stuck[0] : begin + stuck[1], channel], is_stuck = (
                    begin + stuck[0],
                    True,
                )
        return Drawn(coarse, nominal, held if is_stuck else None)

    def _nominal(self, channel: int, starts: np.ndarray) -> np.ndarray:
        """Simulates nominal windows of a channel, shape `(windows, samples, 1)`; many are cut out of one series that is kept."""
        simulator, length = self.simulators[channel], int(starts.max(initial=0)) + self.window
        if length > len(self._series[channel]):
            if 2 * len(starts) * self.window < length:
                each = self.interval_s * (starts[:, None] + np.arange(self.window))
                return self._in_unit(channel, simulator.simulate(each))[:, :, None]
            times = self.interval_s * np.arange(
                1 << length.bit_length()
            )  # the next windows are hardly ever beyond its end
            self._series[channel] = self._in_unit(channel, simulator.simulate(times[None]))[0][
                :, None
            ]
        return cut(self._series[channel : channel + 1], starts, self.window)

    def _concerned(self, scenario: Degraded) -> Sequence[int]:
        if scenario.channel is None:
            return range(len(self.channels))
        if scenario.channel not in self.channels:
            raise InputError(
                f"Expected a channel, one of: {', '.join(self.channels)[:200]}. Received: {scenario.channel!r} in the scenario."
            )
        return [self.channels.index(scenario.channel)]

    def _in_unit(self, channel: int, values: np.ndarray) -> np.ndarray:
        offset, scale = level_offset_and_scale(self.simulators[channel])
        return ((values - offset) / scale).astype(np.float32)


class Runs:
    """Runs of the user's simulator on the clock of the telemetry.

    Args:
        nominal: The nominal run of the fit, whose columns are the inputs of the enhancer.
        window: Length of a window in samples.
        delay_s: How much later the telemetry is than the coarse run, in seconds.
        name: Name of the coarse simulator. Empty: that of the run.
        commands: The traces, if the run are commands of the telemetry's own file.
    """

    def __init__(
        self,
        nominal: Recording,
        window: int,
        delay_s: float = 0.0,
        name: str = "",
        commands: CommandTraces | None = None,
    ):
        self.nominal, self.window, self.delay_s = nominal, int(window), float(delay_s)
        self.name, self.commands = name or nominal.name, commands

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the coarse columns."""
        return self.nominal.columns

    def usable(self, run: Recording) -> Recording:
        """Returns the parts of a recording that can be enhanced, with the columns of the fit; raises InputError if there are none."""
        run, interval_s = run.select(self.columns), self.nominal.interval_s
        if abs(run.interval_s / interval_s - 1) > SAME_RATE:
            raise InputError(
                f"Expected a coarse run with a sample every {interval_s:g} s, as in the fit. Received: every {run.interval_s:g} s in {run.name}. "
                "Read it with read_recording(..., interval_s=model.interval_s)."
            )
        usable = long_enough(run, self.window)
        if usable is None:
            raise InputError(
                f"Expected a coarse run of at least one window of {self.window} samples without a gap. "
                f"Received: {max(map(len, run.parts))} samples in {run.name}. Record a longer run."
            )
        return usable

    def pair(self, telemetry: Recording, run: Recording) -> tuple[Recording, Recording]:
        """Cuts telemetry and a run to the stretches of at least a window that both cover; raises InputError if there are none."""
        return pair_recordings(telemetry, self.usable(run), self.delay_s, self.window)

    def draw(self, starts: np.ndarray, scenarios: Sequence[Any], rng: np.random.Generator) -> Drawn:
        """Cuts coarse windows out of the nominal run, whose possible starts are counted again and again; raises InputError for a scenario."""
        for scenario in scenarios:
            if scenario is not None:
                raise InputError(
                    f"Expected a recorded run of the scenario for a model of recorded runs. Received: {str(scenario)[:80]}. "
                    "Simulate it and give the run: generate MODEL_DIR --coarse fault_run.csv."
                )
        run = self.usable(self.nominal)
        windows = windows_of(
            run, np.asarray(starts) % num_window_starts(run.parts, self.window), self.window
        )
        return Drawn(windows, windows)


Alignment = Waves | Runs


def least_squares(waveform: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns the shift and the gain by which each waveform of shape `(windows, samples)` fits its target; a gain of 0 if it is constant."""
    wave_mean, target_mean = (each.mean(axis=1, dtype=np.float64) for each in (waveform, target))
    centred = waveform - wave_mean[:, None]
    power = np.sum(centred**2, axis=1)
    gain = np.sum(centred * (target - target_mean[:, None]), axis=1) / np.where(
        power > 0, power, 1.0
    )
    gain = np.where(power > 0, gain, 0.0)
    return target_mean - gain * wave_mean, gain
