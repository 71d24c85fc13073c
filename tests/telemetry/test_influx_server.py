"""Tests of the InfluxDB store with a real server: points are restored bit for bit despite server
restarts; errors are one line.
"""

import io
import logging
import pickle
import threading
import time
import traceback
import uuid

import numpy as np
import pytest

from enhsim_tf.common.errors import InputError
from enhsim_tf.own_store import InfluxTelemetry
from enhsim_tf.paper.telemetry import Telemetry
from enhsim_tf.telemetry.influx_store import VARIABLES, InfluxLocation, InfluxStore
from enhsim_tf.telemetry.sources import read_source
from tests.telemetry import influxd

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    """The server started by the tests; skips if there is none."""
    pytest.importorskip("influxdb_client")
    program = influxd.find_influxd()
    if program is None:
        pytest.skip(influxd.WITHOUT)
    ours = influxd.Server(program, tmp_path_factory.mktemp("influxd"))
    yield ours
    ours.kill()


@pytest.fixture
def named(server, monkeypatch):
    """Sets the environment variables to the server."""
    for name, value in zip(VARIABLES, (server.url, server.token, server.org), strict=True):
        monkeypatch.setenv(name, value)
    return server


@pytest.fixture
def mortal(named):
    """A server that the test may kill. It runs again after the test."""
    yield named
    if named.process.poll() is not None:
        named.start()


@pytest.fixture
def bucket(named):
    """A bucket used by one test only."""
    name = f"test {uuid.uuid4().hex[:12]}"
    with _client() as client:
        made = client.buckets_api().create_bucket(bucket_name=name)
        yield name
        client.buckets_api().delete_bucket(made)


def _client():
    from influxdb_client import InfluxDBClient

    return InfluxDBClient.from_env_properties()


def _put(bucket, lines):
    """Writes points as another program would."""
    from influxdb_client.client.write_api import SYNCHRONOUS

    with _client() as client:
        client.write_api(SYNCHRONOUS).write(bucket, record=lines, write_precision="ns")


def _flux(query):
    with _client() as client:
        return [
            record.values for table in client.query_api().query(query) for record in table.records
        ]


def _location(bucket, rest="wheel/speed"):
    return f"influxdb://{bucket.replace(' ', '%20')}/{rest}"


def _points(number, seed=0, interval_ns=10**9):
    """Times and values of a series."""
    return interval_ns * np.arange(number), np.random.default_rng(seed).normal(size=number).astype(
        np.float32
    )


def test_every_finite_float32_comes_back_and_a_repeated_write_stores_it_once(bucket):
    bits = np.random.default_rng(0).integers(0, 2**32, 20_000, dtype=np.uint32).view(np.float32)
    extremes = np.array(
        [0, -0.0, 1e-45, -1e-45, 1.1754944e-38, 3.4028235e38, -3.4028235e38, 0.1, 16777217],
        np.float32,
    )
    kept = np.concatenate([bits[np.isfinite(bits)], extremes])
    times = np.arange(len(kept)) + 1_583_020_800_123_456_789  # a nanosecond apart
    for _ in range(2):
        InfluxStore(_location(bucket)).write(times, kept)
    found, values = InfluxStore(_location(bucket)).read()
    assert np.array_equal(found, times) and values.astype(np.float32).tobytes() == kept.tobytes()


def test_series_of_one_bucket_stay_apart(bucket):
    places = ["a/f", "a/g", "b/f", "c/f?t=1", "c/f?t=2"]
    for number, place in enumerate(places):
        InfluxStore(_location(bucket, place)).write(*_points(50, number))
    for number, place in enumerate(places):
        assert np.array_equal(
            InfluxStore(_location(bucket, place)).read()[1], _points(50, number)[1]
        ), place


def test_places_with_hostile_names(bucket):
    place = InfluxLocation(
        bucket, 'it\'s "m" ${1}\\n, a=b', 'f"\\g${h}, i=j', (('t"\\u${v}, w=x', 'y"\\z${0}, 1=2'),)
    )
    InfluxStore(place).write(*_points(30))
    assert np.array_equal(InfluxStore(str(place)).read()[1], _points(30)[1])


def test_a_series_of_another_program_is_read_unchanged(bucket):
    rng = np.random.default_rng(0)
    times = np.unique(rng.integers(10**18, 10**18 + 10**15, 3_000))
    values = rng.normal(size=len(times))
    order = rng.permutation(len(times))
    _put(
        bucket,
        "\n".join(f"bus,craft=A volts={float(values[i])!r},amperes={i}i {times[i]}" for i in order),
    )
    _put(bucket, f"bus,craft=B volts=7 {times[0]}")
    found, read = InfluxStore(_location(bucket, "bus/volts?craft=A")).read()
    assert np.array_equal(found, times) and read.tobytes() == values.tobytes(), (
        "float64 as it is kept"
    )
    ((name, channel),) = read_source(_location(bucket, "bus/volts?craft=A")).items()
    assert name == "volts" and (channel.series.index.asi8 == times).all()
    assert (channel.series == values).all()
    found, read = InfluxStore(_location(bucket, "bus/amperes")).read()
    assert np.array_equal(found, times) and np.array_equal(read, np.arange(len(times))), (
        "whole numbers are numbers"
    )


