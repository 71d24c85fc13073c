"""Which windows of a simulator are beyond what its enhancer was taught: told from the coarse ones alone."""

from types import SimpleNamespace

import numpy as np
import pytest

from enhsim_tf.coarse_simulator.degraded import MODES, Degraded
from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.enhanced_simulator.trusted_range import TrustedRange


@pytest.fixture(scope="module")
def trusted():
    """Of two waves whose periods no number of samples divides: no two windows are the same."""
    coarse = SquareWaveSimulator([SquareWave(47.3, low=-1.0, high=1.0), SquareWave(11.9, low=-0.4, high=0.4)])
    return TrustedRange(SimpleNamespace(coarse=coarse, interval_s=1.0, window=100))


def test_nominal_windows_are_out_of_range_as_seldom_as_was_asked_for(trusted):
    # 1 % of 2,000 drawn anew, at a limit that 1,500 windows set: sd sqrt(0.01 (1 / 2000 + 1 / 1500)) = 0.0034
    assert trusted.share_outside(None, 2_000) == pytest.approx(0.01, abs=4 * 0.0034)


@pytest.mark.parametrize("mode", MODES)
def test_worse_is_further_out(trusted, mode):
    shares = [trusted.share_outside(Degraded(mode, severity, 0.1), 500) for severity in (0.0, 0.6, 1.0)]
    assert shares[0] < 0.05 < 0.5 < shares[1] <= shares[2] and shares[2] > 0.9


def test_a_shift_is_scored_by_its_size_over_the_limit(trusted):
    coarse = trusted.simulator.coarse.simulate(np.arange(100.0)[None])
    near, far = (trusted.score(coarse + shift)[0] for shift in (50.0, 100.0))
    assert far == pytest.approx(2 * near, rel=0.02) and near > 1  # a shift is about orthogonal to waves of mean zero


def test_windows_that_repeat_exactly_are_in_range_and_others_are_not():
    simulator = SimpleNamespace(coarse=SquareWaveSimulator([SquareWave(20.0, low=0.0, high=1.0)]), interval_s=1.0, window=60)
    trusted = TrustedRange(simulator)
    nominal = simulator.coarse.simulate(np.arange(60.0)[None] + 7)
    assert trusted.score(nominal)[0] < 1 < trusted.score(nominal + 0.01)[0] < trusted.score(nominal + 0.1)[0]
    assert trusted.share_outside(None) == 0


def test_the_same_seed_draws_the_same(trusted):
    scenario = Degraded("stuck", 0.2, 0.7)
    assert trusted.share_outside(scenario, 50, 1) == trusted.share_outside(scenario, 50, 1)


def test_windows_of_another_length_are_refused(trusted, refused):
    with refused("(windows, 100)"):
        trusted.score(np.zeros((2, 99)))
