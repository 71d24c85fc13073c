"""Targets that read telemetry: tables, arrays, a store's folder, labelled channels, saved arrays."""

import io
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from enhsim_tf.enhancer.out_of_range import OutOfRange
from enhsim_tf.telemetry.cleaning.clean import Cleaning, clean
from enhsim_tf.telemetry.parquet_store import ParquetStore
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.sources import read_source, read_telemetry
from enhsim_tf.telemetry.telemanom import load_labelled
from tests.fuzzing.target import Target, UnusedError, all_of, json_of, text_of

_NUM = 60


def _wave() -> np.ndarray:
    return np.round(np.sin(np.arange(_NUM) / 5), 3)


def _use(source: Path | str, **options) -> None:
    """Reads and cleans every channel of a source, refusing and dropping bad cells."""

    def channels(cleaning: Cleaning) -> None:
        for series in read_source(source, options=cleaning, **options).values():
            cleaned = clean(series, cleaning)
            for line in (*cleaned.report.lines(), json.dumps(cleaned.report.to_dict(), allow_nan=False)):
                assert line.isprintable(), line
            assert all(np.isfinite(part.values).all() and len(part) for part in cleaned.parts)

    all_of(lambda: channels(Cleaning()), lambda: channels(Cleaning(interval_s=1.0, on_bad_times="drop", on_bad_values="drop")))


def _file(name: str):
    def run(data: bytes, folder: Path) -> None:
        path = folder / name
        path.write_bytes(data)
        all_of(lambda: _use(path), lambda: read_telemetry(path), lambda: read_telemetry(path, "value", "time"))

    return run


def _csv_seeds() -> list[bytes]:
    times = pd.date_range("2024-10-27", periods=_NUM, freq="h")
    frames = [
        pd.DataFrame({"time": times, "value": _wave()}).to_csv(index=False),
        pd.DataFrame({"time": times.tz_localize("UTC"), "value": _wave(), "word": "on"}).to_csv(index=False),
        pd.DataFrame({"time": np.arange(_NUM) * 60, "value": _wave()}).to_csv(index=False, sep=";", decimal=","),
        pd.DataFrame({"epoch": 1_700_000_000_000 + np.arange(_NUM) * 1_000, "a": _wave(), "b": 1}).to_csv(index=False, sep="\t"),
        "# made by hand\n# twice\nvalue\n" + "\n".join(map(str, _wave())),
        "date,value\n" + "\n".join(f"2024-01-{day:02d}T00:00:00+0{day % 3}:00,{day / 7:.2f}" for day in range(1, 29)),
        'time,"a ""b""",c\n2024-01-01 00:00:59,1,x\n2024-01-01 00:00:60,,y\n2024-01-01 00:01:01,nan,1e5\n' * 3,
    ]
    return [text.encode() for text in frames] + [frames[0].encode("utf-16"), frames[1].replace("word", "Größe").encode("latin-1")]


def _parquet_bytes(table: pa.Table, **options) -> bytes:
    sink = io.BytesIO()
    pq.write_table(table, sink, **options)
    return sink.getvalue()


def _tables() -> list[pa.Table]:
    times = pd.date_range("2024-01-01", periods=_NUM, freq="min")
    frames = [
        pd.DataFrame({"time": times, "value": _wave()}),
        pd.DataFrame({"value": _wave().astype(np.float32)}, index=pd.DatetimeIndex(times, tz="Europe/Berlin", name="t")),
        pd.DataFrame({"time": times.astype(str), "value": [f"{value}" for value in _wave()], "flag": _wave() > 0}),
        pd.DataFrame({"value": pd.Categorical([1.5, 2.5, 3.5] * 20), "day": times.date, "span": times - times[0]}),
        pd.DataFrame({"value": pd.array([1, 2, None] * 20, "Int64"), "period": times.to_period("h").astype(str)}),
    ]
    nested = pa.table({"value": pa.array([[1.0, 2.0]] * 9), "s": pa.array([{"a": 1}] * 9), "n": pa.nulls(9), "b": pa.array([b"x"] * 9)})
    odd = {
        "value": pa.array([1, 2, 3], pa.decimal128(10, 2)),
        "time": pa.array([1, 2, 3], pa.date32()),
        "at": pa.array([1, 2, 3], pa.time64("ns")),
    }
    return [*map(pa.Table.from_pandas, frames), nested, pa.table(odd)]


