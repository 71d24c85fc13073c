"""Tables of a study: as results of a stage, and in compact files, small enough to be committed."""

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.common.atomic_files import replace_file
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.stages import Stages

if TYPE_CHECKING:
    import pandas as pd


def stage_tables(
    stages: Stages,
    name: str,
    compute: Callable[[], Mapping[str, Any]],
    settings: Any,
    after: Iterable[str] = (),
    version: int = 1,
) -> "dict[str, pd.DataFrame]":
    """Computes tables in a stage, or finds them in the cache; see `Stages.run`.

    Args:
        stages: Runs stages and caches their results.
        name: Name of the stage.
        compute: Returns tables, or lists of their rows, by name.
        settings: What the result depends on.
        after: Names of the stages whose results `compute` reads.
        version: Version of the code.
    """
    import pandas as pd

    def make(folder: Path) -> None:
        for table, rows in compute().items():
            pd.DataFrame(rows).to_parquet(folder / f"{table}.parquet")

    folder = stages.run(name, make, settings, after, version)
    return {path.stem: pd.read_parquet(path) for path in sorted(folder.glob("*.parquet"))}


def seeds_of(table: "pd.DataFrame") -> list[int]:
    """The seeds with which a table was made."""
    return sorted(set(table["seed"].tolist()))


@dataclasses.dataclass(frozen=True)
class KeptTables:
    """The tables that a study stores, one Parquet file each.

    Args:
        names: Names of the tables.
        labels: Columns with few distinct values, which are stored as dictionaries.
        digits: Decimals that numbers are rounded to.
        command: The command that produces them.
        digits_of: Decimals of tables that differ from `digits`.
        former: Names of tables that the command no longer makes, which are read where they are
            published.
    """

    names: tuple[str, ...]
    labels: tuple[str, ...]
    digits: int
    command: str
    digits_of: Mapping[str, int] = dataclasses.field(default_factory=dict)
    former: tuple[str, ...] = ()

    def write(self, tables: "Mapping[str, pd.DataFrame]", folder: Path) -> None:
        """Writes tables by name to a folder: labels as dictionaries, and numbers rounded to the
        precision that their counts support.
        """
        for name, table in tables.items():
            digits = self.digits_of.get(name, self.digits)
            compact = table.reset_index(drop=True)
            for column in compact.columns:
                values = compact[column]
                if column in self.labels:
                    compact[column] = values.astype("category")
                elif values.dtype == np.float64:
                    compact[column] = values.round(digits).astype(np.float32)
            with replace_file(folder / f"{name}.parquet") as temporary:
                compact.to_parquet(temporary, compression="zstd", index=False)

    def read(self, folder: Path) -> "dict[str, pd.DataFrame]":
        """Reads the tables that `write` wrote.

        Raises:
            InputError: If one is missing.
        """
        import pandas as pd

        paths = {name: folder / f"{name}.parquet" for name in (*self.names, *self.former)}
        missing = [name for name in self.names if not paths[name].is_file()]
        if missing:
            raise InputError(
                f"Expected the tables of the study in {folder}. Received: no "
                f"{missing[0]}.parquet. Run {self.command}."
            )
        tables = {name: pd.read_parquet(path) for name, path in paths.items() if path.is_file()}
        for table in tables.values():
            for column in set(self.labels) & set(table.columns):
                table[column] = table[column].astype(str)  # categories back to strings
        return tables
