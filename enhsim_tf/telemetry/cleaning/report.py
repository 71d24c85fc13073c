"""The log that cleaning keeps: what was accepted, repaired or left out, how often and where.

Nothing is lost without a line in it: rows in = rows used + rows left out, samples = rows used + samples filled in.
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
    "columns left out": ("accepted", "columns without a number, where no columns are named"),
    "time column": ("accepted", "the time column was found, not named"),
    "time unit": ("accepted", "the unit of times that are numbers, told by their size"),
    "time zone": ("accepted", "times of a zone become UTC; times without one are taken as UTC"),
    "leap seconds": ("repaired", "a 60th second is the next minute's first"),
    "decimal comma": ("accepted", "numbers written with a decimal comma"),
    "missing times": ("left out", "rows without a time"),
    "bad times": ("left out", "rows whose time is none"),
    "clock change": ("left out", "local times that a clock change makes ambiguous or impossible"),
    "descending": ("repaired", "rows from the last to the first, turned round"),
    "unsorted": ("repaired", "rows out of the order of time, sorted"),
    "duplicate rows": ("left out", "the same time and value again"),
    "same time": ("left out", "another value of the same time"),
    "missing values": ("left out", "NaN, None, infinite or empty values"),
    "bad values": ("left out", "text among numbers, and numbers beyond float32"),
    "finer stretches": ("repaired", "a faster sampling rate, averaged down"),
    "coarser stretches": ("repaired", "a slower sampling rate, interpolated"),
    "other rates": ("left out", "stretches of another sampling rate"),
    "averaged": ("left out", "rows that share an interval with another are averaged"),
    "jitter": ("repaired", "times off the regular grid, snapped to it"),
    "gaps filled": ("repaired", "short gaps, filled by a straight line"),
    "gaps": ("accepted", "long gaps part the series"),
    "clock steps": ("accepted", "the clock of the samples jumps: the series is parted"),
    "short parts": ("left out", "parts too short to use"),
    "constant": ("accepted", "a channel that does not vary"),
    "stuck": ("accepted", "long stretches of one value"),
    "quantised": ("accepted", "values of few levels, and their step"),
    "resolution": ("accepted", "differences that float32 rounds"),
    "changing level": ("accepted", "level or amplitude that change over time"),
}
_NUM_PLACES = 3  # named of each kind


@dataclasses.dataclass(frozen=True)
class Finding:
    """One kind of thing that was met.

    Args:
        kind: One of `KINDS`.
        count: How often: rows, samples, gaps or stretches, as `text` says.
        text: What was met and what was done, in plain words.
        places: The first few places.
        rows_left_out: Rows that no sample stands for.
        samples_filled: Samples that no row stands for.
        details: Numbers behind the text, in plain JSON types.
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
        """What was done with it: accepted, repaired or left out."""
        return KINDS[self.kind][0]

    def line(self) -> str:
        """The finding in one line of plain words."""
        where = f" (first: {', '.join(self.places)})" if self.places else ""
        return f"{self.action}: {self.text}{where}"

    def to_dict(self) -> dict[str, Any]:
        """The finding in plain JSON types; `Finding(**...)` takes all but `action` back."""
        found = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return found | {"places": list(self.places), "details": dict(self.details), "action": self.action}


def finding_from_dict(content: Mapping[str, Any]) -> Finding:
    """The finding that `Finding.to_dict` wrote."""
    given = {name: value for name, value in content.items() if name != "action"}
    return Finding(**given | {"places": tuple(given.get("places", ()))})


@dataclasses.dataclass(frozen=True)
class Report:
    """What cleaning did to one channel.

    Args:
        channel: Its name.
        rows_in: Rows that were given.
        rows_used: Rows that a sample of the result stands for, counted in the result.
        samples: Samples of the result, over all parts.
        num_parts: Number of parts.
        interval_s: Sampling interval of the result, in seconds (in samples without time).
        findings: What was met.
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
        """Rows that were reported as left out; with the used ones they make all."""
        return sum(finding.rows_left_out for finding in self.findings)

    @property
    def samples_filled(self) -> int:
        """Samples that no row stands for; with the used rows they make all samples."""
        return sum(finding.samples_filled for finding in self.findings)

    def find(self, kind: str) -> Finding | None:
        """What was found of a kind (the first of it), or None."""
        return next((finding for finding in self.findings if finding.kind == kind), None)

    def lines(self) -> list[str]:
        """The report in plain words, one line a kind."""
        parts = "1 part" if self.num_parts == 1 else f"{self.num_parts} parts"
        filled = f", {self.samples_filled:,} of them filled in" if self.samples_filled else ""
        head = f"{self.channel}: {self.rows_in:,} rows, {self.rows_used:,} used, {self.rows_left_out:,} left out; "
        lines = [f"{head}{self.samples:,} samples in {parts}{filled}", *(finding.line() for finding in self.findings)]
        return [printable(line) for line in lines]  # names of channels and columns may hold anything

    def to_dict(self) -> dict[str, Any]:
        """The report in plain JSON types."""
        counted = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        sums = {"rows_left_out": self.rows_left_out, "samples_filled": self.samples_filled}
        return counted | sums | {"findings": [finding.to_dict() for finding in self.findings]}


class CleaningLog:
    """Findings as they are made, with their places in the source.

    Args:
        times: Times of all rows in the order of the source, int64 nanoseconds since 1970, or None where samples are counted.
        findings: What reading the source found before.
    """

    def __init__(self, times: np.ndarray | None, findings: Sequence[Finding] = ()):
        self.times, self.findings = times, list(findings)

    def place(self, row: int) -> str:
        """A row of the source (counted from 0) with its time, in words."""
        row = int(row)
        if self.times is None or self.times[row] == pd.NaT.value:
            return f"row {row}"
        return f"row {row}, {iso_time(self.times[row])}"

    def add(self, kind: str, rows: Sequence[int] | np.ndarray, text: str, count: int | None = None, **numbers: Any) -> None:
        """Notes a finding; nothing where its count is 0.

        Args:
            kind: One of `KINDS`.
            rows: Rows of the source where it was met; the first few are named.
            text: What was met and what was done, with `{count}` where the count belongs.
            count: How often, where it is not the number of rows.
            **numbers: The other fields of a `Finding`.
        """
        count = len(rows) if count is None else count
        if count:
            places = tuple(self.place(row) for row in rows[:_NUM_PLACES])
            self.findings.append(Finding(kind, int(count), text.replace("{count}", f"{count:,}"), places, **numbers))

    def fill(self, kind: str, samples: int) -> None:
        """Adds filled samples to a finding that was noted before it was known how many of them are kept."""
        self.findings = [dataclasses.replace(one, samples_filled=samples) if one.kind == kind else one for one in self.findings]


def iso_time(nanoseconds: int) -> str:
    """A time in nanoseconds since 1970 as ISO 8601 text in UTC."""
    return pd.Timestamp(int(nanoseconds), tz="UTC").isoformat()
