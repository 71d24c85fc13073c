"""The data of a run: telemetry written to the store and read back, its parts, and windows of them.

This module contains what all stages of the pipeline share and nothing that is trained.
"""

import dataclasses
import functools
import zlib
from collections.abc import Callable, Sized
from pathlib import Path

import numpy as np

from enhsim_tf.coarse_simulator.degraded import Degraded, degrade
from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator, level_offset_and_scale
from enhsim_tf.common.errors import InputError
from enhsim_tf.enhancer.training_pairs import paired_windows
from enhsim_tf.noise.extraction import extract_noise, noise_unit
from enhsim_tf.reproduce.paper.signals import sines
from enhsim_tf.reproduce.settings import Settings
from enhsim_tf.telemetry.parquet_store import ParquetStore
from enhsim_tf.telemetry.series import Telemetry, check_values
from enhsim_tf.telemetry.sources import read_telemetry
from enhsim_tf.telemetry.windows import cut_windows, evenly_spaced_starts, random_window_starts, split_by_time

_MIN_DISJOINT = 20  # disjoint windows below which a part is read through overlapping ones


@dataclasses.dataclass(frozen=True)
class Source:
    """Where real telemetry comes from.

    Args:
        path: The file.
        column: Which column holds the values.
        time: Which column holds the times, or None.
    """

    path: Path
    column: str | None = None
    time: str | None = None


@dataclasses.dataclass(frozen=True)
class Channel:
    """One series with its parts, its coarse simulator and, where known in closed form, its true signal.

    Args:
        telemetry: The whole series.
        train: Its training part.
        calibration: The part on which thresholds are set, or None.
        test: The part on which results are measured.
        coarse: Its coarse simulator.
        periods_s: Periods of its sines in seconds, or None if unknown.
        amplitudes: Their amplitudes, or None.
    """

    telemetry: Telemetry
    train: Telemetry
    calibration: Telemetry | None
    test: Telemetry
    coarse: SquareWaveSimulator
    periods_s: tuple[float, ...] | None = None
    amplitudes: tuple[float, ...] | None = None

    @property
    def truth(self) -> Callable[[np.ndarray], np.ndarray] | None:
        """The noiseless signal as a function of time, or None if it is unknown."""
        return None if self.periods_s is None else functools.partial(sines, periods_s=self.periods_s, amplitudes=self.amplitudes)


def waves_of(settings: Settings) -> dict[str, tuple[tuple[float, ...], tuple[float, ...]]]:
    """Periods and amplitudes of each series of the paper's example, by the series' name."""
    chosen = settings.telemetry
    if chosen.layout == "separate":
        return {
            "orbit": ((chosen.orbit_period_s,), (chosen.orbit_amplitude,)),
            "rotation": ((chosen.rotation_period_s,), (chosen.rotation_amplitude,)),
        }
    return {"orbit and rotation": ((chosen.orbit_period_s, chosen.rotation_period_s), (chosen.orbit_amplitude, chosen.rotation_amplitude))}


def least_part(settings: Settings) -> int:
    """The smallest number of samples in a part: ten overlapping windows of noise, and the edges that the moving average removes."""
    return settings.telemetry.window + 9 + settings.noise.moving_average - 1


def draw(settings: Settings, purpose: str) -> np.random.Generator:
    """The random generator of one purpose. Draws for one purpose do not affect those for another."""
    return np.random.default_rng([settings.seed, zlib.crc32(purpose.encode())])


def fill_store(store: ParquetStore, settings: Settings, source: Source | None) -> None:
    """Writes the telemetry to the store: the paper's example or a real channel.

    Args:
        store: The store.
        settings: All settings.
        source: A file of real telemetry, or None for the paper's example.
    """
    chosen = settings.telemetry
    if source is not None:
        store.write(read_telemetry(source.path, source.column, source.time, 2 * least_part(settings)))
        return
    rng = draw(settings, "telemetry")
    for name, (periods, amplitudes) in waves_of(settings).items():
        clean = sines(chosen.interval_s * np.arange(chosen.num_samples), periods, amplitudes)
        values = (clean + chosen.draw_noise(clean, rng)).astype(np.float32)
        store.write(Telemetry(values, chosen.interval_s, start="2020-01-01T00:00:00+00:00", name=name))


