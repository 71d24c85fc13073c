"""The log of cleaning actions and the report made from it: what was accepted, repaired or left out,
how often and where.

The report accounts for every row and sample: rows in = rows used + rows left out, and samples =
rows used + samples filled in.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import MANY, counted, printable, spoken
from enhsim_tf.telemetry.series import iso_time

_ACTIONS = {
    "accepted": (
        "files, header lines, encoding, clock, further clocks, labels, quality flags, row numbers, "
        "own columns, series, parts, columns left out, commands, decimal comma, units, "
        "missing words, gaps, clock steps, constant, stuck, quantised, resolution, changing level, "
        "counter, states"
    ),
    "WARNING": "mostly filled, fill values",
    "repaired": "unsorted, other rates, jitter, gaps filled",
    "left out": (
        "ragged lines, padding, missing times, bad times, clock change, duplicate rows, same time, "
        "missing values, bad values, averaged, short parts, other channels"
    ),
}
KINDS = {kind: action for action, kinds in _ACTIONS.items() for kind in kinds.split(", ")}
"""What was done about each kind of finding."""
_NUM_PLACES = 3  # places named in each finding
_SUMS = ("rows_in", "rows_used", "samples", "samples_filled")


@dataclasses.dataclass(frozen=True, eq=False)
class Places:
    """Where the rows of a channel are. Without files, rows are counted from 0.

    Args:
        files: First row, its line, and name of each file, in the order of the rows.
        rows: Row of the table for each row of the channel, shape `(rows,)`, if a table holds
            several series. None: they are equal.
    """

    files: tuple[tuple[int, int, str], ...] = ()
    rows: np.ndarray | None = None

    def of(self, row: int) -> str:
        """Describes a row of the channel, counted from 0, for messages."""
        row = int(row) if self.rows is None else int(self.rows[row])
        before = [file for file in self.files if file[0] <= row]
        if not before:
            return f"row {row}"
        first, line, name = before[-1]
        is_one = len({name for _, _, name in self.files}) == 1
        return f"line {row - first + line}" + ("" if is_one else f" of {name}")


ROWS = Places()


@dataclasses.dataclass(frozen=True)
class Finding:
    """One entry of the cleaning log."""

    kind: str  # one of `KINDS`
    count: int  # of rows, samples, gaps or stretches, as `text` says
    text: str  # what was found and what was done about it
    places: tuple[str, ...] = ()  # the first few where it was found
    rows_left_out: int = 0  # rows that are not represented by a sample
    samples_filled: int = 0  # samples that do not represent a row
    # further numbers, in plain JSON types
    details: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    @property
    def action(self) -> str:
        """What was done: "accepted", "repaired" or "left out"."""
        return KINDS[self.kind]

    def line(self) -> str:
        """The finding as one line of text."""
        where = f" (first: {', '.join(self.places)})" if self.places else ""
        return f"{self.action}: {self.text}{where}"

    def to_dict(self) -> dict[str, Any]:
        """The finding in plain JSON types."""
        return dataclasses.asdict(self) | {"action": self.action}


@dataclasses.dataclass(frozen=True)
class Report:
    """The report of cleaning one channel."""

    channel: str
    rows_in: int  # rows in the source
    rows_used: int  # rows that are represented by a sample of the result
    samples: int  # samples in the result, over all parts
    num_parts: int
    # sampling interval of the result in seconds, or in samples if the source has no times
    interval_s: float
    findings: tuple[Finding, ...]  # the entries of the cleaning log

    @property
    def rows_left_out(self) -> int:
        """Number of rows that are not represented by a sample: `rows_in` minus `rows_used`."""
        return sum(finding.rows_left_out for finding in self.findings)

    @property
    def samples_filled(self) -> int:
        """Number of samples that do not represent a row: `samples` minus `rows_used`."""
        return sum(finding.samples_filled for finding in self.findings)

    def find(self, kind: str) -> Finding | None:
        """The first finding of a kind, or None."""
        return next((finding for finding in self.findings if finding.kind == kind), None)

    @property
    def summary(self) -> str:
        """The counts of rows and samples."""
        share = self.samples_filled / max(1, self.samples)
        filled = f", {self.samples_filled:,} of them ({share:.1%}) filled in" if share else ""
        rows = (
            f"{counted(self.rows_in, 'row')}, {self.rows_used:,} used, {self.rows_left_out:,} left "
            "out"
        )
        return (
            f"{rows}; {counted(self.samples, 'sample')} in "
            f"{counted(self.num_parts, 'part')}{filled}"
        )

    def lines(self) -> list[str]:
        """The report as text: a summary, then one line for each finding."""
        return lines_of([self])

    def to_dict(self) -> dict[str, Any]:
        """The report in plain JSON types."""
        sums = {"rows_left_out": self.rows_left_out, "samples_filled": self.samples_filled}
        return (
            dataclasses.asdict(self)
            | sums
            | {"findings": [finding.to_dict() for finding in self.findings]}
        )


def lines_of(reports: Sequence[Report]) -> list[str]:
    """The reports of one or several channels as text. What several channels share is said once, and
    of many channels, what is alike in several: the warnings come first.
    """
    owners: dict[str, list[str]] = {}
    for report in reports:
        for text in (report.summary, *(finding.line() for finding in report.findings)):
            owners.setdefault(text, []).append(report.channel)
    if len(reports) > MANY:
        owners = _alike(reports, owners)
    texts = sorted(owners, key=lambda text: not text.startswith("WARNING"))
    lines = [
        f"{spoken(owners[text])}: {text}"
        if len(reports) > 1 or text == reports[0].summary
        else text
        for text in texts
    ]
    # names of channels and columns may contain control characters
    return [printable(line) for line in lines]


def _alike(
    reports: Sequence[Report], owners: Mapping[str, Sequence[str]]
) -> dict[str, Sequence[str]]:
    """Keeps what all channels share, and says of the rest how many channels have findings of a
    kind, with the first of them.
    """
    shared = {text: names for text, names in owners.items() if len(names) == len(reports)}
    by_kind: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for report in reports:
        for finding in report.findings:
            if finding.line() not in shared:
                found = by_kind.setdefault((finding.action, finding.kind), [])
                found.append((report.channel, finding.text))
    if reports[0].summary not in shared:
        sums = [sum(getattr(report, name) for report in reports) for name in _SUMS]
        text = "rows {:,}, used {:,}, samples {:,}, filled in {:,}, in total".format(*sums)
        shared = {text: [report.channel for report in reports]} | shared
    for (action, kind), found in by_kind.items():
        first = ", ".join(name for name, _ in found[:3])
        text = f"{action}: {kind} in {len(found):,} of them ({first}), the first: {found[0][1]}"
        shared[text] = [report.channel for report in reports]
    return shared


@dataclasses.dataclass(frozen=True, eq=False)
class CleaningLog:
    """The log of cleaning actions: collects findings with their places in the source."""

    channel: str
    findings: list[Finding]  # those made while reading come first
    places: Places = ROWS
    # of all rows in the order of the source, int64 nanoseconds since 1970; None without a clock
    times: np.ndarray | None = None
    counts: bool = False  # as in `times.Times`

    def place(self, row: int) -> str:
        """Describes a row of the source by its place and its time."""
        row = int(row)
        if self.times is None or self.times[row] == pd.NaT.value:
            return self.places.of(row)
        time = f"{self.times[row] / 1e9:.10g} s" if self.counts else iso_time(self.times[row])
        return f"{self.places.of(row)}, {time}"

    def add(
        self,
        kind: str,
        rows: Sequence[int] | np.ndarray,
        text: str,
        count: int | None = None,
        **numbers: Any,
    ) -> None:
        """Adds a finding made at rows of the source, unless its count, by default the number of
        these rows, is 0. What is left out are rows, which are not represented by a sample then.

        `{count}` in the text becomes the count; `numbers` are the other fields of the `Finding`.
        """
        count = len(rows) if count is None else count
        if count:
            text = text.replace("{count}", f"{count:,}")
            places = tuple(self.place(row) for row in rows[:_NUM_PLACES])
            left_out = int(count) if KINDS[kind] == "left out" else 0
            self.findings.append(Finding(kind, int(count), text, places, left_out, **numbers))
