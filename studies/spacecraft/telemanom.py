"""Loads labelled telemetry in the layout of telemanom's SMAP and MSL data: `train/`, `test/` and `labeled_anomalies.csv`.

Each array holds one channel: column 0 is the telemetry value, and the other columns are commands. There are no times, so
samples are counted. Anomalous sequences include their last sample in the file; here they are half-open ranges.
"""

import ast
import csv
import dataclasses
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.size_limits import load_npy
from enhsim_tf.telemetry.series import Telemetry

LABELS = "labeled_anomalies.csv"
_COLUMNS = ("chan_id", "anomaly_sequences")  # required columns


@dataclasses.dataclass(frozen=True)
class Labels:
    """The labels of one channel.

    Args:
        channel: Name of the channel.
        sequences: Anomalous samples of the test part, as half-open ranges in chronological order that do not overlap.
        classes: Class of each sequence, such as "point" or "contextual", or "" if the file has no classes.
        spacecraft: Name of the spacecraft, or "" if the file does not name it.
    """

    channel: str
    sequences: tuple[tuple[int, int], ...]
    classes: tuple[str, ...]
    spacecraft: str = ""


@dataclasses.dataclass(frozen=True, eq=False)
class LabelledChannel:
    """One channel with its labels.

    Args:
        labels: The labels of the channel. Sequences that reach beyond the test part are cut at its end.
        train: Nominal telemetry.
        test: Telemetry with the labelled sequences. Its samples are counted from 0 again.
        train_commands: float32 array of shape `(samples, commands)`.
        test_commands: float32 array of shape `(samples, commands)`.
    """

    labels: Labels
    train: Telemetry
    test: Telemetry
    train_commands: np.ndarray
    test_commands: np.ndarray

    @property
    def is_anomalous(self) -> np.ndarray:
        """Mask of the anomalous samples of the test part, bool of shape `(samples,)`."""
        marks = np.zeros(len(self.test), bool)
        for start, stop in self.labels.sequences:
            marks[start:stop] = True
        return marks