class Data:
    """The telemetry of a run, read back from the store, and its windows.

    Args:
        store: The store.
        settings: All settings.
        is_paper: Whether the store holds the paper's example, where the truth is known.
    """

    def __init__(self, store: ParquetStore, settings: Settings, is_paper: bool):
        self.settings, self.window = settings, settings.telemetry.window
        make = self._paper_channel if is_paper else self._real_channel
        self.channels = [make(store.read(name)) for name in store.names()]

    def _paper_channel(self, series: Telemetry) -> Channel:
        split = self.settings.split
        parts = split_by_time(series, (split.train, split.calibration, split.test), self.window)
        periods, amplitudes = waves_of(self.settings)[series.name]
        pairs, levels = zip(periods, amplitudes, strict=True), self.settings.enhancer.num_levels
        coarse = SquareWaveSimulator([SquareWave(period, low=-size, high=size, num_levels=levels) for period, size in pairs])
        return Channel(series, *parts, coarse, periods, amplitudes)

    def _real_channel(self, series: Telemetry) -> Channel:
        # a real channel is short: the gap between the parts gives way before either part falls below a window of noise
        least = least_part(self.settings)
        test_length = max(int((1 - self.settings.split.real_train) * len(series)), least)
        gap = min(self.window, max(0, len(series) - test_length - least))
        train, test = series.part(0, len(series) - test_length - gap), series.part(len(series) - test_length, len(series))
        for name, part in (("training", train), ("test", test)):
            check_values(part.values, f"the {name} part of {series.name}")
            noise = extract_noise(part.values, self.settings.noise.moving_average)[0]
            if np.std(noise, dtype=np.float64) <= 1e-5 * np.std(part.values, dtype=np.float64):  # float32 resolves no less
                raise InputError(
                    f"Expected noise around the moving average. Received: none in the {name} part of {series.name}. Choose another channel."
                )
        return Channel(series, train, None, test, SquareWaveSimulator.fit(train, num_levels=self.settings.enhancer.num_levels))

    def draw(self, purpose: str) -> np.random.Generator:
        """The random generator of one purpose."""
        return draw(self.settings, purpose)

    @property
    def num_test_windows(self) -> int:
        """Number of disjoint test windows: the sample size of every rate that is measured on the test part."""
        return sum(len(channel.test) // self.window for channel in self.channels)

    @functools.cached_property
    def units(self) -> tuple[float, float, float]:
        """Offset and scale of the signal and scale of the noise. A real channel is normalised; the paper's example is not."""
        channel = self.channels[0]
        if channel.truth is not None:
            return 0.0, 1.0, 1.0
        return *level_offset_and_scale(channel.coarse), noise_unit(
            extract_noise(channel.train.values, self.settings.noise.moving_average)[0]
        )

    def windows(self, part: str, num_windows: int | None, purpose: str = "", synchronised: bool = False) -> dict[str, np.ndarray]:
        """Paired windows of one part, with equal numbers of windows from each channel.

        Args:
            part: `train`, `calibration` or `test`.
            num_windows: Number of windows at random starts; None for all disjoint windows in order of time.
            purpose: Name of the random draw of the starts.
            synchronised: Whether the phase of the coarse simulator is aligned to each window instead of continuing from training.

        Returns:
            `coarse`, `target` (the telemetry) and `truth` (the noiseless signal where known, else the telemetry),
            each of shape `(windows, samples)`; and `start`, the first sample of each window in its part, shape `(windows,)`.
        """
        rng, found = self.draw(purpose), []
        for channel in self.channels:
            series = getattr(channel, part)
            starts = self._starts(series, num_windows, rng)
            coarse, target = paired_windows(series, channel.coarse, starts, self.window)
            times = series.time_s[starts[:, None] + np.arange(self.window)]
            if synchronised:
                coarse = channel.coarse.simulate(channel.coarse.synchronise(times, target))
            truth = target if channel.truth is None else channel.truth(times).astype(np.float32)
            found.append({"coarse": coarse, "target": target, "truth": truth, "start": starts})
        return {key: np.concatenate([windows[key] for windows in found]) for key in found[0]}

    def noise_windows(self, part: str, num_windows: int | None, purpose: str = "") -> np.ndarray:
        """Windows of the noise that remains when the moving average is subtracted from a part.

        Args:
            part: `train`, `calibration` or `test`.
            num_windows: Number of windows at random starts; None for all disjoint windows in order of time.
            purpose: Name of the random draw of the starts.

        Returns:
            float32 array of shape `(windows, samples)`.
        """
        rng = self.draw(purpose)
        noises = [extract_noise(getattr(channel, part).values, self.settings.noise.moving_average)[0] for channel in self.channels]
        return np.concatenate([cut_windows(noise, self._starts(noise, num_windows, rng), self.window) for noise in noises])

    def _starts(self, series: Sized, num_windows: int | None, rng: np.random.Generator) -> np.ndarray:
        if num_windows is not None:
            return random_window_starts([series], self.window, num_windows // len(self.channels), rng)
        disjoint = len(series) // self.window
        few = disjoint < _MIN_DISJOINT  # a short real channel: windows must overlap, and nothing may be counted by them
        return evenly_spaced_starts([series], self.window, 200 if few else disjoint)

    def degraded_times(self) -> np.ndarray:
        """Times of the windows on which degraded modes are measured, shape `(windows, samples)`."""
        begins = self.draw("degraded windows").integers(0, 10**6, self.settings.detectors.num_windows)
        return self.settings.telemetry.interval_s * (begins[:, None] + np.arange(self.window, dtype=np.float64))

    def degraded_coarse(self, scenario: Degraded | None) -> np.ndarray:
        """The coarse simulator in a degraded mode, at `degraded_times`."""
        return self.channels[0].coarse.simulate(self.degraded_times(), scenario, self.draw(f"degraded {scenario}"))

    def degraded_truth(self, scenario: Degraded | None, noisy: bool) -> np.ndarray:
        """The true signal of the paper's example in a degraded mode, at the same times and with the same draws."""
        channel, rng = self.channels[0], self.draw(f"degraded {scenario}")
        size = sum(channel.amplitudes)
        clean = degrade(channel.truth, self.degraded_times(), scenario, (-size, size), min(channel.periods_s), rng)
        noise = self.settings.telemetry.draw_noise(clean.ravel(), self.draw(f"degraded noise {scenario}"))
        return (clean + noise.reshape(clean.shape) if noisy else clean).astype(np.float32)
