"""Tests of the Parquet store: series are restored bit for bit, and no other files are changed."""

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.telemetry.parquet_store import ParquetStore
from enhsim_tf.telemetry.series import Telemetry
from tests.telemetry.round_trips import BEYOND, ROUND_TRIPS, same, series


@pytest.mark.parametrize("about", ROUND_TRIPS.values(), ids=ROUND_TRIPS)
def test_round_trip_to_the_bit(tmp_path, about):
    kept = series(**about)
    ParquetStore(tmp_path / "store").write(kept)
    read = ParquetStore(tmp_path / "store").read(kept.name)
    assert same(kept, read) and read.values.dtype == np.float32


@pytest.mark.parametrize("about", BEYOND, ids=str)
def test_times_outside_the_nanosecond_range_are_refused(tmp_path, about, refused):
    with refused("time"):
        ParquetStore(tmp_path).write(series(**about))
    assert not any(tmp_path.iterdir())


def test_pandas_reads_the_one_file_per_day(tmp_path):
    kept = series(60, interval_s=3_600.0, start="2020-02-28T20:00:00+02:00", name="wheel")
    ParquetStore(tmp_path).write(kept)
    files = sorted(path.name for path in (tmp_path / "wheel").iterdir())
    assert files == ["2020-02-28.parquet", "2020-02-29.parquet", "2020-03-01.parquet", "2020-03-02.parquet"]
    table = pd.read_parquet(tmp_path / "wheel").sort_values("time")
    assert (table["value"].to_numpy() == kept.values).all()
    assert (table["time"] == pd.date_range("2020-02-28T18:00:00Z", periods=60, freq="h")).all(), "the zone of a start counts"


@pytest.mark.parametrize("wrong", [series(10, name=""), series(0)], ids=["no name", "no samples"])
def test_a_series_without_a_name_or_samples_is_refused(tmp_path, refused, wrong):
    ParquetStore(tmp_path).write(series(10, name="neighbour"))
    with refused(f"{len(wrong)} samples, name={wrong.name!r}"):
        ParquetStore(tmp_path).write(wrong)
    assert ParquetStore(tmp_path).names() == ["neighbour"]


def test_a_folder_with_other_files_is_left_unchanged(tmp_path, refused):
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "thesis.tex").write_text("mine")
    (tmp_path / "notes").write_text("mine")
    for name, what in (("docs", "thesis.tex"), ("notes", "a file")):
        with refused(what):
            ParquetStore(tmp_path).write(Telemetry(np.arange(3.0, dtype=np.float32), name=name))
    assert (tmp_path / "docs" / "thesis.tex").read_text() == (tmp_path / "notes").read_text() == "mine"


def hours(seed=0):
    """Three days of telemetry."""
    return series(72, seed, interval_s=3_600.0, start="2020-03-01", name="wheel")


@pytest.mark.parametrize("content", [None, b"", b"PAR1 and no more", b"PAR1" + bytes(20) + b"\x14\0\0\0PAR1"])
def test_a_missing_or_damaged_day_is_noticed(tmp_path, refused, content):
    ParquetStore(tmp_path).write(hours())
    day = tmp_path / "wheel" / "2020-03-02.parquet"
    day.unlink()
    if content is not None:
        day.write_bytes(content)
    with refused("wheel"):
        ParquetStore(tmp_path).read("wheel")


def test_a_parquet_file_of_another_program_is_refused(tmp_path, refused):
    (tmp_path / "wheel").mkdir()
    pd.DataFrame({"t": [1, 2], "x": [3, 4]}).to_parquet(tmp_path / "wheel" / "part.parquet")
    with refused("wheel"):
        ParquetStore(tmp_path).read("wheel")


def test_writing_again_replaces_the_old_series(tmp_path):
    store, kept = ParquetStore(tmp_path), series(10, seed=1, name="wheel")
    store.write(hours())
    store.write(kept)
    assert same(kept, store.read("wheel")) and len(list(tmp_path.rglob("*.parquet"))) == 1


def test_a_failed_write_keeps_the_old_series(tmp_path, monkeypatch):
    import pyarrow.parquet

    store, kept = ParquetStore(tmp_path), hours()
    store.write(kept)
    write, written = pyarrow.parquet.write_table, []

    def full_disk(table, file, **options):
        if written:
            raise OSError("no space left")
        written.append(file)
        write(table, file, **options)

    monkeypatch.setattr(pyarrow.parquet, "write_table", full_disk)
    with pytest.raises(OSError, match="no space left"):
        store.write(hours(seed=1))
    assert written and same(kept, store.read("wheel"))
    assert [path.name for path in tmp_path.iterdir()] == ["wheel"]


def test_an_unknown_name_lists_the_stored_names(tmp_path, refused):
    store = ParquetStore(tmp_path / "store")
    for names, said in (([], "it is empty"), (["wheel", "a/b"], "a/b, wheel")):
        for name in names:
            store.write(series(10, name=name))
        assert store.names() == sorted(names)
        with refused(said, "'orbit'"):
            store.read("orbit")


def test_folder_that_cannot_be_made_is_refused(tmp_path, refused):
    (tmp_path / "taken").write_text("x")
    with refused("taken"):
        ParquetStore(tmp_path / "taken").write(series(10))
