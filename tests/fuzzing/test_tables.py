"""Tables and arrays of any content are read, or refused in one line."""

import io
import json

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from enhsim_tf.telemetry.cleaning.clean import Cleaning, clean
from enhsim_tf.telemetry.sources import read_source
from tests.fuzzing.readers import LONG, all_of, changed, judge, tried

NUM = 60
WAVE = np.round(np.sin(np.arange(NUM) / 5), 3)


def use(source):
    """Reads and cleans every channel of a source, refusing and dropping bad cells."""

    def channels(cleaning):
        for series in read_source(source, options=cleaning).values():
            cleaned = clean(series, cleaning)
            record = json.dumps(cleaned.report.to_dict(), allow_nan=False)
            assert all(line.isprintable() for line in (*cleaned.report.lines(), record))
            assert all(np.isfinite(part.values).all() and len(part) for part in cleaned.parts)

    all_of(lambda: channels(Cleaning()), lambda: channels(Cleaning(interval_s=1.0, drop_bad=True)))


def read_file(name, data, folder):
    (folder / name).write_bytes(data)
    all_of(lambda: use(folder / name), lambda: read_source(folder / name, ["value"], "time"))


def csv_seeds():
    times = pd.date_range("2024-10-27", periods=NUM, freq="h")
    frames = [
        pd.DataFrame({"time": times, "value": WAVE}).to_csv(index=False),
        pd.DataFrame({"time": times.tz_localize("UTC"), "value": WAVE, "word": "on"}).to_csv(
            index=False
        ),
        pd.DataFrame({"time": np.arange(NUM) * 60, "value": WAVE}).to_csv(
            index=False, sep=";", decimal=","
        ),
        "# made by hand\n# twice\nvalue\n" + "\n".join(map(str, WAVE)),
        'time,"a ""b""",c\n2024-01-01 00:00:59,1,x\n2024-01-01 00:00:60,,y\n2024-01-01 00:01:01,nan,1e5\n'
        * 3,
    ]
    return [text.encode() for text in frames] + [
        frames[0].encode("utf-16"),
        frames[1].replace("word", "Größe").encode("latin-1"),
    ]


def parquet_of(table, **options):
    sink = io.BytesIO()
    pq.write_table(table, sink, **options)
    return sink.getvalue()


def tables():
    times = pd.date_range("2024-01-01", periods=NUM, freq="min")
    frames = [
        pd.DataFrame({"time": times, "value": WAVE}),
        pd.DataFrame(
            {"value": WAVE.astype(np.float32)},
            index=pd.DatetimeIndex(times, tz="Europe/Berlin", name="t"),
        ),
        pd.DataFrame(
            {"time": times.astype(str), "value": [f"{value}" for value in WAVE], "flag": WAVE > 0}
        ),
        pd.DataFrame(
            {
                "value": pd.Categorical([1.5, 2.5, 3.5] * 20),
                "day": times.date,
                "span": times - times[0],
            }
        ),
    ]
    nested = pa.table(
        {
            "value": pa.array([[1.0, 2.0]] * 9),
            "s": pa.array([{"a": 1}] * 9),
            "n": pa.nulls(9),
            "b": pa.array([b"x"] * 9),
        }
    )
    odd = pa.table(
        {
            "value": pa.array([1, 2, 3], pa.decimal128(10, 2)),
            "time": pa.array([1, 2, 3], pa.date32()),
        }
    )
    return [*map(pa.Table.from_pandas, frames), nested, odd]


def parquet_seeds():
    return [parquet_of(table) for table in tables()] + [
        parquet_of(tables()[0], compression="zstd", use_dictionary=False)
    ]


def npy_of(array):
    sink = io.BytesIO()
    np.lib.format.write_array(sink, array)
    return sink.getvalue()


def npy_seeds():
    archive = io.BytesIO()
    np.savez(archive, value=WAVE)
    arrays = [
        WAVE,
        np.stack([WAVE, WAVE], 1),
        (100 * WAVE).astype(">i2"),
        WAVE.astype("U8"),
        WAVE > 0,
        WAVE + 0j,
        np.array([None, "a"]),
        np.arange(NUM).astype("datetime64[s]"),
        np.zeros(3, [("a", "f4")]),
        np.zeros((2, 3, 4)),
        np.array(1.0),
    ]
    return [npy_of(array) for array in arrays] + [archive.getvalue()]


FILES = {"x.csv": csv_seeds(), "x.parquet": parquet_seeds(), "x.npy": npy_seeds()}
FOUND = [  # inputs that once were neither accepted nor refused well
    ("x.npy", b"\x93NUMPY\x02\x00\x42\x00\x00\x00{'descr': '<U1', 'fortran_order': False, 'shape': (3,), }         \n" + b"\xff\xd8\xff\x00" * 3),
    ("x.npy", b"PK\x03\x04-\x00\x00\x00"),
    ("x.npy", b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (60,), }" + b" " * 20 + b"("),
]  # fmt: skip


@pytest.mark.parametrize("name", FILES)
def test_files_as_they_were_written_are_accepted(name):
    assert judge(read_file, name, FILES[name][0])


@pytest.mark.parametrize(("name", "data"), FOUND)
def test_what_once_failed_is_refused(name, data):
    assert not judge(read_file, name, data)


@pytest.mark.parametrize("name", FILES)
@tried(100)
@given(st.data())
def test_changed_files(name, data):
    judge(read_file, name, data.draw(changed(FILES[name]) | st.binary(max_size=300)))


def test_a_time_too_far_off_for_its_zone_is_refused(tmp_path, refused):
    times = (
        pd.DatetimeIndex(np.array([0, 60, 10**12]).view("datetime64[s]"))
        .tz_localize("UTC")
        .tz_convert("Europe/Berlin")
    )
    pd.DataFrame({"time": times, "value": [1.0, 2.0, 3.0]}).to_parquet(tmp_path / "x.parquet")
    with refused("a time out of range", "row 2"):
        read_source(tmp_path / "x.parquet")


@pytest.mark.parametrize("piece", LONG, ids=range(len(LONG)))
def test_long_names_and_cells_are_read_or_refused(piece):
    seeds = csv_seeds()
    judge(read_file, "x.csv", seeds[2].replace(b"value", piece.encode(), 1))
    judge(read_file, "x.csv", seeds[2].replace(b"\n60;", b"\n60;" + piece.encode(), 1))
    judge(read_file, "x.csv", seeds[0].replace(b"04:00:00", piece.encode(), 1))


def test_a_line_may_be_longer_than_a_field_of_the_csv_module(tmp_path):
    names = ["time", *(f"channel {number} {'of a bus ' * 12}".strip() for number in range(1_200))]
    assert len(",".join(names)) > 131_072  # the limit of the module
    rows = [",".join(map(str, [second, *[second**2 % 7] * 1_200])) for second in range(12)]
    (tmp_path / "x.csv").write_text("\n".join([",".join(names), *rows]))
    assert list(read_source(tmp_path / "x.csv")) == names[1:]
