"""Windows of recorded runs: what an engineer knows, and what everything is judged on."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from enhsim_tf.simulator.joint import cut
from studies.reference_or_source.recordings import COMMANDS, CRUDE, key_of

MOST_KNOWN = 1_200  # windows of the known telemetry that detectors learn from
NUM_FOLDS = 3
RELATIONS = ("channel of another time", "delayed channel")
"""Faults that keep the values of every channel and change only how it moves with the others."""


@dataclasses.dataclass(frozen=True)
class Windows:
    """Windows of telemetry and of the coarse run over the same time.

    Args:
        telemetry: Float32 of shape `(windows, samples, channels)`.
        coarse: Windows of the planned coarse run, shape `(windows, samples, columns)`.
        starts: First sample of each window in its run.
        units: Flight or orbit of each window.
    """

    telemetry: np.ndarray
    coarse: np.ndarray
    starts: np.ndarray
    units: np.ndarray

    @property
    def folds(self) -> np.ndarray:
        """Fold of each window. Those of one unit are in one fold, so that windows of different folds share no sample."""
        return self.units % NUM_FOLDS


def unit_starts(
    system: Any, num_units: int, stride: int, first: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """First samples and units of windows, a stride apart, that lie within one unit each, behind its `first` sample."""
    inside = np.arange(first, system.unit_samples - system.window + 1, stride)
    starts = (np.arange(num_units)[:, None] * system.unit_samples + inside).ravel()
    return starts, starts // system.unit_samples


def by_fold(
    folds: np.ndarray, predict: Callable[[np.ndarray, np.ndarray], np.ndarray]
) -> np.ndarray:
    """Predicts the windows of each fold from those of the others.

    Args:
        folds: Fold of each window.
        predict: Takes the masks of the windows to learn from and of those that are held out, and returns a row for each of the latter.

    Returns:
        The rows of all windows.
    """
    parts = {fold: predict(folds != fold, folds == fold) for fold in np.unique(folds)}
    found = np.empty((len(folds), *parts[folds[0]].shape[1:]), parts[folds[0]].dtype)
    for fold, part in parts.items():
        found[folds == fold] = part
    return found


def delayed(coarse: np.ndarray, unit_samples: int, delays: np.ndarray) -> np.ndarray:
    """Delays each unit of a coarse run of shape `(samples, columns)` by so many samples, negative for a run that is early.

    The first value of a unit is repeated where nothing is known.
    """
    units = coarse.reshape(-1, unit_samples, coarse.shape[1])
    places = np.clip(np.arange(unit_samples) - delays[:, None], 0, unit_samples - 1)
    return np.take_along_axis(units, places[:, :, None], axis=1).reshape(coarse.shape)


def estimated_delays(
    coarse: np.ndarray, telemetry: np.ndarray, unit_samples: int, most: int
) -> np.ndarray:
    """Finds for each unit the delay that takes a coarse run to the telemetry, by the correlation of the channels with their coarse columns.

    Args:
        coarse: The run, shape `(samples, columns)`, with the channels as its first columns.
        telemetry: Telemetry of shape `(samples, channels)`.
        unit_samples: Samples of a unit.
        most: Largest delay in samples, in both directions.
    """
    number = telemetry.shape[1]
    there = telemetry.reshape(-1, unit_samples, number)
    centred = there - there.mean(axis=1, keepdims=True)
    norms = np.sqrt((centred**2).sum(axis=1)) + 1e-9
    tried = np.arange(-most, most + 1)
    sums = []
    for delay in tried:
        moved = delayed(coarse[:, :number], unit_samples, np.full(len(there), delay)).reshape(
            there.shape
        )
        moved = moved - moved.mean(axis=1, keepdims=True)
        products = (moved * centred).sum(axis=1) / (
            norms * (np.sqrt((moved**2).sum(axis=1)) + 1e-9)
        )
        sums.append(products.sum(axis=1))
    return tried[np.argmax(sums, axis=0)]


@dataclasses.dataclass(frozen=True)
class Judged:
    """The windows of one cell.

    Args:
        known: Nominal windows that the engineer has.
        tested: Windows that are judged: nominal ones, then those under each fault.
        labels: Number of the fault of each tested window in `faults`; -1 for nominal.
        faults: Kind and severity of each fault, first those of the system, then those of `RELATIONS`, if they are asked for.
        source: Coarse windows of further nominal commands, shape `(windows, samples, columns)`.
        scale: Standard deviation of each channel of the known telemetry, which is the unit of all telemetry windows.
        simulated: For each fault that the coarse simulator can express, its windows and those of the same commands without a fault.
    """

    known: Windows
    tested: Windows
    labels: np.ndarray
    faults: tuple[tuple[str, float], ...]
    source: np.ndarray
    scale: np.ndarray
    simulated: dict[int, tuple[np.ndarray, np.ndarray]]


def windows_of(
    system: Any,
    runs: Mapping[str, np.ndarray],
    simulator: str,
    num_units: int,
    seed: int,
    noise: float = 1.0,
    delay: str = "none",
    with_relations: bool = False,
) -> Judged:
    """Cuts the windows of one cell, in units of the standard deviations of the known telemetry.

    Args:
        system: The system.
        runs: The arrays that `recordings.record` wrote.
        simulator: Name of the coarse simulator, or `COMMANDS`.
        num_units: Number of units that the engineer knows.
        seed: Seed of the sensors' noise and of the delays.
        noise: Factor of the sensors' noise.
        delay: `none`; `ignored` or `aligned`, where each unit of a planned run is late or early by up to a quarter of a window.
        with_relations: Whether windows of the faults of `RELATIONS` are tested, too.
    """
    window, samples, most = system.window, system.unit_samples, system.window // 4
    scale = None

    def planned(part: str) -> np.ndarray:
        return (
            runs[f"{part}/{CRUDE}"][:, len(system.channels) :]
            if simulator == COMMANDS
            else runs[f"{part}/{simulator}"]
        )

    def pair(part: str, stream: int, units: int | None = None) -> tuple[np.ndarray, np.ndarray]:
        real, coarse = runs[f"{part}/real"], planned(part)
        real, coarse = (
            each if units is None else each[: units * samples] for each in (real, coarse)
        )
        telemetry = system.measure(real, np.random.default_rng([seed, 100, stream]), noise)
        if delay != "none":
            delays = np.random.default_rng([seed, 101, stream]).integers(
                -most, most + 1, len(coarse) // samples
            )
            coarse = delayed(coarse, samples, delays)
            if delay == "aligned":
                coarse = delayed(
                    coarse, samples, estimated_delays(coarse, telemetry, samples, most)
                )
        return telemetry / scale if scale is not None else telemetry, coarse

    def windows(telemetry: np.ndarray, coarse: np.ndarray, stride: int, first: int = 0) -> Windows:
        starts, units = unit_starts(system, len(telemetry) // samples, stride, first)
        return Windows(
            cut([telemetry], starts, window), cut([coarse], starts, window), starts, units
        )

    telemetry, coarse = pair("fit", 0, num_units)
    scale = telemetry.std(axis=0)
    known = windows(telemetry / scale, coarse, window // 4)
    if len(known.starts) > MOST_KNOWN:
        some = np.linspace(0, len(known.starts) - 1, MOST_KNOWN).astype(int)
        known = Windows(
            *(getattr(known, field.name)[some] for field in dataclasses.fields(Windows))
        )
    parts = [windows(*pair("test", 1), window // 2)]
    labels = [np.full(len(parts[0].starts), -1)]
    simulated = {}
    for number, fault in enumerate(system.faults):
        parts.append(windows(*pair(key_of(fault), 10 + number), window // 2, system.onset))
        labels.append(np.full(len(parts[-1].starts), number))
        if f"{key_of(fault)}/{simulator}/simulated" in runs:
            faulty = runs[f"{key_of(fault)}/{simulator}/simulated"]
            starts, _ = unit_starts(system, len(faulty) // samples, window // 2, system.onset)
            simulated[number] = tuple(
                cut([run], starts, window)
                for run in (faulty, runs[f"{fault.kind}/{simulator}/nominal"])
            )
    faults = [(fault.kind, fault.severity) for fault in system.faults]
    for kind in RELATIONS if with_relations else ():
        parts.append(_unrelated(parts[0], kind, np.random.default_rng([seed, 102])))
        labels.append(np.full(len(parts[-1].starts), len(faults)))
        faults.append((kind, 1.0))
    tested = Windows(
        *(
            np.concatenate([getattr(part, field.name) for part in parts])
            for field in dataclasses.fields(Windows)
        )
    )
    source = planned("source")
    starts, _ = unit_starts(system, len(source) // samples, window // 2)
    return Judged(
        known,
        tested,
        np.concatenate(labels),
        tuple(faults),
        cut([source], starts, window),
        scale,
        simulated,
    )


def _unrelated(nominal: Windows, kind: str, rng: np.random.Generator) -> Windows:
    """Takes one channel of each nominal window from another unit, or delays it by a tenth of the window and lets it begin with its first value."""
    telemetry, (number, samples, channels) = nominal.telemetry.copy(), nominal.telemetry.shape
    rows, which = np.arange(number), rng.integers(0, channels, number)
    if kind == RELATIONS[0]:
        other = (rows + rng.integers(number // 4, 3 * number // 4, number)) % number
        telemetry[rows, :, which] = nominal.telemetry[other, :, which]
    else:
        places = np.maximum(np.arange(samples) - samples // 10, 0)
        telemetry[rows, :, which] = nominal.telemetry[rows[:, None], places, which[:, None]]
    return Windows(telemetry, nominal.coarse, nominal.starts, nominal.units)
