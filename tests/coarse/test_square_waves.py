"""Tests of the coarse simulator, its fit to known waves, and its degraded modes in closed form."""

import numpy as np
import pytest

from enhsim_tf.coarse.degraded import Degraded
from enhsim_tf.coarse.square_waves import (
    SquareWave,
    SquareWaveSimulator,
    fit_box,
    level_offset_and_scale,
)
from enhsim_tf.paper import degraded as of_paper
from enhsim_tf.paper.degraded import MODES
from enhsim_tf.telemetry.series import Telemetry

TWO = SquareWaveSimulator(
    [SquareWave(480, low=-0.5, high=0.5), SquareWave(120, phase=0.3, duty=0.4, low=1.0, high=1.5)]
)
TIMES = 10.0 + np.arange(400.0) + np.array([[0.0], [37.0], [1_000.0]])
ONSET = 100  # a quarter of the 400 samples


# a square wave


def test_square_wave_by_hand():
    wave = SquareWave(period_s=4, low=-1, high=3)
    values = wave(np.array([-4.0, -1, 0, 1, 2, 3, 4, 5.9, 6]))
    assert values.tolist() == [3, -1, 3, 3, -1, -1, 3, 3, -1]
    wave = SquareWave(period_s=8, phase=0.25, duty=0.75, low=0, high=1)
    # a quarter of a period ahead: the six high samples of eight began two samples ago
    assert wave(np.arange(8.0)).tolist() == [1, 1, 1, 1, 0, 0, 1, 1]


@pytest.mark.parametrize(
    "argument", [{"period_s": 0}, {"duty": 0}, {"duty": 1}, {"high": np.nan}], ids=str
)
def test_bad_wave_is_refused(refused, argument):
    with refused("SquareWave("):
        SquareWave(**{"period_s": 10.0, **argument})


def test_simulator_is_the_sum_of_its_waves(refused):
    first, second = TWO.waves
    assert (TWO(TIMES) == first(TIMES) + second(TIMES)).all()
    simulated = TWO.simulate(TIMES)
    assert simulated.dtype == np.float32 and (simulated == TWO(TIMES).astype(np.float32)).all()
    assert TWO.levels == (0.5, 2.0)
    assert level_offset_and_scale(TWO) == (1.25, 0.75)
    with refused("waves=[]"):
        SquareWaveSimulator([])


# the fit

SHAPES = {
    # functions of the phase: values between -1 and 1, their duty, and the levels of the best square
    # wave
    "square": (lambda cycle: np.where(cycle < 0.3, 1.0, -1.0), 0.3, (-1.0, 1.0)),
    "sine": (lambda cycle: np.sin(2 * np.pi * cycle), 0.5, (-2 / np.pi, 2 / np.pi)),
    # a ramp takes a fifth of a period: half of the time above, 0.3 at 1 and 0.2 with a mean of 1/2
    "trapezoid": (
        lambda cycle: np.clip(
            np.interp(cycle, [0, 0.1, 0.4, 0.6, 0.9, 1], [0, 1, 1, -1, -1, 0]), -1, 1
        ),
        0.5,
        (-0.8, 0.8),
    ),
}
# period, interval, offset
CLOCKS = [(97.3, 1.0, 12_345.6), (31.7, 0.25, 40.0), (7_260.5, 60.0, -900.0)]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(("period_s", "interval_s", "offset_s"), CLOCKS)
def test_fit_recovers_a_noisy_wave(shape, period_s, interval_s, offset_s):
    wave, duty, (low, high) = SHAPES[shape]
    mean, amplitude, rng, number = 20.0, 3.0, np.random.default_rng(0), 3_000
    ahead = rng.random()
    times = offset_s + interval_s * np.arange(number)
    cycle = np.mod(times / period_s + ahead, 1.0)
    values = mean + amplitude * (wave(cycle) + 0.2 * rng.standard_normal(number))
    telemetry = Telemetry.of(values.astype(np.float32), interval_s=interval_s, offset_s=offset_s)

    (fitted,) = SquareWaveSimulator.fit(telemetry.part(0, 2_030)).waves
    assert fitted.period_s == pytest.approx(period_s, rel=0.005)
    # on a slope, the edge of the box is not well determined
    assert fitted.duty == pytest.approx(duty, abs=0.03)
    levels = mean + amplitude * low, mean + amplitude * high
    assert (fitted.low, fitted.high) == pytest.approx(levels, abs=0.05 * amplitude)

    # the phase also holds at later times that were not fitted
    is_high = fitted(times[2_130:]) > mean
    assert np.mean(is_high == (cycle[2_130:] < duty)) > 0.92


def test_fit_refuses_a_series_without_a_period(refused):
    # a constant; fewer than four samples per period
    for values in (np.ones(300), np.array([1.0, -1, 1, -1, 1, -1])):
        with refused("wheel"):
            SquareWaveSimulator.fit(Telemetry.of(values.astype(np.float32), name="wheel"))


