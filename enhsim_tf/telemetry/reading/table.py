"""A table as it was read, before anything is known about its columns."""

import dataclasses

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
    """

    frame: pd.DataFrame
    places: Places = ROWS
    decimal: str | None = None
    findings: tuple[Finding, ...] = ()
