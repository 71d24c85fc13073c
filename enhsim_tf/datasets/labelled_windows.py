"""Labelled training data: windows, or one continuous series, with labels that mark exactly the samples that a scenario has changed.

The labels are the columns of `label_columns` beside the data.
"""

import dataclasses
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.coarse_simulator.degraded import MODES, Degraded, ScheduledMode
from enhsim_tf.common.atomic_files import make_folder, replace_file
from enhsim_tf.common.errors import InputError
from enhsim_tf.datasets.label_columns import label_samples, label_windows, write_table, write_timeeval
from enhsim_tf.datasets.mix import Mix

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

    from enhsim_tf.simulator.simulator import EnhancedSimulator

_SECONDS = {"d": 86_400, "h": 3_600, "min": 60, "s": 1, "ms": 1e-3}
_LENGTH = re.compile(
    r"(?P<number>[0-9]{1,15}(?:\.[0-9]{1,15}(?= *[a-z]))?) *(?P<unit>d|h|min|s|ms)?"
)  # decimals need a unit, because a number of samples is a whole number
_MOST_SAMPLES = 20_000_000  # maximum length of a continuous series, which is held in memory


@dataclasses.dataclass(frozen=True)
class Share:
    """A part of a training set: windows of one scenario.

    Args:
        scenario: A degraded mode, or None for nominal telemetry.
        num_windows: Number of windows.
        seed: Random seed of these windows.
    """

    scenario: Degraded | None
    num_windows: int
    seed: int


def parse_scenario(text: str) -> Degraded:
    """Parses a scenario in the form `mode:severity` or `mode:severity:onset`, with `CHANNEL=` before it for one of several channels.

    Args:
        text: The scenario, for example `stuck:0.5`.

    Raises:
        InputError: If the mode is unknown or a number is out of range.
    """
    channel, is_named, rest = text.rpartition("=")
    mode, *numbers = rest.split(":")
    if mode not in MODES or not 1 <= len(numbers) <= 2:
        raise InputError(f"Expected mode:severity or mode:severity:onset, mode one of {', '.join(MODES)}. Received: {text!r}.")
    try:
        values = [float(number) for number in numbers]
    except ValueError:
        raise InputError(f"Expected numbers from 0 to 1 after the mode. Received: {text!r}. Write for example {mode}:0.5.") from None
    return Degraded(mode, *values, channel=channel if is_named else None)


def parse_length(text: str) -> tuple[float, str]:
    """Parses a length such as `1d`, `6h`, `90min`, `30s`, or a number of samples.

    Args:
        text: The length.

    Returns:
        The number and its unit, for example `(86400.0, "s")` or `(5000.0, "samples")`.

    Raises:
        InputError: If the text is not a length.
    """
    found = _LENGTH.fullmatch(text.casefold())
    length = float(found["number"]) if found else 0.0
    if not 0 < length < float("inf"):
        raise InputError(f"Expected a length such as 1d, 6h, 90min, 30s or 5000 (samples). Received: {text[:80]!r}.")
    return (length * _SECONDS[found["unit"]], "s") if found["unit"] else (length, "samples")


def parse_num_samples(text: str, interval_s: float) -> int:
    """Converts a length to a number of samples.

    Args:
        text: The length, in the form of `parse_length`.
        interval_s: Sampling interval in seconds.

    Raises:
        InputError: If the text is not a length, or if the series would have no sample or too many.
    """
    length, unit = parse_length(text)
    samples = round(length if unit == "samples" else length / interval_s)
    if not 1 <= samples <= _MOST_SAMPLES:
        raise InputError(
            f"Expected a length of 1 to {_MOST_SAMPLES:,} samples, one every {interval_s:g} s. Received: {text[:80]!r}, which is "
            f"{samples:,} samples. Write several series, each with its own --seed."
        )
    return samples


def parse_start(start: "str | pd.Timestamp") -> "pd.Timestamp":
    """Converts a start time to UTC. A time without a time zone is taken as UTC.

    Args:
        start: The time, for example `2024-01-01`.

    Raises:
        InputError: If it is not a time, or not within the years 1700 to 2200.
    """
    import pandas as pd

    try:
        time = pd.to_datetime(start, utc=True, format="ISO8601").as_unit("ns")
    except (ValueError, TypeError, OverflowError, AttributeError):
        time = pd.NaT
    if pd.isna(time) or not 1700 <= time.year <= 2200:
        raise InputError(f"Expected a start such as 2024-01-01 or 2024-01-01T12:00, from 1700 to 2200. Received: {str(start)[:80]!r}.")
    return time


