"""Files of a large data set: shards, `_manifest.json`, and during generation `_journal.jsonl` and `.lock`.

The manifest contains the settings of the data set and, once it is finished, the record (rows and checksum) of each shard.
During generation, each finished shard appends its record to the journal. An incomplete last line is ignored, and its shard
is generated again. Before a run resumes, the checksum of every recorded shard is verified.
"""

import contextlib
import json
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import filelock

from enhsim_tf.common.atomic_files import sha256, write_json
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.size_limits import read_json
from enhsim_tf.datasets.mix import MOST_WINDOWS
from enhsim_tf.datasets.plan import FORMAT, MOST_VALUES, Plan, plan_key
from enhsim_tf.datasets.shard import Record, shard_file, shard_schema

MANIFEST, JOURNAL, _LOCK = "_manifest.json", "_journal.jsonl", ".lock"  # readers of Parquet folders skip such names
_SHARD = re.compile(r"shard-(\d{6,})\.parquet")
_LEFT = re.compile(r"\.(shard-\d{6,}\.parquet|_manifest\.json)\..*")  # temporary names of `replace_file`
_SHA256 = re.compile("[0-9a-f]{64}")
_MOST_BYTES = 1_000_000_000  # maximum size of a manifest
_LONGEST_LINE = 1_000  # maximum bytes of a journal line; longer lines are read in pieces, which are invalid records


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Locks a folder against other runs. The operating system releases the lock when this process ends for any reason.

    Args:
        folder: The folder, which is created if necessary.

    Raises:
        InputError: If another run has locked the folder.
        OSError: If the folder is not writable.
    """
    folder.mkdir(parents=True, exist_ok=True)
    open(folder / _LOCK, "ab").close()  # no probe beside it: another run may be looking at what is there
    lock = filelock.FileLock(folder / _LOCK, blocking=False, preserve_lock_file=True)  # or where there are no locks, a mark that stays
    try:
        lock.acquire()
    except filelock.Timeout:
        raise InputError(f"Expected a folder that no other run writes to. Received: {folder}. Wait for it, or name another.") from None
    except OSError as error:
        raise InputError(f"Expected a file system with locks. Received: {folder} ({error.strerror}). Name another --out.") from None
    try:
        yield
    finally:
        lock.release()


def check_folder(folder: Path, plan: Plan) -> None:
    """Checks that a folder is new, empty, or contains a finished or unfinished data set of the same plan.

    Args:
        folder: The folder; it is not changed.
        plan: The plan of the data set.

    Raises:
        InputError: If the folder contains something else, or a data set with other settings.
    """
    if not folder.is_dir():
        return
    names = {path.name for path in folder.iterdir()} - {_LOCK}
    if MANIFEST in names:
        kept, asked = read_manifest(folder)["settings"], json.loads(json.dumps(plan.settings()))
        for name in asked:
            if kept.get(name) != asked[name]:
                was, now = (json.dumps(each.get(name))[:100] for each in (kept, asked))
                raise InputError(f"Expected {name} as in the data set in {folder}: {was}. Received: {now}. Give another --out.")
        return
    others = sorted(name for name in names if name != JOURNAL and not _SHARD.fullmatch(name) and not _LEFT.fullmatch(name))
    shards = {name: int(found[1]) for name in sorted(names) if (found := _SHARD.fullmatch(name))}
    others += [name for name, number in shards.items() if number >= plan.num_shards or _key_in(folder / name) != plan.key]
    if others:
        raise InputError(f"Expected a new folder, or one of this data set. Received: {folder}, which contains {others[0]!r}. Give another.")


def _key_in(path: Path) -> str | None:
    """Returns the plan's key stored in a shard, or None if it cannot be read."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return (pq.read_schema(path).metadata or {}).get(b"settings", b"").decode()
    except (OSError, ValueError, pa.ArrowException):
        return None


def read_manifest(folder: Path) -> dict[str, Any]:
    """Reads and validates the manifest of a data set.

    Args:
        folder: Folder of the data set.

    Raises:
        InputError: If the manifest is missing or damaged.
    """
    path = folder / MANIFEST
    try:
        content = read_json(path, _MOST_BYTES)
        if not isinstance(content, dict):
            raise ValueError("not a JSON object")
        if content["format"] != FORMAT:
            raise InputError(
                f"Expected a data set of the format {FORMAT}. Received: {str(content['format'])[:80]!r} in {folder}. Generate it again in another --out."
            )
        settings, shards = content["settings"], content["shards"]
        counts = [settings["windows"], settings["shard"], settings["window"]]
        if (
            any(type(count) is not int or not 1 <= count <= MOST_WINDOWS for count in counts)
            or counts[2] > MOST_VALUES
            or type(settings["interval_s"]) is not float
        ):
            raise ValueError("settings that no data set has")
        if not isinstance(settings["models"], list) or not (shards is None or isinstance(shards, list)):
            raise ValueError("settings that no data set has")
        content["shards"] = None if shards is None else [_record_of(number, each) for number, each in enumerate(shards)]
    except FileNotFoundError:
        raise InputError(f"Expected a data set written by `generate`. Received: {folder}, without a {MANIFEST}.") from None
    except InputError:
        raise
    except (OSError, ValueError, KeyError, TypeError) as error:
        reason = " ".join(str(error).split())[:80]
        raise InputError(
            f"Expected an undamaged {MANIFEST}. Received: a damaged one in {folder} ({type(error).__name__}: {reason}). "
            "Remove it and run `generate` again, which generates all shards again."
        ) from None
    return content


