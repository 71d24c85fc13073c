"""Files whose headers declare more than they contain are rejected before memory is allocated; intact files are read unchanged."""

import json
import os
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from enhsim_tf.common.size_limits import MAX_COLUMNS, check_parquet, load_npy, load_npz, read_json

ROOT = Path(__file__).parents[2]


def npy(path, descr, shape, content=b""):
    """Writes a `.npy` file with the given header."""
    header = f"{{'descr': {descr!r}, 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    path.write_bytes(b"\x93NUMPY" + bytes([2, 0]) + len(header).to_bytes(4, "little") + header + content)
    return path


@pytest.mark.parametrize("array", [np.arange(6.0), np.asfortranarray(np.arange(6).reshape(2, 3)), np.zeros(0), np.array(1)])
def test_an_array_is_read_as_it_was_written(tmp_path, array):
    np.save(tmp_path / "x.npy", array)
    found = load_npy(tmp_path / "x.npy")
    assert type(found) is np.ndarray and found.dtype == array.dtype and found.shape == array.shape and (found == array).all()
    np.savez_compressed(tmp_path / "x.npz", first=array, second=array)
    kept = load_npz(tmp_path / "x.npz", 10_000)
    assert list(kept) == ["first", "second"] and (kept["second"] == array).all() and kept["second"].shape == array.shape


@pytest.mark.parametrize(
    ("descr", "shape", "word"),
    [
        ("<f8", (10**12,), "greater than file"),
        ("<f8", (10**30,), "too large"),
        ("<f8", (-1,), "negative"),
        ("|S0", (10**12,), "no numbers"),
        ("|O", (60,), "objects"),
        ("<U2", (60,), "no numbers"),
        ([("a", "<f8")], (60,), "no numbers"),
    ],
)
def test_an_array_with_a_wrong_header_is_refused(tmp_path, descr, shape, word):
    with pytest.raises(ValueError, match=word):
        load_npy(npy(tmp_path / "x.npy", descr, shape, b"\xff" * 480))


def repeated(num_rows, word=1.5):
    """A table of many equal rows, which Parquet stores as one row and a count."""
    cells = pa.DictionaryArray.from_arrays(pa.array(np.zeros(num_rows, np.int32)), pa.array([word]))
    return pa.table({"value": cells if isinstance(word, (str, bytes)) else cells.cast(cells.type.value_type)})


def fixed_width():
    wide = pa.array([b"w" * 1_000_000], pa.binary(1_000_000)).dictionary_encode()
    return pa.table({"x": pa.DictionaryArray.from_arrays(pa.array(np.zeros(300, np.int32)), wide.dictionary)})  # 0.3 GB


EXPANDING = {
    "15,000,000 values": lambda: repeated(15_000_000),
    "6,000,000 values": lambda: pa.table({"x": pa.array([[0.0] * 100_000] * 60, pa.list_(pa.float64()))}),  # 48 MB in few rows
    "text that becomes": lambda: repeated(10_000, "long " * 20_000),
    "text that becomes 268": fixed_width,
    "columns": lambda: pa.table({str(number): [1.0] for number in range(MAX_COLUMNS + 1)}),
}


@pytest.mark.parametrize("word", EXPANDING)
def test_a_table_that_expands_in_memory_is_refused(tmp_path, word):
    pq.write_table(EXPANDING[word](), tmp_path / "x.parquet", compression="zstd", store_schema=False)
    assert word == "columns" or (tmp_path / "x.parquet").stat().st_size < 150_000
    with pytest.raises(ValueError, match=word):
        check_parquet(tmp_path / "x.parquet")


def test_tables_of_telemetry_pass(tmp_path):
    path, rng = tmp_path / "x.parquet", np.random.default_rng(0)
    times = pd.date_range("2024-01-01", periods=300_000, freq="s")
    for values in (rng.standard_normal(len(times)).astype(np.float32), np.round(np.sin(np.arange(len(times)) / 90), 1)):
        pd.DataFrame({"time": times, "value": values}).to_parquet(path)
        check_parquet(path)
    pd.DataFrame({"time": times[:100_000].astype(str), "value": values[:100_000], "mode": "nominal operation"}).to_parquet(path)
    check_parquet(path)


@pytest.mark.parametrize("content", [b"[" * 100_000, b"{", b'{"a": ' * 50_000, b"\xed\xa0\x80", b" " * 2_000])
def test_invalid_too_large_or_too_deeply_nested_json_is_refused(tmp_path, content):
    (tmp_path / "x.json").write_bytes(content)
    with pytest.raises(ValueError, match=r".+"):
        read_json(tmp_path / "x.json", 1_000 if content == b" " * 2_000 else 10**7)
    (tmp_path / "x.json").write_text(json.dumps({"a": [1, None]}))
    assert read_json(tmp_path / "x.json", 100) == {"a": [1, None]}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_a_pipe_is_refused_without_blocking(tmp_path):
    os.mkfifo(tmp_path / "x.json")
    with pytest.raises(ValueError, match="not a regular file"):
        read_json(tmp_path / "x.json", 100)


MANIFEST = '{"format": "enhsim_tf.datasets.generate/2", "settings": {"windows": 1000000000, "shard": 1, "window": 1, "interval_s": 1.0, "models": []}'
BOMBS = {
    "npy": lambda path: npy(path, "<f8", (10**12,), bytes(80)),
    "parquet": lambda path: pq.write_table(repeated(1_000_000, "long " * 20_000), path, compression="zstd", store_schema=False),  # 100 GB
    "_manifest.json": lambda path: path.write_text(MANIFEST + ', "shards": [' + "{}," * 300_000 + "{}]}"),
}
READS = """
import resource, sys
from pathlib import Path
from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.sources import read_source
from enhsim_tf.datasets.folder import find_problems
import pyarrow.parquet, pandas
path = Path(sys.argv[1])
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    list(find_problems(path.parent)) if path.suffix == ".json" else read_source(path)
except InputError as error:
    print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) // 1024, error)
"""


@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_is_refused_in_one_line_and_little_memory(tmp_path, name):
    path = tmp_path / ("x." + name if name != "_manifest.json" else name)
    BOMBS[name](path)
    limit = 4 * 2**30  # of address space; the memory used is printed
    ended = subprocess.run(
        [sys.executable, "-c", READS, path],
        cwd=ROOT,
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
    )
    assert ended.returncode == 0 and not ended.stderr, ended.stderr[-2_000:]
    (line,) = ended.stdout.splitlines()
    assert int(line.split(" ")[0]) < 1_024 and "Expected" in line