def divide_windows(mix: Mix, num_windows: int, seed: int) -> list[Share]:
    """Divides windows between nominal telemetry and scenarios. Scenarios get equal numbers; the first ones get the remainder.

    Args:
        mix: Scenarios with equal shares and fixed severities, as from `make_mix`.
        num_windows: Total number of windows.
        seed: Random seed of the whole set.

    Returns:
        The parts that have at least one window, each with a seed of its own.

    Raises:
        InputError: If a scenario would get no window.
    """
    scenarios = [Degraded(part.mode, part.severity[0], part.onset[0], part.channel) for part in mix.scenarios]
    num_nominal = round(mix.nominal * num_windows)
    each, left = divmod(num_windows - num_nominal, len(scenarios) or 1)
    counts = [num_nominal, *(each + (number < left) for number in range(len(scenarios)))]
    if mix.nominal < 1 and counts[-1] == 0:
        raise InputError(
            f"Expected at least one window for each of {len(scenarios)} scenarios. Received: {num_windows} windows, of which a share of "
            f"{mix.nominal:g} is nominal. Ask for more windows."
        )
    seeds = np.random.SeedSequence(seed).generate_state(len(counts)).tolist()
    return [Share(*share) for share in zip([None, *scenarios], counts, seeds, strict=True) if share[1]]


def window_columns(window: int, channels: Sequence[str] = ("",)) -> dict[str, "pa.DataType"]:
    """Returns the columns of labelled windows and their types.

    Args:
        window: Length of a window in samples.
        channels: Names of the channels. Of several, each has a column `window NAME` and a column `mask NAME`, and `mask` marks the samples that
            are changed in any of them.
    """
    import pyarrow as pa

    labels = {
        "scenario": pa.string(),
        "severity": pa.float32(),
        "onset": pa.int32(),
        "end": pa.int32(),
        "mask": pa.list_(pa.bool_(), window),
    }
    values = {name: pa.list_(pa.float32(), window) for name in value_names("window", channels)}
    masks = {name: pa.list_(pa.bool_(), window) for name in value_names("mask", channels) if len(channels) > 1}
    return values | labels | masks


def value_names(what: str, channels: Sequence[str]) -> list[str]:
    """Names of the columns of channels: `what` for a single one, otherwise `what NAME`."""
    return [what] if len(channels) == 1 else [f"{what} {name}" for name in channels]


def window_arrays(windows: np.ndarray, masks: np.ndarray, names: Sequence[str], severities: Sequence[float]) -> list["pa.Array"]:
    """Makes the columns of `window_columns`.

    Args:
        windows: float32 of shape `(windows, samples, channels)`.
        masks: Which samples were changed, same shape.
        names: Scenario of each window, which may be nominal.
        severities: Severity of each window.
    """
    import pyarrow as pa

    def lists(values: np.ndarray) -> "pa.Array":
        return pa.FixedSizeListArray.from_arrays(pa.array(np.ascontiguousarray(values).ravel()), values.shape[1])

    channels = range(windows.shape[2])
    labels = label_windows(names, severities, masks.any(axis=2))
    own = [lists(masks[:, :, channel]) for channel in channels] if len(channels) > 1 else []
    return [*(lists(windows[:, :, channel]) for channel in channels), *labels.values(), *own]