def _record_of(number: int, content: Mapping[str, Any]) -> Record:
    record = Record(number, content["rows"], content["sha256"])
    if not _is_record(record) or content["file"] != shard_file(number):
        raise ValueError(f"what is recorded of shard {number}")
    return record


def _is_record(record: Record) -> bool:
    return [type(each) for each in record] == [int, int, str] and _SHA256.fullmatch(record.sha256) is not None


def read_records(folder: Path) -> dict[int, Record]:
    """Reads the records of all finished shards from the manifest and the journal. Invalid lines are ignored.

    Args:
        folder: Folder of the data set.

    Returns:
        The records by the number of the shard.
    """
    records = {record.shard: record for record in read_manifest(folder)["shards"] or ()}
    if not (folder / JOURNAL).exists():
        return records
    with open(folder / JOURNAL, "rb") as journal:
        while line := journal.readline(_LONGEST_LINE):
            try:
                record = Record(*json.loads(line))
            except (ValueError, TypeError, RecursionError):
                continue
            if _is_record(record):
                records[record.shard] = record
    return records


def remove_temporary_files(folder: Path) -> None:
    """Removes incomplete files of a killed process."""
    for path in folder.iterdir():
        if _LEFT.fullmatch(path.name):
            path.unlink(missing_ok=True)


def start_manifest(folder: Path, plan: Plan) -> None:
    """Writes a manifest without records, if there is no manifest yet."""
    if not (folder / MANIFEST).exists():
        (folder / JOURNAL).unlink(missing_ok=True)
        write_json(folder / MANIFEST, {"format": FORMAT, "settings": plan.settings(), "shards": None})


@contextlib.contextmanager
def open_journal(folder: Path) -> Iterator[Callable[[Record], None]]:
    """Opens the journal and yields a function that appends a record and flushes it.

    If the last line is incomplete, the first record begins on a new line.

    Args:
        folder: Folder of the data set.
    """
    with open(folder / JOURNAL, "ab") as journal:
        journal.write(b"\n" if journal.tell() else b"")

        def write(record: Record) -> None:
            journal.write(json.dumps(record).encode() + b"\n")
            journal.flush()

        yield write


def finish_manifest(folder: Path, plan: Plan, records: Mapping[int, Record]) -> None:
    """Writes the manifest of a finished data set and removes the journal.

    Args:
        folder: Folder of the data set.
        plan: The plan of the data set.
        records: The records of all shards, by the number of the shard.
    """
    shards = [
        {"file": shard_file(number), "rows": records[number].rows, "sha256": records[number].sha256} for number in range(plan.num_shards)
    ]
    write_json(folder / MANIFEST, {"format": FORMAT, "settings": plan.settings(), "shards": shards})
    (folder / JOURNAL).unlink(missing_ok=True)


def is_intact(folder: Path, record: Record) -> bool:
    """Whether the file of a shard exists and has the recorded checksum."""
    try:
        return sha256(folder / shard_file(record.shard)) == record.sha256
    except OSError:
        return False


def find_problems(folder: str | os.PathLike) -> Iterable[str]:
    """Verifies a data set against its manifest and yields one line for each problem.

    Args:
        folder: Folder of the data set.

    Raises:
        InputError: If the folder is not a data set, or if its manifest is damaged.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    folder = Path(folder)
    manifest = read_manifest(folder)
    settings, records = manifest["settings"], manifest["shards"]
    expected = -(-settings["windows"] // settings["shard"])
    if records is None:
        yield f"not finished: {len(read_records(folder)):,} of {expected:,} shards are recorded; run the same `generate` again"
        return
    if len(records) != expected or sum(record.rows for record in records) != settings["windows"]:
        yield f"{MANIFEST}: {len(records):,} shards recorded of {expected:,}, {sum(record.rows for record in records):,} windows"
    schema = shard_schema(settings, plan_key(settings))
    for record in records:
        path = folder / shard_file(record.shard)
        if not path.is_file():
            yield f"{path.name}: missing"
        elif not is_intact(folder, record):
            yield f"{path.name}: its checksum differs from the recorded one"
        else:
            try:
                num_rows, found = pq.read_metadata(path).num_rows, pq.read_schema(path)
            except (OSError, ValueError, pa.ArrowException):
                yield f"{path.name}: not a Parquet file"
                continue
            if num_rows != record.rows:
                yield f"{path.name}: {num_rows:,} windows, {record.rows:,} recorded"
            if not found.equals(schema) or found.metadata != schema.metadata:
                yield f"{path.name}: its columns or settings differ from those of the manifest"
    known = {shard_file(record.shard) for record in records}
    for path in sorted(folder.iterdir()):
        if path.name not in known and (_SHARD.fullmatch(path.name) or path.name == JOURNAL):
            yield f"{path.name}: not a file of this data set"
