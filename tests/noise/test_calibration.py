"""The calibration of densities recovers a known distribution and leaves right densities alone."""

import numpy as np
import pytest
from scipy.stats import kstest, t

from enhsim_tf.noise.calibration import Calibration, mixture_probabilities


def test_a_known_density_of_the_probabilities_is_recovered():
    rng = np.random.default_rng(1)
    found = Calibration.fit(rng.beta(2, 1, 100_000), rng.beta(2, 1, 10_000))
    places = np.array([0.1, 0.3, 0.5, 0.7, 0.9])
    np.testing.assert_allclose(found.at(places), 2 * places, rtol=0.1)  # the density of this beta distribution; bins are up to .06 wide
    assert found.density @ np.diff(found.edges) == pytest.approx(1)


def test_accepted_draws_have_this_density():
    rng = np.random.default_rng(2)
    found = Calibration.fit(rng.beta(2, 1, 100_000), rng.beta(2, 1, 10_000))
    draws = rng.random(40_000)
    accepted = draws[found.accept(draws, rng)]
    assert len(accepted) / len(draws) == pytest.approx(1 / found.density.max(), abs=0.02)
    assert kstest(accepted, lambda value: value**2).statistic < 0.02
    assert found.accept(np.full(100, np.nan), rng).all()  # no draw would ever be accepted otherwise


def test_a_right_density_is_left_alone():
    rng = np.random.default_rng(3)
    assert Calibration.fit(rng.random(50_000), rng.random(10_000)) is None
    assert Calibration.fit(rng.random(150), rng.random(20)) is None  # few samples: one bin or two
    assert Calibration.fit(1e-5 * rng.random(100_000), 1e-5 * rng.random(1_000)) is None  # nearly all draws would be rejected


def test_the_probabilities_of_a_mixture_are_the_sum_of_its_parts():
    rng = np.random.default_rng(4)
    values, means, log_scales = rng.normal(size=6), rng.normal(size=(6, 3)), rng.normal(size=(6, 3))
    degrees, shares = np.array([2.5, 30.0, 2_983.0]), np.array([0.2, 0.3, 0.5])
    found = mixture_probabilities(values, np.log(shares) + 7 + np.zeros((6, 1)), means, log_scales, degrees)
    expected = [shares @ t.cdf(value, degrees, mean, scale) for value, mean, scale in zip(values, means, np.exp(log_scales), strict=True)]
    np.testing.assert_allclose(found, expected, atol=1e-4)


@pytest.mark.parametrize(
    ("edges", "density"),
    [
        ([0.0, 0.5], [2.0]),
        ([0.0, 0.6, 0.5, 1.0], [1.0] * 3),
        ([0.0, 1.0], [1.0, 1.0]),
        ([0.0, 1.0], [2.0]),
        ([0.0, 0.5, 1.0], [-1.0, 3.0]),
        ([0.0, 0.5, 1.0], [2.0, 0.0]),
        ([0.0, 1e-3, 1.0], [999.0, 1e-3 / 0.999]),
    ],
)
def test_what_is_no_density_is_refused(edges, density):
    with pytest.raises(ValueError, match="calibration"):
        Calibration(np.array(edges), np.array(density))
