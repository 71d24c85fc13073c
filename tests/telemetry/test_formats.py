"""Files of every registered kind are read with the values and times that were written."""

import gzip
import json

import h5py
import numpy as np
import openpyxl
import pandas as pd
import pyarrow as pa
import pytest
import scipy.io

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.cleaning.clean import Cleaning, clean
from enhsim_tf.telemetry.reading.formats import READERS
from enhsim_tf.telemetry.sources import read_source, read_telemetry

N = 80
VALUES = (20 + 5 * np.sin(np.arange(N) / 5)).round(3)
SECONDS = 0.5 * np.arange(N)
MINUTES = pd.date_range("2024-03-01", periods=N, freq="min").strftime("%Y-%m-%dT%H:%M:%S")
ARRAYS = {"time": SECONDS, "volts": VALUES, "amps": 2 * VALUES}
FRAME = pd.DataFrame(ARRAYS)


def read(source, **cleaning):
    """The one series of a source."""
    (telemetry,) = read_telemetry(source, Cleaning(**cleaning))
    return telemetry


def check(telemetry, interval_s=0.5):
    """Checks that telemetry has the values and the interval of the frame."""
    assert telemetry.interval_s == interval_s
    np.testing.assert_allclose(telemetry.values, FRAME[["volts", "amps"]], rtol=1e-6)


def hdf5(path, **groups):
    with h5py.File(path, "w") as file:
        for name, frame in groups.items():
            for column in frame:
                file[f"{name}/{column}"] = frame[column].to_numpy()
    return path


