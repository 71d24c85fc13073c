"""The enhanced simulator: coarse simulator, alignment, enhancer and noise (figure 1 of the paper, step 5 and "Combined").

It knows nothing of how it is fitted; see `fitting.fit`.
"""

import functools
import itertools
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from enhsim_tf.coarse_simulator.degraded import Degraded
from enhsim_tf.coarse_simulator.recording import Recording
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.read_errors import READ_ERRORS, short_reason
from enhsim_tf.enhancer.model import Enhancer, average_windows, run_starts
from enhsim_tf.noise.window_bootstrap import WindowBootstrap
from enhsim_tf.simulator.alignment import START_RANGE, Alignment, Drawn, Runs
from enhsim_tf.simulator.changes import LEAST_TOLERANCE, TOLERANCE, fade_length, put_changes
from enhsim_tf.simulator.joint import cut, rounded, windows_of
from enhsim_tf.simulator.model_folder import read_saved, write_saved
from enhsim_tf.simulator.packing import packed, unpacked
from enhsim_tf.telemetry.placing import PlacedEvent, in_order
from enhsim_tf.telemetry.quantisation import Levels
from enhsim_tf.telemetry.windows import evenly_spaced_starts

_CHUNK_VALUES = 2_000_000  # values that are generated at a time
_SAVED = (
    "alignment",
    "enhancer",
    "noise",
    "channels",
    "interval_s",
    "levels",
    "quantisation",
    "nominal",
    "level_step",
)  # beside `trained`
_NUM_NOISE = 256  # windows of generated noise from which its standard deviation is computed