def _parquet_seeds() -> list[bytes]:
    plain = [_parquet_bytes(table) for table in _tables()]
    return plain + [_parquet_bytes(_tables()[0], compression=name, use_dictionary=False) for name in ("none", "zstd", "gzip")]


def _parquet_about(data: bytes, folder: Path) -> None:
    """JSON as the metadata that pandas writes into a Parquet file, and the type of the first column."""
    about = json_of(data)
    number = about.get("table", 0)
    table = _tables()[number if type(number) is int and number in range(7) else 0]
    text = json.dumps(about.get("pandas"))
    _file("x.parquet")(_parquet_bytes(table.replace_schema_metadata({"pandas": text})), folder)


def _parquet_about_seeds() -> list[bytes]:
    return [
        json.dumps({"table": number, "pandas": json.loads((table.schema.metadata or {}).get(b"pandas", b"{}"))}).encode()
        for number, table in enumerate(_tables())
    ]


def _npy_bytes(array: np.ndarray, **options) -> bytes:
    sink = io.BytesIO()
    np.lib.format.write_array(sink, array, **options)
    return sink.getvalue()


def _npy_seeds() -> list[bytes]:
    archive = io.BytesIO()
    np.savez(archive, value=_wave())
    wave = _wave()
    arrays = [wave, wave.astype(np.float32)[:, None], np.stack([wave, wave], 1), (100 * wave).astype(">i2"), wave.astype("U8"), wave > 0]
    arrays += [np.arange(_NUM).astype("datetime64[s]"), np.zeros(3, [("a", "f4"), ("b", "i2")]), wave.astype(np.float16), wave + 0j]
    arrays += [np.asfortranarray(np.stack([wave, wave])), np.array([None, "a"]), np.zeros((2, 3, 4)), np.array(1.0)]
    return [_npy_bytes(array) for array in arrays] + [_npy_bytes(wave, version=(2, 0)), archive.getvalue()]


def _npy_header(data: bytes, folder: Path) -> None:
    """Text as the header of a `.npy` file with a correct length, so that its content is parsed."""
    header = data[:60_000]
    content = b"\x93NUMPY\x02\x00" + len(header).to_bytes(4, "little") + header + bytes(480)
    all_of(lambda: _file("x.npy")(content, folder), lambda: _labelled(content, folder, "train"))


