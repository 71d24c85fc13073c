"""Loads labelled telemetry in the layout of telemanom's SMAP and MSL data: `train/`, `test/` and
`labeled_anomalies.csv`.

Each array holds one channel, whose telemetry values are its first column; the other columns, of
commands, are not read. There are no times, so samples are counted. Anomalous sequences include
their last sample in the file; here they are half-open ranges.
"""

import ast
import os
from pathlib import Path

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.reading.clock import NO_TIME
from enhsim_tf.telemetry.sources import read_source

LABELS = "labeled_anomalies.csv"
Ranges = tuple[tuple[int, int], ...]


def read_labels(folder: str | os.PathLike) -> dict[str, Ranges]:
    """Reads the label file. The sequences of all rows of a channel are combined, and overlapping
    sequences are joined.

    Args:
        folder: The folder with `labeled_anomalies.csv`.

    Returns:
        Anomalous samples by channel, in the order of the file.

    Raises:
        InputError: If the file is missing or a row cannot be read. The message names the row's
            channel.
    """
    import pandas as pd

    path = Path(folder) / LABELS
    columns = ["chan_id", "anomaly_sequences"]
    try:
        rows = pd.read_csv(
            path, usecols=columns, dtype=str, keep_default_na=False, encoding="utf-8-sig"
        )
    except (OSError, ValueError) as error:  # pandas raises kinds of ValueError
        raise InputError(
            f"Expected a folder with train/, test/ and {LABELS}, which has the columns "
            f"{' and '.join(columns)}. "
            f"Received: {str(error).splitlines()[0]} in {folder}. Name the data set's folder."
        ) from None
    if rows.empty:
        raise InputError(
            f"Expected labelled channels. Received: none in {path}. Add a line for each."
        )
    found: dict[str, list[tuple[int, int]]] = {}
    for channel, text in rows[columns].itertuples(index=False):
        if Path(channel).name != channel:
            raise InputError(
                f"Expected a channel's name. Received: {channel!r} in {path}. Correct the line."
            )
        found.setdefault(channel, []).extend(_sequences(text, channel))
    return {channel: _joined(sequences) for channel, sequences in found.items()}


def _sequences(text: str, channel: str) -> list[tuple[int, int]]:
    try:
        ranges = [(start, end + 1) for start, end in ast.literal_eval(text)]
        is_good = all(type(bound) is int for pair in ranges for bound in pair) and all(
            0 <= start < stop for start, stop in ranges
        )
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
        is_good = False
    if not is_good:
        raise InputError(
            f"Expected sequences as [[first, last], ...] of samples. Received: {text[:60]!r} of "
            f"{channel} in {LABELS}. Correct the line."
        )
    return ranges


def _joined(sequences: list[tuple[int, int]]) -> Ranges:
    """Sorts sequences by time and joins overlapping ones."""
    joined: list[tuple[int, int]] = []
    for start, stop in sorted(sequences):
        if joined and start < joined[-1][1]:
            joined[-1] = (joined[-1][0], max(joined[-1][1], stop))
        else:
            joined.append((start, stop))
    return tuple(joined)


def load_channel(
    folder: str | os.PathLike, channel: str, labels: Ranges
) -> tuple[np.ndarray, np.ndarray, Ranges]:
    """Loads one labelled channel.

    Args:
        folder: The folder with `train/`, `test/` and `labeled_anomalies.csv`.
        channel: Name of the channel.
        labels: Its anomalous samples, as `read_labels` returns them.

    Returns:
        Nominal telemetry, and telemetry with the labelled sequences, float32 of shape `(samples,
        1)`; and the anomalous samples of the latter, cut at its end.

    Raises:
        InputError: If an array is missing or cannot be used, or a label lies beyond the test part.
    """
    train, test = (_read(Path(folder) / part, channel) for part in ("train", "test"))
    for start, _ in labels:
        if start >= len(test):
            raise InputError(
                f"Expected sequences inside the test part of {len(test):,} samples. Received: one "
                f"from sample {start:,} of {channel} in {LABELS}. "
                "Correct the line, or give the whole array."
            )
    return train, test, tuple((start, min(stop, len(test))) for start, stop in labels)


def _read(folder: Path, channel: str) -> np.ndarray:
    path = folder / f"{channel}.npy"
    values = next(iter(read_source(path, time=NO_TIME).values())).cells.to_numpy(np.float32)
    if not np.isfinite(values).all():
        raise InputError(
            f"Expected finite values. Received: NaN or infinity in {path}. Clean it and save it "
            "again."
        )
    return values[:, None]
