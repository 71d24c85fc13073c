"""A channel as its source has it, before it is cleaned."""

import dataclasses

import numpy as np
import pandas as pd

from enhsim_tf.telemetry.cleaning.options import Cleaning
from enhsim_tf.telemetry.cleaning.report import ROWS, Finding, Places
from enhsim_tf.telemetry.cleaning.times import Times, parse_times


@dataclasses.dataclass(frozen=True, eq=False)
class RawChannel:
    """A channel as its source has it.

    Args:
        name: Name of the channel.
        cells: The values as they are in the source, in its order.
        times: Their times, neither sorted nor dropped; None if samples are counted.
        clock: The column, or columns, of the times, for the report.
        first: Number of the first sample, if samples are counted.
        places: Where the rows are in their files.
        decimal: Decimal sign of numbers in text; None: the cells show it.
        findings: What was found while it was read.
    """

    name: str
    cells: pd.Series
    times: Times | None = None
    clock: str = "the index"
    first: int = 0
    places: Places = ROWS
    decimal: str | None = None
    findings: tuple[Finding, ...] = ()

    @classmethod
    def of(cls, values: "pd.Series | np.ndarray | RawChannel", options: Cleaning) -> "RawChannel":
        """Makes a channel of a pandas Series, whose index holds the times unless it is a
        `RangeIndex`, or of an array.
        """
        if isinstance(values, RawChannel):
            return values
        if not isinstance(values, pd.Series):
            return cls("telemetry", values)
        index = values.index
        name = "telemetry" if values.name is None else str(values.name)
        if isinstance(index, pd.RangeIndex):
            # a slice of a longer series keeps its sample numbers
            return cls(name, values, first=index.start if index.step == 1 else 0)
        what = f"the times of {name}"
        times = parse_times(index, what, options.drop_bad, options.time_format)
        clock = "the index" if index.name is None else repr(str(index.name))
        return cls(name, values, times, clock)

    @property
    def series(self) -> pd.Series:
        """The channel as a pandas Series, with a `DatetimeIndex`, or a `RangeIndex` of sample
        numbers.
        """
        if self.times is not None:
            return self.cells.set_axis(self.times.stamps).rename(self.name)
        index = pd.RangeIndex(self.first, self.first + len(self.cells))
        return self.cells.set_axis(index).rename(self.name)
