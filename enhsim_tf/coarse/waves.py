"""Square waves as the coarse simulator of all channels, and how windows of telemetry find their
phase, offset and gain.
"""

import dataclasses
import itertools
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from enhsim_tf.coarse.alignment import CleanSeries, Drawn, Enhances, Paired
from enhsim_tf.coarse.degraded import Degraded, held_samples
from enhsim_tf.coarse.square_waves import SquareWaveSimulator, level_offset_and_scale
from enhsim_tf.common.errors import InputError, counted
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import average_windows, cut

# of the amplitude of the square wave; a window with a smaller gain is too flat to learn a shape
# from
MIN_GAIN = 0.1
_NUM_PHASES = 400  # phases of one period at which a window is compared with the waveform
_SAME_PERIOD = 0.02  # largest relative difference of periods that are one clock


@dataclasses.dataclass(frozen=True, eq=False)
class Waves:
    """One square wave or constant level for each channel, aligned with each window in phase, offset
    and gain; see `alignment`.

    Coarse windows are in units of the wave: -1 is its lowest level, 1 its highest.

    Args:
        simulators: The wave or level of each channel.
        channels: Names of the channels.
        interval_s: Sampling interval in seconds.
        window: Length of a window in samples.
        waveforms: The enhanced waveform of each channel at `_NUM_PHASES` phases, shape `(phases,
            samples)`; None, also for a channel: the wave itself. A square wave shows its phase
            only at its edges, the enhanced waveform at every sample.
        levels: Offset and gain of each channel at several times, in the order of time, shape
            `(times, channels, 2)`. Each generated window uses those of one time. None: not known
            yet, so that nothing can be generated.
        level_step: Samples between the times of two rows of `levels`. None: half a window.
    """

    simulators: Sequence[SquareWaveSimulator]
    channels: Sequence[str]
    interval_s: float
    window: int
    waveforms: Sequence[np.ndarray | None] | None = None
    levels: np.ndarray | None = None
    level_step: float | None = None
    # of a run, which waves do not have
    columns: ClassVar[None] = None
    delay_s: ClassVar[float] = 0.0

    @property
    def longest_period(self) -> float:
        """The longest period of a wave in samples; 0 if nothing is periodic."""
        periods_s = [wave.period_s for wave in self.simulators if not wave.is_constant]
        return max(periods_s, default=0.0) / self.interval_s

    def phases(self, channel: int) -> np.ndarray:
        """Coarse windows of a channel at all phases of its period, float32 of shape `(phases,
        samples)`.
        """
        starts = self.simulators[channel].period_s * np.arange(_NUM_PHASES) / _NUM_PHASES
        return self._coarse(channel, starts[:, None] + self.interval_s * np.arange(self.window))

    def align(self, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Finds phase, offset and gain of each channel in telemetry windows of shape `(windows,
        samples, channels)`.

        Returns coarse windows of the same times, float32, and offset and gain of each window and
        channel, float64.
        """
        coarse = np.zeros(targets.shape, np.float32)
        shift, gain = np.zeros((2, len(targets), targets.shape[2]))
        for channel, simulator in enumerate(self.simulators):
            target = targets[:, :, channel]
            # there is no shape to which a phase or a gain could be fitted
            if simulator.is_constant:
                shift[:, channel] = target.mean(axis=1, dtype=np.float64)
                gain[:, channel] = simulator.spread
                continue
            best = self.best_phases(targets, channel)
            coarse[:, :, channel] = self.phases(channel)[best]
            shift[:, channel], gain[:, channel] = least_squares(
                self._waveform(channel)[best], target
            )
        return coarse, shift, gain

    def _waveform(self, channel: int) -> np.ndarray:
        learnt = self.waveforms and self.waveforms[channel]
        return self.phases(channel) if learnt is None else learnt

    def best_phases(self, targets: np.ndarray, channel: int) -> np.ndarray:
        """Returns the number of the phase at which the waveform of a channel is most correlated
        with each window, shape `(windows,)`.
        """
        waveform = self._waveform(channel)
        target = targets[:, :, channel]
        centred = waveform - waveform.mean(axis=1, keepdims=True, dtype=np.float64)
        length = np.sqrt(np.sum(centred**2, axis=1, keepdims=True))
        # the waveforms are centred, so the level of the telemetry has no effect
        agreement = (target - target.mean(axis=1, keepdims=True)) @ (
            centred / np.where(length > 0, length, 1.0)
        ).T.astype(np.float32)
        return np.argmax(agreement, axis=1)

    def on_one_clock(self, targets: np.ndarray) -> "Waves":
        """Returns the waves with one period where periods are nearly equal, at the distance in
        phase that telemetry windows show.

        Periods that are fitted to each channel alone differ a little, and over a long time every
        relation of their phases would occur.
        """
        simulators = list(self.simulators)
        moving = [
            number for number, simulator in enumerate(simulators) if not simulator.is_constant
        ]
        for first, other in itertools.combinations(moving, 2):
            wave = simulators[first].waves[0]
            old = simulators[other].waves[0]
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
        return dataclasses.replace(self, simulators=simulators)

    def is_flat(self, gain: np.ndarray) -> np.ndarray:
        """Whether windows are too flat for the wave of a channel; `gain` is that of `align`, of
        shape `(windows, channels)` as the result.
        """
        return gain < [
            0.0 if wave.is_constant else MIN_GAIN * level_offset_and_scale(wave)[1]
            for wave in self.simulators
        ]

    # telemetry

    def with_nominal(self, nominal: Paired) -> "Waves":
        """Returns the waves, which have no run."""
        return self

    def pair(self, telemetry: Telemetry, run: Telemetry | None) -> Paired:
        """Returns the parts of at least a window; raises InputError if there are none, or if a run
        is given.
        """
        if run is not None:
            raise self._no_runs()
        usable = telemetry.long_enough(self.window)
        if usable is None:
            longest = counted(max(map(len, telemetry.parts)), "sample")
            raise InputError(
                f"Expected a part of at least one window of {self.window} samples. Received: "
                f"{longest}. Give more telemetry."
            )
        return Paired(usable)

    def usable(self, run: Telemetry) -> Telemetry:
        """Raises InputError, because square waves need no run."""
        raise self._no_runs()

    def _no_runs(self) -> InputError:
        return InputError(
            "Expected a model of recorded runs. Received: one of square waves, which needs no run. "
            "Leave --coarse out, or fit with it."
        )

    def signals(
        self, enhancer: Enhances, windows: np.ndarray, paired: Paired, starts: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Returns the waves in the unit of the telemetry, each window aligned in phase, offset and
        gain, and the same enhanced.
        """
        coarse, shift, gain = self.align(windows)
        enhanced = enhancer.enhance(coarse, shift, gain)
        return shift[:, None] + gain[:, None] * coarse, enhanced

    def explained(self, enhancer: Enhances, paired: Paired) -> list[np.ndarray]:
        """Returns zeros: a detector sees the telemetry itself."""
        return [np.zeros((1, len(self.channels)), np.float32)] * len(paired.telemetry.parts)

    def state(self) -> dict[str, dict[str, float]]:
        """Returns the median `level` and `gain` of each channel, and the `period_s` of each that is
        periodic.
        """
        level, gain = np.median(self.levels, axis=0).T.tolist()
        return {
            "level": dict(zip(self.channels, level, strict=True)),
            "gain": dict(zip(self.channels, gain, strict=True)),
            "period_s": {
                channel: float(wave.period_s)
                for channel, wave in zip(self.channels, self.simulators, strict=True)
                if not wave.is_constant
            },
        }

    # generation

    def check(self, scenarios: Sequence[Degraded | None]) -> None:
        """Raises InputError if a scenario names a channel that there is not."""
        for scenario in scenarios:
            if scenario is not None:
                self._concerned(scenario)

    def draw(
        self, starts: np.ndarray, scenarios: Sequence[Degraded | None], rng: np.random.Generator
    ) -> Drawn:
        """Simulates coarse windows that begin at these samples of the clock of the waves, each with
        its scenario or None.
        """
        rows_of: dict[Degraded, list[int]] = {}
        for row, scenario in enumerate(scenarios):
            if scenario is not None:
                rows_of.setdefault(scenario, []).append(row)
        changes = [
            (channel, rows, scenario, 0, self.window)
            for scenario, rows in rows_of.items()
            for channel in self._concerned(scenario)
        ]
        times = self.interval_s * (np.asarray(starts)[:, None] + np.arange(self.window))
        return self._drawn(times, changes, rng)

    def draw_levels(self, num_windows: int, rng: np.random.Generator) -> np.ndarray:
        """Draws offset and gain of windows among those of the training."""
        return self.levels[rng.integers(0, len(self.levels), num_windows)]

    def draw_series(
        self,
        num_samples: int,
        events: Sequence[tuple[Degraded, int, int]],
        rng: np.random.Generator,
    ) -> Drawn:
        """Simulates one coarse series, as a single window of `num_samples`; each event is a mode,
        its first sample and its end.
        """
        changes = [
            (channel, [0], *event)
            for channel in range(len(self.simulators))
            for event in events
            if channel in self._concerned(event[0])
        ]
        return self._drawn((self.interval_s * np.arange(num_samples))[None], changes, rng)

    def clean_series(
        self,
        enhancer: Enhances,
        num_samples: int,
        seed: int,
        events: Sequence[tuple[Degraded, int, int]],
    ) -> CleanSeries:
        """Enhances a coarse series in windows that overlap by half, and cross-fades them.

        Offset and gain of consecutive windows are those seen in training, forwards and backwards
        from a random time, as fast as in the telemetry.
        """
        window = self.window
        hop = window // 2
        num_windows = 1 + max(0, -(-(num_samples - window) // hop))
        length = window + (num_windows - 1) * hop
        drawn = self.draw_series(length, events, np.random.default_rng(seed))
        cycle = np.concatenate([self.levels, self.levels[-2:0:-1]])
        begin = np.random.default_rng([seed, 2]).integers(0, len(cycle))
        step = self.level_step or max(1, window // 2)
        steps = np.floor(hop / step * np.arange(num_windows)).astype(int)
        levels = cycle[(begin + steps) % len(cycle)]
        starts = np.arange(0, length - window + 1, hop)

        def joined(coarse: np.ndarray) -> np.ndarray:
            def windows_at(rows: slice) -> np.ndarray:
                pieces = cut([coarse], starts[rows], window)
                return enhancer.enhance(pieces, levels[rows, :, 0], levels[rows, :, 1])

            return average_windows(windows_at, starts, window, length)[:num_samples]

        nominal = joined(drawn.nominal[0])
        return CleanSeries(nominal, joined(drawn.coarse[0]) if events else nominal, drawn)

    def changes(self, scenario: Degraded, begin: int, end: int) -> bool:
        """Whether the wave of a channel that the mode concerns changes."""
        times = self.interval_s * np.arange(begin, end)[None]
        waves = [self.simulators[channel] for channel in self._concerned(scenario)]
        return any(
            (wave.simulate(times, scenario, np.random.default_rng(0)) != wave.simulate(times)).any()
            for wave in waves
        )

    def _drawn(
        self,
        times: np.ndarray,
        changes: Sequence[tuple[int, list[int], Degraded, int, int]],
        rng: np.random.Generator,
    ) -> Drawn:
        """Simulates coarse windows at times of shape `(windows, samples)`, with degraded modes;
        each change is a channel, its windows, the mode, its first sample and its end.
        """
        channels = range(len(self.channels))
        nominal = np.stack([self._coarse(channel, times) for channel in channels], axis=2)
        if not changes:
            return Drawn(nominal, nominal)
        coarse = nominal.copy()
        held = np.broadcast_to(np.arange(nominal.shape[1])[:, None], nominal.shape).copy()
        for channel, rows, scenario, begin, end in changes:
            coarse[rows, begin:end, channel] = self._coarse(
                channel, times[rows, begin:end], scenario, rng
            )
            stuck = held_samples(scenario, end - begin)
            if stuck is not None:
                held[rows, begin + stuck[0] : begin + stuck[1], channel] = begin + stuck[0]
        return Drawn(coarse, nominal, held)

    def _concerned(self, scenario: Degraded) -> Sequence[int]:
        if scenario.channel is None:
            return range(len(self.channels))
        if scenario.channel not in self.channels:
            raise InputError(
                f"Expected a channel, one of: {', '.join(self.channels)[:200]}. Received: "
                f"{scenario.channel!r} in the scenario."
            )
        return [self.channels.index(scenario.channel)]

    def _coarse(
        self,
        channel: int,
        times: np.ndarray,
        scenario: Degraded | None = None,
        rng: np.random.Generator | None = None,
    ) -> np.ndarray:
        """Simulates windows of a channel, in its unit."""
        wave = self.simulators[channel]
        offset, scale = level_offset_and_scale(wave)
        return ((wave.simulate(times, scenario, rng) - offset) / scale).astype(np.float32)


def least_squares(waveform: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns the shift and the gain by which each waveform of shape `(windows, samples)` fits its
    target; a gain of 0 if it is constant.
    """
    wave_mean = waveform.mean(axis=1, dtype=np.float64)
    target_mean = target.mean(axis=1, dtype=np.float64)
    centred = waveform - wave_mean[:, None]
    power = np.sum(centred**2, axis=1)
    covariance = np.sum(centred * (target - target_mean[:, None]), axis=1)
    gain = covariance / np.where(power > 0, power, 1.0)
    return target_mean - gain * wave_mean, gain
