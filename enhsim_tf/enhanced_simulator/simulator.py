"""The enhanced simulator: coarse simulation, enhancement and generated noise (step 5 and "Combined" of the paper's pipeline)."""

import dataclasses
import functools
import itertools
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from enhsim_tf.coarse_simulator.constant_level import waves_or_level
from enhsim_tf.coarse_simulator.degraded import Degraded
from enhsim_tf.coarse_simulator.schedule import ScheduledMode, check_schedule, held_samples, simulate_schedule
from enhsim_tf.coarse_simulator.square_waves import SquareWaveSimulator
from enhsim_tf.common.backend import keras
from enhsim_tf.common.console import SILENT, Progress
from enhsim_tf.common.errors import InputError
from enhsim_tf.enhanced_simulator.changes import add_changed, blend_changes, fade_length, hold_values, spans, tolerance_of
from enhsim_tf.enhanced_simulator.checks import check_counts, check_parts, config_of
from enhsim_tf.enhanced_simulator.noise_fitting import NoiseWindows
from enhsim_tf.enhanced_simulator.noisy_output import NoisyOutput
from enhsim_tf.enhanced_simulator.saving import read_saved, write_saved
from enhsim_tf.enhanced_simulator.training import TrainingSettings, train
from enhsim_tf.enhancer import network
from enhsim_tf.enhancer.rung_networks import network_from, weights_of
from enhsim_tf.enhancer.training_pairs import Pairs, align_to_enhanced, apply_shift_and_gain, cut_pairs
from enhsim_tf.noise.candidates import NoiseModel
from enhsim_tf.noise.states import model_from, state_of
from enhsim_tf.telemetry.parquet_store import write_windows
from enhsim_tf.telemetry.quantisation import Levels
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import cut_windows, first_samples, random_window_starts

_NUM_PHASES = 400  # phases of one period at which a window is compared with the enhanced waveform
_CHUNK = 4_096  # number of windows generated at a time
_NUM_NOISE = 256  # windows of generated noise from which its standard deviation is computed
_START_RANGE = 1_000_000  # windows begin at a random sample below this one, so that every phase of the waves occurs


