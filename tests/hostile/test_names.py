"""Hostile names of channels, columns and sources cannot leave their folder, and are printed as one
plain line.
"""

import json
import os
import string
import urllib.parse

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enhsim_tf.__main__ import main
from enhsim_tf.simulator.model_folder import folder_of, models_of
from enhsim_tf.telemetry.cleaning.clean import clean
from enhsim_tf.telemetry.sources import read_source
from tests.fitted_simulators import TINY
from tests.small_data_set import plain

NAMES = (
    "..", ".", "../../up", "/etc/passwd", "..\\..\\up", "C:\\up", "a/b", ".hidden", "CON", "nul", "com1", "LPT9", "Aux ", "trailing.", " lead",
    "<script>alert(1)</script>", "\"'&<img src=x onerror=alert(1)>", "\x1b[31mred\x1b[0m", "\x1b]0;title\x07", "a\rb", "a\tb", "\u202eevil", "漢字",
    "-rf", "~", "%2e%2e", "%", "a?b*c|d", "$HOME", "`id`", "a" * 160,
)  # fmt: skip
REFUSED = ("", "a" * 181, "é" * 40, "\ud800", "a\udcffb", "." * 61)
# reserved by Windows
KEPT = {
    "con",
    "prn",
    "aux",
    "nul",
    *(f"{port}{number}" for port in ("com", "lpt") for number in range(10)),
}
ALLOWED = set(string.ascii_letters + string.digits + "%_-~ ")


def check_file_name(name):
    found = str(folder_of("", name))
    assert set(found) <= ALLOWED and 1 <= len(found) <= 160 and urllib.parse.unquote(found) == name
    assert (
        found.casefold() not in KEPT and found == found.strip() and os.path.basename(found) == found
    )


@pytest.mark.parametrize("name", REFUSED)
def test_a_name_that_cannot_be_a_file_name_is_refused(name, refused, tmp_path):
    with refused("name"):
        folder_of(tmp_path, name)


@settings(derandomize=True, max_examples=100, deadline=None, database=None)
@given(
    st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=14),
    st.text(min_size=1, max_size=14),
)
def test_any_name_is_encoded_as_a_distinct_file_name(name, other):
    check_file_name(name)
    assert name == other or folder_of("", name) != folder_of("", other)


def test_every_hostile_name_is_encoded():
    for name in NAMES:
        check_file_name(name)


def files_below(folder):
    return {path for path in folder.rglob("*") if path.is_file()}


def lines_of(capfd):
    """The printed output; checks that it has only printable characters."""
    out, error = capfd.readouterr()
    lines = [*out.split("\n"), *error.split("\n")]
    assert all(line.isprintable() for line in lines), [
        line for line in lines if not line.isprintable()
    ]
    return lines


# spaces around the column names of a table are stripped
COMMANDED = [name for name in NAMES if name == name.strip()]


@pytest.fixture
def models(tmp_path):
    for name in COMMANDED:
        plain(channels=(name,)).save(folder_of(tmp_path / "world" / "models", name))
    assert set(models_of(tmp_path / "world" / "models")) == set(COMMANDED)
    return tmp_path / "world" / "models"


def test_training_data_of_hostile_channels_stay_in_their_folder(models, tmp_path, capfd):
    out = tmp_path / "world" / "out"
    before = files_below(tmp_path)
    generate = f"generate {models} --windows 3 --out {out}".split()
    assert main(generate) == 0
    made = files_below(tmp_path) - before
    assert {path.parent for path in made} == {out} and len(made) == len(COMMANDED)
    assert sum("3 windows" in line for line in lines_of(capfd)) == len(COMMANDED)
    found = pd.read_parquet(folder_of(out, "..").with_suffix(".parquet"))
    assert len(found) == 3
    for name in ("\x1b[31mnot there", "\ud800", "x" * 2_000):
        assert main([*generate, "--channel", name]) == 2
        lines_of(capfd)


def table_of(names, num_samples=200):
    times = pd.date_range("2024-01-01", periods=num_samples, freq="2s")
    wave = np.sin(np.arange(num_samples) / 3) + 0.1 * np.random.default_rng(0).standard_normal(
        num_samples
    )
    return pd.DataFrame({"time": times} | {name: wave for name in names})


@pytest.mark.filterwarnings("ignore")
def test_a_fit_of_hostile_channels_stays_in_its_folder(tmp_path, capfd):
    names = ["../../<script>\x1b[31m", "CON"]
    source, out = tmp_path / "world" / "x.parquet", tmp_path / "world" / "models"
    source.parent.mkdir()
    short = {"short\x1b[31m\n": [1.0] * 2 + [np.nan] * 1_498}
    table_of(names, 1_500).assign(**short).to_parquet(source)
    fit = f"fit {source} --out {out} {TINY} --separately --workers 1"
    assert main(fit.split()) == 2  # one is too short
    made = files_below(tmp_path) - {source}
    assert {path.parent for path in made} == {folder_of(out, name) for name in names}
    assert set(models_of(out)) == set(names)
    lines = lines_of(capfd)
    assert any("<script>" in line for line in lines)
    assert sum(line.startswith("error: short") for line in lines) == 1
    text = (folder_of(out, names[0]) / "report.json").read_text()
    report = json.loads(text)
    # JSON keeps the name unchanged
    assert list(report["cleaning"]) == report["report"]["channels"] == [names[0]]
    assert "\x1b" not in text


@pytest.mark.parametrize("name", ["\x1b[31mred", "\u202eevil"])
def test_findings_about_hostile_columns_are_plain_lines(tmp_path, name):
    table_of(["value"]).assign(**{name: "word"}).rename(columns={"time": f"{name} time"}).to_csv(
        tmp_path / "x.csv", index=False
    )
    (series,) = read_source(tmp_path / "x.csv").values()
    lines = clean(series).report.lines()
    assert all(line.isprintable() for line in lines)
    assert any("columns without numbers" in line for line in lines)
