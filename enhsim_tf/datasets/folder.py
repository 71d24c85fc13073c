"""Files of a large data set: shards, `_manifest.json`, and during generation `_journal.jsonl` and `.lock`.

The manifest contains the settings of the data set and, once it is finished, the record (rows and checksum) of each shard.
During generation, each finished shard appends its record to the journal. An incomplete last line is ignored, and its shard
is generated again. Before a run resumes, the checksum of every recorded shard is verified.
"""

import contextlib
import json
import os
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import filelock

from enhsim_tf.common.atomic_files import sha256, write_json
from enhsim_tf.common.errors import InputError
from enhsim_tf.datasets.plan import FORMAT, Plan
from enhsim_tf.datasets.shard import Record, shard_file

MANIFEST, JOURNAL, _LOCK = "_manifest.json", "_journal.jsonl", ".lock"  # readers of Parquet folders skip such names
_SHARD = re.compile(r"shard-(\d{6,})\.parquet")


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Creates a folder and locks it against other runs. The operating system releases the lock when this process ends for any reason."""
    folder.mkdir(parents=True, exist_ok=True)
    open(folder / _LOCK, "ab").close()  # no probe beside it: another run may be looking at what is there
    lock = filelock.FileLock(folder / _LOCK, blocking=False, preserve_lock_file=True)  # or where there are no locks, a mark that stays
    try:
        lock.acquire()
    except filelock.Timeout:
        raise InputError(f"Expected a folder that no other run writes to. Received: {folder}. Wait for it, or name another.") from None
    try:
        yield
    finally:
        lock.release()


def check_folder(folder: Path, plan: Plan) -> None:
    """Checks, without changing it, that a folder is new, empty, or contains a finished or unfinished data set of the same plan."""
    if not folder.is_dir():
        return
    others = sorted(path.name for path in folder.iterdir() if path.name != _LOCK and not path.name.startswith(f".{MANIFEST}."))
    if MANIFEST not in others:
        if others:
            raise InputError(
                f"Expected a new folder, or one of this data set. Received: {folder}, which contains {others[0]!r}. Give another."
            )
        return
    kept = read_manifest(folder)["settings"]
    for name, asked in plan.settings().items():
        if kept.get(name) != asked:
            was, now = (json.dumps(each)[:100] for each in (kept.get(name), asked))
            raise InputError(f"Expected {name} as in the data set in {folder}: {was}. Received: {now}. Give another --out.")


def read_manifest(folder: Path) -> dict[str, Any]:
    """Reads and validates the manifest of a data set. Its `shards` are returned as `Record`s, or None if it is not finished."""
    if not os.path.isfile(folder / MANIFEST):
        raise InputError(f"Expected a data set of `generate --workers`. Received: {folder}, which has no {MANIFEST}. Give another folder.")
    try:
        content = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        settings, shards = content["settings"], content["shards"]
        if content["format"] != FORMAT or not min(settings["windows"], settings["shard"]) >= 1:
            raise ValueError(f"format or settings of something else: {str(content['format'])[:80]}")
        if shards is not None:
            content["shards"] = [Record(number, each["rows"], each["sha256"]) for number, each in enumerate(shards)]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"Expected a data set of `generate` of the format {FORMAT}. Received: {folder}, whose {MANIFEST} is damaged or another one "
            f"({type(error).__name__}: {str(error)[:120]}). Give another folder, or remove this one and run `generate` again."
        ) from None
    return content


def read_records(folder: Path) -> dict[int, Record]:
    """Returns the records of all finished shards, by the number of the shard. Invalid lines of the journal are ignored."""
    records = {record.shard: record for record in read_manifest(folder)["shards"] or ()}
    if not (folder / JOURNAL).exists():
        return records
    with open(folder / JOURNAL, "rb") as journal:
        for line in journal:
            with contextlib.suppress(ValueError, TypeError):
                record = Record(*json.loads(line))
                records[record.shard] = record
    return records


@contextlib.contextmanager
def open_journal(folder: Path) -> Iterator[Callable[[Record], None]]:
    """Opens the journal and yields a function that appends a record. After an incomplete last line, it begins on a new one."""
    with open(folder / JOURNAL, "ab") as journal:
        journal.write(b"\n" if journal.tell() else b"")

        def write(record: Record) -> None:
            journal.write(json.dumps(record).encode() + b"\n")
            journal.flush()

        yield write


def write_manifest(folder: Path, plan: Plan, records: Mapping[int, Record] | None = None) -> None:
    """Writes the manifest of a data set, finished if the records of all its shards are given, by the number of the shard."""
    shards = None
    if records is not None:
        all_of = [records[number] for number in range(plan.num_shards)]
        shards = [{"file": shard_file(each.shard), "rows": each.rows, "sha256": each.sha256} for each in all_of]
    write_json(folder / MANIFEST, {"format": FORMAT, "settings": plan.settings(), "shards": shards})


def is_intact(folder: Path, record: Record) -> bool:
    """Whether the file of a shard exists and has the recorded checksum."""
    try:
        return sha256(folder / shard_file(record.shard)) == record.sha256
    except OSError:
        return False


def find_problems(folder: str | os.PathLike) -> Iterator[str]:
    """Verifies a data set against its manifest and yields one line for each problem.

    Raises:
        InputError: If the folder is not a data set, or if its manifest is damaged.
    """
    folder = Path(folder)
    manifest = read_manifest(folder)
    settings, records = manifest["settings"], manifest["shards"]
    if records is None:
        expected = -(-settings["windows"] // settings["shard"])
        yield f"not finished: {len(read_records(folder)):,} of {expected:,} shards are recorded; run the same `generate` again"
        return
    for record in records:
        if not is_intact(folder, record):
            yield f"{shard_file(record.shard)}: missing, or its checksum differs from the recorded one"
    known = {shard_file(record.shard) for record in records}
    for path in sorted(folder.iterdir()):
        if path.name not in known and (_SHARD.fullmatch(path.name) or path.name == JOURNAL):
            yield f"{path.name}: not a file of this data set"
