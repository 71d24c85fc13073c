"""Windows of recorded runs: what an engineer knows, and what everything is judged on."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from enhsim_tf.telemetry.windows import cut
from studies.reference_or_source.inputs import inputs_of
from studies.reference_or_source.recordings import commands_of, key_of

NUM_FOLDS = 3


class Windows(NamedTuple):
    """Windows of telemetry, and of the coarse run and the commands over the same time.

    Args:
        telemetry: Float32 of shape `(windows, samples, channels)`.
        coarse: Windows of the planned coarse run, shape `(windows, samples, columns)`, with the
            channels as its first columns.
        inputs: Windows of what is known from the commands alone, see `inputs.inputs_of`.
        starts: First sample of each window in its run.
        units: Flight, orbit or discharge of each window.
    """

    telemetry: np.ndarray
    coarse: np.ndarray
    inputs: np.ndarray
    starts: np.ndarray
    units: np.ndarray

    @property
    def folds(self) -> np.ndarray:
        """Fold of each window. Those of one unit are in one fold, so that windows of different
        folds share no sample.
        """
        return self.units % NUM_FOLDS

    def take(self, chosen: np.ndarray) -> "Windows":
        """The windows of a mask or of indices."""
        return Windows(*(values[chosen] for values in self))


def join(parts: Sequence[Windows]) -> Windows:
    """The windows of several parts, one after another."""
    return Windows(*map(np.concatenate, zip(*parts, strict=True)))


class Judged(NamedTuple):
    """What is known of a system, and what detectors are judged on.

    Args:
        known: Windows of the known nominal telemetry.
        tested: Windows that are judged.
        labels: For each tested window -1 for nominal, or the number of its fault.
        faults: Kind and severity of each fault.
        source: Windows of the coarse run that training data are generated from.
        scale: Standard deviation of each channel of the known telemetry, in whose units telemetry
            windows are.
    """

    known: Windows
    tested: Windows
    labels: np.ndarray
    faults: tuple[tuple[str, float], ...]
    source: np.ndarray
    scale: np.ndarray


def unit_starts(
    system: Any, num_units: int, stride: int, first: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """First samples and units of windows, a stride apart, that lie within one unit each, behind its
    `first` sample.
    """
    inside = np.arange(first, system.unit_samples - system.window + 1, stride)
    starts = (np.arange(num_units)[:, None] * system.unit_samples + inside).ravel()
    return starts, starts // system.unit_samples


def by_fold(
    folds: np.ndarray, predict: Callable[[np.ndarray, np.ndarray], np.ndarray]
) -> np.ndarray:
    """Predicts the windows of each fold from those of the others.

    Args:
        folds: Fold of each window.
        predict: Takes the masks of the windows to learn from and of those that are held out, and
            returns a row for each of the latter.

    Returns:
        The rows of all windows.
    """
    parts = {fold: predict(folds != fold, folds == fold) for fold in np.unique(folds)}
    found = np.empty((len(folds), *parts[folds[0]].shape[1:]), parts[folds[0]].dtype)
    for fold, part in parts.items():
        found[folds == fold] = part
    return found


def windows_of(system: Any, runs: Mapping[str, np.ndarray], simulator: str, seed: int) -> Judged:
    """Cuts the windows of one simulator.

    Args:
        system: The system.
        runs: The arrays that `recordings.record` wrote.
        simulator: `recordings.CRUDE` or `recordings.FITTED`.
        seed: Seed of the runs, from which the commands are drawn again, and of the sensors' noise.
    """
    window = system.window
    samples = system.unit_samples
    scale = 1.0

    def measured(part: str, stream: int) -> np.ndarray:
        return system.measure(runs[f"{part}/real"], np.random.default_rng([seed, 100, stream]))

    def windows(telemetry: np.ndarray, part: str, stride: int, first: int = 0) -> Windows:
        starts, units = unit_starts(system, len(telemetry) // samples, stride, first)
        commands = commands_of(system, part, len(telemetry) // samples, seed)
        inputs = inputs_of(
            system.as_inputs(commands), None if system.is_continuous else samples, window
        )[len(commands) - len(telemetry) :]
        series = telemetry / scale, runs[f"{part}/{simulator}"], inputs
        return Windows(*(cut([each], starts, window) for each in series), starts, units)

    telemetry = measured("fit", 0)
    scale = telemetry.std(axis=0)
    parts = [windows(measured("test", 1), "test", window // 2)]
    labels = [np.full(len(parts[0].starts), -1)]
    for number, fault in enumerate(system.faults):
        telemetry_under = measured(key_of(fault), 10 + number)
        parts.append(windows(telemetry_under, fault.kind, window // 2, system.onset))
        labels.append(np.full(len(parts[-1].starts), number))
    source = runs[f"source/{simulator}"]
    starts, _ = unit_starts(system, len(source) // samples, window // 2)
    return Judged(
        windows(telemetry, "fit", window // 4),
        join(parts),
        np.concatenate(labels),
        tuple((fault.kind, fault.severity) for fault in system.faults),
        cut([source], starts, window),
        scale,
    )
