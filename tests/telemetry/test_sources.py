"""Tests of reading raw channels from every kind of source, and of invalid sources."""

import gzip

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry import sources
from enhsim_tf.telemetry.cleaning.clean import Cleaning, clean
from enhsim_tf.telemetry.pandas_series import to_series
from enhsim_tf.telemetry.reading import channels
from enhsim_tf.telemetry.reading.formats import READERS
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.sources import read_source, read_telemetry

N = 50
TIMES = pd.date_range("2020-03-01T06:00:00Z", periods=N, freq="250ms")
VALUES = np.sin(np.arange(N) / 5).round(4)
TABLE = pd.DataFrame({"utc": TIMES, "volts": VALUES, "mode": "nominal", "amps": 2 * VALUES})


CSV = TABLE[["utc", "volts"]].to_csv(index=False, date_format="%Y-%m-%dT%H:%M:%S.%fZ")


def check(channel, name="volts", values=VALUES):
    series = channel.series
    assert isinstance(series.index, pd.DatetimeIndex) and (series.name, len(series)) == (name, N)
    cleaned = clean(channel)
    (part,) = cleaned.parts
    assert (part.interval_s, part.start) == (0.25, "2020-03-01T06:00:00+00:00")
    np.testing.assert_allclose(part.values[:, 0], values, atol=1e-6)
    return cleaned


@pytest.mark.parametrize("encoding", ["utf-16", "latin-1"])
def test_csv_of_other_encodings(tmp_path, encoding):
    path = tmp_path / "a.csv"
    path.write_bytes(CSV.replace("volts", "°C").encode(encoding))
    cleaned = check(read_source(path)["°C"], "°C")
    assert (cleaned.report.find("encoding") is not None) == (encoding == "latin-1")


WRITERS = {
    "a.csv": lambda path: TABLE.to_csv(path, index=False),
    "a.parquet": TABLE.to_parquet,
    "an_index.parquet": TABLE.set_index("utc").to_parquet,
}


@pytest.mark.parametrize("file", WRITERS)
def test_columns_by_name_and_all_of_numbers(tmp_path, file):
    WRITERS[file](path := tmp_path / file)
    channels = read_source(path)
    assert list(channels) == ["volts", "amps"]
    report = check(channels["volts"]).report
    check(channels["amps"], "amps", 2 * VALUES)
    assert kinds_of(report) == ["clock", "columns left out"]
    assert "mode" in report.find("columns left out").text
    named = read_source(str(path), columns=["amps"], time="utc")
    assert list(named) == ["amps"] and kinds_of(clean(named["amps"]).report) == ["clock"]
    counted = read_source(path, columns="amps", time="none")["amps"]
    assert counted.times is None and clean(counted).parts[0].start is None


def kinds_of(report):
    return [finding.kind for finding in report.findings]


@pytest.fixture
def saved(tmp_path):
    """`saved(array)` writes an array and returns its path."""

    def saved(array, name="a.npy"):
        np.save(tmp_path / name, array)
        return tmp_path / name

    return saved


def test_channels_without_time(saved):
    path = saved(np.column_stack([VALUES, 3 * VALUES]), "wheel.npy")
    assert list(read_source(path)) == ["wheel.0", "wheel.1"]
    (channel,) = read_source(path, columns=[1]).values()
    assert (channel.name, channel.cells.tolist()) == ("wheel.1", (3 * VALUES).tolist())
    assert channel.times is None
    for array in (VALUES, VALUES[:, None]):
        assert read_source(saved(array))["a"].cells.tolist() == VALUES.tolist()


def test_a_blank_line_is_a_row(written):
    channels = read_source(written("a,b\n1,2\n2,5\n\n4,\n"))
    assert channels["a"].cells.isna().tolist() == [False, False, True, False]
    assert clean(channels["b"]).report.find("missing values").count == 2


def test_a_packed_array_is_read(saved, tmp_path):
    (tmp_path / "b.npy.gz").write_bytes(gzip.compress(saved(VALUES).read_bytes()))
    assert read_source(tmp_path / "b.npy.gz")["b"].cells.tolist() == VALUES.tolist()


