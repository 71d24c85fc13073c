"""The log of cleaning actions and the report made from it: what was accepted, repaired or left out, how often and where.

The report accounts for every row and sample: rows in = rows used + rows left out, and samples = rows used + samples filled in.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from enhsim_tf.common.errors import printable

KINDS = {
    "header lines": ("accepted", "lines that begin with # above the header are skipped"),
    "encoding": ("accepted", "text that is not UTF-8"),
    "columns left out": ("accepted", "columns without numbers, if no columns were named"),
    "commands": ("accepted", "columns of zeros and ones beside the value of an array, which are commands and not channels"),
    "time column": ("accepted", "the time column was detected, not named"),
    "time unit": ("accepted", "the unit of numeric times, inferred from their magnitude"),
    "time zone": ("accepted", "times with a zone are converted to UTC; times without one are taken as UTC"),
    "leap seconds": ("repaired", "second 60 is taken as the first second of the next minute"),
    "decimal comma": ("accepted", "numbers written with a decimal comma"),
    "missing times": ("left out", "rows without a time"),
    "bad times": ("left out", "rows whose time cannot be read"),
    "clock change": ("left out", "local times that a clock change makes ambiguous or nonexistent"),
    "descending": ("repaired", "rows in descending order of time, reversed"),
    "unsorted": ("repaired", "rows out of chronological order, sorted"),
    "duplicate rows": ("left out", "rows that repeat the time and value of another row"),
    "same time": ("left out", "rows with another value at the same time"),
    "missing values": ("left out", "NaN, None, infinite or empty values"),
    "bad values": ("left out", "text among numbers, and numbers beyond float32"),
    "finer stretches": ("repaired", "stretches with a higher sampling rate, averaged to the common interval"),
    "coarser stretches": ("repaired", "stretches with a lower sampling rate, interpolated to the common interval"),
    "other rates": ("left out", "stretches with another sampling rate"),
    "averaged": ("left out", "rows merged with another row of the same interval"),
    "jitter": ("repaired", "times off the regular grid, snapped to it"),
    "gaps filled": ("repaired", "short gaps, filled by linear interpolation or with the value before them"),
    "gaps": ("accepted", "long gaps, at which the series is split"),
    "clock steps": ("accepted", "jumps of the sampling clock, at which the series is split"),
    "short parts": ("left out", "parts that are too short"),
    "constant": ("accepted", "a channel that does not vary"),
    "stuck": ("accepted", "long stretches of one value"),
    "quantised": ("accepted", "few distinct values, and the step between them"),
    "resolution": ("accepted", "differences that are lost in float32 rounding"),
    "changing level": ("accepted", "a level or amplitude that changes over time"),
}
_NUM_PLACES = 3  # places named in each finding


@dataclasses.dataclass(frozen=True)
class Finding:
    """One entry of the cleaning log.

    Args:
        kind: One of `KINDS`.
        count: Number of rows, samples, gaps or stretches, as `text` says.
        text: What was found and what was done about it.
        places: The first few places where it was found.
        rows_left_out: Number of rows that are not represented by a sample.
        samples_filled: Number of samples that do not represent a row.
        details: Further numbers, in plain JSON types.
    """

    kind: str
    count: int
    text: str
    places: tuple[str, ...] = ()
    rows_left_out: int = 0
    samples_filled: int = 0
    details: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    @property
    def action(self) -> str:
        """What was done: "accepted", "repaired" or "left out"."""
        return KINDS[self.kind][0]

    def line(self) -> str:
        """The finding as one line of text."""
        where = f" (first: {', '.join(self.places)})" if self.places else ""
        return f"{self.action}: {self.text}{where}"

    def to_dict(self) -> dict[str, Any]:
        """The finding in plain JSON types; `finding_from_dict` restores it."""
        found = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return found | {"places": list(self.places), "details": dict(self.details), "action": self.action}


def finding_from_dict(content: Mapping[str, Any]) -> Finding:
    """Restores a finding from the output of `Finding.to_dict`."""
    given = {name: value for name, value in content.items() if name != "action"}
    return Finding(**given | {"places": tuple(given.get("places", ()))})


@dataclasses.dataclass(frozen=True)
class Report:
    """The report of cleaning one channel.

    Args:
        channel: Name of the channel.
        rows_in: Number of rows in the source.
        rows_used: Number of rows that are represented by a sample of the result.
        samples: Number of samples in the result, over all parts.
        num_parts: Number of parts.
        interval_s: Sampling interval of the result in seconds, or in samples if the source has no times.
        findings: The entries of the cleaning log.
    """

    channel: str
    rows_in: int
    rows_used: int
    samples: int
    num_parts: int
    interval_s: float
    findings: tuple[Finding, ...]

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

    def lines(self) -> list[str]:
        """The report as text: a summary, then one line for each finding."""
        parts = "1 part" if self.num_parts == 1 else f"{self.num_parts} parts"
        filled = f", {self.samples_filled:,} of them filled in" if self.samples_filled else ""
        head = f"{self.channel}: {self.rows_in:,} rows, {self.rows_used:,} used, {self.rows_left_out:,} left out; "
        lines = [f"{head}{self.samples:,} samples in {parts}{filled}", *(finding.line() for finding in self.findings)]
        return [printable(line) for line in lines]  # names of channels and columns may contain control characters

    def to_dict(self) -> dict[str, Any]:
        """The report in plain JSON types."""
        counted = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        sums = {"rows_left_out": self.rows_left_out, "samples_filled": self.samples_filled}
        return counted | sums | {"findings": [finding.to_dict() for finding in self.findings]}


class CleaningLog:
    """The log of cleaning actions: collects findings with their places in the source.

    Args:
        times: Times of all rows in the order of the source, int64 nanoseconds since 1970. None: the source has no times.
        findings: Findings made when the source was read.
    """

    def __init__(self, times: np.ndarray | None, findings: Sequence[Finding] = ()):
        self.times, self.findings = times, list(findings)

    def place(self, row: int) -> str:
        """Describes a row of the source by its number, counted from 0, and its time."""
        row = int(row)
        if self.times is None or self.times[row] == pd.NaT.value:
            return f"row {row}"
        return f"row {row}, {iso_time(self.times[row])}"

    def add(self, kind: str, rows: Sequence[int] | np.ndarray, text: str, count: int | None = None, **numbers: Any) -> None:
        """Adds a finding, unless its count is 0.

        Args:
            kind: One of `KINDS`.
            rows: Rows of the source where it was found. The first few are named.
            text: What was found and what was done, with `{count}` as the placeholder for the count.
            count: The count. None: the number of `rows`.
            **numbers: The other fields of the `Finding`.
        """
        count = len(rows) if count is None else count
        if count:
            places = tuple(self.place(row) for row in rows[:_NUM_PLACES])
            self.findings.append(Finding(kind, int(count), text.replace("{count}", f"{count:,}"), places, **numbers))

    def set_samples_filled(self, kind: str, samples: int) -> None:
        """Sets `samples_filled` of a finding that was added before this number was known."""
        self.findings = [dataclasses.replace(one, samples_filled=samples) if one.kind == kind else one for one in self.findings]


def iso_time(nanoseconds: int) -> str:
    """Formats a time in nanoseconds since 1970 as ISO 8601 text in UTC."""
    return pd.Timestamp(int(nanoseconds), tz="UTC").isoformat()
