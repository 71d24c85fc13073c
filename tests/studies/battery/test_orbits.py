import numpy as np
import pytest

from studies.battery.faults import (
    ALL,
    SIZES,
    Fault,
    drift_under,
    load_under,
    measure,
    simulator_inputs,
)
from studies.battery.orbits import (
    CAPACITY_AH,
    FIRST_CHARGE,
    INTERVAL_S,
    ORBIT_SAMPLES,
    REGIMES,
    SUN_SAMPLES,
    battery_current,
    draw_load,
)
from studies.common.faults import SEVERITIES


@pytest.mark.parametrize("regime", REGIMES.values(), ids=REGIMES)
def test_the_controller_keeps_the_charge_between_empty_and_full(regime):
    current = battery_current(draw_load(40, regime, np.random.default_rng(0)), regime)
    charge = FIRST_CHARGE - np.cumsum(current) * INTERVAL_S / 3600 / CAPACITY_AH
    # it does charge the battery in the sun
    assert 0.05 < charge.min() and 0.93 < charge.max() <= 0.951
    current = battery_current(np.full(ORBIT_SAMPLES, regime.bus_a), regime)
    # the taper: 0.05 of 5 Ah over 0.15 h
    assert current[0] == pytest.approx(-(0.95 - FIRST_CHARGE) * CAPACITY_AH / 0.15)
    assert np.all(current[SUN_SAMPLES : SUN_SAMPLES + 30] == regime.bus_a)  # the load in eclipse


def test_each_fault_acts_in_one_place_and_grows_with_its_severity():
    regime, load = REGIMES["gentle"], np.ones(3 * ORBIT_SAMPLES)
    for fault in ALL:
        acts = [
            any(simulator_inputs(fault).values()),
            drift_under(len(load), fault, ORBIT_SAMPLES).any(),
            not np.array_equal(load_under(load, fault, regime, ORBIT_SAMPLES), load),
        ]
        assert sum(acts) == 1, fault
    assert all(
        np.all(np.diff(sizes) > 0) and len(sizes) == len(SEVERITIES) for sizes in SIZES.values()
    )
    assert not any(simulator_inputs(None).values())


def test_faults_begin_at_their_onset():
    drift = drift_under(1_200, Fault("drifting sensor", 1.0), 600)
    # volts an orbit at the largest severity
    assert not drift[:601].any() and drift[600 + ORBIT_SAMPLES] == pytest.approx(0.08)
    load = load_under(np.zeros(1_200), Fault("payload stuck on", 0.4), REGIMES["hard"], 600)
    assert not load[:600].any() and np.all(load[600:] == pytest.approx(0.4 * 1.5))


def test_the_sensor_adds_noise_and_rounds():
    noise, step = np.array([0.002, 0.0]), np.array([5 / 4096, 0.5])
    rng = np.random.default_rng(0)
    measured = measure(np.full((20_000, 2), 3.7), noise, step, rng).astype(np.float64)
    np.testing.assert_allclose(measured / step, np.rint(measured / step), atol=1e-3)
    # the variances of the noise and of the rounding add
    expected = np.hypot(0.002, 5 / 4096 / np.sqrt(12))
    assert np.std(measured, axis=0) == pytest.approx([expected, 0], rel=0.02)
    assert (measured[:, 1] == 3.5).all()
