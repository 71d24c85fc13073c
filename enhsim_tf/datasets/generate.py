"""Generates large data sets with worker processes, resumes them after an interruption, and verifies
them.

The main process assigns numbers of shards to workers and records the checksums of finished shards.
It neither holds windows nor loads networks. If the folder contains a part of the same data set,
finished shards are kept and the others are generated. The bytes of the result do not depend on the
engine, the number of workers or the number of interruptions.

The folder has the shards, `_manifest.json`, and during generation `.lock`. The manifest contains
the settings of the data set and, once it is finished, the checksum of each shard. Until then, a
shard is finished if its file is there, because files are written atomically, and has the key of the
plan and the right number of rows.
"""

import contextlib
import json
import os
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import filelock

from enhsim_tf.common.atomic_files import remove_leftovers, sha256, write_json
from enhsim_tf.common.console import Progress
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.parallel import engines
from enhsim_tf.datasets.labelled_windows import (
    FORMAT,
    Plan,
    ShardMaker,
    finished_shards,
    shard_file,
)

# readers of Parquet folders skip such names
MANIFEST = "_manifest.json"
_LOCK = ".lock"
_SHARD = re.compile(r"shard-(\d{6,})\.parquet")


def generate_data_set(
    out: str | os.PathLike,
    plan: Plan,
    workers: int | None = None,
    engine: str = "local",
    tell: Callable[[str], None] = print,
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


def _generate(
    out: Path, plan: Plan, workers: int | None, engine: str, tell: Callable[[str], None]
) -> None:
    checksums: dict[int, str] = {}
    if (out / MANIFEST).exists():
        recorded = read_manifest(out)["shards"]
        checksums = {
            shard: checksum
            for shard, checksum in finished_shards(out, plan)
            if not recorded or recorded[shard_file(shard)] == checksum
        }
        tell(
            f"{len(checksums):,} of {plan.num_shards:,} shards are there and intact; "
            f"{plan.num_shards - len(checksums):,} to generate"
        )
    else:
        write_manifest(out, plan)
    done = sum(map(plan.num_windows_in, checksums))
    generated = Progress(tell).loop("window", plan.num_windows)
    missing = (shard for shard in range(plan.num_shards) if shard not in checksums)
    # starts no worker if no shard is missing
    running = engines.run(engine, ShardMaker(plan, out), missing, workers)
    with contextlib.closing(running):
        for shard, checksum in running:
            if not (out / shard_file(shard)).is_file():
                raise InputError(
                    f"Expected {shard_file(shard)} in {out} after it was written. Received: no "
                    "such file, because another machine wrote it "
                    "elsewhere. Give an --out that all machines share."
                )
            checksums[shard] = checksum
            done += plan.num_windows_in(shard)
            generated(done)
    write_manifest(out, plan, checksums)


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Creates a folder and locks it against other runs. The operating system releases the lock when
    this process ends for any reason.
    """
    folder.mkdir(parents=True, exist_ok=True)
    # no probe beside it: another run may be looking at what is there
    open(folder / _LOCK, "ab").close()
    # or where there are no locks, a mark that stays
    lock = filelock.FileLock(folder / _LOCK, blocking=False, preserve_lock_file=True)
    try:
        lock.acquire()
    except filelock.Timeout:
        raise InputError(
            f"Expected a folder that no other run writes to. Received: {folder}. Wait for it, or "
            "name another."
        ) from None
    try:
        yield
    finally:
        lock.release()


def check_folder(folder: Path, plan: Plan) -> None:
    """Checks, without changing it, that a folder is new, empty, or contains a finished or
    unfinished data set of the same plan.
    """
    if not folder.is_dir():
        return
    others = sorted(
        path.name
        for path in folder.iterdir()
        if path.name != _LOCK and not path.name.startswith(f".{MANIFEST}.")
    )
    if MANIFEST not in others:
        if others:
            raise InputError(
                f"Expected a new folder, or one of this data set. Received: {folder}, which "
                f"contains {others[0]!r}. Give another."
            )
        return
    kept = read_manifest(folder)["settings"]
    for name, asked in plan.settings().items():
        if kept.get(name) != asked:
            was, now = (json.dumps(setting)[:100] for setting in (kept.get(name), asked))
            raise InputError(
                f"Expected {name} as in the data set in {folder}: {was}. Received: {now}. Give "
                "another --out."
            )


def read_manifest(folder: Path) -> dict[str, Any]:
    """Reads and validates the manifest of a data set. Its `shards` are the checksums by the names
    of the files, None if it is not finished.
    """
    if not os.path.isfile(folder / MANIFEST):
        raise InputError(
            f"Expected a data set of `generate --workers`. Received: {folder}, which has no "
            f"{MANIFEST}. Give another folder."
        )
    try:
        content = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        settings = content["settings"]
        shards = content["shards"]
        if content["format"] != FORMAT or not min(settings["windows"], settings["shard"]) >= 1:
            raise ValueError(f"format or settings of something else: {str(content['format'])[:80]}")
        names = map(shard_file, range(num_shards(settings)))
        if shards is not None and (
            len(shards) != num_shards(settings) or list(dict(shards)) != list(names)
        ):
            raise ValueError(
                f"{len(shards):,} other shards than the {num_shards(settings):,} of its settings"
            )
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(
            f"Expected a data set of `generate` of the format {FORMAT}. Received: {folder}, whose "
            f"{MANIFEST} is damaged or another one "
            f"({type(error).__name__}: {str(error)[:120]}). Give another folder, or remove this "
            "one and run `generate` again."
        ) from None
    return content


def num_shards(settings: Mapping[str, int]) -> int:
    """Returns the number of shards of a data set with these settings."""
    return -(-settings["windows"] // settings["shard"])


def write_manifest(folder: Path, plan: Plan, checksums: Mapping[int, str] | None = None) -> None:
    """Writes the manifest of a data set, finished if the checksums of all its shards are given, by
    the number of the shard.
    """
    shards = (
        None
        if checksums is None
        else {shard_file(shard): checksums[shard] for shard in range(plan.num_shards)}
    )
    write_json(folder / MANIFEST, {"format": FORMAT, "settings": plan.settings(), "shards": shards})


def find_problems(folder: str | os.PathLike) -> Iterator[str]:
    """Verifies a data set and yields a line for each problem; raises InputError if there is no
    manifest, or a damaged one.
    """
    folder = Path(folder)
    manifest = read_manifest(folder)
    shards = manifest["shards"]
    there = {
        path.name for path in folder.iterdir() if _SHARD.fullmatch(path.name) and path.is_file()
    }
    if shards is None:
        number = num_shards(manifest["settings"])
        yield (
            f"not finished: {len(there):,} of {number:,} shards are there; run the same `generate` "
            "again"
        )
        return
    for name, checksum in shards.items():
        if name not in there or sha256(folder / name) != checksum:
            yield f"{name}: missing, or its checksum differs from the recorded one"
    for name in sorted(there - set(shards)):
        yield f"{name}: not a file of this data set"
