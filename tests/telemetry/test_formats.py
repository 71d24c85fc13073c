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
FRAME = pd.DataFrame({"time": SECONDS, "volts": VALUES, "amps": 2 * VALUES})


def hdf5(path, **groups):
    with h5py.File(path, "w") as file:
        for name, frame in groups.items():
            for column in frame:
                file[f"{name}/{column}"] = frame[column].to_numpy()


def matlab_7_3(path):
    """Axes in reverse order, behind a block that says so, as MATLAB 7.3 writes them."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for column in FRAME:
            file[column] = FRAME[column].to_numpy()[None]
    content = path.read_bytes()
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512, b" ") + content[512:])


WRITERS = {
    ".parquet": lambda path: FRAME.to_parquet(path),
    ".xlsx": lambda path: FRAME.to_excel(path, index=False),
    ".xlsm": lambda path: FRAME.to_excel(path, index=False, engine="openpyxl"),
    ".mat": lambda path: scipy.io.savemat(path, {name: FRAME[name].to_numpy() for name in FRAME}),
    ".h5": lambda path: hdf5(path, log=FRAME),
    ".hdf5": lambda path: hdf5(path, log=FRAME),
    ".jsonl": lambda path: FRAME.to_json(path, orient="records", lines=True),
    ".ndjson": lambda path: FRAME.to_json(path, orient="records", lines=True),
    ".json": lambda path: FRAME.to_json(path, orient="records"),
}
OTHERS = {
    ".dat": lambda path: FRAME.to_csv(path, index=False, sep="\t"),
    ".log.gz": lambda path: path.write_bytes(gzip.compress(FRAME.to_csv(index=False).encode())),
    ".parquet.gz": lambda path: path.write_bytes(gzip.compress(FRAME.to_parquet())),
    "_struct.mat": lambda path: scipy.io.savemat(
        path, {"log": {name: FRAME[name].to_numpy() for name in FRAME}, "rate": 2.0}
    ),
    "_7_3.mat": matlab_7_3,
}


def test_every_registered_kind_has_a_writer_here():
    assert set(WRITERS) == set(READERS)


@pytest.mark.parametrize("ending", [*WRITERS, *OTHERS])
def test_a_file_is_read_as_it_was_written(tmp_path, ending):
    (WRITERS | OTHERS)[ending](path := tmp_path / f"a{ending}")
    (telemetry,) = read_telemetry(path)
    assert (sorted(telemetry.columns), telemetry.interval_s) == (["amps", "volts"], 0.5)
    np.testing.assert_allclose(telemetry.values, FRAME[list(telemetry.columns)], rtol=1e-6)


def test_a_matrix_has_a_channel_in_each_column(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"time": SECONDS, "x": np.stack([VALUES, -VALUES], 1)})
    (telemetry,) = read_telemetry(tmp_path / "a.mat")
    assert telemetry.columns == ("x.0", "x.1")
    np.testing.assert_allclose(telemetry.values[:, 1], -VALUES, rtol=1e-6)


def test_a_table_of_several_is_named(tmp_path, refused):
    hdf5(tmp_path / "a.h5", fast=FRAME, slow=FRAME.iloc[::4])
    with refused("--table fast, or --table slow"):
        read_source(tmp_path / "a.h5")
    (telemetry,) = read_telemetry(tmp_path / "a.h5", Cleaning(table="slow"))
    assert (len(telemetry), telemetry.interval_s) == (N // 4, 2.0)
    with refused("'other'", "--table fast"):
        read_source(tmp_path / "a.h5", options=Cleaning(table="other"))


def test_a_sheet_is_named_where_the_first_holds_no_numbers(tmp_path, refused):
    with pd.ExcelWriter(tmp_path / "a.xlsx") as book:
        pd.DataFrame({"Project": ["pump"], "By": ["A"]}).to_excel(book, sheet_name="Info")
        FRAME.to_excel(book, sheet_name="Data", index=False)
        FRAME.iloc[::2].to_excel(book, sheet_name="Slow", index=False)
    with refused("Info", "--table Data, or --table Slow"):
        read_source(tmp_path / "a.xlsx")
    (telemetry,) = read_telemetry(tmp_path / "a.xlsx", Cleaning(table="Slow"))
    assert telemetry.interval_s == 1.0


def test_lines_on_top_are_left_out_and_counted_in_places(tmp_path, refused):
    text = "1,2,3\n4,5,6\n" + FRAME.to_csv(index=False) + "50,x,1\n"
    (tmp_path / "a.csv").write_text(text)
    with refused(f"'x' at line {N + 4}"):
        read_telemetry(tmp_path / "a.csv", Cleaning(skip_rows=2))
    (telemetry,) = read_telemetry(tmp_path / "a.csv", Cleaning(skip_rows=2, drop_bad=True))
    assert telemetry.columns == ("volts", "amps")


def test_channels_in_rows_are_refused(tmp_path, refused):
    np.save(tmp_path / "a.npy", np.zeros((3, 500)))
    scipy.io.savemat(tmp_path / "a.mat", {"x": np.random.default_rng(0).normal(size=(3, 500))})
    for name in ("a.npy", "a.mat"):
        with refused("channels first", "transposed"):
            read_source(tmp_path / name)


def test_words_are_channels_of_zero_and_one_on_request(tmp_path, refused):
    heater = np.where(np.arange(N) % 20 < 8, "ON", "OFF")
    mode = np.array(["SAFE", "RUN", "IDLE", "RUN"])[np.arange(N) // 20]
    frame = pd.DataFrame({"time": SECONDS, "heater": heater, "mode": mode})
    frame.to_csv(tmp_path / "a.csv", index=False)
    with refused("--states"):
        read_source(tmp_path / "a.csv")
    (telemetry,) = read_telemetry(tmp_path / "a.csv", Cleaning(states=True))
    assert telemetry.columns == ("heater", "mode=IDLE", "mode=RUN", "mode=SAFE")
    np.testing.assert_array_equal(telemetry.values[:, 0], heater == "ON")
    np.testing.assert_array_equal(telemetry.values[:, 2], mode == "RUN")


def test_a_zone_above_the_table_of_a_sheet_is_asked_for(tmp_path, refused):
    book = openpyxl.Workbook()
    times = pd.date_range("2024-03-01", periods=N, freq="min")
    rows = zip(times, VALUES.tolist(), strict=True)
    for row in (["zone"], ["Europe/Berlin"], ["time", "volts"], *rows):
        book.active.append(row)
    book.save(tmp_path / "a.xlsx")
    with refused("--timezone Europe/Berlin"):
        read_telemetry(tmp_path / "a.xlsx")
    (telemetry,) = read_telemetry(tmp_path / "a.xlsx", Cleaning(timezone="Europe/Berlin"))
    assert telemetry.start == "2024-02-29T23:00:00+00:00"


def test_deep_json_is_refused(tmp_path, refused):
    for name, text in (("a.jsonl", "[" * 100_000), ("b.json", json.dumps({"a": 1})[:-1])):
        (tmp_path / name).write_text(text)
        with refused(name, "cannot be read"):
            read_source(tmp_path / name)


def test_texts_of_fixed_length_in_records_of_hdf5_are_times(tmp_path):
    stamps = pd.date_range("2024-03-01", periods=len(FRAME), freq="min")
    stamps = np.array(stamps.strftime("%Y-%m-%dT%H:%M:%S"), "S19")
    fields = [("time", "S19"), *((name, "f8") for name in FRAME if name != "time")]
    records = np.empty(len(FRAME), fields)
    for name in FRAME:
        records[name] = stamps if name == "time" else FRAME[name]
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["log"] = records
    (telemetry,) = read_telemetry(tmp_path / "a.h5")
    expected = FRAME[list(telemetry.columns)].to_numpy(np.float32)
    np.testing.assert_array_equal(telemetry.values, expected)
    assert (telemetry.start, telemetry.interval_s) == ("2024-03-01T00:00:00+00:00", 60.0)


def test_units_beside_data_of_hdf5_are_those_of_the_clock(tmp_path, refused):
    hdf5(tmp_path / "a.h5", log=FRAME)
    for key, unit, interval_s in (
        ("units", "ms", 0.0005),
        ("units", np.bytes_("min"), 30.0),
        ("Unit", ["msec."], 0.0005),
        ("UNITS", "s since start", 0.5),
    ):
        with h5py.File(tmp_path / "a.h5", "r+") as file:
            file["log/time"].attrs.clear()
            file["log/time"].attrs[key] = unit
        (telemetry,) = read_telemetry(tmp_path / "a.h5")
        assert telemetry.interval_s == pytest.approx(interval_s)


@pytest.mark.parametrize(
    ("attribute", "value"), [("scale_factor", 0.1), ("units", "hours since 2024-01-01")]
)
def test_values_that_are_to_be_converted_are_refused(tmp_path, refused, attribute, value):
    hdf5(tmp_path / "a.h5", log=FRAME)
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        file["log/time"].attrs[attribute] = value
    with refused("log/time", "xarray"):
        read_telemetry(tmp_path / "a.h5")


def test_signals_of_a_simulation_are_read_with_their_time(tmp_path):
    signals = np.empty(2, object)
    signals[:] = [{"values": FRAME[name].to_numpy()[:, None]} for name in ("volts", "amps")]
    for inside, one in ((signals, "1.values"), ({"values": FRAME.to_numpy()[:, 1:]}, "values.0")):
        log = {"time": SECONDS, "signals": inside, "blockName": "model"}
        scipy.io.savemat(tmp_path / "a.mat", {"log": log})
        (telemetry,) = read_telemetry(tmp_path / "a.mat")
        assert (telemetry.columns[0], telemetry.interval_s) == (f"signals.{one}", 0.5)
        np.testing.assert_allclose(telemetry.values, FRAME[["volts", "amps"]], rtol=1e-6)


def test_tables_of_equal_names_in_two_groups_are_both_offered(tmp_path, refused):
    hdf5(tmp_path / "a.h5", one=FRAME, two=FRAME)
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        for group in ("one", "two"):
            file[f"{group}/cal"] = np.arange(12)
    with refused("--table one/amps", "--table two/cal"):
        read_telemetry(tmp_path / "a.h5")
    (telemetry,) = read_telemetry(tmp_path / "a.h5", Cleaning(table="two/amps"))
    assert len(telemetry) == N


def test_files_of_other_units_or_zones_are_not_joined(tmp_path, refused):
    for name, unit in (("a", "s"), ("b", "ms")):
        hdf5(tmp_path / f"{name}.h5", log=FRAME)
        with h5py.File(tmp_path / f"{name}.h5", "r+") as file:
            file["log/time"].attrs["units"] = unit
    times = pd.date_range("2024", periods=N, freq="s")
    for name, zone in (("a", "UTC"), ("b", None)):
        FRAME.assign(time=times.tz_localize(zone)).to_parquet(tmp_path / f"{name}.parquet")
    missing = FRAME.assign(volts=pd.array([pd.NA] * N, "Int64"))
    missing.to_parquet(tmp_path / "e.parquet")
    FRAME.assign(volts=1, time=SECONDS + N).to_parquet(tmp_path / "f.parquet")
    assert len(read_source([tmp_path / f"{name}.parquet" for name in "ef"])["amps"].cells) == 2 * N
    for ending, factor in (("c", 1), ("d", 1_000)):
        since = 1_709_251_200 + np.arange(N)
        FRAME.assign(time=factor * since).to_parquet(tmp_path / f"{ending}.parquet")
    with refused("'time' of different units"):
        read_telemetry([tmp_path / "c.parquet", tmp_path / "d.parquet"])
    for ending in ("h5", "parquet"):
        with refused("'time' of different units", f"a.{ending} to b.{ending}"):
            read_telemetry([tmp_path / f"a.{ending}", tmp_path / f"b.{ending}"])


def test_an_index_with_a_name_and_spans_of_arrow_are_clocks():
    index = pd.RangeIndex(0, 500 * N, 500, name="time_ms")
    spans = pd.to_timedelta(SECONDS, unit="s")
    spans = pd.Series(spans).astype(pd.ArrowDtype(pa.duration("ms")))
    for frame in (FRAME[["volts"]].set_axis(index), FRAME[["volts"]].assign(time=spans)):
        (telemetry,) = read_telemetry(frame)
        assert (telemetry.columns, telemetry.interval_s) == (("volts",), 0.5)


def test_an_empty_sheet_and_numbered_names_that_exist_are_refused(tmp_path, refused):
    openpyxl.Workbook().save(tmp_path / "a.xlsx")
    with refused("it is empty"):
        read_telemetry(tmp_path / "a.xlsx")
    with refused("'v.1'"):
        read_telemetry(pd.DataFrame(np.ones((9, 4)), columns=["time", "v", "v", "v.1"]))


def test_the_last_line_of_json_may_be_cut(tmp_path, refused):
    text = FRAME.to_json(orient="records", lines=True)
    (tmp_path / "a.jsonl").write_text(text + '{"time": 4')
    channels = read_source(tmp_path / "a.jsonl")
    assert len(channels["volts"].cells) == N
    assert any(finding.kind == "ragged lines" for finding in channels["volts"].findings)
    (tmp_path / "a.jsonl").write_text('{"time": 4\n' + text)
    with refused("cannot be read"):
        read_source(tmp_path / "a.jsonl")


def test_lists_of_values_are_rows(tmp_path, refused):
    rows = FRAME.to_numpy().tolist()
    (tmp_path / "a.json").write_text(json.dumps([list(FRAME), *rows]))
    (telemetry,) = read_telemetry(tmp_path / "a.json")
    np.testing.assert_allclose(telemetry.values, FRAME[["volts", "amps"]], rtol=1e-6)
    (tmp_path / "a.json").write_text(json.dumps([["2024-03-01T10:00:00Z", "1"], ["2024", "2"]]))
    assert len(read_source(tmp_path / "a.json")["column 1"].cells) == 2
    for held in (np.ones((2, 200)).tolist(), {"values": np.ones((2, 200)).tolist()}):
        (tmp_path / "a.json").write_text(json.dumps(held))
        with refused("channels first"):
            read_telemetry(tmp_path / "a.json")
    (tmp_path / "a.json").write_text(json.dumps([*rows, [40.0, 1.0]]))
    with refused("lists of 2 to 3 values"):
        read_telemetry(tmp_path / "a.json")


def test_columns_inside_of_one_json_record_are_a_table(tmp_path):
    FRAME.to_json(tmp_path / "a.json")
    (telemetry,) = read_telemetry(tmp_path / "a.json")
    np.testing.assert_allclose(telemetry.values, FRAME[["volts", "amps"]], rtol=1e-6)


def test_a_zone_beside_lists_of_json_is_asked_for(tmp_path, refused):
    times = pd.date_range("2024-03-01", periods=N, freq="h").strftime("%Y-%m-%dT%H:%M").tolist()
    record = {"timezone": "Asia/Tokyo", "hourly": {"time": times, "volts": VALUES.tolist()}}
    (tmp_path / "a.json").write_text(json.dumps(record))
    with refused("--timezone Asia/Tokyo"):
        read_telemetry(tmp_path / "a.json")
    (telemetry,) = read_telemetry(tmp_path / "a.json", Cleaning(timezone="Asia/Tokyo"))
    assert telemetry.start == "2024-02-29T15:00:00+00:00"


def test_texts_of_matlab_7_3_are_times(tmp_path):
    times = pd.date_range("2024-03-01", periods=N, freq="min").strftime("%Y-%m-%d %H:%M:%S")
    matlab_7_3(tmp_path / "a.mat")
    with h5py.File(tmp_path / "a.mat", "r+") as file:
        del file["time"]
        file["time"] = np.array([list(map(ord, text)) for text in times], np.uint16).T
        file["time"].attrs["MATLAB_class"] = np.bytes_("char")
    (telemetry,) = read_telemetry(tmp_path / "a.mat")
    assert (telemetry.start, telemetry.interval_s) == ("2024-03-01T00:00:00+00:00", 60)


def test_complex_arrays_and_those_of_three_dimensions_are_left_out_with_a_word(tmp_path):
    others = {"z": 1j * VALUES, "cube": np.ones((N, 2, 3))}
    scipy.io.savemat(tmp_path / "a.mat", {"volts": VALUES} | others)
    (series,) = read_source(tmp_path / "a.mat").values()
    assert clean(series).report.find("columns left out").text.endswith("z, cube")


def test_lists_inside_of_one_json_record_are_a_table(tmp_path):
    frame = FRAME.astype({"time": str})
    wide = {"id": 7, "hourly": {"unit": "V", **frame.to_dict("list")}}
    fed = {"channel": {"id": 7}, "feeds": frame.to_dict("records")}
    for record in (frame.to_dict("list"), wide, fed):
        (tmp_path / "a.json").write_text(json.dumps(record))
        (telemetry,) = read_telemetry(tmp_path / "a.json")
        expected = FRAME[list(telemetry.columns)].to_numpy(np.float32)
        assert set(telemetry.columns) == set(FRAME) - {"time"}
        np.testing.assert_array_equal(telemetry.values, expected)


def test_the_series_of_a_chart_are_columns_beside_its_times(tmp_path):
    series = [{"name": name, "data": FRAME[name].tolist()} for name in ("volts", "amps")]
    record = {"time": FRAME["time"].astype(str).tolist(), "series": series}
    (tmp_path / "a.json").write_text(json.dumps(record))
    (telemetry,) = read_telemetry(tmp_path / "a.json")
    assert telemetry.columns == ("series.volts", "series.amps")
    np.testing.assert_allclose(telemetry.values, FRAME[["volts", "amps"]], rtol=1e-6)


def test_one_of_several_lists_of_records_is_chosen_by_name(tmp_path, refused):
    records = FRAME.astype({"time": str}).to_dict("records")
    (tmp_path / "a.json").write_text(json.dumps({"one": records, "two": {"x": records[::-1]}}))
    with refused("--table one, or --table two.x"):
        read_telemetry(tmp_path / "a.json")
    (telemetry,) = read_telemetry(tmp_path / "a.json", Cleaning(table="one"))
    assert len(telemetry) == len(FRAME)
    (tmp_path / "a.json").write_text(json.dumps(records))
    with refused("Leave it out"):
        read_telemetry(tmp_path / "a.json", Cleaning(table="one"))


def test_an_answer_of_prometheus_says_what_makes_a_table_of_it(tmp_path):
    values = [[1_709_251_200 + 15 * row, str(row / 4)] for row in range(20)]
    answer = {"status": "success", "data": {"result": [{"metric": {}, "values": values}]}}
    for indent in (None, 1):
        file = tmp_path / "a.json"
        file.write_text(json.dumps(answer, indent=indent))
        with pytest.raises(InputError, match="one record") as refused:
            read_source(file)
        recipe = str(refused.value).rpartition("of Prometheus, ")[2].removesuffix(".")
        (series,) = read_source(eval(recipe, {"pandas": pd, "json": json, "file": file})).values()
        telemetry = clean(series).telemetry
        assert telemetry.start == "2024-03-01T00:00:00+00:00" and telemetry.interval_s == 15
        np.testing.assert_array_equal(telemetry.values[:, 0], np.arange(20) / 4)
