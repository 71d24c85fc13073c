"""The enhanced simulator: coarse simulator, alignment, enhancer and noise (figure 1 of the paper,
step 5 and "Combined").

It knows nothing of how it is fitted; see `fitting.fit`.
"""

import dataclasses
import functools
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from enhsim_tf.coarse.alignment import START_RANGE, Paired
from enhsim_tf.coarse.degraded import Degraded
from enhsim_tf.coarse.runs import Runs
from enhsim_tf.coarse.waves import Waves
from enhsim_tf.common.errors import InputError
from enhsim_tf.enhancer.model import Enhancer, check_finite
from enhsim_tf.noise.registry import NoiseModel
from enhsim_tf.simulator.changes import (
    LEAST_TOLERANCE,
    TOLERANCE,
    borders,
    put_changes,
)
from enhsim_tf.simulator.model_folder import read_saved, write_saved
from enhsim_tf.simulator.packing import packed, unpacked
from enhsim_tf.telemetry.placing import PlacedEvent, in_order
from enhsim_tf.telemetry.quantisation import Levels, rounded
from enhsim_tf.telemetry.series import SAME_RATE, Telemetry
from enhsim_tf.telemetry.windows import evenly_spaced_starts, windows_of

_CHUNK_VALUES = 2_000_000  # values that are generated at a time
_NUM_NOISE = 256  # windows of generated noise from which its standard deviation is computed


