"""A table as it was read, before anything is known about its columns."""

import dataclasses
from collections.abc import Mapping

import pandas as pd

from enhsim_tf.telemetry.cleaning.report import ROWS, Finding, Places


@dataclasses.dataclass(frozen=True, eq=False)
class Table:
    """A table.

    Args:
        frame: The cells; columns have names of text, which may repeat.
        places: Where the rows are in their files.
        decimal: Decimal sign of numbers in text; None: each column shows its own.
        findings: Findings for the cleaning log.
        units: Cells of a line of units by the names of the columns.
    """

    frame: pd.DataFrame
    places: Places = ROWS
    decimal: str | None = None
    findings: tuple[Finding, ...] = ()
    units: Mapping[str, str] = dataclasses.field(default_factory=dict)
