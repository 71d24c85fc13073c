"""The recipes of the docs for files that other libraries read, on files that are made here."""

import struct

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.telemetry.cleaning.clean import Cleaning
from enhsim_tf.telemetry.sources import read_telemetry
from tests.clone import blocks_of

N = 300
VALUES = (12 + np.sin(np.arange(N) / 9)).astype(np.float32)
RECIPES = blocks_of("docs/forms.md")


def mdf(folder):
    asammdf = pytest.importorskip("asammdf")
    file = asammdf.MDF()
    file.append([asammdf.Signal(VALUES, 0.1 * np.arange(N), name="volts")])
    file.save(folder / "drive.mf4")
    file.close()


def tdms(folder):
    nptdms = pytest.importorskip("nptdms")
    about = {"wf_increment": 0.1, "wf_start_offset": 0.0}
    with nptdms.TdmsWriter(folder / "bench.tdms") as writer:
        writer.write_segment([nptdms.ChannelObject("Group", "volts", VALUES, about)])


def ulog(folder):
    pytest.importorskip("pyulog")

    def message(kind, content):
        return struct.pack("<HB", len(content), ord(kind)) + content

    content = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    content += message("F", b"battery_status:uint64_t timestamp;float volts;")
    content += message("A", struct.pack("<BH", 0, 7) + b"battery_status")
    for number, value in enumerate(VALUES):
        content += message("D", struct.pack("<HQf", 7, 5_000_000 + 100_000 * number, value))
    (folder / "flight.ulg").write_bytes(content)


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("write", [mdf, tdms, ulog])
def test_a_recipe_reads_the_values_and_the_interval(tmp_path, monkeypatch, write):
    write(tmp_path)
    (recipe,) = [text for text in RECIPES if list(tmp_path.iterdir())[0].name in text]
    monkeypatch.chdir(tmp_path)
    names = {"pd": pd, "read_telemetry": read_telemetry, "Cleaning": Cleaning}
    exec(recipe, names)
    assert names["telemetry"].columns == ("volts",)
    assert names["telemetry"].interval_s == pytest.approx(0.1)
    np.testing.assert_allclose(names["telemetry"].values[:, 0], VALUES, rtol=1e-6)
