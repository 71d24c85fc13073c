"""A channel of one's own is cleaned before the paper's pipeline runs on it; what was repaired is
told, and what cannot be is refused.
"""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.common.stages import Stages
from enhsim_tf.own_channel import OwnChannel
from enhsim_tf.paper.settings import Settings

N = 4_000
VALUES = np.sin(np.arange(N) / 15) + 0.1 * np.random.default_rng(0).standard_normal(N)
TABLE = pd.DataFrame(
    {
        "utc": pd.Timestamp("2021-03-04") + pd.to_timedelta(30 * np.arange(N), unit="s"),
        "volts": VALUES,
    }
)


def pipeline(path, column="volts", time="utc"):
    """The pipeline on a file, and the lines that it told."""
    told: list[str] = []
    return OwnChannel(
        Settings(), Stages(path.parent / "cache", tell=told.append), None, path, column, time
    ), told


@pytest.fixture
def written(tmp_path):
    def write(frame: pd.DataFrame) -> Path:
        frame.to_csv(tmp_path / "x.csv", index=False)
        return tmp_path / "x.csv"

    return write


def test_what_can_be_repaired_is_and_is_told(written):
    spoilt = TABLE.drop(index=[50, 51]).sample(frac=1, random_state=0)
    found, told = pipeline(written(spoilt))
    before, *filled, after = found.own.values[49:53]
    np.testing.assert_allclose(filled, np.linspace(before, after, 4)[1:3], rtol=1e-5)
    # the unit of the pipeline is another one
    expected, others = (np.delete(values, [50, 51]) for values in (VALUES, found.own.values))
    slope, offset = np.polyfit(expected, others, 1)
    np.testing.assert_allclose(others, slope * expected + offset, atol=1e-5)
    for words in ("gaps", "rows out of chronological order"):
        assert [line for line in told if line.startswith(f"repaired: {words}")]


def test_the_channel_has_the_name_of_its_file(written):
    assert pipeline(written(TABLE))[0].telemetry_settings["name"] == "x"


def test_a_channel_in_several_parts_is_refused(written, refused):
    with refused("2 parts in x.csv"):
        pipeline(written(TABLE.drop(index=range(500, 900))))


def test_a_constant_channel_is_refused(written, refused):
    with refused("the constant 2 in volts of x.csv"):
        pipeline(written(TABLE.assign(volts=2.0)))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("amperes", "utc"), "'amperes'"),
        (("volts", "t"), "'t'"),
        ((None, "utc"), "2 in x.csv (volts, watts)"),
    ],
)
def test_a_column_that_is_not_there_or_not_named_is_refused(written, refused, arguments, words):
    with refused(words):
        pipeline(written(TABLE.assign(watts=VALUES)), *arguments)


@pytest.mark.parametrize("column", [None, "-1", "value"])
def test_a_column_of_an_array_is_a_number(tmp_path, refused, column):
    np.save(tmp_path / "x.npy", np.zeros((5, 3)))
    with refused("x.npy", *([repr(column)] if column else [])):
        pipeline(tmp_path / "x.npy", column, None)


def test_what_is_no_file_is_refused(tmp_path, refused):
    (tmp_path / "folder.csv").mkdir()
    for name in ("absent.csv", "folder.csv"):
        with refused(name):
            pipeline(tmp_path / name)
