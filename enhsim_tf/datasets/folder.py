"""A data set at rest: a folder of shards, `_manifest.json`, and while it is being made `_journal.jsonl` and `.lock`.

The manifest says what the data set is and, once it is finished, what is recorded of each shard. Until then a line is added
to the journal for each shard; a line that was not written to its end counts for nothing, and its shard is made again.
Nothing is believed that its checksum does not show: files are read again before a run goes on behind them.
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
from enhsim_tf.datasets.plan import FORMAT, MOST_VALUES, Plan, key_of
from enhsim_tf.datasets.scenario_file import MOST_WINDOWS
from enhsim_tf.datasets.shard import Record, file_of, schema_of

MANIFEST, JOURNAL, _LOCK = "_manifest.json", "_journal.jsonl", ".lock"  # readers of a folder of Parquet files pass over such names
_SHARD = re.compile(r"shard-(\d{6,})\.parquet")
_LEFT = re.compile(r"\.(shard-\d{6,}\.parquet|_manifest\.json)\..*")  # a temporary name of `replace_file`
_SHA256 = re.compile("[0-9a-f]{64}")
_MOST_BYTES = 1_000_000_000  # of a manifest
_LONGEST_LINE = 1_000  # of the journal, in bytes; what is longer comes in pieces without sense


@contextlib.contextmanager
def held(folder: Path) -> Iterator[None]:
    """Holds a folder against other runs; the system lets go of it when this process ends, however it ends.

    Raises:
        InputError: If another run holds it.
        OSError: If it cannot be written to.
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
    """Refuses a folder that holds anything but a data set of this plan, finished or not.

    Raises:
        InputError: If it holds something else, or a data set of other settings; nothing is written then.
    """
    if not folder.is_dir():
        return
    names = {path.name for path in folder.iterdir()} - {_LOCK}
    if MANIFEST in names:
        kept, asked = read_manifest(folder)["settings"], json.loads(json.dumps(plan.settings()))
        for name in asked:
            if kept.get(name) != asked[name]:
                was, now = (json.dumps(each.get(name))[:100] for each in (kept, asked))
                raise InputError(f"Expected {name} as this data set was begun: {was}. Received: {now}. Name another --out than {folder}.")
        return
    others = sorted(name for name in names if name != JOURNAL and not _SHARD.fullmatch(name) and not _LEFT.fullmatch(name))
    shards = {name: int(found[1]) for name in sorted(names) if (found := _SHARD.fullmatch(name))}
    others += [name for name, number in shards.items() if number >= plan.num_shards or _key_in(folder / name) != plan.key]
    if others:
        raise InputError(f"Expected a new folder, or one of this data set. Received: {folder}, which holds {others[0]!r}. Name another.")


def _key_in(path: Path) -> str | None:
    """The key that a shard carries; None where it cannot be read."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return (pq.read_schema(path).metadata or {}).get(b"settings", b"").decode()
    except (OSError, ValueError, pa.ArrowException):
        return None


def read_manifest(folder: Path) -> dict[str, Any]:
    """The manifest of a data set, its form checked.

    Raises:
        InputError: If there is none, or a damaged one.
    """
    path = folder / MANIFEST
    try:
        content = read_json(path, _MOST_BYTES)
        if not isinstance(content, dict) or content["format"] != FORMAT:
            raise ValueError("another format")
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
        raise InputError(f"Expected a data set that `generate` made. Received: {folder}, without a {MANIFEST}.") from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        reason = " ".join(str(error).split())[:80]
        raise InputError(
            f"Expected {MANIFEST} as it was written. Received: a damaged one in {folder} ({type(error).__name__}: {reason}). "
            "Remove it and run `generate` again: the shards are made again."
        ) from None
    return content


def _record_of(number: int, content: Mapping[str, Any]) -> Record:
    record = Record(number, content["rows"], content["sha256"])
    if not _is_record(record) or content["file"] != file_of(number):
        raise ValueError(f"what is recorded of shard {number}")
    return record


def _is_record(record: Record) -> bool:
    return [type(each) for each in record] == [int, int, str] and _SHA256.fullmatch(record.sha256) is not None


def read_records(folder: Path) -> dict[int, Record]:
    """What is recorded of the shards, in the manifest and then in the journal; lines without sense are left out."""
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


def clear(folder: Path) -> None:
    """Removes what a killed process left half written."""
    for path in folder.iterdir():
        if _LEFT.fullmatch(path.name):
            path.unlink(missing_ok=True)


def begin(folder: Path, plan: Plan) -> None:
    """Writes the manifest of a data set that is begun, where there is none."""
    if not (folder / MANIFEST).exists():
        (folder / JOURNAL).unlink(missing_ok=True)
        write_json(folder / MANIFEST, {"format": FORMAT, "settings": plan.settings(), "shards": None})


@contextlib.contextmanager
def journal_of(folder: Path) -> Iterator[Callable[[Record], None]]:
    """Yields what adds a record to the journal, at once and behind a torn line if there is one."""
    with open(folder / JOURNAL, "ab") as journal:
        journal.write(b"\n" if journal.tell() else b"")

        def write(record: Record) -> None:
            journal.write(json.dumps(record).encode() + b"\n")
            journal.flush()

        yield write


def finish(folder: Path, plan: Plan, records: Mapping[int, Record]) -> None:
    """Writes the manifest of a finished data set; the journal is needed no more.

    Args:
        folder: The data set.
        plan: What it is.
        records: What is recorded of each of its shards.
    """
    shards = [
        {"file": file_of(number), "rows": records[number].rows, "sha256": records[number].sha256} for number in range(plan.num_shards)
    ]
    write_json(folder / MANIFEST, {"format": FORMAT, "settings": plan.settings(), "shards": shards})
    (folder / JOURNAL).unlink(missing_ok=True)


def is_whole(folder: Path, record: Record) -> bool:
    """Whether a shard's file is there and as it was recorded."""
    try:
        return sha256(folder / file_of(record.shard)) == record.sha256
    except OSError:
        return False


def problems_of(folder: str | os.PathLike) -> Iterable[str]:
    """Checks a finished data set against its manifest, and yields a line for each thing that is wrong.

    Raises:
        InputError: If it is no data set, or its manifest is damaged.
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
    schema = schema_of(settings, key_of(settings))
    for record in records:
        path = folder / file_of(record.shard)
        if not path.is_file():
            yield f"{path.name}: missing"
        elif not is_whole(folder, record):
            yield f"{path.name}: its checksum is not the one that was recorded"
        else:
            try:
                num_rows, found = pq.read_metadata(path).num_rows, pq.read_schema(path)
            except (OSError, ValueError, pa.ArrowException):
                yield f"{path.name}: no Parquet file"
                continue
            if num_rows != record.rows:
                yield f"{path.name}: {num_rows:,} windows, {record.rows:,} recorded"
            if not found.equals(schema) or found.metadata != schema.metadata:
                yield f"{path.name}: other columns or settings than the manifest's"
    known = {file_of(record.shard) for record in records}
    for path in sorted(folder.iterdir()):
        if path.name not in known and (_SHARD.fullmatch(path.name) or path.name == JOURNAL):
            yield f"{path.name}: not of this data set"