def test_box_finds_the_fundamental_under_a_stronger_harmonic():
    # two short pulses a period, of heights 1 and 0.4: every even harmonic is stronger than the
    # fundamental
    phase = np.arange(4_000) % 100
    values = 1.0 * (phase < 2) + 0.4 * ((phase >= 50) & (phase < 52))
    strongest = np.argsort(np.abs(np.fft.rfft(values - values.mean())))[::-1][:12] * 100 / 4_000
    assert (strongest % 2 == 0).all()
    wave = fit_box(values)
    assert (wave.period_s, wave.high) == pytest.approx((100, 1.0), rel=0.001)
    assert wave.duty == pytest.approx(0.02, abs=0.006)


# degraded modes


def degrade(signal, times, scenario, levels):
    """Degrades a signal whose shortest period is 40 s, as the coarse simulator is degraded."""
    onset, rng = scenario.first_sample(times.shape[1]), np.random.default_rng(0)
    return of_paper.degrade(
        signal, times, scenario.mode, scenario.severity, levels, 40.0, rng, onset
    )


def by_time(mode, severity):
    """Degrades a signal that returns the time itself, which shows how the mode changes the
    mechanism's time.
    """
    return degrade(lambda time: time.copy(), TIMES, Degraded(mode, severity), (-1.0, 3.0))


@pytest.mark.parametrize("mode", MODES)
def test_nominal_to_the_bit_before_the_onset_and_not_after(mode):
    before = TIMES.copy()
    nominal = TWO.simulate(TIMES)
    none, degraded = (
        TWO.simulate(TIMES, Degraded(mode, severity), np.random.default_rng(1))
        for severity in (0, 0.3)
    )
    assert none.tobytes() == nominal.tobytes()
    assert degraded.shape == nominal.shape and degraded.dtype == np.float32
    assert degraded[:, :ONSET].tobytes() == nominal[:, :ONSET].tobytes()
    assert (degraded[:, ONSET:] != nominal[:, ONSET:]).any(axis=1).all()
    assert (before == TIMES).all()  # the caller's array is unchanged


@pytest.mark.parametrize("onset", [0.0, 0.29, 0.57])
def test_onset_is_the_sample_asked_for(onset):
    scenario = Degraded("gain_loss", 1.0, onset)
    values = degrade(lambda time: 5 + 0 * time, np.arange(100.0)[None], scenario, (0.0, 2.0))
    assert np.argmax(values[0] != 5) == round(100 * onset)


BEGIN, LATE = TIMES[:, ONSET : ONSET + 1], TIMES[:, ONSET:]


@pytest.mark.parametrize(
    ("mode", "expected"),
    [
        ("gain_loss", 1 + (LATE - 1) / 2),  # the mean of both levels is 1
        ("drift", LATE + 0.5 * 4 * np.linspace(0, 1, 300)),  # they are 4 apart
        ("period_change", BEGIN + (LATE - BEGIN) / 1.5),
    ],
)
def test_modes_without_draws_in_closed_form(mode, expected):
    np.testing.assert_allclose(by_time(mode, 0.5)[:, ONSET:], expected)


def test_stuck_stands_still_for_its_fraction_and_then_catches_up():
    clock = by_time("stuck", 0.5)
    still = LATE <= BEGIN + 0.5 * 299  # half of the 299 s that are left
    assert (clock[:, ONSET:] == np.where(still, BEGIN, LATE)).all()
    assert still.sum(axis=1).tolist() == [150] * 3
    assert (by_time("stuck", 1.0)[:, ONSET:] == BEGIN).all()


def test_friction_delays_by_a_bounded_lag_and_never_reverses():
    severity = 0.2
    clock = by_time("friction", severity)
    lag = TIMES - clock
    assert (lag[:, ONSET] == 0).all() and lag.min() >= 0
    assert lag.max() <= severity * 40 / 4
    assert lag.max() > 0.9 * severity * 40 / 4  # 3 x 30 uniform lags
    assert np.diff(clock, axis=1).min() >= -1e-9
    # each window has its own lags
    assert len({tuple(np.round(row, 6)) for row in lag[:, ONSET:]}) == 3


def test_dropout_reads_the_lowest_level_in_runs_of_ten():
    times = np.arange(10_000.0) + np.zeros((4, 1))
    for severity in (0.2, 1.0):
        scenario = Degraded("dropout", severity, onset=0)
        lost = degrade(lambda time: time + 1, times, scenario, (-1.0, 3.0)) == -1
        runs = lost.reshape(4, 1_000, 10)
        assert (runs.all(axis=2) | ~runs.any(axis=2)).all()
        share = severity / 2
        assert np.mean(runs) == pytest.approx(share, abs=5 * np.sqrt(share * (1 - share) / 4_000))
    kept = by_time("dropout", 0.5)
    assert (kept[kept != -1] == TIMES[kept != -1]).all()


@pytest.mark.parametrize(
    "arguments",
    [{"mode": "broken"}, {"severity": 1.1}, {"severity": np.nan}, {"onset": -0.1}, {"onset": 1}],
    ids=str,
)
def test_bad_scenario_is_refused(refused, arguments):
    with refused(next(iter(arguments))):
        Degraded(**{"mode": "stuck", **arguments})
