"""Detectors on made-up simulators whose map is known, so that PyBaMM is not needed."""

import sys

import numpy as np
import pytest

from enhsim_tf.enhancer.names import RIDGE
from studies.battery import detectors, record, simulate
from studies.battery.__main__ import command
from studies.battery.detectors import COARSE_RUN, ENHANCED_RUN, Judge
from studies.battery.faults import ALL
from studies.battery.orbits import INTERVAL_S, ORBIT_SAMPLES, REGIMES, battery_current, draw_load
from studies.battery.record import pair_windows, run_key

GENTLE = REGIMES["gentle"]
OHMS = 0.02  # by which the made-up vehicle differs from the published one


def _run(load, added=0.0):
    """A battery with a linear open-circuit voltage and a resistance, in both simulators."""
    current = battery_current(load, GENTLE)
    charge = 4.0 - 0.5 * np.cumsum(current) * INTERVAL_S / 3600 / 5
    coarse = np.stack([charge - (0.03 + added) * current, current, 25 + 0.5 * current], axis=1)
    fine = coarse.copy()
    fine[:, 0] = 0.9 * coarse[:, 0] - OHMS * current + 0.3
    return coarse.astype(np.float32), fine.astype(np.float32)


def _added(fault):
    return 0.5 * fault.severity if fault is not None and fault.kind == "raised resistance" else 0.0


@pytest.fixture(scope="module")
def recorded():
    runs, rng = {}, np.random.default_rng(0)
    loads = {
        part: draw_load(orbits + 1, GENTLE, rng)
        for part, orbits in (("fit", 16), ("more", 8), ("test", 8), ("coarse", 16))
    }
    for part, load in loads.items():
        runs[run_key(part, "coarse")], runs[run_key(part, "fine")] = _run(load)
    load = draw_load(3, GENTLE, rng)
    for fault in (None, *ALL):
        coarse, fine = _run(load, _added(fault))
        runs[run_key("fault", "coarse", fault)], runs[run_key("fault", "fine", fault)] = (
            coarse,
            fine,
        )
    return runs


@pytest.fixture(autouse=True)
def small_numbers(monkeypatch):
    # few orbits are enough to learn short windows from
    counts = {"NUM_TEST": 80, "NUM_FAULT": 10, "NUM": 100, "WINDOW": 100}
    for module in (detectors, record):
        for name in counts.keys() & vars(module).keys():
            monkeypatch.setattr(module, name, counts[name])


@pytest.fixture
def pairs(recorded):
    return pair_windows(recorded, "fit", 300, 0)


def test_windows_of_both_simulators_cover_the_same_time_and_share_the_noise_of_their_common_samples(
    recorded,
):
    each, fine = pair_windows(recorded, "test", 200, 1), recorded[run_key("test", "fine")][:, 0]
    assert each.starts.min() >= ORBIT_SAMPLES and each.starts.max() + record.WINDOW <= len(fine)
    inside = slice(each.starts[7], each.starts[7] + record.WINDOW)
    np.testing.assert_allclose(each.telemetry[7], fine[inside], atol=0.02)  # volts of noise
    np.testing.assert_array_equal(each.coarse[7], recorded[run_key("test", "coarse")][inside])
    step = int(each.starts[1] - each.starts[0])
    np.testing.assert_array_equal(each.telemetry[0, step:], each.telemetry[1, :-step])
    assert not np.array_equal(each.telemetry, pair_windows(recorded, "test", 200, 2).telemetry)


def test_the_residual_finds_the_fault_that_the_planned_run_does_not_have(recorded, pairs):
    judge = Judge(recorded, pairs, RIDGE, 0)
    rows = {
        (row["training"], row["fault"], row["severity"]): row["alarms"]
        for row in judge.reference_rows()
    }
    for reference in (ENHANCED_RUN, COARSE_RUN):
        # not all: the current is small where the battery is nearly full
        assert rows[reference, "raised resistance", 1.0] > 0.5
    assert rows[ENHANCED_RUN, "nominal", 0.0] < 0.1


def test_training_and_threshold_share_no_orbit_and_are_drawn_by_the_seed(recorded, pairs):
    sources, again = (Judge(recorded, pairs, RIDGE, 0).sources() for _ in range(2))
    assert set(sources) == set(detectors.SOURCES)
    for name, (training, held_out) in sources.items():
        assert not (training[:, None, :50] == held_out[None, :, :50]).all(axis=2).any()
        np.testing.assert_array_equal(again[name][1], held_out)


def test_without_pybamm_the_command_says_what_to_install(monkeypatch, capsys, tmp_path):
    monkeypatch.setitem(sys.modules, "pybamm", None)
    simulate.import_pybamm.cache_clear()
    words = f"--budget smoke --out {tmp_path}/out --cache {tmp_path}/cache"
    assert command(words.split()) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "pip install 'enhsim_tf[battery]'" in line
    simulate.import_pybamm.cache_clear()
