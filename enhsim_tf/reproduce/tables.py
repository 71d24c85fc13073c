"""Tables of an experiment in compact files, small enough to be committed."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.common.atomic_files import replace_file
from enhsim_tf.common.errors import InputError

if TYPE_CHECKING:
    import pandas as pd


@dataclasses.dataclass(frozen=True)
class KeptTables:
    """The tables that an experiment stores, one Parquet file each.

    Args:
        names: Names of the tables.
        labels: Columns with few distinct values, which are stored as dictionaries.
        digits: Decimals that numbers are rounded to.
        kind: Word for messages: an `experiment` or a `study`.
        command: The command that produces them.
        digits_of: Decimals of tables that differ from `digits`.
    """

    names: tuple[str, ...]
    labels: tuple[str, ...]
    digits: int
    kind: str
    command: str
    digits_of: Mapping[str, int] = dataclasses.field(default_factory=dict)

    def write(self, tables: "Mapping[str, pd.DataFrame]", folder: Path) -> None:
        """Writes all tables: labels as dictionaries, and numbers rounded to the precision that their counts support.

        Args:
            tables: By name.
            folder: An existing folder.
        """
        for name, table in tables.items():
            compact = table.reset_index(drop=True)
            for column in compact.columns:
                if column in self.labels:
                    compact[column] = compact[column].astype("category")
                elif compact[column].dtype == np.float64:
                    compact[column] = compact[column].round(self.digits_of.get(name, self.digits)).astype(np.float32)
            with replace_file(folder / f"{name}.parquet") as temporary:
                compact.to_parquet(temporary, compression="zstd", index=False)

    def read(self, folder: Path) -> "dict[str, pd.DataFrame]":
        """Reads the tables that `write` wrote.

        Raises:
            InputError: If one is missing.
        """
        import pandas as pd

        missing = [name for name in self.names if not (folder / f"{name}.parquet").is_file()]
        if missing:
            raise InputError(f"Expected the tables of the {self.kind} in {folder}. Received: no {missing[0]}.parquet. Run {self.command}.")
        tables = {name: pd.read_parquet(folder / f"{name}.parquet") for name in self.names}
        for table in tables.values():
            for column in set(self.labels) & set(table.columns):
                table[column] = table[column].astype(str)  # categories back to strings
        return tables

    def with_earlier_seeds(self, tables: "Mapping[str, pd.DataFrame]", folder: Path, first_seed: int) -> "dict[str, pd.DataFrame]":
        """Adds the rows of a folder's tables whose seed is before the first one of a run.

        Published results of former models cannot be computed again with the present code; a new run must not lose them.

        Args:
            tables: The tables of the run by name, each with the column `seed`.
            folder: A folder that may hold such tables.
            first_seed: First seed of the run.

        Returns:
            The tables, those rows first.

        Raises:
            InputError: If the folder holds some of the tables only: writing would lose what they hold.
        """
        import pandas as pd

        if not any((folder / f"{name}.parquet").is_file() for name in self.names):
            return dict(tables)
        kept = self.read(folder)
        return {name: pd.concat([kept[name][kept[name]["seed"] < first_seed], table], ignore_index=True) for name, table in tables.items()}