def test_columns_of_an_array_are_named_as_their_channels(saved, refused):
    path = saved(np.column_stack([VALUES, np.full(N, np.nan), VALUES]))
    with refused("--column a.0 --column a.2"):
        read_telemetry(path)
    (telemetry,) = read_telemetry(path, columns=["a.0", "a.2"])
    assert telemetry.columns == ("a.0", "a.2")


def test_commands_are_no_channels_unless_they_are_named(saved):
    # one command after the other
    sent = (np.arange(24) == np.arange(N)[:, None] % 24).astype(float)
    path = saved(np.column_stack([VALUES, sent]))
    assert list(read_source(path)) == ["a.0"]
    assert list(read_source(path, ["0", "3"])) == ["a.0", "a.3"]
    assert len(read_source(saved(np.column_stack([VALUES, 2 * sent])))) == 25


def test_a_column_that_counts_may_be_the_clock_of_an_array(saved, refused):
    path = saved(np.column_stack([np.arange(N), VALUES]))
    with refused("--column 1, or --time none"):
        read_source(path)
    assert list(read_source(path, time="none")) == ["a.0", "a.1"]


def test_every_row_of_a_dirty_table_is_accounted_for(written):
    """Seven rows: one without a time, one with a word as its time, one duplicate, one cut off by a
    killed recorder.
    """
    rows = ["{}:00,1", ",2", "{}:01,3", "boot,4", "{}:01,3", "{}:02,5", "{}:03"]
    path = written("\n".join(["time,volts", *rows]).replace("{}", "2020-03-01T00:00"))
    report = clean(read_source(path, options=Cleaning(drop_bad=True))["volts"]).report
    assert (report.rows_in, report.rows_used, report.rows_left_out, report.samples) == (6, 3, 3, 3)
    assert {finding.kind: finding.count for finding in report.findings} == dict.fromkeys(
        ["clock", "bad times", "missing times", "duplicate rows", "ragged lines"], 1
    )


# case: bytes of a table, words of the message, arguments
BAD_TABLES = {
    "empty": (b"", "empty"),
    "comments only": (b"# a\n# b\n", "a.csv"),
    "bytes": (bytes(range(256)) * 20, "not text"),
    "no header": (b"1,2\n3,4\n5,6\n", "1, 2"),
    "lines longer than the header": (b"a,b\n1,2,3\n4,5,6\n", "a.csv"),
    "one name for two columns, named": (
        b"a,a,b\n1,2,3\n3,4,5\n",
        "a.1, a.2, b",
        {"columns": ["a"]},
    ),
    "no such column": (b"a,b\n1,2\n", "'c'", {"columns": ["c"]}),
    "two time columns": (
        b"start,planned,v\n2020-01-01,2020-01-02,1\n2020-01-02,2020-01-03,2\n",
        "start, planned",
    ),
    "words only": (b"a,b\nx,y\nz,w\n", "none in a.csv"),
    "no columns named": (b"a,b\n1,2\n", "columns=[]", {"columns": []}),
}
# case: name and content of the file, words of the message, arguments
BAD = {
    "not there": ("absent.csv", None, "does not exist"),
    "a name no file can have": ("x" * 300 + ".csv", None, "does not exist"),
    "a folder without tables": (".", None, "without any"),
    "windows": (
        "a.parquet",
        pd.DataFrame({"window": [[1.0, 2.0], [3.0, 4.0]]}),
        "left out: window ([1. 2.])",
    ),
    "two levels of names": (
        "a.parquet",
        pd.DataFrame([[1.0]], columns=pd.MultiIndex.from_tuples([("a", "x")])),
        "2 levels",
    ),
    "no array": ("a.npy", b"not an array", "a.npy"),
    "an array of text": ("a.npy", np.array(["a", "b"]), "a.npy"),
    "an array of records": ("a.npy", np.zeros(3, [("a", "f4")]), "a.npy"),
    "a column number too large": ("a.npy", np.zeros((3, 2)), "'2'", {"columns": ["2"]}),
    "a time of an array": ("a.npy", np.zeros(3), "'t'", {"time": "t"}),
} | {case: ("a.csv", *others) for case, others in BAD_TABLES.items()}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("case", BAD)
def test_bad_sources_are_refused(tmp_path, refused, case):
    name, content, words, *arguments = BAD[case]
    path = tmp_path / name
    if isinstance(content, pd.DataFrame):
        content.to_parquet(path)
    elif isinstance(content, np.ndarray):
        np.save(path, content)
    elif content is not None:
        path.write_bytes(content)
    with refused(words):
        read_source(path, **dict(*arguments))


