"""Options, names and addresses of any content are used, or refused in one line."""

import contextlib
import io

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from enhsim_tf.cli.arguments import parse
from enhsim_tf.common.parallel.engines import parse_workers
from enhsim_tf.datasets.places import parse_num_samples, parse_scenario, parse_start
from enhsim_tf.simulator.model_folder import folder_of
from enhsim_tf.telemetry.cleaning.clean import Cleaning, clean
from enhsim_tf.telemetry.influx_store import parse_location
from enhsim_tf.telemetry.sources import read_source
from tests.fuzzing.readers import all_of, changed, judge, tried


def name_of_a_channel(name, folder):
    found = folder_of(folder, name)
    found.mkdir()
    assert found.parent == folder and [path.name for path in folder.iterdir()] == [found.name]
    assert (
        found.name.isascii()
        and not set(found.name) & set('\\/:*?"<>|.')
        and found.name.upper() not in ("CON", "NUL", " ")
    )


def address(text, folder):
    location = parse_location(text)
    assert parse_location(str(location)) == location


def zone(text, folder):
    clean(
        pd.Series(np.arange(60.0), index=pd.date_range("2024-10-26", periods=60, freq="h")),
        Cleaning(timezone=text),
    )


def time_format(text, folder):
    clean(
        pd.Series(np.arange(20.0), index=[f"26.10.24 {hour:02d}:00:00" for hour in range(20)]),
        Cleaning(time_format=text),
    )


def column(text, folder):
    path = folder / "x.csv"
    pd.DataFrame({"time": range(9), "value": np.arange(9.0) ** 2, "Größe": 1.5}).to_csv(
        path, index=False
    )
    np.save(folder / "x.npy", np.zeros((4, 3)))
    all_of(
        lambda: read_source(path, [text]),
        lambda: read_source(path, None, text),
        lambda: read_source(folder / "x.npy", [text]),
        lambda: read_source(path, ["value"], text),
    )


def source(text, folder):
    (folder / "x.csv").write_text("value\n1\n2\n3\n")
    text = text.replace("/", ":")  # so that it does not leave this folder
    read_source(text)


def command_line(text, folder):
    try:
        with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
            parse(text.split("\n"))
    except SystemExit as ended:
        assert ended.code == 0  # help


READERS = {
    name_of_a_channel: ["volts", "a/b", "..", "CON", "Größe 1.", " x "],
    address: [
        "influxdb://bucket/measurement/field",
        "influxdb://b%2Fc/m/f?tag=value&other=%C3%A9",
        "influxdb://user:pass@host/m/f?a=b",
    ],
    zone: ["Europe/Berlin", "UTC", "+02:00"],
    time_format: ["%d.%m.%y %H:%M:%S", "ISO8601", "mixed"],
    column: ["value", "time", "none", "0", "Größe"],
    source: ["x.csv", "influxdb://b/m/f", "."],
    command_line: [
        "fit\nx.csv\n--out\nmodels\n--window\n64\n--noise\nbest",
        "generate\nmodels\n--windows\n10_000\n--scenario\nstuck:0.5\n--workers\nauto\n--out\nset",
        "score\nmodels\nx.csv\n--false-alarm-rate\n0.01\n--out\ny.csv",
        "--help",
    ],
    lambda text, folder: parse_scenario(text): ["stuck:0.5:0.25", "volts=drift:0.2-0.8:1e-3-0.9"],
    lambda text, folder: parse_num_samples(text, 0.5): ["1d", "6h", "90min", "5000", "1.5 s"],
    lambda text, folder: parse_start(text): [
        "2024-01-01",
        "2024-01-01T12:00:00.5+02:00",
        "2024-W01-1",
    ],
    lambda text, folder: parse_workers(text): ["auto", "2", "16"],
}
FOUND = [  # inputs that once were neither accepted nor refused well
    (time_format, "%d.%m.%y:%M:%M:%S"),
    (time_format, "%Y-%n"),
    (name_of_a_channel, "\udcff\udcff"),
    (source, "\udcff"),
    (address, "influxdb://b\ud800/m/f"),
    (address, "influxdb://user:pass@host/\ud800m/f?a=b"),
]


@pytest.mark.parametrize(("read", "text"), FOUND)
def test_what_once_failed_is_used_or_refused(read, text):
    judge(read, text)


@pytest.mark.parametrize("read", READERS)
@tried(60)
@given(st.data())
def test_texts(read, data):
    seeds = changed([seed.encode() for seed in READERS[read]]).map(
        lambda seed: seed.decode("utf-8", "surrogateescape")
    )
    judge(read, data.draw(seeds | st.text(max_size=60)))
