"""Large data sets: millions of windows, many processes, one manifest; nothing lost when a run is stopped, nothing doubled.

The driver hands out numbers of shards and keeps records; it holds no windows and loads no network. A run into a folder
that holds a part of the same data set verifies what is there and makes what is missing or damaged. Which engine worked,
with how many processes and after how many stops cannot be seen in the result: its bytes are the same.
"""

import contextlib
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

from enhsim_tf.common.console import progress
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.parallel import engines
from enhsim_tf.datasets.folder import (
    MANIFEST,
    begin,
    check_folder,
    clear,
    finish,
    held,
    is_whole,
    journal_of,
    problems_of,
    read_manifest,
    read_records,
)
from enhsim_tf.datasets.plan import Plan
from enhsim_tf.datasets.shard import Record, ShardMaker, file_of


def generate_fleet(
    out: str | os.PathLike, plan: Plan, workers: int | None = None, engine: str = "local", tell: Callable[[str], None] = print
) -> None:
    """Makes a data set, or what is missing of it.

    Args:
        out: Its folder.
        plan: What it is.
        workers: Processes; None: one a CPU.
        engine: `local` or `ray`.
        tell: Called with each line.

    Raises:
        InputError: If the folder holds something else, another run writes to it, or it cannot be written.
    """
    out = Path(out)
    if out.suffix == ".parquet":
        raise InputError(f"Expected a folder for a data set of many files. Received: --out {out}.")
    check_folder(out, plan)
    try:
        with held(out):
            check_folder(out, plan)  # now that nobody else can change it
            clear(out)
            try:
                _generate(out, plan, workers, engine, tell)
            finally:
                clear(out)
    except BrokenPipeError:  # whoever read what is told has left
        raise
    except OSError as error:
        raise InputError(f"Expected a folder that can be written to. Received: {out} ({error.strerror or error}).") from None


def _generate(out: Path, plan: Plan, workers: int | None, engine: str, tell: Callable[[str], None]) -> None:
    begin(out, plan)
    began, quiet = time.monotonic(), not sys.stderr.isatty()
    recorded = read_records(out)
    records: dict[int, Record] = {}
    for number in progress(range(plan.num_shards), "checking", unit="shards", disable=quiet or not recorded, leave=False):
        record = recorded.get(number)
        if record is not None and record.rows == plan.rows_of(number) and is_whole(out, record):
            records[number] = record
    if recorded:
        tell(f"{len(records):,} of {plan.num_shards:,} shards are there and whole; {plan.num_shards - len(records):,} to make")
    kept = sum(record.rows for record in records.values())
    missing = (number for number in range(plan.num_shards) if number not in records)
    bar = progress(total=plan.num_windows, initial=kept, unit="windows", unit_scale=True, disable=quiet, smoothing=0.05)
    running = engines.run(engine, ShardMaker(plan, out), missing, workers)  # starts nothing where nothing is missing
    with bar, journal_of(out) as write, contextlib.closing(running):
        for record in running:
            before = recorded.get(record.shard, record)
            if before.sha256 != record.sha256 and before.rows == record.rows:
                raise InputError(
                    f"Expected {file_of(record.shard)} to become what was recorded of it in {out}. Received: other bytes: this machine "
                    f"computes otherwise, or the record is damaged. Remove {MANIFEST} and run the same command again: all shards are made again."
                )
            if not (out / file_of(record.shard)).is_file():
                raise InputError(
                    f"Expected {file_of(record.shard)} in {out} after it was written. Received: no such file here: another machine wrote it. "
                    "Name an --out that all machines share."
                )
            write(record)
            records[record.shard] = record
            bar.update(record.rows)
    finish(out, plan, records)
    made, seconds = plan.num_windows - kept, time.monotonic() - began
    rate = f", {made:,} of them now, {made / seconds:,.0f} a second" if made else ""
    tell(f"{plan.num_windows:,} windows of {plan.window} samples in {plan.num_shards:,} shards in {out}{rate}")


def verify(folder: str | os.PathLike, tell: Callable[[str], None] = print) -> int:
    """Checks a finished data set, tells what is wrong with it in a line each, and returns the exit code: 0 where nothing is.

    Args:
        folder: The data set.
        tell: Called with each line.
    """
    num_problems = 0
    for line in problems_of(folder):
        num_problems += 1
        tell(line)
    if not num_problems:
        settings = read_manifest(Path(folder))["settings"]
        tell(f"{settings['windows']:,} windows in {-(-settings['windows'] // settings['shard']):,} shards, all as they were recorded")
    return 2 if num_problems else 0
