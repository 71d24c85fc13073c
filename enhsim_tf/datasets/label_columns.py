"""The label columns of every labelled table of this package: series, windows, shards and injected telemetry.

- `scenario`: `nominal`, or the degraded mode or kind of anomaly
- `severity`: severity of the mode or anomaly; 0 if nominal
- `onset`: first changed sample; null if nominal
- `end`: first sample after the last changed one; null if nominal
- `mask`: whether the sample was changed

In a table of one row per sample, the labels describe the event that changed the sample, and samples are counted by rows of the
table. In a table of one row per window, the labels describe the window. Its samples are counted from 0, and `mask` is a list.
"""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.common.atomic_files import make_folder, replace_file
from enhsim_tf.common.errors import InputError

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

NOMINAL = "nominal"
LABELS = ("scenario", "severity", "onset", "end", "mask")
_TIMEEVAL = ("timestamp", "is_anomaly")  # the first and the last column of TimeEval's files


def label_samples(mask: np.ndarray, events: Sequence[tuple[str, float, int, int]]) -> dict[str, "pd.Categorical | pd.Series | np.ndarray"]:
    """Makes the label columns of a series.

    Args:
        mask: Boolean array that marks the changed samples, shape `(samples,)`.
        events: Name, severity, onset and end of each event, in the order of time and without overlaps.

    Returns:
        The columns `LABELS`, each with one value per sample. A sample that was not changed is labelled nominal, also within an
        event, such as a sample between two spikes.
    """
    import pandas as pd

    names = list(dict.fromkeys([NOMINAL, *(name for name, *_ in events)]))
    codes, severity, onset, end = (np.zeros(len(mask), dtype) for dtype in (np.int8, np.float32, np.int32, np.int32))
    for name, degree, first, last in events:
        inside = slice(first, last)
        codes[inside], severity[inside], onset[inside], end[inside] = names.index(name), degree, first, last
    hidden = ~mask
    codes[hidden], severity[hidden] = 0, 0
    return {
        "scenario": pd.Categorical.from_codes(codes, names),
        "severity": severity,
        "onset": pd.arrays.IntegerArray(onset, hidden.copy()),
        "end": pd.arrays.IntegerArray(end, hidden.copy()),
        "mask": mask,
    }


def label_windows(names: Sequence[str], severities: Sequence[float], masks: np.ndarray) -> dict[str, "pa.Array"]:
    """Makes the label columns of windows.

    Args:
        names: Scenario of each window, which may be nominal.
        severities: Severity of the scenario of each window.
        masks: Boolean array that marks the changed samples, shape `(windows, samples)`.

    Returns:
        The columns `LABELS`. A window in which the scenario changed no sample is labelled nominal, with the severity 0.
    """
    import pyarrow as pa

    changed, samples = masks.any(axis=1), masks.shape[1]
    onset, end = masks.argmax(axis=1), samples - masks[:, ::-1].argmax(axis=1)
    return {
        "scenario": pa.array(np.where(changed, np.asarray(names, object), NOMINAL), pa.string()),
        "severity": pa.array(np.where(changed, severities, 0).astype(np.float32)),
        "onset": pa.array(onset.astype(np.int32), mask=~changed),
        "end": pa.array(end.astype(np.int32), mask=~changed),
        "mask": pa.FixedSizeListArray.from_arrays(pa.array(masks.ravel()), samples),
    }


def write_table(path: str | os.PathLike, frame: "pd.DataFrame") -> None:
    """Writes a labelled table to a `.csv` or `.parquet` file. Its index becomes the first column.

    Args:
        path: Path of the file, which appears only when it is complete.
        frame: The table.
    """
    make_folder(Path(path).parent)
    table = frame.reset_index()
    table.attrs = {}  # Parquet would store them as JSON
    with replace_file(path) as temporary:
        if Path(path).suffix == ".csv":
            table.to_csv(temporary, index=False)
        else:
            table.to_parquet(temporary, compression="zstd", index=False)


def write_timeeval(path: str | os.PathLike, channels: Mapping[str, "pd.DataFrame"]) -> None:
    """Writes labelled series as CSV in the layout of TimeEval: `timestamp`, one column per channel, `is_anomaly`.

    Times are in UTC and without a zone. A series without times has its sample numbers or seconds in `timestamp`. `is_anomaly` is
    1 where the mask of any channel is true. TimeEval (Wenig, Schmidl and Papenbrock, VLDB 2022), aeon and others read such files.

    Args:
        path: Path of the file, which appears only when it is complete.
        channels: Labelled series with the columns `value` and `mask`, by the name of the channel. Their indexes are equal.

    Raises:
        InputError: If the indexes differ, or if a channel has the name of one of the other columns.
    """
    import pandas as pd

    (first, frame), *others = channels.items()
    for name in channels:
        if name in _TIMEEVAL:
            raise InputError(f"Expected channels that are not named {' or '.join(_TIMEEVAL)}. Received: {name!r}. Rename it.")
    for name, other in others:
        if not other.index.equals(frame.index):
            raise InputError(
                f"Expected channels with the same times for one TimeEval file. Received: {first!r} with {len(frame):,} and {name!r} with "
                f"{len(other):,} samples, or other times. Give a folder as --out, which gets one file per channel."
            )
    times = frame.index.tz_convert(None) if isinstance(frame.index, pd.DatetimeIndex) else frame.index
    columns = {"timestamp": times, **{name: each["value"].to_numpy() for name, each in channels.items()}}
    marked = np.any([each["mask"].to_numpy() for each in channels.values()], axis=0)
    table = pd.DataFrame({**columns, "is_anomaly": marked.astype(np.int8)})
    make_folder(Path(path).parent)
    with replace_file(path) as temporary:
        table.to_csv(temporary, index=False)