class EnhancedSimulator:
    """Generates realistic telemetry of one or several channels.

    Args:
        alignment: The coarse simulator, and how it is aligned with telemetry.
        enhancer: Maps coarse windows of all columns to windows of all channels.
        noise: The noise model of all channels, see `noise.window_bootstrap`.
        channels: Names of the channels.
        interval_s: Sampling interval in seconds.
        levels: For square waves: offset and gain of each channel at several times, in the order of time, shape `(times, channels, 2)`. Each
            generated window uses those of one time. None for recorded runs.
        quantisation: Levels to which each channel is rounded, or None.
        nominal: Nominal telemetry of the fit, with which thresholds are set. None if there is none.
        trained: Record of the fit, in plain JSON types.
        level_step: Samples between the times of two rows of `levels`. None: half a window.

    Example:
    >>> simulator, report = fit(telemetry)
    >>> windows = simulator.generate(num_windows=1000, scenario=Degraded("stuck", severity=0.5), seed=1)
    >>> simulator.save("model_dir")
    >>> simulator = EnhancedSimulator.load("model_dir")
    """

    def __init__(
        self,
        alignment: Alignment,
        enhancer: Enhancer,
        noise: WindowBootstrap,
        channels: Sequence[str] = ("telemetry",),
        interval_s: float = 1.0,
        levels: np.ndarray | None = None,
        quantisation: Sequence[Levels | None] | None = None,
        nominal: Recording | None = None,
        trained: Mapping[str, Any] | None = None,
        level_step: float | None = None,
    ):
        self.alignment, self.enhancer, self.noise, self.nominal = (
            alignment,
            enhancer,
            noise,
            nominal,
        )
        self.channels, self.interval_s = tuple(channels), float(interval_s)
        self.levels = (
            None
            if levels is None
            else np.asarray(levels, np.float64).reshape(-1, len(self.channels), 2)
        )
        self.quantisation = (
            tuple(quantisation) if quantisation is not None else (None,) * len(self.channels)
        )
        self.trained = dict(trained or {})
        self.level_step = float(level_step or max(1, enhancer.window // 2))

    @property
    def window(self) -> int:
        """Length of a window in samples."""
        return self.enhancer.window

    @property
    def is_run_model(self) -> bool:
        """Whether the coarse simulator is recorded runs on the clock of the telemetry."""
        return isinstance(self.alignment, Runs)

    @property
    def nominal_run(self) -> Recording | None:
        """The coarse run of the nominal telemetry; None for square waves."""
        return self.alignment.nominal if self.is_run_model else None

    @functools.cached_property
    def noise_sd(self) -> np.ndarray:
        """Standard deviation of the generated noise of each channel, shape `(channels,)`."""
        return np.std(
            self.draw_noise(self.generate(_NUM_NOISE, with_noise=False), np.random.default_rng(0)),
            axis=(0, 1),
            dtype=np.float64,
        )

    @functools.cached_property
    def scale(self) -> np.ndarray:
        """Standard deviation of the generated telemetry of each channel, shape `(channels,)`; 1 for a constant one."""
        deviation = np.hypot(
            np.std(self.generate(_NUM_NOISE, with_noise=False), axis=(0, 1), dtype=np.float64),
            self.noise_sd,
        )
        return np.where(deviation > 0, deviation, 1.0)

    # enhancement

    def enhance(
        self, coarse: np.ndarray, shift: np.ndarray | None = None, gain: np.ndarray | None = None
    ) -> np.ndarray:
        """Enhances coarse windows of shape `(windows, samples, columns)`; no noise is added (step 5 of the paper's pipeline).

        `shift` and `gain` are offset and factor of each window and channel, shape `(windows, channels)`. The result is float32 of shape
        `(windows, samples, channels)`, in the telemetry's unit. Raises InputError if the shape is wrong or a value is not finite.
        """
        columns = self.enhancer.columns
        if np.ndim(coarse) != 3 or np.shape(coarse)[1:] != (self.window, columns):
            raise InputError(
                f"Expected coarse windows of shape (windows, {self.window}, {columns}). Received: {np.shape(coarse)}."
            )
        enhanced = self.enhancer.predict(coarse)
        if shift is not None and gain is not None:
            enhanced *= gain[:, None].astype(np.float32)
            enhanced += shift[:, None].astype(np.float32)
        return check_finite(enhanced)

    def enhance_run(self, coarse: np.ndarray) -> np.ndarray:
        """Enhances one run without gaps, in overlapping windows that are averaged; no noise is added.

        The run has the shape `(samples, columns)` and at least a window of samples; the result is float32 of shape `(samples, channels)`.
        """
        coarse = np.asarray(coarse, np.float32)
        if (
            coarse.ndim != 2
            or coarse.shape[1] != self.enhancer.columns
            or len(coarse) < self.window
        ):
            raise InputError(
                f"Expected a run of shape (samples, {self.enhancer.columns}) with at least {self.window} samples. Received: {coarse.shape}."
            )
        starts = run_starts(len(coarse), self.window)
        return average_windows(
            lambda rows: self.enhance(cut([coarse], starts[rows], self.window)),
            starts,
            self.window,
            len(coarse),
        )

    def residuals(self, targets: np.ndarray) -> np.ndarray:
        """Returns telemetry windows of shape `(windows, samples, channels)` minus the square waves that are aligned with them, enhanced.

        The gain may leave the range of the training by at most a factor of 2, so that a channel that stands still is not explained.
        """
        coarse, _, gain = self.alignment.align(targets)
        learnt = self.levels[:, :, 1]
        left = targets - np.clip(gain, learnt.min(axis=0) / 2, learnt.max(axis=0) * 2)[
            :, None
        ] * self.enhance(coarse)
        return (left - left.mean(axis=1, keepdims=True)).astype(np.float32)

    def windows_and_signal(
        self, telemetry: Recording, run: Recording | None, number: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Returns so many evenly spaced windows of telemetry, shape `(windows, samples, channels)`, and the enhanced signal of the same times.

        For recorded runs, `run` is the coarse run with the same parts.
        """
        starts = evenly_spaced_starts(telemetry.parts, self.window, number)
        windows = windows_of(telemetry, starts, self.window)
        if run is None:
            return windows, self.enhance(*self.alignment.align(windows))
        return windows, cut(
            [self.enhance_run(part.values) for part in run.parts], starts, self.window
        )

    def judged_series(self, telemetry: Recording, run: Recording | None) -> list[np.ndarray]:
        """Returns what detectors judge: the parts of the telemetry that have a window, without the enhanced run of the same parts, if given."""
        found = []
        for number, part in enumerate(telemetry.parts):
            if len(part) >= self.window:
                found.append(
                    part.values
                    if run is None
                    else part.values - self.enhance_run(run.parts[number].values)
                )
        return found

    # noise

    def draw_noise(self, clean: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Generates noise for an enhanced signal: windows of shape `(windows, samples, channels)`, or one series `(samples, channels)`."""
        draw = self.noise.generate if np.ndim(clean) == 3 else self.noise.generate_series
        return check_finite(draw(len(clean), rng, clean))

    # windows

    def generate(
        self,
        num_windows: int,
        scenario: Degraded | None = None,
        seed: int = 0,
        with_noise: bool = True,
    ) -> np.ndarray:
        """Generates realistic telemetry windows: enhanced signal plus generated noise ("Combined").

        Args:
            num_windows: Number of windows.
            scenario: A degraded mode, or None for nominal telemetry.
            seed: Random seed of start times, scenario and noise. The same seed gives the same windows.
            with_noise: Whether noise is added to the enhanced signal.

        Returns:
            float32 array of shape `(num_windows, samples, channels)`, in the telemetry's unit.

        Raises:
            InputError: If `num_windows` is negative or not a whole number, or a scenario cannot be applied.
        """
        _check_count("num_windows", num_windows, 0)
        windows, filled = np.empty((num_windows, self.window, len(self.channels)), np.float32), 0
        for chunk, _ in self.generate_labelled_chunks([scenario] * num_windows, seed, with_noise):
            windows[filled : filled + len(chunk)] = chunk
            filled += len(chunk)
        return windows

    def generate_labelled_chunks(
        self, scenarios: Sequence[Degraded | None], seed: int = 0, with_noise: bool = True
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yields windows as those of `generate`, one for each scenario, in chunks, with a mask of the samples that the scenario has changed.

        Memory does not grow with the number of windows. A sample that is not marked equals that of the same seed without a scenario.
        """
        rng, noise_rng = (
            np.random.default_rng(seed),
            np.random.default_rng([seed, 1]) if with_noise else None,
        )
        num_windows = len(scenarios)
        starts = rng.integers(0, START_RANGE, num_windows)
        rows = np.random.default_rng([seed, 2]).integers(
            0, 1 if self.levels is None else len(self.levels), num_windows
        )
        chunk = max(1, _CHUNK_VALUES // (self.window * len(self.channels)))
        for first in range(0, num_windows, chunk):
            some = slice(first, first + chunk)
            drawn = self.alignment.draw(starts[some], scenarios[some], rng)
            levels = (
                () if self.levels is None else np.moveaxis(self.levels[rows[some]], 2, 0)
            )  # offset and gain of each window and channel
            clean = windows = self.enhance(drawn.nominal, *levels)
            mask = np.zeros(clean.shape, bool)
            degraded = [row for row, scenario in enumerate(scenarios[some]) if scenario is not None]
            if degraded:
                windows, own = (
                    clean.copy(),
                    Drawn(*(None if each is None else each[degraded] for each in drawn)),
                )
                changed, fade = (
                    self.enhance(own.coarse, *(each[degraded] for each in levels)),
                    fade_length(self.window),
                )
                windows[degraded], mask[degraded] = put_changes(
                    clean[degraded], changed, own, [(0, self.window)], fade, self._tolerance
                )
            yield (
                (windows, mask)
                if noise_rng is None
                else self._with_noise(windows, clean, mask, noise_rng)
            )

    @property
    def _tolerance(self) -> np.ndarray:
        """Largest difference from the nominal run of each channel that does not count as a change."""
        return np.maximum(TOLERANCE * self.noise_sd, LEAST_TOLERANCE * self.scale)

    def _with_noise(
        self, windows: np.ndarray, clean: np.ndarray, mask: np.ndarray, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """Adds noise that follows the nominal signal, so that other samples equal the nominal ones; where rounding removes a change, it is not marked."""
        noise = self.draw_noise(clean, rng)
        values = rounded(check_finite(windows + noise), self.quantisation)
        if mask.any():
            is_quantised = [levels is not None for levels in self.quantisation]
            mask[..., is_quantised] &= (values != rounded(clean + noise, self.quantisation))[
                ..., is_quantised
            ]
        return values, mask

    # series

    def generate_series(
        self, num_samples: int, scenario: Degraded | None = None, seed: int = 0
    ) -> np.ndarray:
        """Generates one continuous series, float32 of shape `(num_samples, channels)`; see `generate_labelled_series`."""
        return self.generate_labelled_series(num_samples, scenario, seed)[0]

    def generate_labelled_series(
        self,
        num_samples: int,
        scenario: Degraded | None = None,
        seed: int = 0,
        schedule: Sequence[PlacedEvent] = (),
    ) -> tuple[np.ndarray, np.ndarray, list[tuple[str, float, int, int]]]:
        """Generates one continuous series of any length without visible joins, with a mask of what a degraded mode has changed.

        Args:
            num_samples: Length of the series in samples.
            scenario: A degraded mode over the whole series, or None.
            seed: Random seed of the scenario and the noise.
            schedule: Degraded modes at given places, instead of a scenario.

        Returns:
            The float32 series, and a boolean array that marks the samples that differ from the nominal series of the same seed, both of shape
            `(samples, channels)`; and for each event that changed a sample its mode, its severity, its first changed sample, and the first
            sample after its last changed one.

        Raises:
            InputError: If events overlap or lie outside the series, or if both a scenario and a schedule are given.
        """
        _check_count("num_samples", num_samples, 1)
        if scenario is not None and schedule:
            raise InputError(
                "Expected a scenario or a schedule. Received: both. Put the scenario into the schedule."
            )
        schedule, noise_rng = (
            in_order(schedule, [(0, num_samples)], gap=1),
            np.random.default_rng([seed, 1]),
        )
        if self.is_run_model:
            self.alignment.draw(np.zeros(0, int), [scenario, *schedule], noise_rng)  # refuses them
            clean = self.nominal_series(num_samples)
            return *self._with_noise(clean, clean, np.zeros(clean.shape, bool), noise_rng), []
        events = [
            (Degraded(each.kind, each.severity, 0.0), each.begin, each.end) for each in schedule
        ]
        events += [] if scenario is None else [(scenario, 0, num_samples)]
        window, hop = self.window, self.window // 2
        num_windows = 1 + max(
            0, -(-(num_samples - window) // hop)
        )  # that overlap by half and cover the series
        drawn = self.alignment.draw_series(
            window + (num_windows - 1) * hop, events, np.random.default_rng(seed)
        )
        levels = self._following_levels(num_windows, seed)
        series = clean = self._join_series(drawn.nominal[0], levels)[:num_samples]
        mask = np.zeros(clean.shape, bool)
        if events:
            degraded, ranges = (
                self._join_series(drawn.coarse[0], levels)[:num_samples],
                [event[1:] for event in events],
            )
            (series,), (mask,) = put_changes(
                clean[None], degraded[None], drawn, ranges, fade_length(window), self._tolerance
            )
        values, mask = self._with_noise(series, clean, mask, noise_rng)
        return values, mask, _changed_events(mask.any(axis=1), events)

    def _join_series(self, coarse: np.ndarray, levels: np.ndarray) -> np.ndarray:
        """Enhances a coarse series in windows that overlap by half, and cross-fades them."""
        starts = np.arange(0, len(coarse) - self.window + 1, self.window // 2)

        def windows_at(rows: slice) -> np.ndarray:
            return self.enhance(
                cut([coarse], starts[rows], self.window), levels[rows, :, 0], levels[rows, :, 1]
            )

        return average_windows(windows_at, starts, self.window, len(coarse))

    def _following_levels(self, num_windows: int, seed: int) -> np.ndarray:
        """Returns offset and gain of consecutive windows: those seen in training, forwards and backwards from a random time."""
        cycle = np.concatenate([self.levels, self.levels[-2:0:-1]])
        begin = np.random.default_rng([seed, 2]).integers(0, len(cycle))
        rows = np.floor((self.window // 2) / self.level_step * np.arange(num_windows)).astype(
            int
        )  # as fast as in the telemetry
        return cycle[(begin + rows) % len(cycle)]

    @functools.cached_property
    def _nominal_clean(self) -> list[np.ndarray]:
        """The parts of the nominal run, enhanced."""
        return [
            self.enhance_run(part.values)
            for part in self.recorded_runs().usable(self.alignment.nominal).parts
        ]

    def nominal_series(self, num_samples: int) -> np.ndarray:
        """Returns the enhanced nominal run, repeated if the series is longer; parts and repetitions are cross-faded."""
        fade, clean = self.window // 2, self._nominal_clean
        rise = (np.sin(np.pi / 2 * (np.arange(fade) + 0.5) / fade) ** 2)[:, None]
        pieces, tail, length = [clean[0][:-fade]], clean[0][-fade:], len(clean[0]) - fade
        while length < num_samples:
            following = clean[len(pieces) % len(clean)].copy()
            following[:fade] = (1 - rise) * tail + rise * following[:fade]
            pieces.append(following[:-fade])
            length, tail = length + len(following) - fade, following[-fade:]
        return np.concatenate(pieces)[:num_samples].astype(np.float32)

    # runs of the user's simulator

    def generate_copies(
        self, run: Recording, num_copies: int, seed: int = 0
    ) -> Iterator[list[np.ndarray]]:
        """Yields copies of a run, for example of a fault: the enhanced run plus another draw of noise in each copy.

        A copy is one float32 array of shape `(samples, channels)` for each part of `alignment.usable(run)`. The first copies do not depend on
        the number of copies.
        """
        _check_count("num_copies", num_copies, 0)
        clean = [self.enhance_run(part.values) for part in self.recorded_runs().usable(run).parts]
        for number in range(num_copies):
            rng = np.random.default_rng([seed, 1, number])
            yield [
                rounded(enhanced + self.draw_noise(enhanced, rng), self.quantisation)
                for enhanced in clean
            ]

    def recorded_runs(self) -> Runs:
        """Returns the alignment of a simulator of recorded runs; raises InputError if it is one of square waves."""
        if not isinstance(self.alignment, Runs):
            raise InputError(
                "Expected a model of recorded runs. Received: one of square waves, which needs no run. Leave --coarse out, or fit with it."
            )
        return self.alignment

    # files

    def save(self, folder: str | os.PathLike) -> None:
        """Saves the simulator to a folder, see `model_folder`, in place of one that was saved there before.

        Raises:
            InputError: If the folder contains something else; it is left unchanged.
        """
        arrays: dict[str, np.ndarray] = {}
        settings = {name: packed(getattr(self, name), arrays, name) for name in _SAVED}
        write_saved(folder, arrays, settings | {"trained": self.trained})

    @classmethod
    def load(cls, folder: str | os.PathLike) -> "EnhancedSimulator":
        """Loads a saved simulator; raises InputError if the folder was not written by `save`, or a file in it has changed since."""
        arrays, settings = read_saved(folder)
        try:
            return cls(
                **{name: unpacked(settings[name], arrays) for name in _SAVED},
                trained=settings["trained"],
            )
        except READ_ERRORS as error:
            raise InputError(
                f"Expected the parts of a simulator. Received: {folder} ({short_reason(error)}). Fit it again."
            ) from None


def _changed_events(
    changed: np.ndarray, events: Sequence[tuple[Degraded, int, int]]
) -> list[tuple[str, float, int, int]]:
    """Mode, severity, first changed sample and end of the events that changed a sample; what lies between two belongs to the nearer."""
    edges = [
        0,
        *((before[2] + after[1]) // 2 for before, after in itertools.pairwise(events)),
        len(changed),
    ]
    found = []
    for (scenario, *_), begin, end in zip(events, edges[:-1], edges[1:], strict=False):
        places = np.flatnonzero(changed[begin:end])
        found += (
            [
                (
                    scenario.mode,
                    scenario.severity,
                    begin + int(places[0]),
                    begin + int(places[-1]) + 1,
                )
            ]
            if len(places)
            else []
        )
    return found


def _check_count(name: str, count: Any, least: int) -> None:
    if not (isinstance(count, int | np.integer) and count >= least):
        raise InputError(
            f"Expected {name} to be a whole number, at least {least}. Received: {name}={count!r}."
        )


def check_finite(windows: np.ndarray) -> np.ndarray:
    """Returns generated telemetry; raises InputError if a value is not finite."""
    bad = np.size(windows) - np.count_nonzero(np.isfinite(windows))
    if bad:
        raise InputError(
            f"Expected a simulator that generates finite values. Received: {bad:,} of {np.size(windows):,} values that are not. Fit it again."
        )
    return windows
