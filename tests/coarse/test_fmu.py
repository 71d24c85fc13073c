"""FMUs as coarse simulators, tried on a real FMU that pythonfmu builds; skipped where the extra
`fmi` is not installed.
"""

from pathlib import Path

import numpy as np
import pytest

from enhsim_tf.coarse.fmu import FmuSimulator
from enhsim_tf.coarse.interface import CoarseSimulator, record, simulate
from tests.fitted_simulators import recorded

pytest.importorskip("fmpy", reason="the extra fmi is not installed: pip install 'enhsim_tf[fmi]'")
builder = pytest.importorskip(
    "pythonfmu.builder", reason="pythonfmu, which builds the FMU, is not installed"
)
TIMES = 10.0 * np.arange(200)


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fmu")
    return builder.FmuBuilder.build_FMU(Path(__file__).with_name("heater_fmu.py"), dest=folder)


COMMANDS = recorded(np.sin(TIMES / 150) > 0, "command", None)


def expected(efficiency=1.0, loss=0.005):
    """The steps of the box, by hand: each step of 10 s uses the command at its beginning."""
    power, celsius = np.zeros(200), np.full(200, 20.0)
    command = COMMANDS.values[:, 0]
    for step in range(199):
        power[step + 1] = efficiency * command[step]
        celsius[step + 1] = celsius[step] + 10 * (
            0.1 * power[step + 1] - loss * (celsius[step] - 20)
        )
    return np.stack([power, celsius], axis=1)


def test_a_run_is_that_of_the_equations(fmu):
    simulator = FmuSimulator(fmu, ["power", "celsius"], commands=COMMANDS)
    assert isinstance(simulator, CoarseSimulator)
    np.testing.assert_allclose(simulate(simulator, TIMES), expected(), rtol=1e-5)
    assert expected()[:, 1].max() > 30


def test_parameters_are_faults(fmu):
    simulator = FmuSimulator(fmu, ["power", "celsius"], {"loss": 0.01}, COMMANDS)
    np.testing.assert_allclose(simulate(simulator, TIMES), expected(loss=0.01), rtol=1e-5)
    weak = record(simulator, TIMES, {"efficiency": 0.5}, labels={"scenario": "weak"})
    np.testing.assert_allclose(weak.parts[0].values, expected(0.5, 0.01), rtol=1e-5)
    assert weak.name == "Heater.fmu" and set(weak.parts[0].carried["scenario"]) == {"weak"}


def test_what_an_fmu_cannot_do_is_refused(refused, fmu, tmp_path):
    with refused("(output)", "'volts'", "celsius"):
        FmuSimulator(fmu, ["volts"])
    with refused("(parameter)", "'celsius'", "efficiency"):
        FmuSimulator(fmu, ["power"], {"celsius": 3.0})
    simulator = FmuSimulator(fmu, ["celsius"], commands=COMMANDS)
    with refused("'efficency'"):
        simulate(simulator, TIMES, {"efficency": 0.5})
    with refused("dictionary of parameters"):
        simulate(simulator, TIMES, "weak")
    with refused("every value equals the nominal one"):
        simulate(simulator, TIMES, {"efficiency": 1.0})
    with refused("covers", "1990"):
        simulate(simulator, TIMES + 50)
    (tmp_path / "no.fmu").write_bytes(b"nothing")
    with refused("no.fmu", "cannot be read"):
        FmuSimulator(tmp_path / "no.fmu", ["celsius"])
