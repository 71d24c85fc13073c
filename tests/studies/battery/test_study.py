"""Errors, trust and detectors on made-up simulators whose map is known, so that PyBaMM is not needed."""

import sys

import numpy as np
import pytest

from enhsim_tf.enhancer.names import RIDGE
from studies.battery import classifiers, detectors, errors, simulate, windows
from studies.battery.__main__ import command
from studies.battery.detectors import COARSE_RUN, ENHANCED_RUN, Judge, alarm_rows
from studies.battery.faults import ALL
from studies.battery.orbits import INTERVAL_S, ORBIT_SAMPLES, REGIMES, battery_current, draw_load
from studies.battery.record import Recorded, key_of

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
    for part, orbits in (("fit", 16), ("more", 8), ("test", 8), ("coarse", 16)):
        runs[f"{part}/nominal/coarse"], runs[f"{part}/nominal/fine"] = _run(draw_load(orbits + 1, GENTLE, rng))
    load = draw_load(3, GENTLE, rng)
    for fault in (None, *ALL):
        runs[f"fault/{key_of(fault)}/coarse"], runs[f"fault/{key_of(fault)}/fine"] = _run(load, _added(fault))
    return Recorded(runs, {})


@pytest.fixture(autouse=True)
def small_numbers(monkeypatch):
    counted = {
        errors: {"NUM_WINDOWS": 300, "NUM_TEST": 80, "NUM_FAULT": 10},
        detectors: {"NUM": 100, "WINDOW": 100},
        windows: {"NUM_TEST": 80, "NUM_FAULT": 10, "WINDOW": 100},  # shorter windows, so that few orbits are enough to learn from
    }
    for module, counts in counted.items():
        for name, value in counts.items():
            monkeypatch.setattr(module, name, value)


@pytest.fixture
def pairs(recorded):
    return windows.pair_windows(recorded, "fit", 300, 0)


def test_windows_of_both_simulators_cover_the_same_time_behind_the_first_orbit(recorded):
    each, fine = windows.pair_windows(recorded, "test", 30, 1), recorded.get("test", "fine")[:, 0]
    assert each.starts.min() >= ORBIT_SAMPLES and each.starts.max() + windows.WINDOW <= len(fine)
    np.testing.assert_array_equal(each.fine[7], fine[each.starts[7] : each.starts[7] + windows.WINDOW])
    np.testing.assert_array_equal(each.coarse[7], recorded.get("test", "coarse")[each.starts[7] :][: windows.WINDOW])
    np.testing.assert_array_equal(each.telemetry, windows.pair_windows(recorded, "test", 30, 1).telemetry)
    assert not np.array_equal(each.telemetry, windows.pair_windows(recorded, "test", 30, 2).telemetry)


def test_windows_share_the_noise_of_their_common_samples(recorded):
    each = windows.pair_windows(recorded, "test", 200, 0)
    step = int(each.starts[1] - each.starts[0])
    assert 0 < step < windows.WINDOW
    np.testing.assert_array_equal(each.telemetry[0, step:], each.telemetry[1, :-step])


def test_ridge_with_the_current_reaches_the_floor_on_a_linear_map_and_on_faults_of_the_same_map(recorded, pairs):
    enhancers = errors.fit_enhancers(pairs, ("coarse itself", "level and gain", "ridge, voltage and current"), 0, 1)
    rows = {(row["enhancer"], row["fault"], row["severity"]): row for row in errors.error_rows(recorded, enhancers, 0)}
    floor = rows[errors.FLOOR, "nominal", 0.0]
    assert floor["nrmse_true"] == 0 and floor["nrmse"] > 0
    for fault in ALL:
        ridge = rows["ridge, voltage and current", fault.kind, fault.severity]
        assert ridge["nrmse_true"] < 0.5 * rows["coarse itself", fault.kind, fault.severity]["nrmse_true"]
    nominal = {name: rows[name, "nominal", 0.0]["nrmse_true"] for name in enhancers}
    assert nominal["ridge, voltage and current"] < 0.3 * nominal["level and gain"] < 0.3 * nominal["coarse itself"], nominal


