"""Recorded runs of the user's simulator as the coarse simulator, on the clock of the telemetry."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from enhsim_tf.coarse.alignment import CleanSeries, Drawn, Enhances, Paired
from enhsim_tf.coarse.pairing import most_similar, pair_recordings
from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.series import SAME_RATE, Telemetry
from enhsim_tf.telemetry.windows import cut, num_window_starts, windows_of


@dataclasses.dataclass(eq=False)
class Runs:
    """Runs of the user's simulator on the clock of the telemetry; see `alignment`.

    Args:
        nominal: The nominal run of the fit, whose columns are the inputs of the enhancer.
        channels: Names of the channels of the telemetry.
        window: Length of a window in samples.
        delay_s: How much later the telemetry is than the coarse run, in seconds.
    """

    nominal: Telemetry
    channels: Sequence[str]
    window: int
    delay_s: float = 0.0

    def __post_init__(self):
        # an enhancer and its output for each part of the nominal run, which every series repeats
        self._enhanced: tuple[Enhances | None, list[np.ndarray]] = (None, [])

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the coarse columns."""
        return self.nominal.columns

    # telemetry

    def with_nominal(self, nominal: Paired) -> "Runs":
        """Returns the alignment with another nominal run."""
        return dataclasses.replace(self, nominal=nominal.run)

    def pair(self, telemetry: Telemetry, run: Telemetry | None) -> Paired:
        """Cuts telemetry and a run to the stretches of at least a window that both cover; raises
        InputError if there are none, or no run is given.
        """
        if run is None:
            raise InputError(
                "Expected the coarse run of the same time, because the simulator was fitted to "
                f"runs of {self.nominal.name}. Received: none. Give it with --coarse."
            )
        return Paired(*pair_recordings(telemetry, self.usable(run), self.delay_s, self.window))

    def usable(self, run: Telemetry) -> Telemetry:
        """Returns the parts of a recording that can be enhanced, with the columns of the fit;
        raises InputError if there are none.
        """
        run = run.select(self.columns)
        interval_s = self.nominal.interval_s
        if abs(run.interval_s / interval_s - 1) > SAME_RATE:
            raise InputError(
                f"Expected a coarse run with a sample every {interval_s:g} s, as in the fit. "
                f"Received: every {run.interval_s:g} s in {run.name}. "
                "Read it with read_recording(..., interval_s=model.interval_s)."
            )
        usable = run.long_enough(self.window)
        if usable is None:
            raise InputError(
                f"Expected a coarse run of at least one window of {self.window} samples without a "
                f"gap. Received: {max(map(len, run.parts))} samples in {run.name}. Record a longer "
                "run."
            )
        return usable

    def signals(
        self, enhancer: Enhances, windows: np.ndarray, paired: Paired, starts: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Returns windows of the run, for each channel of the coarse column that is most similar to
        it, and of the enhanced run.
        """
        coarse = windows_of(paired.run, starts, self.window)
        enhanced = cut(self.explained(enhancer, paired), starts, self.window)
        return coarse[:, :, most_similar(coarse, windows)], enhanced

    def explained(self, enhancer: Enhances, paired: Paired) -> list[np.ndarray]:
        """Returns the enhanced run: a detector sees what is left of the telemetry."""
        return [enhancer.enhance_run(part.values) for part in paired.run.parts]

    def state(self) -> dict[str, dict[str, float]]:
        """Returns nothing of any channel: a run has no level, gain or period of its own."""
        return {"level": {}, "gain": {}, "period_s": {}}

    # generation

    def check(self, scenarios: Sequence[Any]) -> None:
        """Raises InputError for a scenario, of which a run has to be recorded."""
        for scenario in scenarios:
            if scenario is not None:
                raise InputError(
                    "Expected a recorded run of the scenario for a model of recorded runs. "
                    f"Received: {str(scenario)[:80]}. "
                    "Simulate it and give the run: generate MODEL_DIR --coarse fault_run.csv."
                )

    def draw(self, starts: np.ndarray, scenarios: Sequence[Any], rng: np.random.Generator) -> Drawn:
        """Cuts coarse windows out of the nominal run, whose possible starts are counted again and
        again; raises InputError for a scenario.
        """
        self.check(scenarios)
        run = self.usable(self.nominal)
        starts = np.asarray(starts) % num_window_starts(run.parts, self.window)
        windows = windows_of(run, starts, self.window)
        return Drawn(windows, windows)

    def draw_levels(self, num_windows: int, rng: np.random.Generator) -> np.ndarray:
        """Returns the offset 0 and the gain 1: enhanced runs are in the unit of the telemetry."""
        return np.tile([0.0, 1.0], (num_windows, len(self.channels), 1))

    def clean_series(
        self,
        enhancer: Enhances,
        num_samples: int,
        seed: int,
        events: Sequence[tuple[Any, int, int]],
    ) -> CleanSeries:
        """Returns the enhanced nominal run, repeated if the series is longer; parts and repetitions
        are cross-faded.
        """
        self.check([event[0] for event in events])
        usable = self.usable(self.nominal)
        if self._enhanced[0] is not enhancer:
            self._enhanced = enhancer, self.explained(enhancer, Paired(usable, usable))
        parts = self._enhanced[1]
        fade = self.window // 2
        rise = (np.sin(np.pi / 2 * (np.arange(fade) + 0.5) / fade) ** 2)[:, None]
        pieces = [parts[0][:-fade]]
        tail = parts[0][-fade:]
        length = len(pieces[0])
        while length < num_samples:
            following = parts[len(pieces) % len(parts)].copy()
            following[:fade] = (1 - rise) * tail + rise * following[:fade]
            pieces.append(following[:-fade])
            tail = following[-fade:]
            length += len(pieces[-1])
        clean = np.concatenate(pieces)[:num_samples].astype(np.float32)
        return CleanSeries(clean, clean)