class EnhancedSimulator(NoisyOutput):
    """Generates realistic telemetry from a coarse simulator, an enhancing network and generated noise.

    Args:
        coarse: The coarse simulator.
        enhancer: Network that maps coarse windows to enhanced windows, both of shape `(windows, samples)`.
        noise: The noise model, see `noise.candidates`.
        interval_s: Sampling interval in seconds.
        offset: Value, in the telemetry's unit, that corresponds to 0 in the enhancer's normalised units.
        scale: Size, in the telemetry's unit, of 1 in the enhancer's normalised units.
        levels: For telemetry whose level and amplitude change: offset and gain relative to the coarse simulator at several
            times, in the order of time, shape `(times, 2)`. Each generated window uses one of these rows. None means that
            level and amplitude are constant.
        trained: Record of how the networks were trained, in plain JSON types. It is saved with the networks.
        quantisation: Levels of the channel, to which generated telemetry is rounded. None does not round.

    Example:
    >>> simulator = EnhancedSimulator.fit(telemetry, coarse=SquareWaveSimulator.fit(telemetry), seed=0)
    >>> windows = simulator.generate(num_windows=1000, scenario=Degraded("stuck", severity=0.5), seed=1)
    >>> simulator.save("model_dir")
    >>> simulator = EnhancedSimulator.load("model_dir")
    """

    def __init__(
        self,
        coarse: SquareWaveSimulator,
        enhancer: keras.Model,
        noise: NoiseModel,
        interval_s: float = 1.0,
        offset: float = 0.0,
        scale: float = 1.0,
        levels: np.ndarray | None = None,
        trained: Mapping[str, Any] | None = None,
        quantisation: Levels | None = None,
    ):
        self.quantisation = quantisation
        self.levels = None if levels is None else np.asarray(levels, np.float64).reshape(-1, 2)
        self.trained = dict(trained or {})
        self.coarse, self.enhancer, self.noise = coarse, enhancer, noise
        self.interval_s, self.offset, self.scale = float(interval_s), float(offset), float(scale)

    @property
    def window(self) -> int:
        """Length of a window in samples."""
        return self.enhancer.input_shape[1]

    @functools.cached_property
    def noise_sd(self) -> float:
        """Standard deviation of the generated noise, in the telemetry's unit."""
        noise = self.draw_noise(self.generate_clean(_NUM_NOISE), np.random.default_rng(0))
        return float(np.std(noise, dtype=np.float64))

    @classmethod
    def fit(
        cls,
        telemetry: Telemetry | Sequence[Telemetry],
        coarse: SquareWaveSimulator | None = None,
        seed: int = TrainingSettings.seed,
        num_windows: int = TrainingSettings.num_windows,
        epochs: int = TrainingSettings.epochs,
        window: int = TrainingSettings.window,
        noise: str = TrainingSettings.noise,
        held_out: float = TrainingSettings.held_out,
        decay: bool = TrainingSettings.decay,
        follow: bool = TrainingSettings.follow,
        enhancer: str = TrainingSettings.enhancer,
        verbose: int | str = "auto",
        progress: Progress = SILENT,
    ) -> "EnhancedSimulator":
        """Trains the enhancer on nominal telemetry, and fits its noise.

        Args:
            telemetry: Nominal telemetry, or the parts between its gaps on a common clock. Its length must be at least eight
                windows.
            coarse: The coarse simulator. None fits square waves to the longest part of the telemetry.
            seed: Random seed of the training.
            num_windows: Number of training windows, cut at random starts.
            epochs: Passes of the enhancer over the training windows.
            window: Length of a window in samples.
            noise: `best`, the simplest noise model that held-out telemetry does not tell from real noise; or one of
                `noise.names.CANDIDATES`. Noise is the telemetry minus the enhanced signal.
            held_out: Share of the telemetry, from 0 to below 1 and taken from its end, that is used for the noise only and not for
                training the enhancer. 0 uses all telemetry for both, which is safe with many windows, few epochs and periodic
                coarse windows: the enhancer then cannot memorise the noise of single windows.
            decay: Whether the enhancer's learning rate falls to zero along a cosine. With a constant rate, as in the paper,
                the weights keep the noise of the last batches.
            follow: Whether the coarse simulator is aligned in time, offset and gain with each window before the enhancer
                learns from that window. This is for telemetry that drifts away from a fixed simulator. The epochs of the
                enhancer `network` are split into up to three rounds; from the second round on, windows are aligned using the
                enhanced waveform. For other enhancers, windows are aligned with the waveform of ridge regression.
                Offsets and gains are stored, and generated windows sample from them.
            enhancer: `network`, the paper's; `best`, the simplest rung of `enhancer.ladder` that is not measurably worse than
                the best one on held-out time; or the name of a rung.
            verbose: Progress bars: 0 none, 1 always, "auto" on a terminal.
            progress: Reports the progress of the training as lines of text.

        Returns:
            The trained simulator.

        Raises:
            InputError: If the telemetry is empty, not finite, constant or too short, or if a setting is out of range.
        """
        settings = TrainingSettings(
            seed=seed,
            num_windows=num_windows,
            epochs=epochs,
            window=window,
            noise=noise,
            held_out=held_out,
            decay=decay,
            follow=follow,
            enhancer=enhancer,
        )
        return train(cls, telemetry, coarse, settings, verbose, progress)

    def residual_windows(self, telemetry: Telemetry | Sequence[Telemetry], num_windows: int, rng: np.random.Generator) -> np.ndarray:
        """Returns the difference between telemetry and the enhanced signal: noise, and effects that are not simulated.

        Args:
            telemetry: Telemetry on the clock of the coarse simulator, or the parts between its gaps. A simulator with
                `levels` is aligned with each window first.
            num_windows: Number of windows, cut at random starts.
            rng: Random generator that draws the starts.

        Returns:
            float32 array of shape `(num_windows, samples)`, in the telemetry's unit.
        """
        parts = check_parts(telemetry)
        check_counts(num_windows=(num_windows, 0))
        return self.noise_windows(parts, random_window_starts(parts, self.window, num_windows, rng)).noise

    def noise_windows(self, parts: Sequence[Telemetry], starts: np.ndarray) -> NoiseWindows:
        """Returns the noise of telemetry, and the enhanced signal below it.

        Args:
            parts: Telemetry, or the parts between its gaps.
            starts: Start of each window, counted over all parts as in `telemetry.windows`.
        """
        pairs = self.pairs(parts, starts)
        clean = self.follow(pairs)
        return NoiseWindows(pairs.target - clean, clean, first_samples(parts, starts, self.window))

    def pairs(self, telemetry: Telemetry | Sequence[Telemetry], starts: np.ndarray) -> Pairs:
        """Cuts windows of telemetry together with the coarse windows of the same times.

        A simulator with `levels` is aligned with each window in time, offset and gain.

        Args:
            telemetry: Telemetry, or the parts between its gaps.
            starts: Start of each window, counted over all parts as in `telemetry.windows`.

        Returns:
            The pairs of windows.
        """
        pairs = cut_pairs(check_parts(telemetry), self.coarse, starts, self.window, self.levels is not None)
        return pairs if self.levels is None else self.align_to_enhanced(pairs)

    def align_to_enhanced(self, pairs: Pairs) -> Pairs:
        """Realigns the phase, offset and gain of pairs using the enhanced waveform.

        Args:
            pairs: Pairs of windows that are aligned with the coarse simulator.

        Returns:
            The realigned pairs; the same pairs if the coarse simulator is a sum of several waves, which is not periodic, or
            a constant level, which has no phase.
        """
        if len(self.coarse.waves) > 1 or getattr(self.coarse, "is_constant", False):
            return pairs
        phases = self.coarse.waves[0].period_s * np.arange(_NUM_PHASES) / _NUM_PHASES
        coarse = self.coarse.simulate(phases[:, None] + self.interval_s * np.arange(self.window))
        return align_to_enhanced(pairs, coarse, self.enhance(coarse))

    def follow(self, pairs: Pairs) -> np.ndarray:
        """Returns the enhanced signal without noise for pairs of windows, at the level of the telemetry.

        Args:
            pairs: Pairs of coarse windows and telemetry, with the offset and gain of each.

        Returns:
            float32 array of shape `(windows, samples)`, in the telemetry's unit.
        """
        enhanced = self.enhance(pairs.coarse)
        return enhanced if self.levels is None else apply_shift_and_gain(enhanced, pairs.shift, pairs.gain)

    def generate_coarse(self, num_windows: int, scenario: Degraded | None = None, seed: int = 0) -> np.ndarray:
        """Generates coarse windows that begin at random times (step 2 of the paper's pipeline).

        Args:
            num_windows: Number of windows.
            scenario: A degraded mode, or None for nominal telemetry.
            seed: Random seed. The same seed gives the same windows.

        Returns:
            float32 array of shape `(num_windows, samples)`, in the telemetry's unit.
        """
        check_counts(num_windows=(num_windows, 0))
        rng = np.random.default_rng(seed)
        starts, levels = rng.integers(0, _START_RANGE, num_windows), self._draw_levels(num_windows, seed)
        coarse = self.coarse.simulate(self.interval_s * (starts[:, None] + np.arange(self.window)), scenario, rng)
        return coarse if levels is None else apply_shift_and_gain(coarse, *levels.T)

    def _draw_levels(self, num_windows: int, seed: int) -> np.ndarray | None:
        """Draws the offset and gain of each generated window from those seen in training, shape `(num_windows, 2)`."""
        if self.levels is None:
            return None
        return self.levels[np.random.default_rng([seed, 2]).integers(0, len(self.levels), num_windows)]

    def enhance(self, coarse: np.ndarray) -> np.ndarray:
        """Enhances coarse windows; no noise is added (step 5 of the paper's pipeline).

        Args:
            coarse: Coarse windows of shape `(windows, samples)`, for example from `generate_coarse`.

        Returns:
            float32 array of the same shape, in the telemetry's unit.

        Raises:
            InputError: If the windows do not have the length that the enhancer expects.
        """
        if np.ndim(coarse) != 2 or np.shape(coarse)[1] != self.window:
            raise InputError(f"Expected coarse windows of shape (windows, {self.window}). Received: shape {np.shape(coarse)}.")
        enhanced = network.enhance(self.enhancer, (np.asarray(coarse) - self.offset) / self.scale)
        enhanced *= np.float32(self.scale)
        enhanced += np.float32(self.offset)
        return enhanced

    def generate(self, num_windows: int, scenario: Degraded | None = None, seed: int = 0) -> np.ndarray:
        """Generates realistic telemetry windows: enhanced signal plus generated noise ("Combined").

        Args:
            num_windows: Number of windows.
            scenario: A degraded mode, or None for nominal telemetry.
            seed: Random seed of start times, scenario and noise. The same seed gives the same windows.

        Returns:
            float32 array of shape `(num_windows, samples)`, in the telemetry's unit.

        Raises:
            InputError: If `num_windows` is negative or not a whole number.
        """
        return self._join(num_windows, self.generate_chunks(num_windows, scenario, seed))

    def generate_chunks(self, num_windows: int, scenario: Degraded | None = None, seed: int = 0) -> Iterator[np.ndarray]:
        """Generates the windows of `generate` in chunks of some thousand, so that memory does not grow with their number.

        Args:
            num_windows: Number of windows.
            scenario: A degraded mode, or None for nominal telemetry.
            seed: Random seed. The same seed gives the same windows.

        Returns:
            An iterator over float32 arrays of shape `(chunk, samples)`, in the telemetry's unit.
        """
        return (windows for windows, _ in self._chunks(num_windows, scenario, seed, _noise_rng(seed)))

    def generate_labelled_chunks(
        self, num_windows: int, scenario: Degraded | None = None, seed: int = 0
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Generates the windows of `generate_chunks`, each chunk with a mask of the samples that the scenario has changed.

        Args:
            num_windows: Number of windows.
            scenario: A degraded mode, or None for nominal telemetry.
            seed: Random seed. The same seed gives the same windows.

        Returns:
            An iterator over tuples of float32 windows and boolean masks, both of shape `(chunk, samples)`. A sample that is not
            marked equals that of `generate_chunks` without a scenario and with the same seed.
        """
        return self._chunks(num_windows, scenario, seed, _noise_rng(seed))

    def generate_clean(self, num_windows: int, scenario: Degraded | None = None, seed: int = 0) -> np.ndarray:
        """Returns the windows of `generate` before noise is added.

        Args:
            num_windows: Number of windows.
            scenario: A degraded mode, or None for nominal telemetry.
            seed: Random seed, with the same meaning as in `generate`.

        Returns:
            float32 array of shape `(num_windows, samples)`, in the telemetry's unit.
        """
        return self._join(num_windows, (windows for windows, _ in self._chunks(num_windows, scenario, seed, None)))

    def _chunks(
        self, num_windows: int, scenario: Degraded | None, seed: int, noise_rng: np.random.Generator | None
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        check_counts(num_windows=(num_windows, 0))
        rng = np.random.default_rng(seed)
        starts, levels = rng.integers(0, _START_RANGE, num_windows), self._draw_levels(num_windows, seed)
        for first in range(0, num_windows, _CHUNK):
            times = self.interval_s * (starts[first : first + _CHUNK, None] + np.arange(self.window))
            nominal = self.coarse.simulate(times)
            coarse = nominal if scenario is None else self.coarse.simulate(times, scenario, rng)
            held = held_samples(scenario, self.window)
            rows = [(row, *held) for row in range(len(coarse))] if held else []
            yield self.complete_labelled(coarse, nominal, None if levels is None else levels[first : first + _CHUNK], noise_rng, rows)

    def _join(self, num_windows: int, chunks: Iterator[np.ndarray]) -> np.ndarray:
        check_counts(num_windows=(num_windows, 0))
        windows, filled = np.empty((num_windows, self.window), np.float32), 0
        for chunk in chunks:
            windows[filled : filled + len(chunk)] = chunk
            filled += len(chunk)
        return windows

    def generate_to_parquet(self, path: str | os.PathLike, num_windows: int, scenario: Degraded | None = None, seed: int = 0) -> None:
        """Writes the windows of `generate` to a Parquet file, chunk by chunk, so that memory does not grow with their number.

        Args:
            path: Path of the file.
            num_windows: Number of windows.
            scenario: A degraded mode, or None for nominal telemetry.
            seed: Random seed. The same seed gives the same windows.
        """
        write_windows(path, self.generate_chunks(num_windows, scenario, seed), self.window)

    def generate_series(self, num_samples: int, scenario: Degraded | None = None, seed: int = 0, start_s: float = 0.0) -> np.ndarray:
        """Generates one continuous series of any length, without visible joins between windows.

        Enhanced windows that overlap by half are cross-faded with weights that add up to one. The noise is generated
        separately, as one series.

        Args:
            num_samples: Length of the series in samples.
            scenario: A degraded mode over the whole series, or None for nominal telemetry.
            seed: Random seed of the scenario and the noise.
            start_s: Time of the first sample on the coarse simulator's clock, in seconds.

        Returns:
            float32 array of shape `(num_samples,)`, in the telemetry's unit.
        """
        return self.generate_labelled_series(num_samples, scenario, seed, start_s)[0]

    def generate_labelled_series(
        self,
        num_samples: int,
        scenario: Degraded | None = None,
        seed: int = 0,
        start_s: float = 0.0,
        schedule: Sequence[ScheduledMode] = (),
    ) -> tuple[np.ndarray, np.ndarray, list[tuple[str, float, int, int]]]:
        """Generates the series of `generate_series`, with a mask of the samples that a degraded mode has changed.

        Args:
            num_samples: Length of the series in samples.
            scenario: A degraded mode over the whole series, or None.
            seed: Random seed of the scenario and the noise.
            start_s: Time of the first sample on the coarse simulator's clock, in seconds.
            schedule: Degraded modes at given places, instead of a scenario.

        Returns:
            `(values, mask, events)`: the float32 series, a boolean array that marks the samples that differ from the nominal
            series of the same seed, both of shape `(samples,)`, and for each event that changed a sample its mode, its severity,
            its first changed sample, and the first sample after its last changed one.

        Raises:
            InputError: If events overlap or lie outside the series, or if both a scenario and a schedule are given.
        """
        check_counts(num_samples=(num_samples, 1))
        if scenario is not None and schedule:
            raise InputError("Expected a scenario or a schedule. Received: both. Put the scenario into the schedule.")
        schedule = check_schedule(schedule, num_samples)
        window, hop = self.window, self.window // 2
        num_windows = 1 + max(0, -(-(num_samples - window) // hop))  # that overlap by half and cover the series
        rng = np.random.default_rng(seed)
        times = start_s + self.interval_s * np.arange(window + (num_windows - 1) * hop)
        levels = None if self.levels is None else self._follow_levels(num_windows, seed)
        nominal, coarse = self.coarse.simulate(times[None])[0], None
        ranges = [(event.mode, event.severity, event.begin, event.end) for event in schedule]
        if scenario is not None:  # the scenario covers only the series, and the last window may extend beyond it
            coarse = nominal.copy()
            coarse[:num_samples] = self.coarse.simulate(times[None, :num_samples], scenario, rng)[0]
            ranges = [(scenario.mode, scenario.severity, 0, num_samples)]
        elif schedule:
            coarse = simulate_schedule(self.coarse, times, schedule, rng)
        nominal_clean = self._join_series(nominal, levels)[:num_samples]
        clean, mask, events = nominal_clean, np.zeros(num_samples, bool), []
        if coarse is not None:
            inside, held = np.zeros((1, num_samples), bool), []
            for mode, severity, begin, end in ranges:
                stuck = held_samples(scenario or Degraded(mode, severity, 0.0), end - begin)
                if stuck:
                    held.append((0, begin + stuck[0], begin + stuck[1]))
                else:
                    inside[:, begin:end] = spans((coarse != nominal)[None, begin:end])
            tolerance, clean, mask = tolerance_of(self.noise_sd, self.scale), clean[None].copy(), mask[None]
            if inside.any():
                degraded = self._join_series(coarse, levels)[None, :num_samples]
                clean, mask = blend_changes(clean, degraded, inside, fade_length(window), tolerance)
            hold_values(clean, mask, held, tolerance)
            clean, mask = clean[0], mask[0]
        noise = self.draw_noise(nominal_clean, _noise_rng(seed))
        values, mask = add_changed(clean, nominal_clean, noise, mask, self.quantisation)
        edges = [0, *((before[3] + after[2]) // 2 for before, after in itertools.pairwise(ranges)), num_samples]
        for (mode, severity, *_), (begin, end) in zip(ranges, itertools.pairwise(edges), strict=bool(ranges)):
            changed = np.flatnonzero(mask[begin:end])
            events += [(mode, severity, begin + int(changed[0]), begin + int(changed[-1]) + 1)] if len(changed) else []
        return values, mask, events

    def _join_series(self, coarse: np.ndarray, levels: np.ndarray | None) -> np.ndarray:
        """Enhances a coarse series in windows that overlap by half, and cross-fades them. The series has no noise."""
        window, hop = self.window, self.window // 2
        starts = np.arange(0, len(coarse) - window + 1, hop)
        enhanced = self.complete(cut_windows(coarse, starts, window), levels)
        fade = np.sin(np.pi * (np.arange(window) + 0.5) / window) ** 2  # the weights of two windows that overlap by half add up to 1
        signal, total = np.zeros((2, len(coarse)))
        for begin, clean in zip(starts, enhanced, strict=True):
            signal[begin : begin + window] += fade * clean
            total[begin : begin + window] += fade
        return (signal / total).astype(np.float32)

    def _follow_levels(self, num_windows: int, seed: int) -> np.ndarray:
        """Returns offset and gain of consecutive windows: those seen in training, forwards and backwards from a random time."""
        cycle = np.concatenate([self.levels, self.levels[-2:0:-1]])
        begin = np.random.default_rng([seed, 2]).integers(0, len(cycle))
        return cycle[(begin + np.arange(num_windows)) % len(cycle)]

    def save(self, folder: str | os.PathLike) -> None:
        """Saves the simulator to a folder: `arrays.npz`, `settings.json`, and `manifest.json` with their checksums.

        Args:
            folder: The folder. A simulator that was saved there before is replaced.

        Raises:
            InputError: If the folder contains something other than a saved simulator, if a number of the simulator is not finite,
                or if its noise is a model of another make, which is not saved; the folder is left unchanged.
        """
        noise = state_of(self.noise)
        settings = {
            "coarse": config_of(self.coarse),
            "noise": dict(noise.settings),
            "window": self.window,
            "interval_s": self.interval_s,
            "offset": self.offset,
            "scale": self.scale,
            "levels": None if self.levels is None else self.levels.tolist(),
            "quantisation": None if self.quantisation is None else dataclasses.asdict(self.quantisation),
            "trained": self.trained,
        }
        write_saved(folder, {"enhancer": weights_of(self.enhancer), "noise": noise.arrays}, settings)

    @classmethod
    def load(cls, folder: str | os.PathLike) -> "EnhancedSimulator":
        """Loads a saved simulator.

        Args:
            folder: A folder written by `save`.

        Returns:
            The simulator.

        Raises:
            InputError: If the folder was not written by `save`, or if a file in it has changed since.
        """
        return read_saved(folder, cls._from_saved)

    @classmethod
    def _from_saved(cls, arrays: Mapping[str, Mapping[str, np.ndarray]], settings: Mapping[str, Any]) -> "EnhancedSimulator":
        coarse, enhancer = waves_or_level(settings["coarse"]), network_from(arrays["enhancer"])
        if enhancer.input_shape != enhancer.output_shape or enhancer.input_shape[1] != settings["window"]:
            raise ValueError("an enhancer of another window length than the settings say")
        noise = model_from(settings["noise"], arrays["noise"])
        units = settings["interval_s"], settings["offset"], settings["scale"], settings["levels"]
        quantisation = None if settings["quantisation"] is None else Levels(**settings["quantisation"])
        return cls(coarse, enhancer, noise, *units, settings["trained"], quantisation)


def _noise_rng(seed: int) -> np.random.Generator:
    """Returns a random generator for the noise that is independent of the one for the coarse windows, which uses `seed` alone."""
    return np.random.default_rng([seed, 1])
