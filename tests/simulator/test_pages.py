"""The examples of docs/own_simulator.md run, and its commands are parsed."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.__main__ import main
from tests.clone import ROOT, blocks_of

BLOCKS = blocks_of("docs/own_simulator.md")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A working folder with the files of the first example."""
    rng, times = np.random.default_rng(0), pd.date_range("2024-01-01", periods=2_000, freq="10s")
    watts = np.convolve(rng.standard_normal(2_000), np.hanning(20), "same")
    run = pd.DataFrame({"time": times, "watts": watts})
    run.to_csv(tmp_path / "simulator.csv", index=False)
    run.iloc[:300].assign(watts=0.5 * watts[:300], scenario="weak heater").to_csv(
        tmp_path / "fault_run.csv", index=False
    )
    measured = 20 + watts + 0.1 * rng.standard_normal(2_000)
    pd.DataFrame({"time": times, "celsius": measured}).to_csv(
        tmp_path / "telemetry.csv", index=False
    )
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_example_with_files_runs(folder, capsys):
    made = {}
    exec(BLOCKS[0].replace("FitOptions(seed=0)", "FitOptions(seed=0, num_windows=200)"), made)
    assert [copy.shape for copy in made["copies"]] == [
        (300, 1)
    ] * 3 and "Used: " in capsys.readouterr().out


def test_the_example_with_a_function_runs(folder):
    made = {}
    exec(BLOCKS[1].replace("seed=0)\n\nweak", "seed=0, num_windows=300, window=64)\n\nweak"), made)
    truth = 20 + 1.2 * made["heater"](made["times"][:2_000], 0.5)[:, 1]
    assert np.sqrt(np.mean((made["copy"][:, 0] - truth) ** 2)) < 0.5 * truth.std()


def test_the_example_with_an_fmu_runs(folder):
    pytest.importorskip("fmpy", reason="the extra fmi is not installed")
    builder = pytest.importorskip("pythonfmu.builder", reason="pythonfmu is not installed")
    builder.FmuBuilder.build_FMU(ROOT / "tests" / "coarse" / "heater_fmu.py", dest=folder)
    command = (np.sin(np.arange(300) / 15) > 0).astype(int)
    pd.DataFrame(
        {"time": pd.date_range("2024-01-01", periods=300, freq="10s"), "command": command}
    ).to_csv("commands.csv", index=False)
    made = {}
    exec(BLOCKS[2], made)
    nominal, weak = (made[name].parts[0].values for name in ("nominal", "weak"))
    np.testing.assert_allclose(weak[:, 0], 0.5 * nominal[:, 0])
    assert nominal[:, 1].max() > weak[:, 1].max() + 5


def test_the_files_of_a_family_become_one_model(folder, capsys):
    rng = np.random.default_rng(1)
    for kind in ("telemetry", "runs"):
        Path("recorded", kind).mkdir(parents=True)
    for name in ("first", "second"):
        watts = np.convolve(rng.standard_normal(1_500), np.hanning(20), "same")
        celsius = 20 + watts + 0.1 * rng.standard_normal(1_500)
        for kind, column, values in (("telemetry", "celsius", celsius), ("runs", "watts", watts)):
            table = pd.DataFrame({"time": np.arange(1_500) * 10, column: values})
            table.to_csv(Path("recorded", kind, f"{name}.csv"), index=False)
    arguments = "--delay 0 --window 64 --num-windows 200 --enhancer ridge --out family_model"
    fit = f"fit {{0}}/telemetry --coarse {{0}}/runs {arguments}"
    assert main(fit.format("recorded").split()) == 2
    assert "over the same times" in capsys.readouterr().err
    exec(BLOCKS[3], {})
    assert main(fit.format("family").split()) == 0
    assert "3,000 samples in 2 parts" in capsys.readouterr().out
