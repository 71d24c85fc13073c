"""Tests of the InfluxDB store without a server: locations, answers, and refusals in one line before
any work.
"""

import http.server
import sys
import threading

import numpy as np
import pytest

from enhsim_tf.telemetry import influx_store
from enhsim_tf.telemetry.influx_store import VARIABLES, InfluxLocation, InfluxStore, parse_location
from tests.clone import answered

POINTS = np.arange(3), np.ones(3, np.float32)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("influxdb://b/m/f", ("b", "m", "f", ())),
        ("influxdb://b/m/f?z=1&a=2", ("b", "m", "f", (("a", "2"), ("z", "1")))),
        ("influxdb://My%20b/m%2Fn/f%3F?t%3D=%26", ("My b", "m/n", "f?", (("t=", "&"),))),
        ("influxdb://b+c/m#n/f:1@2[3?t=a+b", ("b+c", "m#n", "f:1@2[3", (("t", "a+b"),))),
        ("influxdb://B/%C2%B0/%25", ("B", "°", "%", ())),
    ],
)
def test_locations_are_read(text, parts):
    assert parse_location(text) == InfluxLocation(*parts)


@pytest.mark.parametrize(
    "rest", ["", "/m/f", "b", "b//f", "b/m", "b/m/?t=v", "b/m/f/g", "b/m/f?t", "b/m/f?t=", "b/m/f?=v", "b/m/f?t=v&", "b/m/f?t=v=w",
             "b/m/f?t=v&t=w", "b/m/%FF", "b/m/\ud800"],
)  # fmt: skip
def test_invalid_locations_are_refused(rest, refused):
    with refused("influxdb://bucket/measurement/field?tag=value"):
        parse_location(f"influxdb://{rest}")
    with refused("influxdb://bucket"):
        parse_location("http://b/m/f")


HEAD, ROW = b",result,table,_time,_value\r\n", b",_result,0,1970-01-01T00:00:01.%09dZ,%s\r\n"


ODD = {
    "an error after the points": HEAD
    + ROW % (7, b"1")
    + b"\r\n#datatype,string,string\r\n,error,reference\r\n,out of memory,17\r\n",
    "words": HEAD + ROW % (7, b"safe"),
    "a time that is none": HEAD + b",_result,0,soon,1\r\n",
    "half a row": HEAD + b",_result,0\r\n",
    "other columns": b",result,table,_time\r\n,_result,0,1970-01-01T00:00:01Z\r\n",
    "something else": b"\ra\\b\n",
}


def test_a_missing_client_is_named(pretended, monkeypatch, refused):
    monkeypatch.setitem(sys.modules, "influxdb_client", None)
    with refused("pip install influxdb-client"):
        InfluxStore("influxdb://b/m/f")


URLS = "localhost:8086|ftp://localhost|http://|http://[|http://a:b|http://a:0|http://a b|http://a\n|http://u:secret@b".split(
    "|"
)


@pytest.mark.parametrize("name", ODD)
def test_an_answer_without_numbers_is_refused(name, refused):
    with refused("a field of numbers"):
        influx_store._parse(ODD[name])


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [(name, " ", f"no {name}") for name in VARIABLES]
    + [("INFLUXDB_V2_URL", url, "INFLUXDB_V2_URL") for url in URLS],
)
def test_a_variable_that_is_missing_or_no_address_is_named(
    pretended, monkeypatch, refused, name, value, words
):
    monkeypatch.setenv(name, value)
    with refused(words) as caught:
        InfluxStore("influxdb://b/m/f")
    assert "secret" not in str(caught.value)


@pytest.mark.parametrize(
    "use",
    [lambda store: store.check(), lambda store: store.read(), lambda store: store.write(*POINTS)],
)
def test_a_server_that_is_down_is_reported_at_once(pretended, refused, use):
    with refused("http://127.0.0.1:9", "no answer"):
        use(InfluxStore("influxdb://b/m/f"))


