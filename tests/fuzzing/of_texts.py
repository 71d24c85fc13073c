"""Targets that parse text: scenario files, command-line options, addresses, names and database responses."""

import contextlib
import io
import json
import os
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd

from enhsim_tf.cli.arguments import parse
from enhsim_tf.cli.generate_many import parse_workers
from enhsim_tf.coarse_simulator.degraded import MODES
from enhsim_tf.datasets.labelled_windows import parse_num_samples, parse_scenario, parse_start
from enhsim_tf.datasets.scenario_file import read_mix
from enhsim_tf.enhanced_simulator.model_folder import folder_of
from enhsim_tf.telemetry import influx_client
from enhsim_tf.telemetry.cleaning.clean import Cleaning, clean
from enhsim_tf.telemetry.influx_store import InfluxStore, parse_location
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.sources import read_source, read_telemetry
from tests.fuzzing.target import Target, all_of, json_of, text_of

_SCENARIOS = """\
windows: 1000
seed: 3
shard: 100
nominal: 0.5
scenarios:
  - mode: stuck
    share: 0.3
    severity: [0.2, 0.9]
    onset: [0.0, 0.5]
  - {mode: drift, share: 0.2, severity: 0.5}
models:
  - folder: vehicle-1/volts
    name: first
    share: 0.75
  - folder: "vehicle-2/volts"
    share: 0.25
"""
_SERVER = {"INFLUXDB_V2_URL": "http://localhost:8086", "INFLUXDB_V2_TOKEN": "nobody-may-see-this", "INFLUXDB_V2_ORG": "ours"}


def _scenario_file(data: bytes, folder: Path) -> None:
    (folder / "mix.yaml").write_bytes(data)
    mix = read_mix(folder / "mix.yaml")
    assert abs(mix.nominal + sum(part.share for part in mix.scenarios) - 1) < 1e-5
    assert all(0 <= part.severity[0] <= part.severity[1] <= 1 for part in mix.scenarios)


def _channel_name(data: bytes, folder: Path) -> None:
    """For any channel name, the folder is directly inside the models folder and its name is not reserved by a system."""
    found = folder_of(folder, text_of(data))
    found.mkdir()
    assert found.parent == folder and [path.name for path in folder.iterdir()] == [found.name]
    assert found.name.isascii() and not set(found.name) & set('\\/:*?"<>|.') and found.name.upper() not in ("CON", "NUL", " ")


def _address(data: bytes, folder: Path) -> None:
    location = parse_location(text_of(data))
    assert parse_location(str(location)) == location


def _zone(data: bytes, folder: Path) -> None:
    times = pd.date_range("2024-10-26", periods=60, freq="h")
    clean(pd.Series(np.arange(60.0), index=times), Cleaning(timezone=text_of(data)))


def _time_format(data: bytes, folder: Path) -> None:
    times = [f"26.10.24 {hour:02d}:00:00" for hour in range(20)]
    clean(pd.Series(np.arange(20.0), index=times), Cleaning(time_format=text_of(data)))


def _column_options(data: bytes, folder: Path) -> None:
    text, path = text_of(data), folder / "x.csv"
    pd.DataFrame({"time": range(9), "value": np.arange(9.0) ** 2, "Größe": 1.5}).to_csv(path, index=False)
    np.save(folder / "x.npy", np.zeros((4, 3)))
    all_of(
        lambda: read_source(path, [text]),
        lambda: read_source(path, None, text),
        lambda: read_source(folder / "x.npy", [text]),
        lambda: read_telemetry(path, text),
        lambda: read_telemetry(path, "value", text),
        lambda: read_telemetry(folder / "x.npy", text),
    )


def _source_name(data: bytes, folder: Path) -> None:
    text = text_of(data).replace("/", ":")  # so that it does not leave this folder
    (folder / "x.csv").write_text("value\n1\n2\n3\n")
    all_of(lambda: read_source(text), lambda: read_source(f"store#{text}"), lambda: read_telemetry(text), lambda: read_mix(text))


def _command_line(data: bytes, folder: Path) -> None:
    try:
        with contextlib.redirect_stderr(io.StringIO()):
            parse(text_of(data).split("\n"))
    except SystemExit as ended:
        assert ended.code == 0  # help


class _Answer:
    """A server response that is read a few bytes at a time."""

    def __init__(self, data: bytes):
        self.left = io.BytesIO(data)

    def read(self, size: int) -> bytes:
        return self.left.read(100)

    def close(self) -> None:
        pass


def _server_answer(data: bytes, folder: Path) -> None:
    with _named_server():
        server = influx_client.InfluxServer("bucket", max_retry_s=0)
        server._repeat = lambda request: _Answer(data)
        for times, values in server.stream("|> last()", 0, 2**62):
            assert len(times) == len(values) and times.dtype == np.int64


def _server_answer_seeds() -> list[bytes]:
    head = "#datatype,string,long,dateTime:RFC3339,double\r\n,result,table,_time,_value\r\n"
    rows = "".join(f",_result,0,2024-01-01T00:00:{second:02d}.123456789Z,{second / 7}\r\n" for second in range(20))
    whole = head.replace("double", "long") + ",_result,0,2024-01-01T00:00:00Z,3\r\n\r\n"
    error = "\r\n#datatype,string,string\r\n,error,reference\r\n,engine: it broke,17\r\n"
    return [(head + rows + "\r\n").encode(), whole.encode(), (head + rows + error).encode(), b"\r\n"]


