"""Labelled training data from recorded runs: copies of a run with different noise, whose rows keep the labels of the run."""

import dataclasses
import os
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from enhsim_tf.coarse_simulator.recording import Recording
from enhsim_tf.common.atomic_files import make_folder, replace_file
from enhsim_tf.common.errors import InputError
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.simulator.trusted_range import TrustedRange
from enhsim_tf.telemetry.series import nanoseconds

_MOST_ROWS = 10**9
_OWN = ("copy", "time", "sample", "value", "out_of_range")


def write_copies(
    path: str | os.PathLike,
    model: EnhancedSimulator,
    run: Recording,
    num_copies: int,
    seed: int = 0,
) -> int:
    """Writes copies of a run to one Parquet file, which appears only when it is complete, and returns the number of rows.

    The columns are `copy` (from 0), `time` (of the telemetry, that is with the delay of the model, in seconds if the clock counts from zero;
    `sample` if the run has no times), `value` (of several channels, their names), `out_of_range` (above 1, the coarse run is outside the
    training range), and the carried columns of the run.

    Args:
        path: Path of the file.
        model: A simulator of recorded runs.
        run: The run, for example of a fault.
        num_copies: Number of copies, each with another draw of noise.
        seed: Random seed of the noise.

    Raises:
        InputError: If the run cannot be enhanced, a carried column has the name of another column, or there are too many rows.
    """
    usable = model.alignment.usable(run)
    num_rows = num_copies * len(usable)
    if num_copies < 1 or num_rows > _MOST_ROWS:
        raise InputError(
            f"Expected 1 copy or more, and at most {_MOST_ROWS:,} rows. Received: {num_copies:,} copies, {num_rows:,} rows."
        )
    time, others = _shared_columns(model, usable)
    names = ["value"] if len(model.channels) == 1 else list(model.channels)
    first = {
        "copy": pa.int32(),
        **{name: column.type for name, column in time.items()},
        **dict.fromkeys(names, pa.float32()),
    }
    schema = pa.schema(first | {name: column.type for name, column in others.items()})
    schema = schema.with_metadata(
        {"interval_s": repr(model.interval_s), "channel": ", ".join(model.channels)}
    )
    make_folder(Path(path).parent)
    with (
        replace_file(path) as temporary,
        pq.ParquetWriter(temporary, schema, compression="zstd") as writer,
    ):
        for number, parts in enumerate(model.generate_copies(usable, num_copies, seed)):
            values = np.concatenate(parts)
            own = {
                name: pa.array(np.ascontiguousarray(values[:, channel]))
                for channel, name in enumerate(names)
            }
            writer.write_table(
                pa.table(
                    {
                        "copy": pa.array(np.full(len(values), number, np.int32)),
                        **time,
                        **own,
                        **others,
                    }
                )
            )
    return num_rows


def _shared_columns(
    model: EnhancedSimulator, usable: Recording
) -> tuple[dict[str, pa.Array], dict[str, pa.Array]]:
    """Returns the columns that are the same in every copy: the times, and the score of the range with what is carried."""
    trusted = TrustedRange(model)
    taken = [name for name in usable.parts[0].carried if name in _OWN]
    if taken:
        raise InputError(
            f"Expected other names than {', '.join(_OWN)} for the columns to be carried. Received: {taken[0]!r} in {usable.name}. Rename it."
        )
    clocks = [usable.clock(part) for part in usable.parts]
    delay_s = model.alignment.delay_s
    times = np.concatenate(
        [
            nanoseconds(dataclasses.replace(each, offset_s=each.offset_s + delay_s))
            for each in clocks
        ]
    )
    stamps = (
        pa.array(times / 1e9)
        if usable.clock().counts
        else pa.array(times, pa.timestamp("ns", tz="UTC"))
    )
    time = {"sample": pa.array(times // 10**9)} if usable.start is None else {"time": stamps}
    others = {
        "out_of_range": pa.array(
            np.concatenate([trusted.score_run(part.values) for part in usable.parts])
        )
    }
    for name in usable.parts[0].carried:
        cells = pd.concat(
            [pd.Series(part.carried[name]).reset_index(drop=True) for part in usable.parts],
            ignore_index=True,
        )
        if name.split(" ")[0] == "mask" and cells.isin([0, 1]).all():
            cells = cells.astype(bool)  # a CSV file may write a mask as 0 and 1
        try:
            column = pa.array(cells, from_pandas=True)
        except (
            pa.ArrowException,
            TypeError,
            ValueError,
        ):  # cells of several types, such as numbers and words
            column = pa.array(
                [None if pd.isna(cell) else str(cell) for cell in cells.astype(object)], pa.string()
            )
        others[name] = column
    return time, others


def coverage_lines(model: EnhancedSimulator, run: Recording) -> list[str]:
    """Says which share of a run the training range covers, as a whole and for each of at most 20 values of its column `scenario`."""
    trusted = TrustedRange(model)
    usable = model.alignment.usable(run)
    covered = np.concatenate([trusted.score_run(part.values) <= 1 for part in usable.parts])
    lines = [f"the training range covers {np.mean(covered):.1%} of the run"]
    if "scenario" in usable.parts[0].carried:
        names = (
            pd.concat(
                [pd.Series(part.carried["scenario"]) for part in usable.parts], ignore_index=True
            )
            .astype(str)
            .to_numpy()
        )
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
            f"left out, in parts shorter than a window of {model.window} samples: {left:,} of {len(run):,} samples"
        )
    return lines