def matlab_7_3(path):
    """Axes in reverse order, behind a block that says so, as MATLAB 7.3 writes them."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for column in FRAME:
            file[column] = FRAME[column].to_numpy()[None]
    content = path.read_bytes()
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512, b" ") + content[512:])


def json_lines(path):
    FRAME.to_json(path, orient="records", lines=True)


WRITERS = {
    ".parquet": FRAME.to_parquet,
    ".xlsx": lambda path: FRAME.to_excel(path, index=False),
    ".xlsm": lambda path: FRAME.to_excel(path, index=False, engine="openpyxl"),
    ".mat": lambda path: scipy.io.savemat(path, ARRAYS),
    ".h5": lambda path: hdf5(path, log=FRAME),
    ".hdf5": lambda path: hdf5(path, log=FRAME),
    ".jsonl": json_lines,
    ".ndjson": json_lines,
    ".json": lambda path: FRAME.to_json(path, orient="records"),
}
OTHERS = {
    ".dat": lambda path: FRAME.to_csv(path, index=False, sep="\t"),
    ".log.gz": lambda path: path.write_bytes(gzip.compress(FRAME.to_csv(index=False).encode())),
    ".parquet.gz": lambda path: path.write_bytes(gzip.compress(FRAME.to_parquet())),
    "_struct.mat": lambda path: scipy.io.savemat(path, {"log": ARRAYS, "rate": 2.0}),
    "_7_3.mat": matlab_7_3,
}


def test_every_registered_kind_has_a_writer_here():
    assert set(WRITERS) == set(READERS)


@pytest.mark.parametrize("ending", [*WRITERS, *OTHERS])
def test_a_file_is_read_as_it_was_written(tmp_path, ending):
    (WRITERS | OTHERS)[ending](path := tmp_path / f"a{ending}")
    telemetry = read(path)
    assert sorted(telemetry.columns) == ["amps", "volts"]
    check(telemetry.select(["volts", "amps"]))


def test_a_matrix_has_a_channel_in_each_column(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"time": SECONDS, "x": np.stack([VALUES, -VALUES], 1)})
    telemetry = read(tmp_path / "a.mat")
    assert telemetry.columns == ("x.0", "x.1")
    np.testing.assert_allclose(telemetry.values[:, 1], -VALUES, rtol=1e-6)


def test_a_table_of_several_is_named(tmp_path, refused):
    path = hdf5(tmp_path / "a.h5", fast=FRAME, slow=FRAME.iloc[::4])
    with refused("--table fast, or --table slow"):
        read(path)
    telemetry = read(path, table="slow")
    assert (len(telemetry), telemetry.interval_s) == (N // 4, 2.0)
    with refused("'other'", "--table fast"):
        read(path, table="other")


def test_a_sheet_is_named_where_the_first_holds_no_numbers(tmp_path, refused):
    path = tmp_path / "a.xlsx"
    with pd.ExcelWriter(path) as book:
        pd.DataFrame({"Project": ["pump"], "By": ["A"]}).to_excel(book, sheet_name="Info")
        FRAME.to_excel(book, sheet_name="Data", index=False)
        FRAME.iloc[::2].to_excel(book, sheet_name="Slow", index=False)
    with refused("Info", "--table Data, or --table Slow"):
        read(path)
    assert read(path, table="Slow").interval_s == 1.0


def test_lines_on_top_are_left_out_and_counted_in_places(written, refused):
    path = written("1,2,3\n4,5,6\n" + FRAME.to_csv(index=False) + "50,x,1\n")
    with refused(f"'x' at line {N + 4}"):
        read(path, skip_rows=2)
    assert read(path, skip_rows=2, drop_bad=True).columns == ("volts", "amps")


def test_channels_in_rows_are_refused(tmp_path, refused):
    np.save(tmp_path / "a.npy", np.zeros((3, 500)))
    scipy.io.savemat(tmp_path / "a.mat", {"x": np.random.default_rng(0).normal(size=(3, 500))})
    for name in ("a.npy", "a.mat"):
        with refused("channels first", "transposed"):
            read(tmp_path / name)


def test_words_are_channels_of_zero_and_one_on_request(written, refused):
    heater = np.where(np.arange(N) % 20 < 8, "ON", "OFF")
    mode = np.array(["SAFE", "RUN", "IDLE", "RUN"])[np.arange(N) // 20]
    path = written(pd.DataFrame({"time": SECONDS, "heater": heater, "mode": mode}))
    with refused("--states"):
        read(path)
    telemetry = read(path, states=True)
    assert telemetry.columns == ("heater", "mode=IDLE", "mode=RUN", "mode=SAFE")
    np.testing.assert_array_equal(telemetry.values[:, 0], heater == "ON")
    np.testing.assert_array_equal(telemetry.values[:, 2], mode == "RUN")


def workbook(path, *sheets):
    """A workbook with the rows of sheets."""
    book = openpyxl.Workbook()
    for number, rows in enumerate(sheets):
        sheet = book.create_sheet() if number else book.active
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


def test_a_sheet_is_read_with_its_dates_and_asks_for_the_zone_above_its_table(tmp_path, refused):
    rows = zip(pd.to_datetime(MINUTES), VALUES, strict=True)
    above = ["zone"], ["Europe/Berlin"], [], ["Zeit", "Spannung"]
    path = workbook(tmp_path / "a.xlsx", [*above, *rows])
    zone = "Europe/Berlin"
    with refused(f"--timezone {zone}"):
        read(path)
    (series,) = read_source(path, options=Cleaning(timezone=zone)).values()
    assert (series.name, series.places.of(0)) == ("Spannung", "line 5")
    telemetry = read(path, timezone=zone)
    assert (telemetry.start, telemetry.interval_s) == ("2024-02-29T23:00:00+00:00", 60)
    np.testing.assert_allclose(telemetry.values[:, 0], VALUES, rtol=1e-6)


def test_a_first_sheet_without_numbers_is_named(tmp_path, refused):
    path = workbook(tmp_path / "a.xlsx", [["v"], ["by hand"]], [["v"], [1.5]])
    with refused("only the first sheet was read: Sheet"):
        read_source(path)


def test_texts_of_fixed_length_in_records_of_hdf5_are_times(tmp_path):
    records = FRAME.assign(time=MINUTES).to_records(index=False, column_dtypes={"time": "S19"})
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["log"] = records
    telemetry = read(tmp_path / "a.h5")
    check(telemetry, 60.0)
    assert telemetry.start == "2024-03-01T00:00:00+00:00"


def with_attribute(path, key, value):
    """A file of HDF5 in which the times have an attribute."""
    with h5py.File(hdf5(path, log=FRAME), "r+") as file:
        file["log/time"].attrs[key] = value
    return path


@pytest.mark.parametrize(
    ("key", "unit", "interval_s"),
    [
        ("units", "ms", 0.0005),
        ("units", np.bytes_("min"), 30.0),
        ("Unit", ["msec."], 0.0005),
        ("UNITS", "s since start", 0.5),
    ],
)
def test_units_beside_data_of_hdf5_are_those_of_the_clock(tmp_path, key, unit, interval_s):
    telemetry = read(with_attribute(tmp_path / "a.h5", key, unit))
    assert telemetry.interval_s == pytest.approx(interval_s)


@pytest.mark.parametrize(
    ("key", "value"), [("scale_factor", 0.1), ("units", "hours since 2024-01-01")]
)
def test_values_that_are_to_be_converted_are_refused(tmp_path, refused, key, value):
    path = with_attribute(tmp_path / "a.h5", key, value)
    with refused("log/time", "xarray"):
        read(path)


def test_signals_of_a_simulation_are_read_with_their_time(tmp_path):
    signals = np.empty(2, object)
    signals[:] = [{"values": FRAME[name].to_numpy()[:, None]} for name in ("volts", "amps")]
    for inside, one in ((signals, "1.values"), ({"values": FRAME.to_numpy()[:, 1:]}, "values.0")):
        log = {"time": SECONDS, "signals": inside, "blockName": "model"}
        scipy.io.savemat(tmp_path / "a.mat", {"log": log})
        telemetry = read(tmp_path / "a.mat")
        assert telemetry.columns[0] == f"signals.{one}"
        check(telemetry)


def test_each_of_many_runs_in_an_array_of_structs_is_a_table(tmp_path, refused):
    runs = np.empty(2, object)
    data = FRAME.assign(time=SECONDS)
    runs[:] = [
        {"kind": "charge", "data": {name: data[name].to_numpy() for name in data}},
        {"kind": "rest", "data": {"time": SECONDS, "volts": -VALUES}},
    ]
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"log": {"run": runs}})
    with refused("--table log.run.1.data", "--table log.run.2.data"):
        read(path)
    check(read(path, table="log.run.1.data"))
    np.testing.assert_allclose(read(path, table="log.run.2.data").values[:, 0], -VALUES, rtol=1e-6)


def test_tables_of_equal_names_in_two_groups_are_both_offered(tmp_path, refused):
    path = hdf5(tmp_path / "a.h5", one=FRAME, two=FRAME)
    with h5py.File(path, "r+") as file:
        for group in ("one", "two"):
            file[f"{group}/cal"] = np.arange(12)
    with refused("--table one/amps", "--table two/cal"):
        read(path)
    assert len(read(path, table="two/amps")) == N


def parquet(path, **columns):
    FRAME.assign(**columns).to_parquet(path)
    return path


def test_files_of_other_units_or_zones_are_not_joined(tmp_path, refused):
    since = 1_709_251_200 + np.arange(N)
    times = pd.to_datetime(since, unit="s")
    for name, time in (
        ("seconds", since),
        ("milliseconds", 1_000 * since),
        ("zoned", times.tz_localize("UTC")),
        ("local", times),
    ):
        parquet(tmp_path / f"{name}.parquet", time=time)
    for unit in ("s", "ms"):
        with_attribute(tmp_path / f"{unit}.h5", "units", unit)
    for first, second in (
        ("seconds.parquet", "milliseconds.parquet"),
        ("zoned.parquet", "local.parquet"),
        ("s.h5", "ms.h5"),
    ):
        with refused("'time' of different units", f"{first} to {second}"):
            read([tmp_path / first, tmp_path / second])


def test_a_channel_without_values_in_one_file_is_joined(tmp_path):
    missing = parquet(tmp_path / "a.parquet", volts=pd.array([pd.NA] * N, "Int64"))
    there = parquet(tmp_path / "b.parquet", volts=1, time=SECONDS + N)
    assert len(read_source([missing, there])["amps"].cells) == 2 * N


def test_an_index_with_a_name_and_spans_of_arrow_are_clocks():
    index = pd.RangeIndex(0, 500 * N, 500, name="time_ms")
    spans = pd.to_timedelta(SECONDS, unit="s")
    spans = pd.Series(spans).astype(pd.ArrowDtype(pa.duration("ms")))
    for frame in (FRAME[["volts"]].set_axis(index), FRAME[["volts"]].assign(time=spans)):
        telemetry = read(frame)
        assert (telemetry.columns, telemetry.interval_s) == (("volts",), 0.5)


def test_an_empty_sheet_and_numbered_names_that_exist_are_refused(tmp_path, refused):
    with refused("it is empty"):
        read(workbook(tmp_path / "a.xlsx", []))
    with refused("'v.1'"):
        read(pd.DataFrame(np.ones((9, 4)), columns=["time", "v", "v", "v.1"]))


def test_the_last_line_of_json_may_be_cut(written, refused):
    text = FRAME.to_json(orient="records", lines=True)
    volts = read_source(written(text + '{"time": 4', "a.jsonl"))["volts"]
    assert len(volts.cells) == N
    assert any(finding.kind == "ragged lines" for finding in volts.findings)
    with refused("cannot be read"):
        read(written('{"time": 4\n' + text, "a.jsonl"))


# JSON of other forms


@pytest.fixture
def record(written):
    """`record(content)` writes a record of JSON and returns its path."""
    return lambda content: written(json.dumps(content), "a.json")


TEXTS = FRAME.astype({"time": str})
# form: a record that holds the frame
RECORDS = {
    "lists of rows below the names": [list(FRAME), *FRAME.to_numpy().tolist()],
    "columns by the number of the row": json.loads(FRAME.to_json()),
    "columns": TEXTS.to_dict("list"),
    "columns beside units": {"id": 7, "hourly": {"unit": "V", **TEXTS.to_dict("list")}},
    "records beside what they are of": {
        "channel": {"id": 7},
        "feeds": TEXTS.to_dict("records"),
    },
    "the series of a chart": {
        "time": TEXTS["time"].tolist(),
        "series": [{"name": name, "data": FRAME[name].tolist()} for name in ("volts", "amps")],
    },
}


@pytest.mark.parametrize("form", RECORDS)
def test_a_table_inside_of_one_record_is_read(record, form):
    telemetry = read(record(RECORDS[form]))
    inside = "series." if form == "the series of a chart" else ""
    assert telemetry.columns == (f"{inside}volts", f"{inside}amps")
    check(telemetry)


def test_lists_of_values_without_names_are_rows(record, refused):
    path = record([["2024-03-01T10:00:00Z", "1"], ["2024", "2"]])
    assert len(read_source(path)["column 1"].cells) == 2
    for held in (np.ones((2, 200)).tolist(), {"values": np.ones((2, 200)).tolist()}):
        with refused("channels first"):
            read(record(held))
    with refused("lists of 2 to 3 values"):
        read(record([*FRAME.to_numpy().tolist(), [40.0, 1.0]]))


def test_a_zone_beside_lists_of_json_is_asked_for(record, refused):
    times = pd.date_range("2024-03-01", periods=N, freq="h").strftime("%Y-%m-%dT%H:%M").tolist()
    hourly = {"time": times, "volts": VALUES.tolist()}
    path = record({"timezone": "Asia/Tokyo", "hourly": hourly})
    with refused("--timezone Asia/Tokyo"):
        read(path)
    assert read(path, timezone="Asia/Tokyo").start == "2024-02-29T15:00:00+00:00"


def test_texts_of_matlab_7_3_are_times(tmp_path):
    matlab_7_3(tmp_path / "a.mat")
    with h5py.File(tmp_path / "a.mat", "r+") as file:
        del file["time"]
        file["time"] = np.array([list(map(ord, text)) for text in MINUTES], np.uint16).T
        file["time"].attrs["MATLAB_class"] = np.bytes_("char")
    telemetry = read(tmp_path / "a.mat")
    assert (telemetry.start, telemetry.interval_s) == ("2024-03-01T00:00:00+00:00", 60)


def test_complex_arrays_and_those_of_three_dimensions_are_left_out_with_a_word(tmp_path):
    others = {"z": 1j * VALUES, "cube": np.ones((N, 2, 3))}
    scipy.io.savemat(tmp_path / "a.mat", {"volts": VALUES} | others)
    (series,) = read_source(tmp_path / "a.mat").values()
    assert clean(series).report.find("columns left out").text.endswith("z, cube")


def test_one_of_several_lists_of_records_is_chosen_by_name(record, refused):
    records = TEXTS.to_dict("records")
    path = record({"one": records, "two": {"x": records[::-1]}})
    with refused("--table one, or --table two.x"):
        read(path)
    assert len(read(path, table="one")) == N
    with refused("Leave it out"):
        read(record(records), table="one")


@pytest.mark.parametrize("indent", [None, 1])
def test_an_answer_of_prometheus_says_what_makes_a_table_of_it(written, indent):
    values = [[1_709_251_200 + 15 * row, str(row / 4)] for row in range(20)]
    answer = {"status": "success", "data": {"result": [{"metric": {}, "values": values}]}}
    file = written(json.dumps(answer, indent=indent), "a.json")
    with pytest.raises(InputError, match="one record") as refused:
        read(file)
    recipe = str(refused.value).rpartition("of Prometheus, ")[2].removesuffix(".")
    telemetry = read(eval(recipe, {"pandas": pd, "json": json, "file": file}))
    assert telemetry.start == "2024-03-01T00:00:00+00:00" and telemetry.interval_s == 15
    np.testing.assert_array_equal(telemetry.values[:, 0], np.arange(20) / 4)
