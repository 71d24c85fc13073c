"""The recorded pair in `examples/battery`, which needs no PyBaMM."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.telemetry.sources import read_source
from studies.battery import example
from studies.battery.orbits import INTERVAL_S, ORBIT_SAMPLES

FOLDER = Path(__file__).parents[3] / "examples" / "battery"
NAMES = ("telemetry", "simulator", "telemetry_fault", "simulator_fault", "simulator_planned")


@pytest.fixture(scope="module")
def pair():
    return {name: pd.read_csv(FOLDER / f"{name}.csv") for name in NAMES}


def test_the_pair_is_small_and_every_file_is_read_as_telemetry(pair):
    assert sum((FOLDER / f"{name}.csv").stat().st_size for name in NAMES) < 1_000_000
    assert list(read_source(FOLDER / "telemetry.csv")) == ["volts"]
    assert list(read_source(FOLDER / "simulator.csv")) == ["volts", "amperes", "celsius"]
    for name, table in pair.items():
        assert np.all(np.diff(table["time"]) == INTERVAL_S) and not table.isna().any().any(), name
    assert pair["telemetry"]["time"].equals(pair["simulator"]["time"])
    assert pair["telemetry_fault"]["time"].equals(pair["simulator_fault"]["time"])


def test_the_fault_raises_the_resistance_after_its_first_orbit(pair):
    table, telemetry = pair["simulator_fault"], pair["telemetry_fault"]
    assert list(table["mask"]) == [0] * ORBIT_SAMPLES + [1] * (len(table) - ORBIT_SAMPLES)
    assert table.groupby("mask")[["scenario", "severity"]].first().to_numpy().tolist() == [["nominal", 0.0], ["raised resistance", 1.0]]
    steps = table["amperes"].diff()
    for values in (table["volts"], telemetry["volts"]):  # by how much the voltage falls for a step of the current
        ohms = [
            -np.polyfit(steps[rows], values.diff()[rows], 1)[0]
            for rows in ((np.abs(steps) > 0.3) & (table["mask"] == mask) for mask in (0, 1))
        ]
        assert ohms[1] - ohms[0] == pytest.approx(0.032, abs=0.01)


def test_the_planned_run_has_the_commands_of_the_run_with_the_fault_and_not_the_fault(pair):
    planned, faulty = pair["simulator_planned"], pair["simulator_fault"]
    assert planned[["time", "amperes"]].equals(faulty[["time", "amperes"]])
    lower = planned["volts"] - faulty["volts"]
    assert (lower[:ORBIT_SAMPLES] == 0).all() and np.corrcoef(lower[ORBIT_SAMPLES:], planned["amperes"][ORBIT_SAMPLES:])[0, 1] > 0.9


@pytest.mark.slow
def test_the_pair_is_simulated_again_as_it_is(pair):
    pytest.importorskip("pybamm", reason="PyBaMM is an optional extra: pip install 'enhsim_tf[battery]'")
    tables = example.tables(num_orbits=1, num_fault_orbits=2)
    assert set(tables) == set(NAMES)
    first, shipped = (table[: ORBIT_SAMPLES // 2].astype(float).to_numpy() for table in (tables["simulator"], pair["simulator"]))
    np.testing.assert_allclose(first, shipped, atol=0.02)