def test_a_nonnumeric_client_variable_is_refused(pretended, monkeypatch, refused):
    monkeypatch.setenv("INFLUXDB_V2_TIMEOUT", "soon")
    with refused("INFLUXDB_V2_TIMEOUT"):
        InfluxStore("influxdb://b/m/f").check()


def test_series_that_influxdb_cannot_store_are_refused(pretended, refused):
    for wrong, word in ((np.nan, "sample 1"), (np.inf, "inf")):
        with refused(word):
            InfluxStore("influxdb://b/m/f").write(POINTS[0], np.array([1, wrong, 2], np.float32))
    for place in ("m%0A/f", "%23m/f", "m%5C/f", "m/_f", "m/f?time=a", "m/f?_t=a", "m/f?t=%5C"):
        with refused("another location"):
            InfluxStore(f"influxdb://b/{place}").write(*POINTS)


@pytest.fixture
def served(pretended, monkeypatch):
    """`served(answer)` starts a server that answers every request to write or to read by the status
    and the content of `answer(path)`.
    """
    servers = []

    def served(answer):
        class Handler(http.server.BaseHTTPRequestHandler):
            def log_message(self, *words):
                pass

            def do_POST(self):  # noqa: N802
                self.rfile.read(int(self.headers["Content-Length"]))
                status, content = answer(self.path.partition("?")[0])
                self.send_response(status)
                self.send_header("Content-Length", str(len(content)))
                self.end_headers()
                self.wfile.write(content)

        server = http.server.HTTPServer(("127.0.0.1", 0), Handler)
        servers.append(server)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        monkeypatch.setenv("INFLUXDB_V2_URL", f"http://127.0.0.1:{server.server_port}")

    yield served
    for server in servers:
        server.shutdown()
        server.server_close()


@pytest.mark.parametrize(
    ("status", "words"), [(200, "something else"), (404, "something else"), (302, "(302)")]
)
def test_another_service_at_the_address_is_reported(served, refused, status, words):
    served(lambda path: (status, b"<html><body>Welcome,\nfriend</body></html>"))
    with refused(words):
        InfluxStore("influxdb://b/m/f").check()


def test_a_write_has_one_client_which_is_closed(served, monkeypatch):
    from influxdb_client import InfluxDBClient

    paths, clients, closed = [], [], []
    opened = InfluxDBClient.__init__
    close = InfluxDBClient.close
    monkeypatch.setattr(
        InfluxDBClient,
        "__init__",
        lambda self, *given, **more: clients.append(self) or opened(self, *given, **more),
    )
    monkeypatch.setattr(InfluxDBClient, "close", lambda self: closed.append(self) or close(self))
    served(lambda path: paths.append(path) or (200 if "query" in path else 204, b""))
    InfluxStore("influxdb://b/m/f").write(np.arange(6_000), np.ones(6_000, np.float32))
    assert paths == ["/api/v2/query", "/api/v2/write", "/api/v2/write"]
    assert len(clients) == 1 and closed == clients


@pytest.mark.parametrize(
    ("store", "word"),
    [
        ("influxdb", "INFLUXDB_V2_TOKEN"),
        ("influxdb://telemetry/m/f", "no answer"),
        ("influxdb://telemetry", "influxdb://"),
        ("sqlite", "parquet, influxdb"),
    ],
)
def test_an_unusable_store_is_reported_before_any_work(
    pretended, monkeypatch, tmp_path, store, word
):
    if word == "INFLUXDB_V2_TOKEN":
        monkeypatch.delenv(word)
    words = f"--store {store} --budget smoke --out {tmp_path}/out --cache {tmp_path}/cache"
    done = answered("enhsim_tf.reproduce", words.split())
    assert (done.returncode, done.stdout) == (2, "set()\n"), done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith("error: Expected ") and word in done.stderr
    assert not list(tmp_path.iterdir())