def _npy_header_seeds() -> list[bytes]:
    kinds = ("<f8", "|i1", "<U5", "|S0", "|V8", "<M8[s]", "|O", ">f4")
    shapes = ((60,), (30, 2), (10**12,), (0, 5), (10**6, 10**6), (), (1, 60))
    texts = [f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n" for kind in kinds for shape in shapes]
    return [text.encode() for text in [*texts, "{'descr': [('a', '<f4'), ('b', '<i4')], 'fortran_order': True, 'shape': (60,)}"]]


def _store_file(data: bytes, folder: Path) -> None:
    (folder / "store" / "volts").mkdir(parents=True, exist_ok=True)
    (folder / "store" / "volts" / "2024-01-01.parquet").write_bytes(data)
    _use(folder / "store")


def _series() -> Telemetry:
    return Telemetry(_wave().astype(np.float32), 60.0, 0.0, "2024-01-01T00:00:00+00:00", "volts", "V")


def _store_seeds() -> list[bytes]:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        ParquetStore(folder).write(_series())
        return [file.read_bytes() for file in Path(folder).rglob("*.parquet")] + _parquet_seeds()[:2]


def _store_about(data: bytes, folder: Path) -> None:
    """JSON as the metadata that a store writes into the file of a series."""
    about = {str(key): str(value) for key, value in json_of(data).items()}
    table = pq.read_table(io.BytesIO(_store_seeds()[0]))
    try:
        content = _parquet_bytes(table.replace_schema_metadata(about))
    except UnicodeEncodeError:  # Arrow cannot write surrogates
        raise UnusedError from None
    _store_file(content, folder)


def _store_about_seeds() -> list[bytes]:
    about = {"name": "volts", "unit": "V", "start": "2024-01-01T00:00:00+00:00", "interval_s": "60.0", "offset_s": "0.0"}
    return [json.dumps(each).encode() for each in (about, about | {"start": ""}, about | {"interval_s": "1e-9"})]


def _store_names(data: bytes, folder: Path) -> None:
    """A channel name in a store: its folder is inside the store, and the name is restored."""
    name = text_of(data)
    all_of(lambda: _round_trip(name, folder / "store"), lambda: _use(f"{folder / 'store'}#{name}"), lambda: ParquetStore(folder).read(name))


def _round_trip(name: str, folder: Path) -> None:
    series = Telemetry(_wave().astype(np.float32), 60.0, 0.0, None, name)
    store = ParquetStore(folder)
    store.write(series)
    (channel,) = folder.iterdir()
    assert store.names() == [name] and store.read(name).name == name
    assert {path.parent for path in folder.parent.rglob("*.parquet")} == {channel}


def _labels(data: bytes, folder: Path) -> None:
    _labelled(None, folder, "train")
    (folder / "labelled" / "labeled_anomalies.csv").write_bytes(data)
    for channel in load_labelled(folder / "labelled"):
        assert len(channel.is_anomalous) == len(channel.test)


def _labelled(data: bytes | None, folder: Path, part: str) -> None:
    for each in ("train", "test"):
        (folder / "labelled" / each).mkdir(parents=True, exist_ok=True)
        content = data if each == part and data is not None else _npy_bytes(np.stack([_wave(), _wave()], 1))
        (folder / "labelled" / each / "A-1.npy").write_bytes(content)
    (folder / "labelled" / "labeled_anomalies.csv").write_bytes(_label_seeds()[0])
    if data is not None:
        list(load_labelled(folder / "labelled"))


def _label_seeds() -> list[bytes]:
    head = "chan_id,spacecraft,anomaly_sequences,class,num_values\n"
    return [
        f'{head}A-1,SMAP,"[[10, 20], [30, 40]]","[point, contextual]",60\n'.encode(),
        f'{head}A-1,MSL,"[[0, 5]]",[point],60\nA-1,MSL,"[[3, 9]]",[point],60\n'.encode(),
        b'chan_id,anomaly_sequences\nA-1,"[[1, 1000]]"\n\n',
    ]


def _saved_score(data: bytes, folder: Path) -> None:
    (folder / "x.npz").write_bytes(data)
    score = OutOfRange.load(folder / "x.npz")
    score.score(np.zeros((2, 8)))


def _saved_score_seeds() -> list[bytes]:
    import tempfile

    rng = np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as folder:
        score = OutOfRange()
        score.fit(rng.standard_normal((30, 8)))
        score.save(Path(folder) / "x.npz")
        return [(Path(folder) / "x.npz").read_bytes(), _npy_seeds()[-1]]


TARGETS = {
    "csv table": Target(_file("x.csv"), _csv_seeds, "text", 3),
    "parquet table": Target(_file("x.parquet"), _parquet_seeds, "bytes", 3),
    "what pandas says of a parquet table": Target(_parquet_about, _parquet_about_seeds, "json", 1),
    "npy array": Target(_file("x.npy"), _npy_seeds, "bytes", 3),
    "header of an npy array": Target(_npy_header, _npy_header_seeds, "text", 3),
    "parquet file of a store": Target(_store_file, _store_seeds, "bytes", 1),
    "description in a store": Target(_store_about, _store_about_seeds, "json", 1),
    "name of a channel in a store": Target(_store_names, lambda: [b"volts", "Größe/1 %".encode(), b"a.b"], "text", 1),
    "labels": Target(_labels, _label_seeds, "text", 4),
    "labelled array": Target(lambda data, folder: _labelled(data, folder, "test"), _npy_seeds, "bytes", 4),
    "saved score npz": Target(_saved_score, _saved_score_seeds, "bytes", 2),
}