def read_labels(folder: str | os.PathLike, spacecraft: str | None = None) -> dict[str, Labels]:
    """Reads the label file. If a channel has several rows, their sequences are combined, and overlapping sequences are joined.

    Args:
        folder: The folder with `labeled_anomalies.csv`.
        spacecraft: Name of a spacecraft, such as "SMAP" or "MSL", whose channels are selected. None: all channels.

    Returns:
        Labels by channel, in the order of the file.

    Raises:
        InputError: If the file is missing or a row cannot be read. The message names the row.
    """
    path = Path(folder) / LABELS
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            rows = list(csv.reader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(
            f"Expected a folder with train/, test/ and {LABELS}. Received: {folder} ({reason}). Name the data set's folder."
        ) from None
    header = [name.strip() for name in rows[0]] if rows else []
    if not set(_COLUMNS) <= set(header):
        raise InputError(
            f"Expected the columns {', '.join(_COLUMNS)}. Received: {', '.join(header[:8]) or 'none'} in {path}. Add a header."
        )
    found: dict[str, list[tuple[tuple[int, int], str]]] = {}
    crafts: dict[str, str] = {}
    for number, cells in enumerate(rows[1:], 2):
        if not any(cell.strip() for cell in cells):
            continue
        where = f"line {number} of {path.name}"
        if len(cells) != len(header):
            raise InputError(f"Expected {len(header)} columns. Received: {len(cells)} in {where}. Correct the line.")
        row = {name: cell.strip() for name, cell in zip(header, cells, strict=True)}
        channel = row["chan_id"]
        if not channel or channel in (".", "..") or {"/", "\\"} & set(channel):
            raise InputError(f"Expected a channel's name. Received: {channel!r} in {where}. Correct the line.")
        if crafts.setdefault(channel, row.get("spacecraft", "")) != row.get("spacecraft", ""):
            raise InputError(f"Expected one spacecraft for a channel. Received: two for {channel} in {where}. Correct the line.")
        found.setdefault(channel, []).extend(_sequences_of(row, where))
    labels = {channel: Labels(channel, *_joined(sequences), crafts[channel]) for channel, sequences in found.items()}
    if spacecraft is not None:
        labels = {channel: label for channel, label in labels.items() if label.spacecraft.casefold() == spacecraft.casefold()}
    if not labels:
        known = ", ".join(sorted(set(crafts.values()) - {""})) or "none"
        raise InputError(f"Expected channels of one of: {known}. Received: none of spacecraft={spacecraft!r} in {path}. Name another.")
    return labels


def _sequences_of(row: dict[str, str], where: str) -> list[tuple[tuple[int, int], str]]:
    try:
        pairs = ast.literal_eval(row["anomaly_sequences"])
        ranges = [(start, end + 1) for start, end in pairs]
        is_good = all(type(bound) is int for pair in ranges for bound in pair) and all(0 <= start < stop for start, stop in ranges)
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
        is_good = False
    if not is_good:
        received = row["anomaly_sequences"][:60]
        raise InputError(f"Expected sequences as [[first, last], ...] of samples. Received: {received!r} in {where}. Correct the line.")
    classes = [name.strip(" '\"") for name in row.get("class", "").strip().strip("[]").split(",")]
    if classes == [""]:
        classes = [""] * len(ranges)
    if len(classes) != len(ranges):
        raise InputError(f"Expected a class for each of {len(ranges)} sequences. Received: {len(classes)} in {where}. Correct the line.")
    return list(zip(ranges, classes, strict=True))


def _joined(sequences: list[tuple[tuple[int, int], str]]) -> tuple[tuple[tuple[int, int], ...], tuple[str, ...]]:
    """Sorts sequences by time and joins overlapping ones, which get the class of the first."""
    joined: list[tuple[tuple[int, int], str]] = []
    for (start, stop), name in sorted(sequences, key=lambda sequence: sequence[0]):
        if joined and start < joined[-1][0][1]:
            (first, last), earlier = joined[-1]
            joined[-1] = ((first, max(last, stop)), earlier)
        else:
            joined.append(((start, stop), name))
    return tuple(bounds for bounds, _ in joined), tuple(name for _, name in joined)


def load_channel(folder: str | os.PathLike, channel: str) -> LabelledChannel:
    """Loads one labelled channel.

    Args:
        folder: The folder with `train/`, `test/` and `labeled_anomalies.csv`.
        channel: Name of the channel.

    Returns:
        The channel.

    Raises:
        InputError: If the channel has no labels, an array is missing or cannot be used, or a label lies beyond the test part.
    """
    labels = read_labels(folder)
    if channel not in labels:
        raise InputError(f"Expected a labelled channel, one of: {', '.join(list(labels)[:8])}. Received: {channel!r}. Name one of these.")
    return _load(Path(folder), labels[channel])


def load_labelled(
    folder: str | os.PathLike, channels: Sequence[str] | None = None, spacecraft: str | None = None
) -> Iterator[LabelledChannel]:
    """Loads labelled channels one after another, in the order of the label file.

    Args:
        folder: The folder with `train/`, `test/` and `labeled_anomalies.csv`.
        channels: Names of the channels. None: all.
        spacecraft: Name of a spacecraft whose channels are selected. None: all.

    Returns:
        Iterator over the channels, each of which is loaded when it is requested.

    Raises:
        InputError: As for `load_channel`. Unknown names raise at once, a bad array when its channel is requested.
    """
    labels = read_labels(folder, spacecraft)
    unknown = [channel for channel in channels or () if channel not in labels]
    if unknown:
        raise InputError(f"Expected labelled channels, of: {', '.join(list(labels)[:8])}. Received: {unknown[0]!r}. Name others.")
    return (_load(Path(folder), label) for name, label in labels.items() if channels is None or name in channels)


def _load(folder: Path, labels: Labels) -> LabelledChannel:
    train, train_commands = _read(folder / "train", labels.channel)
    test, test_commands = _read(folder / "test", labels.channel)
    beyond = [bounds for bounds in labels.sequences if bounds[0] >= len(test)]
    if beyond:
        raise InputError(
            f"Expected sequences inside the test part of {len(test):,} samples. Received: {list(beyond[0])} of {labels.channel} in {LABELS}. "
            "Correct the line, or give the whole array."
        )
    inside = tuple((start, min(stop, len(test))) for start, stop in labels.sequences)
    return LabelledChannel(dataclasses.replace(labels, sequences=inside), train, test, train_commands, test_commands)


def _read(folder: Path, channel: str) -> tuple[Telemetry, np.ndarray]:
    path = folder / f"{channel}.npy"
    try:
        array = load_npy(path)
    except ValueError as error:
        raise InputError(f"Expected the array {folder.name}/{path.name}. Received: {error} in {folder}. Complete the data set.") from None
    if array.ndim == 1:
        array = array[:, None]
    if array.ndim != 2 or array.dtype.kind not in "fiu" or 0 in array.shape:
        raise InputError(
            f"Expected numbers of shape (samples, 1 + commands). Received: {array.dtype} of shape {array.shape} in {folder.name}/{path.name}. "
            "Save it again."
        )
    values = array[:, 0].astype(np.float32)
    if not np.isfinite(values).all():
        bad = int(np.argmax(~np.isfinite(values)))
        raise InputError(
            f"Expected finite values. Received: {array[bad, 0]} at sample {bad} of {folder.name}/{path.name}. Clean it and save it again."
        )
    return Telemetry(values, name=channel), array[:, 1:].astype(np.float32)
