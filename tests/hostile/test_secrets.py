"""The database token and passwords in URLs never appear in anything that is printed or written.

Tests that need a server are in `test_influx_server.py::test_the_token_appears_nowhere`.
"""

import logging
import pickle

import numpy as np
import pytest

from enhsim_tf.__main__ import main
from enhsim_tf.common.errors import InputError
from enhsim_tf.simulator.model_folder import folder_of
from enhsim_tf.telemetry.influx_store import parse_location
from enhsim_tf.telemetry.sources import read_source
from tests.hostile.test_names import table_of
from tests.small_data_set import plain

NOMINAL = np.random.default_rng(0).standard_normal((500, 1)).astype(np.float32)
TOKEN, PASSWORD = "token-0123456789abcdef==", "pass-0123456789"


@pytest.fixture(autouse=True)
def named_cluster(pretended, monkeypatch):
    monkeypatch.setenv("RAY_ADDRESS", f"ray://user:{PASSWORD}@127.0.0.1:9")


@pytest.fixture
def world(tmp_path):
    plain(channels=("volts",), nominal=[NOMINAL]).save(folder_of(tmp_path / "models", "volts"))
    table_of(["volts"]).to_csv(tmp_path / "x.csv", index=False)
    return tmp_path


RUNS = {
    "a fit from a database": "fit influxdb://bucket/measurement/field --out {0}/new",
    "a fit from an address with a password": (
        f"fit influxdb://user:{PASSWORD}@host/m/f --out {{0}}/new"
    ),
    "a token in the address": f"fit influxdb://host/m/f?token={TOKEN} --out {{0}}/new",
    "a token for a channel": (
        f"generate {{0}}/models --windows 3 --channel {TOKEN} --out {{0}}/y.parquet"
    ),
    "a large data set": "generate {0}/models --windows 30 --workers 1 --out {0}/set",
    "a cluster that is not there": "generate {0}/models --windows 30 --engine ray --out {0}/set",
    "scores": "score {0}/models {0}/x.csv --out {0}/y.parquet",
}
DONE = {"a large data set", "scores"}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * ("cluster" in name)) for name in RUNS]
)
def test_a_run_prints_and_writes_no_secret(world, capfd, caplog, name):
    caplog.set_level(logging.DEBUG, "enhsim_tf")
    if "cluster" in name:
        pytest.importorskip("ray")
    code = main(RUNS[name].format(world).split())
    assert code == (0 if name in DONE else 2)
    said = "".join(capfd.readouterr()) + caplog.text
    written = [path for path in world.rglob("*") if path.is_file()]
    for secret in (TOKEN, PASSWORD):
        assert secret not in said
        assert not [
            path for path in written if secret.encode() in path.read_bytes() or secret in path.name
        ]
    assert said and len(written) >= 4  # the table, and the three files of the model


@pytest.mark.parametrize(
    "address",
    [
        f"influxdb://user:{PASSWORD}@host/m",
        f"https://user:{PASSWORD}@[::1]:8086/x?y=z",
        f"//:{PASSWORD}@h",
    ],
)
def test_no_refusal_repeats_a_password(address, tmp_path):
    for use in (parse_location, read_source, lambda text: read_source(tmp_path / "x.csv", [text])):
        (tmp_path / "x.csv").write_text("value\n1\n2\n")
        with pytest.raises(InputError) as caught:
            use(address)
        for told in (
            str(caught.value),
            repr(caught.value),
            repr(pickle.loads(pickle.dumps(caught.value))),
            repr(vars(caught.value)),
        ):
            assert PASSWORD not in told


@pytest.mark.parametrize(
    "address",
    [
        "influxdb://user:se/cret@host/m",
        "https://se:cr et@b/x",
        "user:pw@host:10001",
        "'user:pw@[::1]:1'",
        "ray://:pass@h:1",
    ],
)
def test_passwords_of_unusual_addresses_are_hidden(address):
    line = str(InputError(f"Expected a. Received: {address}. Do c."))
    assert "***@" in line and not any(secret in line for secret in ("cret", "cr et", "pw", "pass"))


@pytest.mark.parametrize("token", [TOKEN, "x" * 2_000, "a.b*c[d\\e", "it's secret"])
def test_no_refusal_repeats_the_token(monkeypatch, token):
    monkeypatch.setenv("INFLUXDB_V2_TOKEN", token)
    assert str(InputError(f"Expected a. Received: {[token]!r}.")).count("***") == 1, "escaped"
    line = str(InputError(f"Expected a. Received: {token} and {token}. Do c."))
    assert line == "Expected a. Received: *** and ***. Do c."


def test_addresses_and_words_without_secrets_stay_as_they_are(monkeypatch):
    # a short token may be an ordinary word of a message
    monkeypatch.setenv("INFLUXDB_V2_TOKEN", "a")
    for text in (
        "Expected a time at 12:30. Received: http://host:8086/a@b.",
        "Expected a. Received: influxdb://bucket/measurement/a:b@c.",
    ):
        assert str(InputError(text)) == text


@pytest.mark.parametrize("letter", ["x", "a:", "='", "//a:", "(", "@"])
def test_a_secret_between_very_long_names_is_masked(letter):
    url = f"https://user:{PASSWORD}@host:8086"
    line = str(InputError(f"Expected {url} {letter * 50_000}. Received: {letter * 50_000} {url}."))
    assert PASSWORD not in line and line.startswith("Expected https://***@") and len(line) <= 600
