"""Coarse simulators of the user's own: what they return is checked, and a scenario is never ignored
without a word.
"""

import numpy as np
import pytest

from enhsim_tf.coarse.degraded import Degraded
from enhsim_tf.coarse.interface import CoarseSimulator, FunctionSimulator, record, simulate
from enhsim_tf.coarse.square_waves import ConstantLevel, SquareWave, SquareWaveSimulator

TIMES = np.arange(0.0, 100.0, 2.0)


def heater(time_s, scenario=None, rng=None):
    power = 1.0 if scenario is None else scenario["power"]
    return np.stack([power * (np.sin(time_s / 9) > 0), 20 + 0.1 * time_s], axis=1)


class Tank:
    """A user's class with the interface of a simulator."""

    columns = ("level",)

    def run(self, time_s, scenario=None, rng=None):
        return np.exp(-time_s / (50 if scenario is None else scenario))


SIMULATORS = {
    "square waves": lambda: (SquareWaveSimulator([SquareWave(40)]), Degraded("drift", 0.5)),
    "constant level": lambda: (ConstantLevel(7.0, 2.0), Degraded("dropout", 1.0)),
    "function": lambda: (FunctionSimulator(heater, ["power", "celsius"]), {"power": 0.5}),
    "class": lambda: (Tank(), 25.0),
    "recorded run": lambda: (record(Tank(), TIMES), None),
}
"""An example of every coarse simulator, and a scenario that changes it; None if it has none."""


@pytest.mark.parametrize("name", SIMULATORS)
def test_every_coarse_simulator_keeps_the_contract(name, refused):
    check_simulator(*SIMULATORS[name](), refused)


def check_simulator(simulator, scenario, refused):
    """Its columns have names, the same draws give the same run, and no scenario is ignored."""
    assert isinstance(simulator, CoarseSimulator) and all(simulator.columns)
    first, again = (simulate(simulator, TIMES, None, np.random.default_rng(1)) for _ in range(2))
    assert first.shape == (len(TIMES), len(simulator.columns)) and first.dtype == np.float32
    np.testing.assert_array_equal(first, again)
    if scenario is None:
        with refused("scenario"):
            simulate(simulator, TIMES, "fault")
    else:
        assert (simulate(simulator, TIMES, scenario) != first).any()


def test_a_simulation_has_the_values_of_the_function():
    two = FunctionSimulator(heater, ["power", "celsius"])
    np.testing.assert_array_equal(simulate(two, TIMES), heater(TIMES).astype(np.float32))
    np.testing.assert_allclose(simulate(Tank(), TIMES, 25.0)[:, 0], np.exp(-TIMES / 25), rtol=1e-6)


def test_a_scenario_of_square_waves_is_drawn_as_by_themselves():
    waves = SquareWaveSimulator([SquareWave(40)])
    scenario = Degraded("friction", 0.9)
    one, other = np.random.default_rng(3), np.random.default_rng(3)
    np.testing.assert_array_equal(
        simulate(waves, TIMES, scenario, one)[:, 0], waves.simulate(TIMES[None], scenario, other)[0]
    )
    assert one.random() == other.random()  # the comparison with the nominal run draws nothing
    simulate(waves, TIMES, Degraded("stuck", 0.0))  # severity 0 is nominal by definition


def test_a_simulator_that_ignores_a_scenario_is_refused(refused):
    with refused("every value equals the nominal one", "Tank"):
        simulate(Tank(), TIMES, 50)
    with refused("no parameter `scenario`", "weak"):
        simulate(FunctionSimulator(lambda time_s: time_s, ["ramp"], "ramps"), TIMES, "weak")


@pytest.mark.parametrize(
    ("returned", "word"),
    [
        (np.zeros((50, 3)), "(50, 3)"),
        (np.zeros(49), "(49,)"),
        (np.where(TIMES == 10, np.nan, 1.0), "at 10 s"),
        (np.full(50, "warm"), "Expected numbers"),
    ],
)
def test_unusable_output_is_refused(refused, returned, word):
    with refused(word):
        simulate(FunctionSimulator(lambda time_s: returned, ["celsius"]), TIMES)


def test_what_is_no_simulator_and_names_of_columns_are_refused(refused):
    with refused("FunctionSimulator", "function"):
        simulate(heater, TIMES)
    for columns in ([], ["a", "a"], [3]):
        with refused("columns"):
            FunctionSimulator(heater, columns)
    with refused("regular interval"):
        record(Tank(), np.array([0.0, 1.0, 3.0]))


def test_a_recorded_simulation_keeps_times_and_labels():
    run = record(Tank(), TIMES + 6, 25.0, labels={"scenario": "leak", "severity": 0.5})
    (part,) = run.parts
    assert (run.columns, run.interval_s, part.offset_s, len(run)) == (("level",), 2.0, 6.0, 50)
    assert set(part.carried["scenario"]) == {"leak"} and part.carried["severity"].shape == (50,)
    first, second = np.exp(-8 / 25), np.exp(-10 / 25)
    found = run.run(np.array([8.0, 9.0]))[:, 0]
    np.testing.assert_allclose(found, [first, (first + second) / 2], rtol=1e-6)
