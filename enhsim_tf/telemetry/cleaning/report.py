"""The log of cleaning actions and the report made from it: what was accepted, repaired or left out, how often and where.

The report accounts for every row and sample: rows in = rows used + rows left out, and samples = rows used + samples filled in.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import counted, printable, spoken

_ACTIONS = {
    "accepted": "files, header lines, encoding, clock, further clocks, labels, quality flags, row numbers, own columns, series, "
    "columns left out, commands, decimal comma, units, fill values, missing words, gaps, clock steps, constant, stuck, quantised, resolution, changing level",
    "repaired": "unsorted, other rates, jitter, gaps filled",
    "left out": "padding, missing times, bad times, clock change, duplicate rows, same time, missing values, bad values, averaged, short parts",
}
KINDS = {kind: action for action, kinds in _ACTIONS.items() for kind in kinds.split(", ")}
"""What was done about each kind of finding."""
_NUM_PLACES = 3  # places named in each finding


class Places(list):
    """Where the rows of a channel are: `[first row, its line, name of the file]` of each file, in the order of the rows.

    It is a list because pandas writes the attributes of a Series as JSON. Without files, rows are counted from 0.

    Args:
        files: The files.
        rows: Row of the table for each row of the channel, shape `(rows,)`, if a table holds several series. None: they are equal.
    """

    def __init__(self, files: Sequence[Sequence[Any]] = (), rows: np.ndarray | None = None):
        super().__init__(map(list, files))
        self.rows = rows

    __hash__ = object.__hash__  # never changed, and a default of dataclasses

    def __deepcopy__(self, memo: dict) -> "Places":
        return self  # pandas copies attributes with every operation

    def of(self, row: int) -> str:
        """Describes a row of the channel, counted from 0, for messages."""
        row = int(row) if self.rows is None else int(self.rows[row])
        inside = [each for each in self if each[0] <= row]
        if not inside:
            return f"row {row}"
        first, line, name = inside[-1]
        return f"line {row - first + line}" + (f" of {name}" if len(self) > 1 else "")


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
    details: Mapping[str, Any] = dataclasses.field(
        default_factory=dict
    )  # further numbers, in plain JSON types

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
    interval_s: float  # sampling interval of the result in seconds, or in samples if the source has no times
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
        filled = f", {self.samples_filled:,} of them filled in" if self.samples_filled else ""
        rows = f"{counted(self.rows_in, 'row')}, {self.rows_used:,} used, {self.rows_left_out:,} left out"
        return f"{rows}; {counted(self.samples, 'sample')} in {counted(self.num_parts, 'part')}{filled}"

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
    """The reports of one or several channels as text; what several channels share is said once."""
    owners: dict[str, list[str]] = {}
    for report in reports:
        for text in (report.summary, *(finding.line() for finding in report.findings)):
            owners.setdefault(text, []).append(report.channel)
    is_named = [len(reports) > 1 or text == reports[0].summary for text in owners]
    lines = [
        f"{spoken(names)}: {text}" if named else text
        for (text, names), named in zip(owners.items(), is_named, strict=True)
    ]
    return [
        printable(line) for line in lines
    ]  # names of channels and columns may contain control characters


class CleaningLog:
    """The log of cleaning actions: collects findings with their places in the source.

    `times` are those of all rows in the order of the source, int64 nanoseconds since 1970, or None; `findings` are the fields of those made
    while reading; `counts` as in `times.Times`.
    """

    def __init__(
        self,
        times: np.ndarray | None,
        findings: Sequence[Mapping[str, Any]] = (),
        places: Places = ROWS,
        counts: bool = False,
    ):
        self.times, self.places, self.counts = times, places, counts
        self.findings = [Finding(**each) for each in findings]

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
        """Adds a finding made at rows of the source, unless its count, by default the number of these rows, is 0.

        `{count}` in the text becomes the count; `numbers` are the other fields of the `Finding`.
        """
        count = len(rows) if count is None else count
        if count:
            places = tuple(self.place(row) for row in rows[:_NUM_PLACES])
            self.findings.append(
                Finding(kind, int(count), text.replace("{count}", f"{count:,}"), places, **numbers)
            )


def iso_time(nanoseconds: int) -> str:
    """Formats a time in nanoseconds since 1970 as ISO 8601 text in UTC."""
    return pd.Timestamp(int(nanoseconds), tz="UTC").isoformat()
