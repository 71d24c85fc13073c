"""The run model: turns runs of the user's coarse simulator into realistic telemetry (step 5 and "Combined" of the pipeline)."""

import dataclasses
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from enhsim_tf.coarse_simulator.interface import CoarseSimulator, name_of
from enhsim_tf.coarse_simulator.pairing import Pair, pair_with_recording
from enhsim_tf.coarse_simulator.recording import Recording, Run, record
from enhsim_tf.common.errors import InputError
from enhsim_tf.enhanced_simulator.checks import check_counts, check_finite
from enhsim_tf.enhanced_simulator.noisy_output import NoisyOutput
from enhsim_tf.enhanced_simulator.runs import saving
from enhsim_tf.enhanced_simulator.runs.coverage import Coverage
from enhsim_tf.enhancer.ladder import Rung
from enhsim_tf.enhancer.overlapping import cut_run, enhance_run
from enhsim_tf.noise.candidates import NoiseModel
from enhsim_tf.telemetry.quantisation import Levels
from enhsim_tf.telemetry.series import Telemetry

_CHUNK = 2_048  # windows generated at a time
_SAME_RATE = 1e-3


class RunModel(NoisyOutput):
    """Generates realistic telemetry from runs of a coarse simulator.

    Args:
        rung: The enhancer.
        noise: The noise model, see `noise.candidates`.
        coverage: The range of the training runs.
        nominal: The nominal run of the fit, with the model's columns. It is saved with the model.
        window: Length of a window in samples.
        delay_s: How much later the telemetry is than the coarse run, in seconds.
        coarse: The coarse simulator, or None if it has to be given again.
        trained: Record of the training, in plain JSON types.
        quantisation: Levels of the channel, to which generated telemetry is rounded. None does not round.

    Example:
    >>> model, report = fit_run_model(telemetry, read_recording("simulator.csv"))
    >>> copies = model.generate_copies(read_recording("fault_run.csv", model.columns), num_copies=100, seed=1)
    >>> model.save("model_dir")
    """

    def __init__(
        self,
        rung: Rung,
        noise: NoiseModel,
        coverage: Coverage,
        nominal: Recording,
        window: int,
        delay_s: float = 0.0,
        coarse: CoarseSimulator | None = None,
        trained: Mapping[str, Any] | None = None,
        quantisation: Levels | None = None,
    ):
        self.quantisation = quantisation
        self.rung, self.noise, self.coverage, self.nominal = rung, noise, coverage, nominal
        self.window, self.delay_s, self.coarse, self.trained = int(window), float(delay_s), coarse, dict(trained or {})

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the coarse columns that are inputs of the enhancer."""
        return self.nominal.columns

    @property
    def interval_s(self) -> float:
        """Sampling interval in seconds."""
        return self.nominal.interval_s

    def usable(self, run: Recording) -> Recording:
        """Returns the parts and columns of a recording that the model can enhance.

        Args:
            run: A recording. Its columns may be in any order, and further columns are ignored.

        Returns:
            The recording with the model's columns, without parts shorter than a window.

        Raises:
            InputError: If a column is missing, the interval differs, or every part is shorter than a window.
        """
        run = run.select(self.columns)
        if abs(run.interval_s / self.interval_s - 1) > _SAME_RATE:
            raise InputError(
                f"Expected a coarse run with a sample every {self.interval_s:g} s, as in the fit. Received: every {run.interval_s:g} s in {run.name}. "
                "Read it with read_recording(..., interval_s=model.interval_s)."
            )
        parts = tuple(part for part in run.parts if len(part) >= self.window)
        if not parts:
            longest = max(map(len, run.parts))
            raise InputError(
                f"Expected a coarse run of at least one window of {self.window} samples without a gap. Received: {longest} samples in {run.name}. "
                "Record a longer run."
            )
        return dataclasses.replace(run, parts=parts)

    def enhance(self, coarse: np.ndarray) -> np.ndarray:
        """Enhances one run without gaps; no noise is added.

        Args:
            coarse: Values of the model's columns, shape `(samples, columns)`, with at least a window of samples.

        Returns:
            float32 array of shape `(samples,)`, in the telemetry's unit.

        Raises:
            InputError: If the shape is wrong, or if the enhancer's output is not finite.
        """
        coarse = np.asarray(coarse)
        if coarse.ndim != 2 or coarse.shape[1] != len(self.columns) or len(coarse) < self.window:
            raise InputError(
                f"Expected a run of shape (samples, {len(self.columns)}) with at least {self.window} samples. Received: shape {coarse.shape}."
            )
        return check_finite(enhance_run(self.rung.predict, coarse, self.window))

    def generate_copies(self, run: Recording, num_copies: int, seed: int = 0) -> Iterator[list[np.ndarray]]:
        """Yields copies of a run: the enhanced run plus another draw of noise in each copy.

        Args:
            run: A recording, for example of a fault.
            num_copies: Number of copies.
            seed: Random seed of the noise. The same seed gives the same copies, and the first ones do not depend on their number.

        Yields:
            For each copy, one float32 array of shape `(samples,)` for each part of `usable(run)`.

        Raises:
            InputError: If the run cannot be enhanced.
        """
        check_counts(num_copies=(num_copies, 0))
        clean = [self.enhance(part.values) for part in self.usable(run).parts]
        for number in range(num_copies):
            rng = np.random.default_rng([seed, 1, number])
            yield [self.add_noise(enhanced, rng) for enhanced in clean]

    def simulate(self, time_s: np.ndarray, scenario: Any = None, seed: int = 0, labels: Mapping[str, Any] | None = None) -> Recording:
        """Runs the coarse simulator of the model.

        Args:
            time_s: Times in seconds at the model's interval, shape `(samples,)`.
            scenario: What differs from nominal operation, in the form that the simulator understands.
            seed: Random seed of the scenario.
            labels: Values to carry to every sample, see `recording.record`.

        Raises:
            InputError: If the model has no simulator, because it was loaded and code is not saved.
        """
        if self.coarse is None:
            kept = self.trained.get("coarse", {})
            raise InputError(
                f"Expected the coarse simulator {kept.get('name', 'of the fit')}, which is not saved with the model. Received: none. "
                "Give it again, as in RunModel.load(folder, coarse=simulator), or give a recorded run."
            )
        return record(self.coarse, time_s, scenario, np.random.default_rng(seed), labels=labels)

    def pair(self, telemetry: Sequence[Telemetry], run: Recording) -> list[Pair]:
        """Pairs telemetry with a run of the same time, with the delay of the fit; see `pairing.pair_with_recording`."""
        return pair_with_recording(telemetry, self.usable(run), self.delay_s, self.window)

    def residual(self, pair: Pair) -> np.ndarray:
        """Returns the telemetry minus the enhanced run, float32 of shape `(samples,)`."""
        return pair.telemetry.values - self.enhance(pair.coarse)

    # nominal windows and series without a further run, as of a simulator of square waves

    def generate(self, num_windows: int, scenario: Any = None, seed: int = 0) -> np.ndarray:
        """Generates nominal windows from random places of the saved nominal run.

        Args:
            num_windows: Number of windows.
            scenario: None, because a recorded run is nominal.
            seed: Random seed. The same seed gives the same windows.

        Returns:
            float32 array of shape `(num_windows, samples)`.

        Raises:
            InputError: If a scenario is given.
        """
        return np.concatenate([np.empty((0, self.window), np.float32), *self.generate_chunks(num_windows, scenario, seed)])

    def generate_chunks(self, num_windows: int, scenario: Any = None, seed: int = 0) -> Iterator[np.ndarray]:
        """Yields the windows of `generate` in chunks, so that memory does not grow with their number."""
        self._refuse_scenario(scenario)
        noise_rng = np.random.default_rng([seed, 1])
        for clean in self.nominal_chunks(num_windows, np.random.default_rng(seed)):
            yield self.add_noise(clean, noise_rng)

    def nominal_chunks(self, num_windows: int, rng: np.random.Generator) -> Iterator[np.ndarray]:
        """Yields enhanced windows from random places of the saved nominal run, without noise, in chunks.

        Args:
            num_windows: Number of windows.
            rng: Random generator of the places.
        """
        check_counts(num_windows=(num_windows, 0))
        parts = self._nominal_parts()
        firsts = np.cumsum([0] + [len(part) - self.window + 1 for part in parts])
        places = rng.integers(0, firsts[-1], num_windows)
        for first in range(0, num_windows, _CHUNK):
            chosen = places[first : first + _CHUNK]
            which = np.searchsorted(firsts, chosen, "right") - 1
            coarse = np.empty((len(chosen), self.window, len(self.columns)), np.float32)
            for number in np.unique(which):
                here = which == number
                coarse[here] = cut_run(parts[number].values, chosen[here] - firsts[number], self.window)
            yield check_finite(self.rung.predict(coarse))

    def generate_labelled_chunks(self, num_windows: int, scenario: Any = None, seed: int = 0) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yields the windows of `generate_chunks` with masks of changed samples, which are False because the windows are nominal."""
        for windows in self.generate_chunks(num_windows, scenario, seed):
            yield windows, np.zeros(windows.shape, bool)

    def generate_labelled_series(
        self, num_samples: int, scenario: Any = None, seed: int = 0, start_s: float = 0.0, schedule: Sequence[Any] = ()
    ) -> tuple[np.ndarray, np.ndarray, list[tuple[str, float, int, int]]]:
        """Returns the series of `generate_series`, a mask of changed samples, which is False, and no events."""
        self._refuse_scenario(scenario if scenario is not None else (tuple(schedule) or None))
        return self.generate_series(num_samples, None, seed, start_s), np.zeros(num_samples, bool), []

    def generate_series(self, num_samples: int, scenario: Any = None, seed: int = 0, start_s: float = 0.0) -> np.ndarray:
        """Generates one nominal series along the saved nominal run, which is repeated if the series is longer.

        Parts and repetitions are joined at their ends by cross-fading over half a window.

        Args:
            num_samples: Length of the series in samples.
            scenario: None, because a recorded run is nominal.
            seed: Random seed of the noise.
            start_s: Time of the first sample in the nominal run, in seconds.

        Returns:
            float32 array of shape `(num_samples,)`.
        """
        self._refuse_scenario(scenario)
        return self.add_noise(self.nominal_series(num_samples, start_s), np.random.default_rng([seed, 1]))

    def nominal_series(self, num_samples: int, start_s: float = 0.0) -> np.ndarray:
        """Returns the series of `generate_series` without noise."""
        check_counts(num_samples=(num_samples, 1))
        skipped, fade = round(start_s / self.interval_s), self.window // 2
        clean = [self.enhance(part.values) for part in self._nominal_parts()]
        rise = np.sin(np.pi / 2 * (np.arange(fade) + 0.5) / fade) ** 2
        series, number = clean[0], 0
        pieces = [series[:-fade]]
        length, tail = len(series) - fade, series[-fade:]
        while length < skipped + num_samples:
            number += 1
            following = clean[number % len(clean)].copy()
            following[:fade] = (1 - rise) * tail + rise * following[:fade]
            pieces.append(following[:-fade])
            length, tail = length + len(following) - fade, following[-fade:]
        return np.concatenate(pieces)[skipped : skipped + num_samples]

    def _nominal_parts(self) -> tuple[Run, ...]:
        return self.usable(self.nominal).parts

    def _refuse_scenario(self, scenario: Any) -> None:
        if scenario is not None:
            raise InputError(
                f"Expected a recorded run of the scenario for a model of recorded runs. Received: {str(scenario)[:80]}. "
                "Simulate it and give the run: generate MODEL_DIR --coarse fault_run.csv."
            )

    def save(self, folder: str | os.PathLike) -> None:
        """Saves the model to a folder; see `saving.save_run_model`.

        Args:
            folder: The folder. A model that was saved there before is replaced.

        Raises:
            InputError: If the folder contains something other than a saved model, if a number of the model is not finite, or if its
                noise is a GAN, which is not saved; the folder is left unchanged.
        """
        saving.save_run_model(folder, self.rung, self.noise, self.coverage, self.nominal, self.delay_s, self.trained, self.quantisation)

    @classmethod
    def load(cls, folder: str | os.PathLike, coarse: CoarseSimulator | None = None) -> "RunModel":
        """Loads a saved model.

        Args:
            folder: A folder written by `save`.
            coarse: The coarse simulator, for a model of the user's own simulator, whose code is not saved.

        Raises:
            InputError: If the folder was not written by `save`, a file in it has changed since, or the simulator has other
                columns than the model.
        """
        model = cls(**saving.load_run_model(folder))
        if coarse is not None:
            if set(model.columns) - set(coarse.columns):
                raise InputError(
                    f"Expected a simulator with the columns {', '.join(model.columns)[:120]}. Received: {name_of(coarse)} with "
                    f"{', '.join(coarse.columns)[:120]}. Give the simulator of the fit."
                )
            model.coarse = coarse
        return model
