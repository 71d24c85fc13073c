"""The labelled tables of this package: windows, series and injected telemetry. Beside the values,
each has the columns `LABELS`.

- `scenario`: `nominal`, or the degraded mode or kind of anomaly
- `severity`: severity of the mode or anomaly; 0 if nominal
- `onset`: first changed sample; null if nominal
- `end`: first sample after the last changed one; null if nominal
- `mask`: whether the sample was changed

In a table of one row per sample, the labels describe the event that changed the sample, and samples
are counted by rows of the table. In a table of one row per window, the labels describe the window.
Its samples are counted from 0, and `mask` is a list. Values are in the column `value` or `window`.
Of several channels, each has its own columns (`NAME` or `window NAME`, and `mask NAME`), and `mask`
marks the samples that are changed in any of them. A channel whose name is that of another column
has the column `NAME (channel)`.
"""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from enhsim_tf.coarse.degraded import Degraded
from enhsim_tf.common.atomic_files import replace_file
from enhsim_tf.common.columns import apart_from
from enhsim_tf.telemetry.placing import PlacedEvent

NOMINAL = "nominal"
LABELS = ("scenario", "severity", "onset", "end", "mask")
_TIMEEVAL = ("timestamp", "is_anomaly")  # the first and the last column of TimeEval's files
_INDEX = ("time", "time_s", "sample")  # the first column of the files of series


def value_columns(channels: Sequence[str]) -> dict[str, str]:
    """Returns the column of the values of each channel in the table of a series."""
    if len(channels) == 1:
        return dict.fromkeys(channels, "value")
    return apart_from((*LABELS, *_INDEX, *(f"mask {name}" for name in channels)), channels)


def series_table(
    values: np.ndarray,
    masks: np.ndarray,
    channels: Sequence[str],
    events: Sequence[PlacedEvent],
    index: pd.Index,
) -> pd.DataFrame:
    """Makes the labelled table of a series. A sample that was not changed is labelled nominal, also
    within an event.

    `values` are float32 of shape `(samples, channels)`, and `masks` mark the changed samples.
    `events` are in the order of time and do not overlap.
    """
    mask = masks.any(axis=1)
    is_joint = len(channels) > 1
    names = list(dict.fromkeys([NOMINAL, *(event.kind for event in events)]))
    codes = np.zeros(len(mask), np.int8)
    severity = np.zeros(len(mask), np.float32)
    onset, end = np.zeros((2, len(mask)), np.int32)
    for event in events:
        here = slice(event.begin, event.end)
        codes[here] = names.index(event.kind)
        severity[here] = event.severity
        onset[here] = event.begin
        end[here] = event.end
    codes[~mask] = 0
    severity[~mask] = 0
    columns = {
        **dict(zip(value_columns(channels).values(), values.T, strict=True)),
        "scenario": pd.Categorical.from_codes(codes, names),
        "severity": severity,
        "onset": pd.arrays.IntegerArray(onset, ~mask),
        "end": pd.arrays.IntegerArray(end, ~mask),
        "mask": mask,
        **{f"mask {name}": masks[:, number] for number, name in enumerate(channels) if is_joint},
    }
    return pd.DataFrame(columns, index=index)


def window_table(
    windows: np.ndarray,
    masks: np.ndarray,
    channels: Sequence[str],
    scenarios: Sequence[Degraded | None],
) -> pa.Table:
    """Makes the labelled table of windows. A window in which no sample was changed is labelled
    nominal, with the severity 0.

    `windows` are float32 of shape `(windows, samples, channels)`, and `masks` mark the changed
    samples. `scenarios` are those of the windows, None of nominal ones.
    """

    def lists(values: np.ndarray) -> pa.Array:
        return pa.FixedSizeListArray.from_arrays(
            pa.array(np.ascontiguousarray(values).ravel()), values.shape[1]
        )

    mask = masks.any(axis=2)
    is_joint = len(channels) > 1
    changed = mask.any(axis=1)
    modes = [NOMINAL if scenario is None else scenario.mode for scenario in scenarios]
    severities = [0.0 if scenario is None else scenario.severity for scenario in scenarios]
    onset = mask.argmax(axis=1)
    end = windows.shape[1] - mask[:, ::-1].argmax(axis=1)
    columns = {
        f"window {name}" if is_joint else "window": lists(windows[:, :, number])
        for number, name in enumerate(channels)
    }
    columns |= {
        "scenario": pa.array(np.where(changed, np.asarray(modes, object), NOMINAL), pa.string()),
        "severity": pa.array(np.where(changed, severities, 0).astype(np.float32)),
        "onset": pa.array(onset.astype(np.int32), mask=~changed),
        "end": pa.array(end.astype(np.int32), mask=~changed),
        "mask": lists(mask),
    }
    return pa.table(
        columns
        | {
            f"mask {name}": lists(masks[:, :, number])
            for number, name in enumerate(channels)
            if is_joint
        }
    )


def write_table(path: str | os.PathLike, frame: pd.DataFrame, timeeval: Sequence[str] = ()) -> None:
    """Writes a labelled series to a `.csv` or `.parquet` file, which appears only when it is
    complete.

    Args:
        path: Path of the file, in an existing folder.
        frame: The table. Its index becomes the first column.
        timeeval: Names of the channels, to write TimeEval's CSV (Wenig, Schmidl and Papenbrock,
            VLDB 2022) instead: `timestamp`, in UTC without a zone, or sample numbers or seconds;
            one column per channel; and `is_anomaly`, which is 1 where the mask is true.
    """
    table = frame.reset_index()
    if timeeval:
        times = frame.index
        if isinstance(times, pd.DatetimeIndex):
            times = times.tz_convert(None)
        columns = apart_from(_TIMEEVAL, timeeval)
        values = {
            columns[name]: frame[column].to_numpy()
            for name, column in value_columns(timeeval).items()
        }
        marks = frame["mask"].to_numpy().astype(np.int8)
        table = pd.DataFrame({"timestamp": times, **values, "is_anomaly": marks})
    with replace_file(path) as temporary:
        if Path(path).suffix == ".csv":
            table.to_csv(temporary, index=False)
        else:
            table.to_parquet(temporary, compression="zstd", index=False)
