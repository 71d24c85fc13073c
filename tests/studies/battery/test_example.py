"""The program that wrote the recorded pair in `examples/battery`, which needs PyBaMM."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from studies.battery import example
from studies.battery.orbits import ORBIT_SAMPLES

FOLDER = Path(__file__).parents[3] / "examples" / "battery"


@pytest.mark.slow
def test_the_pair_is_simulated_again_as_it_is_and_its_fault_raises_the_resistance():
    pytest.importorskip(
        "pybamm", reason="PyBaMM is an optional extra: pip install 'enhsim_tf[battery]'"
    )
    tables = example.tables(num_orbits=1, num_fault_orbits=4)
    assert set(tables) == {path.stem for path in FOLDER.glob("*.csv")}
    shipped = pd.read_csv(FOLDER / "simulator.csv")
    np.testing.assert_allclose(
        *(table[: ORBIT_SAMPLES // 2].astype(float) for table in (tables["simulator"], shipped)),
        atol=0.02,
    )
    planned, faulty, measured = (
        tables[name] for name in ("simulator_planned", "simulator_fault", "telemetry_fault")
    )
    assert planned[["time", "amperes"]].equals(faulty[["time", "amperes"]])
    assert faulty["mask"].tolist() == [0] * ORBIT_SAMPLES + [1] * 3 * ORBIT_SAMPLES
    assert (planned["volts"] == faulty["volts"])[:ORBIT_SAMPLES].all()
    steps = faulty["amperes"].astype(float).diff()
    for table in (faulty, measured):  # by how much the voltage falls for a step of the current
        falls = -table["volts"].astype(float).diff()
        before, under = ((np.abs(steps) > 0.3) & (faulty["mask"] == mask) for mask in (0, 1))
        ohms = [np.polyfit(steps[rows], falls[rows], 1)[0] for rows in (before, under)]
        assert ohms[1] - ohms[0] == pytest.approx(0.032, abs=0.01)