def _server_description(data: bytes, folder: Path) -> None:
    """JSON as a server's response for the description of a series."""
    about = json_of(data)
    with _named_server():
        store = InfluxStore("influxdb://bucket/measurement/field")
        store.server.ask = lambda query, limit=None: [{"_value": json.dumps(about)}]
        times = 1_704_067_200 * 10**9 + np.arange(9) * 10**9
        store.server.stream = lambda *asked: iter([(times, np.arange(9.0))])
        all_of(store.names, store.versions, lambda: store.read("volts"), lambda: list(store.chunks("volts")))


def _server_description_seeds() -> list[bytes]:
    about = {"interval_s": 1.0, "offset_s": 0.0, "start": "2024-01-01T00:00:00+00:00", "name": "volts", "unit": "V"}
    about |= {"num_samples": 9, "location": "influxdb://bucket/measurement/field", "version": "0123456789abcdef"}
    return [json.dumps(each).encode() for each in (about, about | {"start": None, "num_samples": 10}, about | {"num_samples": 10**12})]


def _store_write(data: bytes, folder: Path) -> None:
    """A series name and location in line protocol: one line per point, whatever the names contain."""
    name = text_of(data)
    with _named_server():
        all_of(lambda: _written("influxdb://bucket/measurement/field", name), lambda: _written(name, "volts"))


def _written(location: str, name: str) -> None:
    store, lines = InfluxStore(location), []
    store.server.send, store.server.ask, store.server.delete = lines.append, lambda *asked: [], lines.append
    store.write(Telemetry(np.arange(3, dtype=np.float32), 1.0, 0.0, None, name))
    assert [text.count("\n") for text in lines] == [2, 0] and all(text.isprintable() for text in "\n".join(lines).split("\n"))


@contextlib.contextmanager
def _named_server():
    before, time = os.environ.copy(), influx_client.time
    os.environ |= _SERVER
    influx_client.time = SimpleNamespace(sleep=lambda seconds: None, monotonic=time.monotonic)
    try:
        yield
    finally:
        influx_client.time = time
        os.environ.clear()
        os.environ.update(before)


def _lines(*texts: str):
    return lambda: [text.encode() for text in texts]


_COMMANDS = (
    "fit\nx.csv\n--out\nmodels\n--window\n64\n--noise\npaper",
    "generate\nmodels\n--windows\n10_000\n--scenario\nstuck:0.5\n--workers\nauto\n--engine\nlocal\n--out\nset",
    "score\nmodels\nx.csv\n--detector\npca-residual\n--false-alarm-rate\n0.01\n--out\ny.csv\n--seed\n3",
    "verify\nset",
    "--help",
)
_ADDRESSES = ("influxdb://bucket/measurement/field", "influxdb://b%2Fc/m/f?tag=value&other=%C3%A9", "influxdb://user:pass@host/m/f?a=b")
TARGETS = {
    "scenario file": Target(_scenario_file, _lines(_SCENARIOS, "nominal: 1.0", "models: [{folder: a}]"), "text", 10),
    "option --scenario": Target(
        lambda data, folder: parse_scenario(text_of(data)), _lines(*(f"{mode}:0.5:0.25" for mode in MODES), "stuck:1"), "text", 10
    ),
    "option --continuous": Target(
        lambda data, folder: parse_num_samples(text_of(data), 0.5), _lines("1d", "6h", "90min", "5000", "1.5 s"), "text", 10
    ),
    "option --start": Target(
        lambda data, folder: parse_start(text_of(data)), _lines("2024-01-01", "2024-01-01T12:00:00.5+02:00", "2024-W01-1"), "text", 6
    ),
    "option --workers": Target(lambda data, folder: parse_workers(text_of(data)), _lines("auto", "2", "16"), "text", 4),
    "option --timezone": Target(_zone, _lines("Europe/Berlin", "UTC", "+02:00", "America/New_York"), "text", 2),
    "format of times": Target(_time_format, _lines("%d.%m.%y %H:%M:%S", "ISO8601", "mixed", "%Y-%m-%dT%H:%M:%S%z"), "text", 2),
    "options --column and --time": Target(_column_options, _lines("value", "time", "none", "0", "Größe"), "text", 2),
    "name of a source": Target(_source_name, _lines("x.csv", "store#volts", "influxdb://b/m/f", "."), "text", 4),
    "command line": Target(_command_line, _lines(*_COMMANDS), "text", 4),
    "name of a channel": Target(_channel_name, _lines("volts", "a/b", "..", "CON", "Größe 1.", " x "), "text", 8),
    "address of a database": Target(_address, _lines(*_ADDRESSES), "text", 10),
    "names in a database": Target(_store_write, _lines("volts", *_ADDRESSES), "text", 2),
    "answer of a database": Target(_server_answer, _server_answer_seeds, "text", 4),
    "description in a database": Target(_server_description, _server_description_seeds, "json", 4),
}
