"""The table of all measurements of claims in many runs of the paper, one of them after another.

A run is a named tuple with a `seed` and `words`, which tell what else it is.
"""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pandas as pd

from enhsim_tf.common.atomic_files import replace_file


def measured(run: Any, claims: Iterable[Any], pipeline: Any) -> pd.DataFrame:
    """The measurements of claims in one run, whose pipeline is given: one row for each, with the
    fields of the run and the columns `claim`, `name` and `value`.
    """
    rows = [
        (*run, claim.id, name, value)
        for claim in claims
        for name, value in claim.measure(pipeline).items()
    ]
    return pd.DataFrame(rows, columns=[*run._fields, "claim", "name", "value"])


def add_runs(
    planned: list[Any],
    measure: Callable[[Any], pd.DataFrame],
    path: Path,
    tell: Callable[[str], None],
) -> pd.DataFrame:
    """Does the runs that the table at a path does not have yet, writes it after each of them, and
    returns it.

    Args:
        planned: The runs, at least one.
        measure: Does a run and returns its rows, see `measured`.
        path: The Parquet file of the table.
        tell: Called with a line about each run.
    """
    kind = type(planned[0])
    tables = [pd.read_parquet(path)] if path.is_file() else []
    done = {
        kind(*row) for table in tables for row in table[[*kind._fields]].itertuples(index=False)
    }
    for number, run in enumerate(planned, 1):
        state = " (in the table)" if run in done else ""
        tell(f"run {number} of {len(planned)}: {run.words}, seed {run.seed}{state}")
        if run in done:
            continue
        tables.append(measure(run))
        with replace_file(path) as temporary:
            pd.concat(tables, ignore_index=True).to_parquet(
                temporary, compression="zstd", index=False
            )
    return pd.concat(tables, ignore_index=True)