def test_the_trust_score_calls_the_changed_fault_alone_out_of_range(recorded, pairs):
    share = {(row["fault"], row["severity"]): row["out_of_range"] for row in errors.trust_rows(recorded, pairs)}
    assert share["raised resistance", 1.0] > 0.5 >= share["drifting sensor", 1.0] and share["nominal", 0.0] < 0.3


def test_the_residual_finds_the_fault_that_the_planned_run_does_not_have(recorded, pairs):
    judge = Judge(recorded, pairs, RIDGE, 0)
    rows = {(row["training"], row["fault"], row["severity"]): row["alarms"] for row in judge.reference_rows()}
    for reference in (ENHANCED_RUN, COARSE_RUN):
        assert rows[reference, "raised resistance", 1.0] > 0.5  # not all: the current is small where the battery is nearly full
    assert rows[ENHANCED_RUN, "nominal", 0.0] < 0.1


def test_training_and_threshold_share_no_orbit_and_residual_windows_have_the_size_of_the_residuals(recorded, pairs):
    judge = Judge(recorded, pairs, RIDGE, 0)
    sources = judge.sources()
    assert set(sources) == set(detectors.SOURCES)
    coarse, enhanced, noisy = (sources[name][0] for name in (detectors.COARSE, detectors.ENHANCED, detectors.WITH_RESIDUALS))
    assert np.std(noisy - enhanced) == pytest.approx(np.std(judge.residuals), rel=0.1)
    assert np.abs(coarse - enhanced).max() > 0.05
    for training, held_out in sources.values():
        assert not (training[:, None, :50] == held_out[None, :, :50]).all(axis=2).any()
    again = Judge(recorded, pairs, RIDGE, 0).sources()
    np.testing.assert_array_equal(again[detectors.WITH_RESIDUALS][1], sources[detectors.WITH_RESIDUALS][1])


def test_a_threshold_comes_from_the_training_data():
    held_out = np.arange(1, 1_001, dtype=float)  # the conformal threshold of 1 % is the 991st of 1,000 scores
    nominal, faulty = np.full(100, 991.0), np.full(40, 992.0)
    nominal[[3, 70]] = 2_000
    rows = alarm_rows("training", "name", held_out, {None: nominal, ALL[0]: faulty}, 4)
    assert [row["alarms"] for row in rows] == [0.02, 1.0]
    assert [row["is_found"] for row in rows] == [0.5, 1.0]  # of four stretches of 25 windows, the first and the third
    assert rows[0]["fault"] == "nominal" and (rows[1]["fault"], rows[1]["severity"]) == (ALL[0].kind, ALL[0].severity)


def test_a_classifier_learns_simulated_faults_and_each_has_orbits_of_its_own(recorded, pairs, monkeypatch):
    def made_up(load, regime, faults, models):
        return [(simulate.Run(_run(load, _added(fault))[0]),) for fault in faults]

    monkeypatch.setattr(classifiers, "simulate_all", made_up)
    monkeypatch.setattr(classifiers, "NUM", 200)
    faulty, planned = faults = classifiers.simulate_faults(2, GENTLE, 5)
    each = len(faulty) // len(ALL)
    assert not np.array_equal(planned[0], planned[each]) and np.array_equal(faulty, classifiers.simulate_faults(2, GENTLE, 5)[0])
    changed = np.abs(faulty - planned).max(axis=(1, 2)).reshape(len(ALL), each).min(axis=1) > 0.01
    assert [bool(value) for value in changed] == [fault.kind == "raised resistance" for fault in ALL]
    rows = classifiers.classifier_rows(Judge(recorded, pairs, RIDGE, 0), faults)
    of_reference = [row for row in rows if row["training"] == ENHANCED_RUN + classifiers.FAULTS]
    assert len(rows) == 3 * 2 * (1 + len(ALL)) == 3 * len(of_reference)
    worst = {row["detector"]: row["alarms"] for row in of_reference if row["fault"] == "raised resistance"}
    assert worst["boosted trees"] > 0.5


def test_without_pybamm_the_command_says_what_to_install(monkeypatch, capsys, tmp_path):
    monkeypatch.setitem(sys.modules, "pybamm", None)
    simulate._pybamm.cache_clear()
    assert command(["--budget", "smoke", "--out", str(tmp_path / "out"), "--cache", str(tmp_path / "cache")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "pip install 'enhsim_tf[battery]'" in line
    simulate._pybamm.cache_clear()