def test_influxdb_refuses_columns_and_an_incomplete_location(monkeypatch, refused):
    for name in ("INFLUXDB_V2_URL", "INFLUXDB_V2_TOKEN", "INFLUXDB_V2_ORG"):
        monkeypatch.delenv(name, raising=False)
    for words, arguments in (
        ("time='utc'", {"time": "utc"}),
        ("columns=['volts']", {"columns": ["volts"]}),
        ("INFLUXDB_V2_URL", {}),
    ):
        with refused(words):
            read_source("influxdb://bucket/bus/volts", **arguments)


@pytest.mark.parametrize("interval_s", [1 / 3, 1 / 30, 0.7])
def test_times_rounded_to_milliseconds_are_regular(written, interval_s):
    rows = np.arange(400)
    times = (rows * interval_s).round(3 if interval_s > 0.1 else 4)
    path = written(pd.DataFrame({"v": rows % 7, "t": times}))
    (part,) = clean(read_source(path, ["v"], "t", Cleaning(time_format="s"))["v"]).parts
    assert np.abs(part.time_s - times).max() < 0.05 * interval_s
    assert part.values[:, 0].tolist() == (rows % 7).tolist()
    assert (part.start[:19], part.clock.unit) == ("1970-01-01T00:00:00", "s")


def test_telemetry_to_pandas_and_back(refused):
    timed = Telemetry.of(VALUES.astype(np.float32), 0.25, 2.5, "2020-03-01T06:00:00+00:00", "volts")
    series = to_series(timed)
    assert (series.index == TIMES + pd.Timedelta("2.5s")).all() and series.name == "volts"
    (back,) = clean(series).parts
    assert (back.values == timed.values).all() and (back.interval_s, back.name) == (0.25, "volts")
    assert pd.Timestamp(back.start) + pd.Timedelta(seconds=back.offset_s) == series.index[0]
    counted = to_series(Telemetry.of(VALUES.astype(np.float32), offset_s=7.0))
    assert (counted.index[0], clean(counted).longest.offset_s) == (7, 7.0)
    with refused("ndarray"):
        to_series(VALUES)


@pytest.mark.parametrize("ending", READERS)
def test_every_reader_refuses_what_is_damaged(ending, tmp_path):
    check_reader(ending, tmp_path)


def check_reader(ending, folder):
    """Files that are empty, cut off or something else are refused in one line."""
    path = folder / f"damaged{ending}"
    for content in (b"", b"\x93NUMPY", b"{", b"\xff\xfe\x00words", b"[" * 100_000):
        path.write_bytes(content)
        with pytest.raises(InputError) as caught:
            read_telemetry(path)
        assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize("begin_s", [-10.0, 4e7])
def test_a_clock_that_counts_is_never_one_of_dates(begin_s):
    frame = pd.DataFrame({"time_s": begin_s + np.arange(400.0), "volts": np.arange(400) % 7})
    (telemetry,) = read_telemetry(frame)
    assert telemetry.clock.counts and telemetry.clock.kind == "counted"
    assert telemetry.nanoseconds.tolist() == [int((begin_s + k) * 1e9) for k in range(400)]


@pytest.mark.parametrize("source", [[[1.0, 2.0], [3.0, 4.0]], [1.0, 2.0], 3, None, np.ones(9)])
def test_what_is_no_source_is_refused(source, refused):
    with refused("Received: "):
        read_source(source)


def test_a_defect_of_ours_is_not_said_to_be_one_of_the_file(saved, written, monkeypatch):
    def defect(*given, **options):
        raise AttributeError("a defect")

    monkeypatch.setattr(channels, "lay_out", defect)
    monkeypatch.setattr(sources, "refuse_channels_first", defect)
    monkeypatch.setattr(sources, "RawChannel", defect)
    for path in (saved(VALUES), written("volts\n1\n2\n")):
        with pytest.raises(AttributeError, match="a defect"):
            read_source(path)
