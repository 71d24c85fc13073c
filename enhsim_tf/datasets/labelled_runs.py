"""Labelled training data from recorded runs: copies of a run with different noise, whose rows keep
the labels of the run.
"""

import os
from collections.abc import Sequence

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from enhsim_tf.common.atomic_files import replace_file
from enhsim_tf.common.columns import apart_from
from enhsim_tf.common.errors import InputError
from enhsim_tf.scoring.trusted_range import TrustedRange
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.series import Telemetry

_MOST_ROWS = 10**9
_OURS = ("copy", "time", "sample", "value", "out_of_range")


def write_copies(
    path: str | os.PathLike,
    model: EnhancedSimulator,
    run: Telemetry,
    num_copies: int,
    seed: int = 0,
) -> int:
    """Writes copies of a run to one Parquet file, which appears only when it is complete, and
    returns the number of rows.

    The columns are `copy` (from 0), `time` (of the telemetry, that is with the delay of the model,
    in seconds if the clock counts from zero; `sample` if the run has no times), `value` (of several
    channels, their names), `out_of_range` (above 1, the coarse run is outside the training range),
    and the carried columns of the run. A name of the user's that another column has is followed by
    `(channel)` or `(run)`.

    Args:
        path: Path of the file, in an existing folder.
        model: A simulator of recorded runs.
        run: The run, for example of a fault.
        num_copies: Number of copies, each with another draw of noise.
        seed: Random seed of the noise.

    Raises:
        InputError: If the run cannot be enhanced, or there are too many rows.
    """
    usable = model.alignment.usable(run)
    num_rows = num_copies * len(usable)
    if num_copies < 1 or num_rows > _MOST_ROWS:
        raise InputError(
            f"Expected 1 copy or more, and at most {_MOST_ROWS:,} rows. Received: {num_copies:,} "
            f"copies, {num_rows:,} rows."
        )
    names = ["value"]
    if len(model.channels) > 1:
        names = list(apart_from(_OURS, model.channels).values())
    time, others = _shared_columns(model, usable, names)

    def table_of(number: int, values: np.ndarray) -> pa.Table:
        columns = {"copy": pa.array(np.full(len(values), number, np.int32)), **time}
        for name, channel in zip(names, values.T, strict=True):
            columns[name] = pa.array(np.ascontiguousarray(channel))
        return pa.table(columns | others)

    about = {"interval_s": repr(model.interval_s), "channel": ", ".join(model.channels)}
    empty = table_of(0, np.zeros((len(usable), len(names)), np.float32))
    schema = empty.schema.with_metadata(about)
    with (
        replace_file(path) as temporary,
        pq.ParquetWriter(temporary, schema, compression="zstd") as writer,
    ):
        for number, parts in enumerate(model.generate_copies(usable, num_copies, seed)):
            writer.write_table(table_of(number, np.concatenate(parts)))
    return num_rows


def _shared_columns(
    model: EnhancedSimulator, usable: Telemetry, names: Sequence[str]
) -> tuple[dict[str, pa.Array], dict[str, pa.Array]]:
    """Returns the columns that are the same in every copy: the times, and the score of the range
    with what is carried, under names apart from those of the channels' columns.
    """
    carried = apart_from((*_OURS, *names), list(usable.parts[0].carried), "run")
    times = usable.clock.nanoseconds(usable.time_s + model.alignment.delay_s)
    stamps = (
        pa.array(times / 1e9)
        if usable.clock.counts
        else pa.array(times, pa.timestamp("ns", tz="UTC"))
    )
    time = {"sample": pa.array(times // 10**9)} if usable.start is None else {"time": stamps}
    others = {"out_of_range": pa.array(TrustedRange(model).score_parts(usable))}
    for name, column_name in carried.items():
        cells = _cells_of(usable, name)
        if name.split(" ")[0] == "mask" and cells.isin([0, 1]).all():
            cells = cells.astype(bool)  # a CSV file may write a mask as 0 and 1
        try:
            column = pa.array(cells, from_pandas=True)
        # cells of several types, such as numbers and words
        except (pa.ArrowException, TypeError, ValueError):
            column = pa.array(
                [None if pd.isna(cell) else str(cell) for cell in cells.astype(object)], pa.string()
            )
        others[column_name] = column
    return time, others


def _cells_of(usable: Telemetry, name: str) -> pd.Series:
    """A carried column of a run."""
    return pd.concat([pd.Series(part.carried[name]) for part in usable.parts], ignore_index=True)


def coverage_lines(model: EnhancedSimulator, run: Telemetry) -> list[str]:
    """Says which share of a run the training range covers, as a whole and for each of at most 20
    values of its column `scenario`.
    """
    usable = model.alignment.usable(run)
    covered = TrustedRange(model).score_parts(usable) <= 1
    lines = [f"the training range covers {np.mean(covered):.1%} of the run"]
    if "scenario" in usable.parts[0].carried:
        names = _cells_of(usable, "scenario").astype(str).to_numpy()
        kinds = list(dict.fromkeys(names))
        if 1 < len(kinds) <= 20:
            lines[0] += (
                f" ({', '.join(f'{kind} {np.mean(covered[names == kind]):.1%}' for kind in kinds)})"
            )
    if np.mean(covered) < 0.5:
        lines[0] += (
            "; outside it, the enhanced run is an extrapolation, see the column out_of_range"
        )
    left = len(run) - len(usable)
    if left:
        lines.append(
            f"left out, in parts shorter than a window of {model.window} samples: {left:,} of "
            f"{len(run):,} samples"
        )
    return lines
