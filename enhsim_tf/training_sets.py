"""Labelled training data: windows, or one continuous series, with what happens in them and from when.

The labels stand in the columns beside the data: `scenario` (`nominal` or a degraded mode), `severity`, and `onset`, the
first sample that it concerns.
"""

import dataclasses
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.errors import InputError
from enhsim_tf.files import make_folder, replace_file
from enhsim_tf.simulator import MODES, Degraded

if TYPE_CHECKING:
    from enhsim_tf.enhanced_simulator import EnhancedSimulator

NOMINAL = "nominal"
_WRITTEN = 65_536  # samples of a series written at a time
_MOST_SAMPLES = 20_000_000  # of a continuous series, which is made in memory


@dataclasses.dataclass(frozen=True)
class Share:
    """A part of a training set.

    Args:
        scenario: A degraded mode, or None for nominal.
        num_windows: Its windows.
        seed: Seed of everything drawn for it.
    """

    scenario: Degraded | None
    num_windows: int
    seed: int


def parse_scenario(text: str) -> Degraded:
    """Reads `mode:severity` or `mode:severity:onset`, such as `stuck:0.5`.

    Raises:
        InputError: If the mode is unknown or a number is out of its range.
    """
    mode, *numbers = text.split(":")
    if mode not in MODES or not 1 <= len(numbers) <= 2:
        raise InputError(f"Expected mode:severity or mode:severity:onset, mode one of {', '.join(MODES)}. Received: {text!r}.")
    try:
        values = [float(number) for number in numbers]
    except ValueError:
        raise InputError(f"Expected numbers from 0 to 1 after the mode. Received: {text!r}. Write for example {mode}:0.5.") from None
    return Degraded(mode, *values)


def num_samples_of(length: str, interval_s: float) -> int:
    """Samples of a length such as `1d`, `6h`, `90min`, `30s`, or a number of samples.

    Raises:
        InputError: If it is no length, or less than a sample.
    """
    import pandas as pd

    try:
        samples = int(length) if length.isdecimal() else round(pd.Timedelta(length).total_seconds() / interval_s)
    except (ValueError, OverflowError):
        samples = 0
    if not 1 <= samples <= _MOST_SAMPLES:
        raise InputError(
            f"Expected a length such as 1d, 6h, 90min or 5000 (samples), up to {_MOST_SAMPLES:,} samples. Received: {length!r}."
        )
    return samples


def shares_of(scenarios: Sequence[Degraded], num_windows: int, nominal_share: float, seed: int) -> list[Share]:
    """Divides windows between nominal ones and scenarios, the rest of the division going to the first.

    Args:
        scenarios: Degraded modes; none makes every window nominal.
        num_windows: Windows in all.
        nominal_share: Share of them that is nominal, where there are scenarios.
        seed: Seed of the whole set.
    """
    if not 0 <= nominal_share <= 1:
        raise InputError(f"Expected a nominal share from 0 to 1. Received: {nominal_share}.")
    num_nominal = round(nominal_share * num_windows) if scenarios else num_windows
    counts = [num_nominal] + [
        (num_windows - num_nominal) // len(scenarios) + (number < (num_windows - num_nominal) % len(scenarios))
        for number in range(len(scenarios))
    ]
    seeds = np.random.SeedSequence(seed).generate_state(len(counts)).tolist()
    return [Share(*each) for each in zip([None, *scenarios], counts, seeds, strict=True) if each[1]]


def write_windows_labelled(path: str | os.PathLike, simulator: "EnhancedSimulator", shares: Sequence[Share]) -> None:
    """Writes labelled windows to one Parquet file, as they are made; the file appears when it is complete.

    Columns: `window` (a list of float32), `scenario`, `severity`, `onset` (the first sample concerned, null where nominal).

    Args:
        path: The file.
        simulator: What makes them.
        shares: Which and how many.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema = pa.schema(
        {
            "window": pa.list_(pa.float32(), simulator.window),
            "scenario": pa.string(),
            "severity": pa.float32(),
            "onset": pa.int32(),
        }
    ).with_metadata({"interval_s": repr(simulator.interval_s), "channel": str(simulator.trained.get("telemetry", ""))})
    make_folder(Path(path).parent)
    with replace_file(path) as temporary, pq.ParquetWriter(temporary, schema, compression="zstd") as writer:
        for share in shares:
            name, severity, onset = _labels(share.scenario, simulator.window)
            for windows in simulator.generate_chunks(share.num_windows, share.scenario, share.seed):
                columns = [
                    pa.FixedSizeListArray.from_arrays(pa.array(windows.ravel()), simulator.window),
                    pa.array([name] * len(windows)),
                    pa.array([severity] * len(windows), pa.float32()),
                    pa.array([onset] * len(windows), pa.int32()),
                ]
                writer.write_table(pa.table(columns, schema=schema))


def write_series_labelled(
    path: str | os.PathLike, simulator: "EnhancedSimulator", num_samples: int, scenario: Degraded | None, seed: int
) -> None:
    """Writes one continuous series to a Parquet file: `time_s`, `value`, `scenario`, `severity`, a row a sample.

    Before its onset a scenario's rows are nominal.

    Args:
        path: The file.
        simulator: What makes it.
        num_samples: Its length.
        scenario: A degraded mode, or None.
        seed: Seed of everything drawn.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    values = simulator.generate_series(num_samples, scenario, seed)
    name, severity, onset = _labels(scenario, num_samples)
    schema = pa.schema({"time_s": pa.float64(), "value": pa.float32(), "scenario": pa.string(), "severity": pa.float32()})
    make_folder(Path(path).parent)
    with replace_file(path) as temporary, pq.ParquetWriter(temporary, schema, compression="zstd") as writer:
        for first, stop in _stretches(num_samples):
            samples = np.arange(first, stop)
            late = np.zeros(len(samples), bool) if onset is None else samples >= onset
            columns = [
                pa.array(samples * simulator.interval_s),
                pa.array(values[first:stop]),
                pa.array(np.where(late, name, NOMINAL).tolist()),
                pa.array(np.where(late, severity, 0).astype(np.float32)),
            ]
            writer.write_table(pa.table(columns, schema=schema))


def _stretches(num_samples: int) -> Iterator[tuple[int, int]]:
    for first in range(0, num_samples, _WRITTEN):
        yield first, min(first + _WRITTEN, num_samples)


def _labels(scenario: Degraded | None, num_samples: int) -> tuple[str, float, int | None]:
    """Name, severity and first sample of a scenario; one of severity 0 is nominal."""
    if scenario is None or scenario.severity == 0:
        return NOMINAL, 0.0, None
    return scenario.mode, scenario.severity, int(round(scenario.onset * num_samples, 6))