def test_anything_but_one_numeric_series_is_refused(bucket, refused):
    _put(
        bucket,
        'bus,craft=A,side=l volts=1 1\nbus,craft=A,side=r volts=2 1\nbus,craft=B volts=3 1\nbus,craft=A mode="safe" 1\nbus on=true 1',
    )

    def read(place):
        return InfluxStore(_location(bucket, place)).read()[0]

    assert len(read("bus/volts?craft=B")) == 1
    with refused("several", "craft=A&side=l", "craft=A&side=r"):
        read("bus/volts?craft=A")
    for place in (
        "bis/volts",
        "bus/vlts",
        "bus/volts?craft=C",
        "bus/volts?kraft=A",
        "bus/volts?craft=B&side=l",
    ):
        with refused(
            f"Expected points at influxdb://{bucket.replace(' ', '%20')}/{place}. Received: none"
        ):
            read(place)
    for place in ("bus/mode", "bus/on"):
        with refused("a field of numbers"):
            read(place)


def test_server_restarts_during_a_write_neither_lose_nor_repeat_points(mortal, bucket, caplog):
    million = 10**6
    # integers, whose sum is exact in any order
    values = np.random.default_rng(0).permutation(million).astype(np.float32)
    writing = threading.Thread(
        target=InfluxStore(_location(bucket)).write, args=(10**9 * np.arange(million), values)
    )
    writing.start()
    for _ in range(2):
        time.sleep(1)
        assert writing.is_alive()
        mortal.kill()  # while batches are being sent
        time.sleep(1)
        mortal.start()
    writing.join()
    assert "Retrying" in caplog.text, "a batch met no server"
    times, found = InfluxStore(_location(bucket)).read()
    assert np.array_equal(times, 10**9 * np.arange(million)) and np.array_equal(found, values)


@pytest.mark.parametrize(
    "use",
    [
        lambda store: store.check(),
        lambda store: store.write(*_points(9)),
        lambda store: store.read(),
    ],
    ids=["check", "write", "read"],
)
def test_an_unknown_token_organisation_or_bucket_is_named(named, bucket, monkeypatch, refused, use):
    with refused("'nowhere'", "bucket"):
        use(InfluxStore(_location("nowhere")))
    with monkeypatch.context() as patch, refused("INFLUXDB_V2_TOKEN"):
        patch.setenv("INFLUXDB_V2_TOKEN", "wrong-" + named.token)
        use(InfluxStore(_location(bucket)))
    monkeypatch.setenv("INFLUXDB_V2_ORG", "of nobody")
    with refused("INFLUXDB_V2_ORG", "'of nobody'"):
        use(InfluxStore(_location(bucket)))


def test_missing_samples_are_noticed(bucket, refused):
    store = InfluxTelemetry(_location(bucket))
    store.write(Telemetry(_points(1_000)[1].astype(np.float32), 1.0, "2020-01-01T00:00:00Z"))
    with _client() as client:
        client.delete_api().delete(
            "2020-01-01T00:08:00Z", "2020-01-01T00:08:00Z", '_measurement="wheel"', bucket
        )
    with refused("1,000 samples", "999"):
        store.read()


@pytest.mark.parametrize(
    "token",
    [
        "not-the-right-one-0123456789",
        "lines-0123456789\ntwo-of-them-0123456789",
        "not-latin-€-0123456789",
    ],
)
def test_the_token_appears_nowhere(named, bucket, monkeypatch, caplog, capfd, token):
    told = io.StringIO()
    caplog.set_level(logging.DEBUG)
    for url, place in ((named.url, bucket), (named.url, "nowhere"), ("http://127.0.0.1:9", bucket)):
        for given in (token, named.token):
            monkeypatch.setenv("INFLUXDB_V2_URL", url)
            monkeypatch.setenv("INFLUXDB_V2_TOKEN", given)
            for use in (lambda store: store.write(*_points(20)), lambda store: store.read()):
                store = None
                try:
                    store = InfluxStore(_location(place))
                    use(store)
                except InputError as error:
                    assert error.__context__ is None and error.__cause__ is None
                    told.write("".join(traceback.format_exception(error)))
                if store is not None:
                    told.write(f"{store!r} {vars(store)} {pickle.dumps(store)}")
    said = told.getvalue() + caplog.text + "".join(capfd.readouterr())
    assert "Expected" in said and "INFLUXDB_V2_TOKEN" in said
    for part in (token, named.token, *token.split(), repr(token)):
        assert part not in said


def test_the_reproduction_runs_through_influxdb(named, bucket, tmp_path, capsys):
    from enhsim_tf.reproduce import main

    place = _location(bucket, "paper/value")
    count = f'from(bucket: "{bucket}") |> range(start: 2019-01-01T00:00:00Z, stop: 2021-01-01T00:00:00Z) |> count()'
    for name in ("first", "again", "deleted"):
        if name == "deleted":  # the stage counts as done, but its series is deleted from the server
            with _client() as client:
                client.delete_api().delete(
                    "1970-01-01T00:00:00Z", "2200-01-01T00:00:00Z", '_measurement="paper"', bucket
                )
        words = [
            "--budget",
            "smoke",
            "--only",
            "fig14",
            "--cache",
            tmp_path / "cache",
            "--store",
            place,
            "--out",
            tmp_path / name,
        ]
        assert main([str(word) for word in words]) == 0
        assert ("(from the cache)" in capsys.readouterr().out) == (name != "first")
        assert f"store {place} · " in (tmp_path / name / "fig14_telemetry_store.svg").read_text(
            encoding="utf-8"
        )
        assert [row["_value"] for row in _flux(count)] == [120_000], (
            "they are there, and there once"
        )
    for file in tmp_path.rglob("*"):
        assert not file.is_file() or named.token.encode() not in file.read_bytes()
