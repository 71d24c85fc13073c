"""Loads labelled telemetry in the layout of telemanom's SMAP and MSL data: `train/`, `test/` and `labeled_anomalies.csv`.

Each array holds one channel, whose telemetry values are its first column; the other columns, of commands, are not read. There are no
times, so samples are counted. Anomalous sequences include their last sample in the file; here they are half-open ranges.
"""

import ast
import csv
import dataclasses
import os
from pathlib import Path

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.size_limits import load_npy
from enhsim_tf.telemetry.series import Telemetry

LABELS = "labeled_anomalies.csv"
_COLUMNS = ("chan_id", "anomaly_sequences")

Ranges = tuple[tuple[int, int], ...]


@dataclasses.dataclass(frozen=True, eq=False)
class LabelledChannel:
    """One channel with its labels.

    Args:
        name: Its name.
        train: Nominal telemetry.
        test: Telemetry with the labelled sequences. Its samples are counted from 0 again.
        sequences: Anomalous samples of the test part, as half-open ranges in the order of time that do not overlap.
    """

    name: str
    train: Telemetry
    test: Telemetry
    sequences: Ranges

    @property
    def is_anomalous(self) -> np.ndarray:
        """Boolean array that marks the anomalous samples of the test part, shape `(samples,)`."""
        marks = np.zeros(len(self.test), bool)
        for start, stop in self.sequences:
            marks[start:stop] = True
        return marks


def read_labels(folder: str | os.PathLike) -> dict[str, Ranges]:
    """Reads the label file. The sequences of all rows of a channel are combined, and overlapping sequences are joined.

    Args:
        folder: The folder with `labeled_anomalies.csv`.

    Returns:
        Anomalous samples by channel, in the order of the file.

    Raises:
        InputError: If the file is missing or a row cannot be read. The message names the row.
    """
    path = Path(folder) / LABELS
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            header, *rows = list(csv.reader(file)) or [[]]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(
            f"Expected a folder with train/, test/ and {LABELS}. Received: {folder} ({reason}). Name the data set's folder."
        ) from None
    header = [name.strip() for name in header]
    if not set(_COLUMNS) <= set(header):
        raise InputError(
            f"Expected the columns {', '.join(_COLUMNS)}. Received: {', '.join(header[:8]) or 'none'} in {path}. Add a header."
        )
    found: dict[str, list[tuple[int, int]]] = {}
    for number, cells in enumerate(rows, 2):
        if any(cell.strip() for cell in cells):
            where = f"line {number} of {path.name}"
            if len(cells) != len(header):
                raise InputError(f"Expected {len(header)} columns. Received: {len(cells)} in {where}. Correct the line.")
            row = {name: cell.strip() for name, cell in zip(header, cells, strict=True)}
            channel = row["chan_id"]
            if not channel or channel in (".", "..") or {"/", "\\"} & set(channel):
                raise InputError(f"Expected a channel's name. Received: {channel!r} in {where}. Correct the line.")
            found.setdefault(channel, []).extend(_sequences(row["anomaly_sequences"], where))
    if not found:
        raise InputError(f"Expected labelled channels. Received: none in {path}. Add a line for each.")
    return {channel: _joined(sequences) for channel, sequences in found.items()}


def _sequences(text: str, where: str) -> list[tuple[int, int]]:
    try:
        ranges = [(start, end + 1) for start, end in ast.literal_eval(text)]
        is_good = all(type(bound) is int for pair in ranges for bound in pair) and all(0 <= start < stop for start, stop in ranges)
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
        is_good = False
    if not is_good:
        raise InputError(f"Expected sequences as [[first, last], ...] of samples. Received: {text[:60]!r} in {where}. Correct the line.")
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


def load_channel(folder: str | os.PathLike, channel: str) -> LabelledChannel:
    """Loads one labelled channel.

    Args:
        folder: The folder with `train/`, `test/` and `labeled_anomalies.csv`.
        channel: Name of the channel. Its sequences that reach beyond the test part are cut at its end.

    Raises:
        InputError: If the channel has no labels, an array is missing or cannot be used, or a label lies beyond the test part.
    """
    labels = read_labels(folder)
    if channel not in labels:
        raise InputError(f"Expected a labelled channel, one of: {', '.join(list(labels)[:8])}. Received: {channel!r}. Name one of these.")
    train, test = (_read(Path(folder) / part / f"{channel}.npy") for part in ("train", "test"))
    for start, _ in labels[channel]:
        if start >= len(test):
            raise InputError(
                f"Expected sequences inside the test part of {len(test):,} samples. Received: one from sample {start:,} of {channel} in {LABELS}. "
                "Correct the line, or give the whole array."
            )
    sequences = tuple((start, min(stop, len(test))) for start, stop in labels[channel])
    return LabelledChannel(channel, Telemetry(train, name=channel), Telemetry(test, name=channel), sequences)


def _read(path: Path) -> np.ndarray:
    where = f"{path.parent.name}/{path.name}"
    try:
        array = load_npy(path)
    except ValueError as error:
        raise InputError(f"Expected the array {where}. Received: {error} in {path.parents[1]}. Complete the data set.") from None
    if array.ndim not in (1, 2) or array.dtype.kind not in "fiu" or 0 in array.shape:
        raise InputError(
            f"Expected numbers of shape (samples, 1 + commands). Received: {array.dtype} of shape {array.shape} in {where}. Save it again."
        )
    column = array if array.ndim == 1 else array[:, 0]
    values = column.astype(np.float32)
    if not np.isfinite(values).all():
        bad = int(np.argmax(~np.isfinite(values)))
        raise InputError(f"Expected finite values. Received: {column[bad]} at sample {bad} of {where}. Clean it and save it again.")
    return values