@dataclasses.dataclass(eq=False, repr=False)
class EnhancedSimulator:
    """Generates realistic telemetry of one or several channels.

    Args:
        alignment: The coarse simulator, and how it is aligned with telemetry: `waves.Waves` or
            `runs.Runs`.
        enhancer: Maps coarse windows of all columns to windows of all channels.
        noise: The noise model of all channels, see `noise.registry`.
        channels: Names of the channels.
        interval_s: Sampling interval in seconds.
        quantisation: Levels to which each channel is rounded, or None.
        nominal: Nominal series from which scores are learnt, each of shape `(samples, channels)`:
            telemetry, or for recorded runs its difference from an enhanced run that has not
            learnt it. `scoring.scorer.bounded` bounds them.
        trained: Record of the fit, in plain JSON types.

    Example:
    >>> simulator, report = fit(telemetry)
    >>> windows = simulator.generate(1000, scenario=Degraded("stuck", severity=0.5), seed=1)
    >>> simulator.save("model_dir")
    >>> simulator = EnhancedSimulator.load("model_dir")
    """

    alignment: Waves | Runs
    enhancer: Enhancer
    noise: NoiseModel
    channels: Sequence[str] = ("telemetry",)
    interval_s: float = 1.0
    quantisation: Sequence[Levels | None] | None = None
    nominal: Sequence[np.ndarray] = ()
    trained: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self):
        self.channels = tuple(self.channels)
        if self.quantisation is None:
            self.quantisation = (None,) * len(self.channels)

    @property
    def window(self) -> int:
        """Length of a window in samples."""
        return self.enhancer.window

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
        """Standard deviation of the generated telemetry of each channel, shape `(channels,)`; 1 for
        a constant one.
        """
        deviation = np.hypot(
            np.std(self.generate(_NUM_NOISE, with_noise=False), axis=(0, 1), dtype=np.float64),
            self.noise_sd,
        )
        return np.where(deviation > 0, deviation, 1.0)

    # enhancement

    def enhance(
        self, coarse: np.ndarray, shift: np.ndarray | None = None, gain: np.ndarray | None = None
    ) -> np.ndarray:
        """Enhances coarse windows; no noise is added. See `Enhancer.enhance`."""
        return self.enhancer.enhance(coarse, shift, gain)

    def enhance_run(self, coarse: np.ndarray) -> np.ndarray:
        """Enhances one run without gaps; no noise is added. See `Enhancer.enhance_run`."""
        return self.enhancer.enhance_run(coarse)

    # telemetry

    def pair(self, telemetry: Telemetry, run: Telemetry | None = None) -> Paired:
        """Cuts telemetry to what can be judged, and the coarse run of the same time with it.

        Args:
            telemetry: Telemetry of the channels, or of some of them. A single channel may have any
                name; what is returned has that of the simulator.
            run: The coarse run, for a simulator of recorded runs.

        Raises:
            InputError: If channels, interval or run do not fit to the simulator, or if every part
                is shorter than a window.
        """
        names = telemetry.columns
        if len(names) == len(self.channels) == 1:
            telemetry = dataclasses.replace(telemetry, columns=self.channels)
        elif not set(names) <= set(self.channels):
            raise InputError(
                f"Expected the channels {', '.join(self.channels)[:120]}. Received: "
                f"{', '.join(names)[:120]}. Select them with --column."
            )
        if abs(telemetry.interval_s - self.interval_s) > SAME_RATE * self.interval_s:
            received = "samples without times"
            give = "a time column"
            if telemetry.start is not None:
                received = f"every {telemetry.interval_s:g} s"
                give = "the same sampling interval, or --interval"
            raise InputError(
                f"Expected a sample every {self.interval_s:g} s, as in the telemetry of the fit. "
                f"Received: {received}. Give telemetry with {give}."
            )
        return self.alignment.pair(telemetry, run)

    def windows_and_signals(
        self, paired: Paired, number: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Returns so many evenly spaced windows of telemetry, shape `(windows, samples, channels)`,
        and the coarse and the enhanced signal of the same times; raises InputError if a channel is
        missing.
        """
        paired = dataclasses.replace(paired, telemetry=paired.telemetry.select(self.channels))
        starts = evenly_spaced_starts(paired.telemetry.parts, self.window, number)
        windows = windows_of(paired.telemetry, starts, self.window)
        return windows, *self.alignment.signals(self.enhancer, windows, paired, starts)

    def named(self, telemetry: Telemetry) -> Telemetry:
        """Returns telemetry with the channels of the simulator in their order; raises InputError
        if one is missing. A single channel may have any name.
        """
        if len(self.channels) == len(telemetry.columns) == 1:
            return dataclasses.replace(telemetry, columns=self.channels)
        return telemetry.select(self.channels)

    def judged_series(self, paired: Paired) -> list[np.ndarray]:
        """Returns what is judged of each part, shape `(samples, channels)`: the telemetry, or for
        recorded runs its difference from the enhanced run of the same time.
        """
        parts = zip(paired.telemetry.parts, self.explained_series(paired), strict=True)
        return [part.values - explained for part, explained in parts]

    def explained_series(self, paired: Paired) -> list[np.ndarray]:
        """Returns the enhanced run at each part, shape `(samples, channels)`; 0 without one."""
        places = [self.channels.index(name) for name in paired.telemetry.columns]
        explained = self.alignment.explained(self.enhancer, paired)
        return [known[:, places] for known in explained]

    # noise

    def draw_noise(self, clean: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Generates noise for an enhanced signal: windows of shape `(windows, samples, channels)`,
        or one series `(samples, channels)`.
        """
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
            seed: Random seed of start times, scenario and noise. The same seed gives the same
                windows.
            with_noise: Whether noise is added to the enhanced signal.

        Returns:
            float32 array of shape `(num_windows, samples, channels)`, in the telemetry's unit.

        Raises:
            InputError: If `num_windows` is negative or not a whole number, or a scenario cannot be
                applied.
        """
        _check_count("num_windows", num_windows, 0)
        windows = np.empty((num_windows, self.window, len(self.channels)), np.float32)
        filled = 0
        for chunk, _ in self.generate_labelled_chunks([scenario] * num_windows, seed, with_noise):
            windows[filled : filled + len(chunk)] = chunk
            filled += len(chunk)
        return windows

    def generate_labelled_chunks(
        self, scenarios: Sequence[Degraded | None], seed: int = 0, with_noise: bool = True
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yields windows as those of `generate`, one for each scenario, in chunks, with a mask of
        the samples that the scenario has changed.

        Memory does not grow with the number of windows. A sample that is not marked equals that of
        the same seed without a scenario.
        """
        _check_count("seed", seed, 0)
        rng = np.random.default_rng(seed)
        noise_rng = np.random.default_rng([seed, 1])
        num_windows = len(scenarios)
        starts = rng.integers(0, START_RANGE, num_windows)
        levels = self.alignment.draw_levels(num_windows, np.random.default_rng([seed, 2]))
        chunk = max(1, _CHUNK_VALUES // (self.window * len(self.channels)))
        for first in range(0, num_windows, chunk):
            rows = slice(first, first + chunk)
            drawn = self.alignment.draw(starts[rows], scenarios[rows], rng)
            shift, gain = np.moveaxis(levels[rows], 2, 0)
            clean = windows = self.enhance(drawn.nominal, shift, gain)
            mask = np.zeros(clean.shape, bool)
            modes = [row for row, scenario in enumerate(scenarios[rows]) if scenario is not None]
            if modes:
                degraded = clean.copy()
                degraded[modes] = self.enhance(drawn.coarse[modes], shift[modes], gain[modes])
                windows, mask = put_changes(
                    clean, degraded, drawn, [(0, self.window)], self.window, self._tolerance
                )
            if with_noise:
                windows, mask = self._with_noise(windows, clean, mask, noise_rng)
            yield windows, mask

    @property
    def _tolerance(self) -> np.ndarray:
        """Largest difference from the nominal run of each channel that does not count as a
        change.
        """
        return np.maximum(TOLERANCE * self.noise_sd, LEAST_TOLERANCE * self.scale)

    def _with_noise(
        self, windows: np.ndarray, clean: np.ndarray, mask: np.ndarray, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """Adds noise that follows the nominal signal, so that other samples equal the nominal ones;
        where rounding removes a change, it is not marked.
        """
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
        """Generates one continuous series, float32 of shape `(num_samples, channels)`; see
        `generate_labelled_series`.
        """
        return self.generate_labelled_series(num_samples, scenario, seed)[0]

    def generate_labelled_series(
        self,
        num_samples: int,
        scenario: Degraded | None = None,
        seed: int = 0,
        schedule: Sequence[PlacedEvent] = (),
    ) -> tuple[np.ndarray, np.ndarray, list[PlacedEvent]]:
        """Generates one continuous series of any length without visible joins, with a mask of what
        a degraded mode has changed.

        Args:
            num_samples: Length of the series in samples.
            scenario: A degraded mode over the whole series, or None.
            seed: Random seed of the scenario and the noise.
            schedule: Degraded modes at given places, instead of a scenario.

        Returns:
            The float32 series, and a boolean array that marks the samples that differ from the
            nominal series of the same seed, both of shape `(samples, channels)`; and the
            events that changed a sample, each from the first to the last that it changed.

        Raises:
            InputError: If events overlap or lie outside the series, if both a scenario and a
                schedule are given, or if one cannot be applied.
        """
        _check_count("num_samples", num_samples, 1)
        _check_count("seed", seed, 0)
        if scenario is not None and schedule:
            raise InputError(
                "Expected a scenario or a schedule. Received: both. Put the scenario into the "
                "schedule."
            )
        self.alignment.check([scenario, *schedule])
        events = [
            (Degraded(event.kind, event.severity, 0.0, event.channel), event.begin, event.end)
            for event in in_order(schedule, [(0, num_samples)], gap=1)
        ]
        if scenario is not None:
            events.append((scenario, 0, num_samples))
        made = self.alignment.clean_series(self.enhancer, num_samples, seed, events)
        series = clean = made.nominal
        mask = np.zeros(clean.shape, bool)
        if events:
            spans = [(begin, end) for _, begin, end in events]
            (series,), (mask,) = put_changes(
                clean[None], made.degraded[None], made.drawn, spans, self.window, self._tolerance
            )
        noise_rng = np.random.default_rng([seed, 1])
        values, mask = self._with_noise(series, clean, mask, noise_rng)
        return values, mask, _changed_events(mask.any(axis=1), events)

    # runs of the user's simulator

    def generate_copies(
        self, run: Telemetry, num_copies: int, seed: int = 0
    ) -> Iterator[list[np.ndarray]]:
        """Yields copies of a run, for example of a fault: the enhanced run plus another draw of
        noise in each copy.

        A copy is one float32 array of shape `(samples, channels)` for each part of
        `alignment.usable(run)`. The first copies do not depend on the number of copies.
        """
        _check_count("num_copies", num_copies, 0)
        _check_count("seed", seed, 0)
        clean = [self.enhance_run(part.values) for part in self.alignment.usable(run).parts]
        for number in range(num_copies):
            rng = np.random.default_rng([seed, 1, number])
            yield [
                rounded(enhanced + self.draw_noise(enhanced, rng), self.quantisation)
                for enhanced in clean
            ]

    # files

    def save(self, folder: str | os.PathLike) -> None:
        """Saves the simulator to a folder, see `model_folder`, in place of one that was saved there
        before.

        Raises:
            InputError: If the folder contains something else; it is left unchanged.
        """
        arrays: dict[str, np.ndarray] = {}
        settings = {name: packed(getattr(self, name), arrays, name) for name in self._packed()}
        write_saved(folder, arrays, settings | {"trained": self.trained})

    @classmethod
    def _packed(cls) -> list[str]:
        return [field.name for field in dataclasses.fields(cls) if field.name != "trained"]

    @classmethod
    def load(cls, folder: str | os.PathLike) -> "EnhancedSimulator":
        """Loads a saved simulator; raises InputError if the folder was not written by `save`, or a
        file in it has changed since.
        """
        arrays, settings = read_saved(folder)
        parts = {name: unpacked(settings[name], arrays) for name in cls._packed()}
        return cls(**parts, trained=settings["trained"])


def _changed_events(
    changed: np.ndarray, events: Sequence[tuple[Degraded, int, int]]
) -> list[PlacedEvent]:
    """The events that changed a sample, each within its `borders`."""
    edges = borders([(begin, end) for _, begin, end in events], len(changed))
    marked = []
    for (scenario, *_), begin, end in zip(events, edges[:-1], edges[1:], strict=False):
        places = begin + np.flatnonzero(changed[begin:end])
        if len(places):
            first, last = places[[0, -1]].tolist()
            mode = scenario.mode, scenario.severity
            marked.append(PlacedEvent(*mode, first, last + 1 - first, scenario.channel))
    return marked


def _check_count(name: str, count: Any, least: int) -> None:
    if not (isinstance(count, int | np.integer) and count >= least):
        raise InputError(
            f"Expected {name} to be a whole number, at least {least}. Received: {name}={count!r}."
        )
