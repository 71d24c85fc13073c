"""Generates large data sets with worker processes, and resumes them after an interruption.

The main process assigns numbers of shards to workers and records finished shards. It neither holds windows nor loads networks.
If the folder contains a part of the same data set, the shards in it are verified, and missing or damaged shards are generated. The
bytes of the result do not depend on the engine, the number of workers or the number of interruptions.
"""

import contextlib
import os
import time
from collections.abc import Callable
from pathlib import Path

from enhsim_tf.common.atomic_files import remove_leftovers
from enhsim_tf.common.console import Progress
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.parallel import engines
from enhsim_tf.datasets.folder import JOURNAL, MANIFEST, check_folder, is_intact, locked, open_journal, read_records, write_manifest
from enhsim_tf.datasets.plan import Plan
from enhsim_tf.datasets.shard import Record, ShardMaker, shard_file


def generate_data_set(
    out: str | os.PathLike, plan: Plan, workers: int | None = None, engine: str = "local", tell: Callable[[str], None] = print
) -> None:
    """Generates a data set, or the missing shards of a data set.

    Args:
        out: Output folder.
        plan: The plan of the data set.
        workers: Number of worker processes. None uses one per CPU.
        engine: How workers are run: `local` or `ray`.
        tell: Function that is called with each line of output.
    """
    out = Path(out)
    check_folder(out, plan)
    with locked(out):
        check_folder(out, plan)  # again, now that no other run can change the folder
        remove_leftovers(out)
        try:
            _generate(out, plan, workers, engine, tell)
        finally:
            remove_leftovers(out)


def _generate(out: Path, plan: Plan, workers: int | None, engine: str, tell: Callable[[str], None]) -> None:
    if not (out / MANIFEST).exists():
        write_manifest(out, plan)
    began, recorded = time.monotonic(), read_records(out)
    records: dict[int, Record] = {}
    for number in range(plan.num_shards):
        record = recorded.get(number)
        if record is not None and record.rows == plan.num_windows_in(number) and is_intact(out, record):
            records[number] = record
    if recorded:
        tell(f"{len(records):,} of {plan.num_shards:,} shards are there and intact; {plan.num_shards - len(records):,} to generate")
    kept = sum(record.rows for record in records.values())
    missing = (number for number in range(plan.num_shards) if number not in records)
    made, generated = 0, Progress(tell).loop("window", plan.num_windows)
    running = engines.run(engine, ShardMaker(plan, out), missing, workers)  # starts no worker if no shard is missing
    with open_journal(out) as write, contextlib.closing(running):
        for record in running:
            name, before = shard_file(record.shard), recorded.get(record.shard, record)
            if before.sha256 != record.sha256 and before.rows == record.rows:
                raise InputError(
                    f"Expected {name} to match its record in {out}. Received: other bytes, because this machine computes "
                    "different results or the record is damaged. Remove the folder, or give another --out, and run the same command again."
                )
            if not (out / name).is_file():
                raise InputError(
                    f"Expected {name} in {out} after it was written. Received: no such file, because another machine wrote it elsewhere. "
                    "Give an --out that all machines share."
                )
            write(record)
            records[record.shard] = record
            made += record.rows
            generated(kept + made)
    write_manifest(out, plan, records)
    (out / JOURNAL).unlink(missing_ok=True)
    seconds = time.monotonic() - began
    rate = f", {made:,} of them now, {made / seconds:,.0f} a second" if made else ""
    tell(f"{plan.num_windows:,} windows of {plan.window} samples in {plan.num_shards:,} shards in {out}{rate}")
