"""Labelled training data: windows, or one continuous series, with what happens in them and from when.

The labels stand in the columns beside the data: `scenario` (`nominal` or a degraded mode), `severity`, and `onset`, the
first sample that it concerns.
"""

import dataclasses
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.coarse_simulator.degraded import MODES, Degraded
from enhsim_tf.common.atomic_files import make_folder, replace_file
from enhsim_tf.common.errors import InputError

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

NOMINAL = "nominal"
_SECONDS = {"d": 86_400, "h": 3_600, "min": 60, "s": 1, "ms": 1e-3}
_LENGTH = re.compile(r"(?P<number>[0-9]{1,15}(?:\.[0-9]{1,15}(?= *[a-z]))?) *(?P<unit>d|h|min|s|ms)?")  # samples are whole
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


def parse_length(text: str) -> tuple[float, str]:
    """Reads a length such as `1d`, `6h`, `90min`, `30s`, or a number of samples: `(86400.0, "s")`, `(5000.0, "samples")`.

    Raises:
        InputError: If it is no length.
    """
    found = _LENGTH.fullmatch(text.casefold())
    length = float(found["number"]) if found else 0.0
    if not 0 < length < float("inf"):
        raise InputError(f"Expected a length such as 1d, 6h, 90min, 30s or 5000 (samples). Received: {text[:80]!r}.")
    return (length * _SECONDS[found["unit"]], "s") if found["unit"] else (length, "samples")


def num_samples_of(text: str, interval_s: float) -> int:
    """Samples of a length, as `parse_length` reads it.

    Args:
        text: The length.
        interval_s: Sampling interval in seconds.

    Raises:
        InputError: If it is no length, less than a sample or more than is made at once.
    """
    length, unit = parse_length(text)
    samples = round(length if unit == "samples" else length / interval_s)
    if not 1 <= samples <= _MOST_SAMPLES:
        raise InputError(
            f"Expected a length of 1 to {_MOST_SAMPLES:,} samples, one every {interval_s:g} s. Received: {text[:80]!r}, which is "
            f"{samples:,}. Write several series, each with its --seed."
        )
    return samples


def start_of(start: "str | pd.Timestamp") -> "pd.Timestamp":
    """A start in UTC, such as that of `2024-01-01`, which names no zone and is taken as UTC.

    Raises:
        InputError: If it is no time, or too early or late for nanoseconds.
    """
    import pandas as pd

    try:
        time = pd.to_datetime(start, utc=True, format="ISO8601").as_unit("ns")
    except (ValueError, TypeError, OverflowError, AttributeError):
        time = pd.NaT
    if pd.isna(time) or not 1700 <= time.year <= 2200:
        raise InputError(f"Expected a start such as 2024-01-01 or 2024-01-01T12:00, from 1700 to 2200. Received: {str(start)[:80]!r}.")
    return time


def shares_of(scenarios: Sequence[Degraded], num_windows: int, nominal_share: float, seed: int) -> list[Share]:
    """Divides windows between nominal ones and scenarios, the rest of the division going to the first.

    Args:
        scenarios: Degraded modes; none makes every window nominal.
        num_windows: Windows in all.
        nominal_share: Share of them that is nominal, where there are scenarios.
        seed: Seed of the whole set.

    Raises:
        InputError: If the share is not from 0 to 1, or a scenario would get no window.
    """
    if not 0 <= nominal_share <= 1:
        raise InputError(f"Expected a nominal share from 0 to 1. Received: {nominal_share}.")
    num_nominal = round(nominal_share * num_windows) if scenarios else num_windows
    counts = [num_nominal] + [
        (num_windows - num_nominal) // len(scenarios) + (number < (num_windows - num_nominal) % len(scenarios))
        for number in range(len(scenarios))
    ]
    if scenarios and nominal_share < 1 and counts[-1] == 0:
        raise InputError(
            f"Expected a window for each of {len(scenarios)} scenarios at least. Received: {num_windows} windows, a share of "
            f"{nominal_share:g} of them nominal. Ask for more windows."
        )
    seeds = np.random.SeedSequence(seed).generate_state(len(counts)).tolist()
    return [Share(*each) for each in zip([None, *scenarios], counts, seeds, strict=True) if each[1]]


def columns_of(window: int) -> dict[str, "pa.DataType"]:
    """The columns of labelled windows and their types.

    Args:
        window: Samples of a window.
    """
    import pyarrow as pa

    return {"window": pa.list_(pa.float32(), window), "scenario": pa.string(), "severity": pa.float32(), "onset": pa.int32()}


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

    schema = pa.schema(columns_of(simulator.window)).with_metadata(
        {"interval_s": repr(simulator.interval_s), "channel": str(simulator.trained.get("telemetry", ""))}
    )
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


def series_labelled(
    simulator: "EnhancedSimulator",
    num_samples: int,
    scenario: Degraded | None = None,
    seed: int = 0,
    start: "str | pd.Timestamp | None" = None,
) -> "pd.DataFrame":
    """One continuous series with its labels. Before its onset a scenario's rows are nominal.

    Args:
        simulator: What makes it.
        num_samples: Its length.
        scenario: A degraded mode, or None.
        seed: Seed of everything drawn.
        start: When its first sample is taken, such as "2024-01-01"; UTC where it names no zone. None: time is counted from 0.

    Returns:
        A frame with the columns `value`, `scenario` (categorical) and `severity`, a row a sample. Its index is a `DatetimeIndex` in UTC
        called `time`, or, without a start, seconds called `time_s`.

    Raises:
        InputError: If the start is no time.
    """
    import pandas as pd

    name, severity, onset = _labels(scenario, num_samples)
    seconds = np.arange(num_samples) * simulator.interval_s
    index = pd.Index(seconds, name="time_s")
    if start is not None:
        index = pd.DatetimeIndex(start_of(start) + pd.to_timedelta(np.round(seconds * 1e9).astype(np.int64), unit="ns"), name="time")
    late = np.zeros(num_samples, bool) if onset is None else np.arange(num_samples) >= onset
    columns = {
        "value": simulator.generate_series(num_samples, scenario, seed),
        "scenario": pd.Categorical.from_codes(late.astype(np.int8), list(dict.fromkeys([NOMINAL, name]))),
        "severity": np.where(late, severity, 0).astype(np.float32),
    }
    return pd.DataFrame(columns, index=index)


def write_series_labelled(
    path: str | os.PathLike,
    simulator: "EnhancedSimulator",
    num_samples: int,
    scenario: Degraded | None,
    seed: int,
    start: "str | pd.Timestamp | None" = None,
) -> None:
    """Writes the frame of `series_labelled` to a Parquet file, its index as the first column.

    Args:
        path: The file.
        simulator: What makes the series.
        num_samples: Its length.
        scenario: A degraded mode, or None.
        seed: Seed of everything drawn.
        start: When its first sample is taken, or None.
    """
    make_folder(Path(path).parent)
    frame = series_labelled(simulator, num_samples, scenario, seed, start)
    with replace_file(path) as temporary:
        frame.reset_index().to_parquet(temporary, compression="zstd", index=False)


def _labels(scenario: Degraded | None, num_samples: int) -> tuple[str, float, int | None]:
    """Name, severity and first sample of a scenario; one of severity 0 is nominal."""
    if scenario is None or scenario.severity == 0:
        return NOMINAL, 0.0, None
    onset = scenario.first_sample(num_samples)
    if onset >= num_samples:
        raise InputError(f"Expected an onset within {num_samples} samples. Received: {scenario.onset}. Choose an earlier one.")
    return scenario.mode, scenario.severity, onset
