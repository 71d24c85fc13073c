"""Detection of coarse windows outside the training range of the enhancer."""

from types import SimpleNamespace

import numpy as np
import pytest

from enhsim_tf.coarse_simulator.degraded import MODES, Degraded
from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.enhanced_simulator.trusted_range import TrustedRange


@pytest.fixture(scope="module")
def trusted():
    """A simulator of two waves with incommensurable periods, so that no two windows are equal."""
    coarse = SquareWaveSimulator([SquareWave(47.3, low=-1.0, high=1.0), SquareWave(11.9, low=-0.4, high=0.4)])
    return TrustedRange(SimpleNamespace(coarse=coarse, interval_s=1.0, window=100))


def test_nominal_windows_are_out_of_range_at_the_given_rate(trusted):
    # rate 1 % on 2,000 new windows, with a limit from 1,500 windows: sd = sqrt(0.01 (1 / 2000 + 1 / 1500)) = 0.0034
    assert trusted.share_outside(None, 2_000) == pytest.approx(0.01, abs=4 * 0.0034)


@pytest.mark.parametrize("mode", MODES)
def test_the_score_grows_with_the_severity(trusted, mode):
    shares = [trusted.share_outside(Degraded(mode, severity, 0.1), 500) for severity in (0.0, 0.6, 1.0)]
    assert shares[0] < 0.05 < 0.5 < shares[1] <= shares[2] and shares[2] > 0.9


def test_the_score_of_an_offset_is_proportional_to_its_size(trusted):
    coarse = trusted.simulator.coarse.simulate(np.arange(100.0)[None])
    near, far = (trusted.score(coarse + shift)[0] for shift in (50.0, 100.0))
    assert far == pytest.approx(2 * near, rel=0.02) and near > 1  # an offset is nearly orthogonal to waves of mean zero


def test_exactly_repeated_windows_are_in_range_and_others_are_not():
    simulator = SimpleNamespace(coarse=SquareWaveSimulator([SquareWave(20.0, low=0.0, high=1.0)]), interval_s=1.0, window=60)
    trusted = TrustedRange(simulator)
    nominal = simulator.coarse.simulate(np.arange(60.0)[None] + 7)
    assert trusted.score(nominal)[0] < 1 < trusted.score(nominal + 0.01)[0] < trusted.score(nominal + 0.1)[0]
    assert trusted.share_outside(None) == 0


def test_the_same_seed_gives_the_same_windows(trusted):
    scenario = Degraded("stuck", 0.2, 0.7)
    assert trusted.share_outside(scenario, 50, 1) == trusted.share_outside(scenario, 50, 1)


def test_windows_of_another_length_are_refused(trusted, refused):
    with refused("(windows, 100)"):
        trusted.score(np.zeros((2, 99)))
