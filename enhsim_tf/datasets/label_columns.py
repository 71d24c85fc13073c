"""The labelled tables of this package: windows, series and injected telemetry. Beside the values, each has the columns `LABELS`.

- `scenario`: `nominal`, or the degraded mode or kind of anomaly
- `severity`: severity of the mode or anomaly; 0 if nominal
- `onset`: first changed sample; null if nominal
- `end`: first sample after the last changed one; null if nominal
- `mask`: whether the sample was changed

In a table of one row per sample, the labels describe the event that changed the sample, and samples are counted by rows of the
table. In a table of one row per window, the labels describe the window. Its samples are counted from 0, and `mask` is a list.
Values are in the column `value` or `window`. Of several channels, each has its own columns (`NAME` or `window NAME`, and `mask NAME`), and
`mask` marks the samples that are changed in any of them.
"""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from enhsim_tf.common.atomic_files import make_folder, replace_file
from enhsim_tf.common.errors import InputError

NOMINAL = "nominal"
LABELS = ("scenario", "severity", "onset", "end", "mask")
_TIMEEVAL = ("timestamp", "is_anomaly")  # the first and the last column of TimeEval's files


def series_table(
    values: np.ndarray,
    masks: np.ndarray,
    channels: Sequence[str],
    events: Sequence[tuple[str, float, int, int]],
    index: pd.Index,
) -> pd.DataFrame:
    """Makes the labelled table of a series. A sample that was not changed is labelled nominal, also within an event.

    `values` are float32 of shape `(samples, channels)`, and `masks` mark the changed samples. `events` are name, severity, onset and end of
    each, in the order of time and without overlaps.
    """
    mask, is_joint = masks.any(axis=1), len(channels) > 1
    names = list(dict.fromkeys([NOMINAL, *(name for name, *_ in events)]))
    codes, severity, onset, end = (
        np.zeros(len(mask), dtype) for dtype in (np.int8, np.float32, np.int32, np.int32)
    )
    for name, degree, first, last in events:
        inside = slice(first, last)
        codes[inside], severity[inside], onset[inside], end[inside] = (
            names.index(name),
            degree,
            first,
            last,
        )
    codes[~mask], severity[~mask] = 0, 0
    columns = {
        **dict(zip(channels if is_joint else ["value"], values.T, strict=True)),
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
    names: Sequence[str],
    severities: Sequence[float],
) -> pa.Table:
    """Makes the labelled table of windows. A window in which no sample was changed is labelled nominal, with the severity 0.

    `windows` are float32 of shape `(windows, samples, channels)`, and `masks` mark the changed samples. `names` and `severities` are the
    scenario of each window, which may be nominal.
    """

    def lists(values: np.ndarray) -> pa.Array:
        return pa.FixedSizeListArray.from_arrays(
            pa.array(np.ascontiguousarray(values).ravel()), values.shape[1]
        )

    mask, samples, is_joint = masks.any(axis=2), windows.shape[1], len(channels) > 1
    changed, onset, end = (
        mask.any(axis=1),
        mask.argmax(axis=1),
        samples - mask[:, ::-1].argmax(axis=1),
    )
    columns = {
        f"window {name}" if is_joint else "window": lists(windows[:, :, number])
        for number, name in enumerate(channels)
    }
    columns |= {
        "scenario": pa.array(np.where(changed, np.asarray(names, object), NOMINAL), pa.string()),
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
    """Writes a labelled series to a `.csv` or `.parquet` file, which appears only when it is complete.

    Args:
        path: Path of the file.
        frame: The table. Its index becomes the first column.
        timeeval: Names of the channels, to write TimeEval's CSV (Wenig, Schmidl and Papenbrock, VLDB 2022) instead: `timestamp`, in UTC
            without a zone, or sample numbers or seconds; one column per channel; and `is_anomaly`, which is 1 where the mask is true.

    Raises:
        InputError: If a channel has the name of another column of TimeEval's CSV.
    """
    table = frame.reset_index()
    table.attrs = {}  # Parquet would store them as JSON
    if timeeval:
        taken = [name for name in timeeval if name in _TIMEEVAL]
        if taken:
            raise InputError(
                f"Expected channels that are not named {' or '.join(_TIMEEVAL)}. Received: {taken[0]!r}. Rename it."
            )
        times = (
            frame.index.tz_convert(None)
            if isinstance(frame.index, pd.DatetimeIndex)
            else frame.index
        )
        values = {
            name: frame["value" if len(timeeval) == 1 else name].to_numpy() for name in timeeval
        }
        table = pd.DataFrame(
            {"timestamp": times, **values, "is_anomaly": frame["mask"].to_numpy().astype(np.int8)}
        )
    make_folder(Path(path).parent)
    with replace_file(path) as temporary:
        if Path(path).suffix == ".csv":
            table.to_csv(temporary, index=False)
        else:
            table.to_parquet(temporary, compression="zstd", index=False)