def write_windows_labelled(path: str | os.PathLike, simulator: "EnhancedSimulator", shares: Sequence[Share]) -> dict[Degraded, int]:
    """Writes labelled windows to one Parquet file, chunk by chunk. The file appears only when it is complete.

    The columns are those of `window_columns`, see `label_columns.LABELS`. A window that its scenario has not changed, such as
    one in which the mechanism would have stood still anyway, is labelled nominal.

    Args:
        path: Path of the file.
        simulator: The simulator.
        shares: The scenarios and their numbers of windows.

    Returns:
        For each scenario, the number of its windows that are labelled nominal because it has changed no sample of them.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = window_columns(simulator.window, simulator.channels)
    schema = pa.schema(columns).with_metadata({"interval_s": repr(simulator.interval_s), "channel": ", ".join(simulator.channels)})
    # stores bytes of equal significance together: signs and exponents compress well, noisy mantissas do not
    encoding = {f"{name}.list.element": "BYTE_STREAM_SPLIT" for name in value_names("window", simulator.channels)}
    names = ["scenario"]
    options = {"compression": "zstd", "use_dictionary": names, "column_encoding": encoding, "write_statistics": names}
    make_folder(Path(path).parent)
    unchanged: dict[Degraded, int] = {}
    with replace_file(path) as temporary, pq.ParquetWriter(temporary, schema, **options) as writer:
        for share in shares:
            scenario = _active(share.scenario, simulator.window)
            name, severity = (scenario.mode, scenario.severity) if scenario else ("", 0.0)
            for windows, masks in simulator.generate_labelled_chunks(share.num_windows, scenario, share.seed):
                arrays = window_arrays(windows, masks, [name] * len(windows), [severity] * len(windows))
                writer.write_table(pa.table(arrays, names=list(columns)).cast(schema))
                if scenario:
                    unchanged[scenario] = unchanged.get(scenario, 0) + int(np.count_nonzero(~masks.any(axis=(1, 2))))
    return unchanged


def series_labelled(
    simulator: "EnhancedSimulator",
    num_samples: int,
    scenario: Degraded | None = None,
    seed: int = 0,
    start: "str | pd.Timestamp | None" = None,
    schedule: Sequence[ScheduledMode] = (),
) -> "pd.DataFrame":
    """Generates one continuous series with labels. Samples that equal those of the nominal series are labelled nominal.

    Args:
        simulator: The simulator.
        num_samples: Length of the series in samples.
        scenario: A degraded mode over the whole series, or None for nominal telemetry.
        seed: Random seed.
        start: Time of the first sample, for example "2024-01-01". A time without a time zone is taken as UTC. None gives
            times in seconds from 0.
        schedule: Degraded modes at given places, each followed by nominal operation, instead of a scenario.

    Returns:
        A data frame with one row per sample and the columns `value` (of several channels, their names, and `mask NAME` for each) and
        `label_columns.LABELS`; `scenario` is categorical. Its
        index is a `DatetimeIndex` in UTC named `time`, or, without a start, seconds named `time_s`.

    Raises:
        InputError: If the start is not a time, if events overlap or lie outside the series, or if both a scenario and a schedule
            are given.
    """
    import pandas as pd

    scenario = _active(scenario, num_samples)
    seconds = np.arange(num_samples) * simulator.interval_s
    index = pd.Index(seconds, name="time_s")
    if start is not None:
        index = pd.DatetimeIndex(parse_start(start) + pd.to_timedelta(np.round(seconds * 1e9).astype(np.int64), unit="ns"), name="time")
    values, mask, events = simulator.generate_labelled_series(num_samples, scenario, seed, schedule=schedule)
    channels = simulator.channels
    columns = {name: values[:, number] for number, name in enumerate(["value"] if len(channels) == 1 else channels)}
    own = {f"mask {name}": mask[:, number] for number, name in enumerate(channels) if len(channels) > 1}
    return pd.DataFrame({**columns, **label_samples(mask.any(axis=1), events), **own}, index=index)


def write_series_labelled(
    path: str | os.PathLike,
    simulator: "EnhancedSimulator",
    num_samples: int,
    scenario: Degraded | None,
    seed: int,
    start: "str | pd.Timestamp | None" = None,
    schedule: Sequence[ScheduledMode] = (),
    is_timeeval: bool = False,
) -> int:
    """Writes the result of `series_labelled` to a Parquet or CSV file. Its index becomes the first column.

    Args:
        path: Path of the file.
        simulator: The simulator.
        num_samples: Length of the series in samples.
        scenario: A degraded mode, or None for nominal telemetry.
        seed: Random seed.
        start: Time of the first sample, or None.
        schedule: Degraded modes at given places, instead of a scenario.
        is_timeeval: Whether to write TimeEval's CSV, see `label_columns.write_timeeval`.

    Returns:
        Number of changed samples.
    """
    frame = series_labelled(simulator, num_samples, scenario, seed, start, schedule)
    if is_timeeval:
        value = "value" if len(simulator.channels) == 1 else None
        write_timeeval(path, {name: frame[[value or name, "mask"]].rename(columns={value or name: "value"}) for name in simulator.channels})
    else:
        write_table(path, frame)
    return int(frame["mask"].sum())


def _active(scenario: Degraded | None, num_samples: int) -> Degraded | None:
    """Returns the scenario, or None if it changes nothing because its severity is 0."""
    if scenario is None or scenario.severity == 0:
        return None
    if scenario.first_sample(num_samples) >= num_samples:
        raise InputError(f"Expected an onset within {num_samples} samples. Received: {scenario.onset}. Choose an earlier one.")
    return scenario
