"""Generates large data sets with worker processes, and resumes them after an interruption.

The main process assigns numbers of shards to workers and records the checksums of finished shards. It neither holds windows nor loads networks.
If the folder contains a part of the same data set, finished shards are kept and the others are generated. The bytes of the result do not
depend on the engine, the number of workers or the number of interruptions.
"""

import contextlib
import os
from collections.abc import Callable
from pathlib import Path

from enhsim_tf.common.atomic_files import remove_leftovers
from enhsim_tf.common.console import Progress
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.parallel import engines
from enhsim_tf.datasets.folder import MANIFEST, check_folder, locked, read_manifest, write_manifest
from enhsim_tf.datasets.plan import Plan
from enhsim_tf.datasets.shard import ShardMaker, finished_shards, shard_file


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
    checksums: dict[int, str] = {}
    if (out / MANIFEST).exists():
        recorded = read_manifest(out)["shards"]
        checksums = {shard: found for shard, found in finished_shards(out, plan) if not recorded or recorded[shard_file(shard)] == found}
        tell(f"{len(checksums):,} of {plan.num_shards:,} shards are there and intact; {plan.num_shards - len(checksums):,} to generate")
    else:
        write_manifest(out, plan)
    done, generated = sum(map(plan.num_windows_in, checksums)), Progress(tell).loop("window", plan.num_windows)
    missing = (shard for shard in range(plan.num_shards) if shard not in checksums)
    running = engines.run(engine, ShardMaker(plan, out), missing, workers)  # starts no worker if no shard is missing
    with contextlib.closing(running):
        for shard, checksum in running:
            if not (out / shard_file(shard)).is_file():
                raise InputError(
                    f"Expected {shard_file(shard)} in {out} after it was written. Received: no such file, because another machine wrote it "
                    "elsewhere. Give an --out that all machines share."
                )
            checksums[shard] = checksum
            done += plan.num_windows_in(shard)
            generated(done)
    write_manifest(out, plan, checksums)
