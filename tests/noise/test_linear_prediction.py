"""Linear predictions recover known autoregressions, for whole windows as for single samples."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import solve_toeplitz

from enhsim_tf.noise.linear_prediction import LinearPrediction
from enhsim_tf.noise.surrogates import GaussianAutoregression
from studies.common.noise_processes import AutoregressiveNoise, FractionalGaussianNoise

SAMPLES = 40


@pytest.fixture(scope="module")
def loud():
    """White noise whose loudness alternates every five samples between 0.2 and 1: its magnitude has a period of ten samples."""
    rng = np.random.default_rng(3)
    phase = rng.integers(0, 10, (4_000, 1))
    windows = rng.standard_normal((4_000, SAMPLES)) * np.where((np.arange(SAMPLES) + phase) % 10 < 5, 0.2, 1.0)
    return (windows / windows.std()).astype(np.float32)


def test_the_predictions_of_each_order_solve_the_normal_equations():
    model = GaussianAutoregression([0.5, -0.3, 0.2], 1.0, SAMPLES)
    impulse = np.zeros(4_000)
    for lag in range(4_000):  # the response to one innovation, by the recursion
        impulse[lag] = (lag == 0) + sum(c * impulse[lag - k] for k, c in enumerate((0.5, -0.3, 0.2), 1) if lag >= k)
    covariance = np.array([impulse[: 4_000 - lag] @ impulse[lag:] for lag in range(5)])
    for place in (1, 2, 3):
        coefficients, error = model.at(place)
        expected = solve_toeplitz(covariance[:place], covariance[1 : place + 1])
        assert_allclose(coefficients, expected, rtol=1e-8)
        assert error**2 == pytest.approx(covariance[0] - expected @ covariance[1 : place + 1])
    assert model.at(0)[1] ** 2 == pytest.approx(covariance[0])


def test_held_out_windows_choose_the_order_where_windows_overlap():
    series = AutoregressiveNoise(0.7, 1.0).draw(2_400, np.random.default_rng(1))
    windows = np.lib.stride_tricks.sliding_window_view(series[:1_600], SAMPLES)
    held_out = np.lib.stride_tricks.sliding_window_view(series[1_600:], SAMPLES)
    assert len(GaussianAutoregression.fit(windows, 20).coefficients) == 20  # each sample counts forty times
    chosen = GaussianAutoregression.fit(windows, 20, held_out)
    assert len(chosen.coefficients) < 20
    assert chosen.coefficients[0] == pytest.approx(0.7, abs=0.06)


@pytest.mark.parametrize("seed", range(3))
def test_white_noise_is_predicted_by_its_mean(seed):
    """Held-out windows cannot tell many coefficients near zero from none: less than 0.05 % of the squared error."""
    noise = np.random.default_rng(seed).standard_normal((10_000, 100))
    assert len(GaussianAutoregression.fit(noise[:9_000], 50, noise[9_000:]).coefficients) == 0
    weak = AutoregressiveNoise(0.05, 1.0).draw(1_000_000, np.random.default_rng(seed)).reshape(-1, 100)
    found = GaussianAutoregression.fit(weak[:9_000], 50, weak[9_000:]).coefficients
    assert found[0] == pytest.approx(0.05, abs=0.0045)  # four standard errors of a coefficient: 1 / sqrt(900,000)
    assert np.abs(found[1:]).max() < 0.0045


@pytest.mark.parametrize("times", [1, 3, 30])
def test_a_loud_part_of_the_held_out_time_does_not_hide_what_can_be_predicted(times):
    noise = AutoregressiveNoise(0.9, 1.0).draw(100_000, np.random.default_rng(5)).reshape(-1, 100)
    noise[930:940] *= times
    found = GaussianAutoregression.fit(noise[:900], 20, noise[900:]).coefficients
    assert found[0] == pytest.approx(0.9, abs=0.02)


@pytest.mark.parametrize("coefficient", [0.0, 0.7])
def test_one_held_out_window_tells_white_noise_from_an_autoregression(coefficient):
    """Chance calls white noise correlated as often as the margin says, about one time in 25: at most 6 of 60 here (probability 1 %)."""
    counts = 0
    for seed in range(60):
        noise = AutoregressiveNoise(coefficient, 1.0).draw(5_000, np.random.default_rng(seed)).reshape(10, 500)
        counts += len(GaussianAutoregression.fit(noise[:9], 50, noise[9:]).coefficients) > 0
    assert counts <= 6 if coefficient == 0 else counts == 60


def test_noise_with_a_long_memory_keeps_its_slow_variation():
    noise = FractionalGaussianNoise(0.8, 1.0).draw(400_000, np.random.default_rng(2)).reshape(-1, 200)
    model = GaussianAutoregression.fit(noise[:1_800], 100, noise[1_800:])
    # the variance of the mean of n samples of fractional Gaussian noise is n to the power of 2 H - 2
    assert np.std(model.generate(4_000, 1).mean(axis=1)) == pytest.approx(200 ** (0.8 - 1), rel=0.1)


def test_the_error_falls_from_that_of_the_process_to_that_of_the_innovations():
    noise = AutoregressiveNoise(0.7, 1.0).draw(40_000, np.random.default_rng(1)).reshape(-1, SAMPLES).astype(np.float32)
    found = LinearPrediction.fit(noise[:900], noise[900:])
    assert found.errors[0] == pytest.approx(1.0, rel=0.05)
    assert_allclose(found.errors[1:], np.sqrt(1 - 0.7**2), rtol=0.03)
    predicted = found.predict(noise[900:])
    assert predicted.shape == (100, SAMPLES, 2) and predicted.dtype == np.float32
    assert_allclose(predicted[:, 1:, 0], 0.7 * noise[900:, :-1], atol=0.15)
    assert (predicted[:, 0, 0] == 0).all()


def test_a_periodic_loudness_is_predicted(loud):
    found = LinearPrediction.fit(loud[:3_000], loud[3_000:])
    assert np.abs(found.values.coefficients).max(initial=0) < 0.05  # no sample tells the next one
    predicted = np.exp(found.predict(loud[3_000:])[:, 20:, 1])
    is_loud = np.abs(predicted) > found.mean_magnitude
    quiet, loud_ones = (np.std(loud[3_000:, 20:][each]) for each in (~is_loud, is_loud))
    assert loud_ones > 3 * quiet


def test_the_loudness_is_that_of_what_is_not_predicted():
    noise = AutoregressiveNoise(0.7, 1.0).draw(40_000, np.random.default_rng(1)).reshape(-1, SAMPLES).astype(np.float32)
    found = LinearPrediction.fit(noise[:900], noise[900:])
    innovations = (noise[900:, 1:] - 0.7 * noise[900:, :-1]) / np.sqrt(1 - 0.7**2)
    predicted = found.predict(noise[900:])
    expected = np.abs(innovations) - np.sqrt(2 / np.pi)  # the mean magnitude of a normal distribution
    assert_allclose(found.loudness(noise[900:], predicted[:, :, 0])[:, 1:], expected, atol=0.25)
    assert_allclose(predicted[:, 1:, 1], np.log(np.sqrt(2 / np.pi)), atol=0.2)  # a loud sample says nothing of the next innovation


def test_single_steps_give_the_predictions_of_whole_windows(loud):
    found = LinearPrediction.fit(loud[:3_000], loud[3_000:])
    rows, whole = loud[:6], found.predict(loud[:6])
    past = np.pad(rows, ((0, 0), (SAMPLES - 1, 0)))
    loudness = np.pad(found.loudness(rows, whole[:, :, 0]), ((0, 0), (SAMPLES - 1, 0)))
    for place in range(SAMPLES):
        value, magnitude = found.next(past[:, place : place + SAMPLES - 1], loudness[:, place : place + SAMPLES - 1], place)
        assert_allclose(value, whole[:, place, 0], atol=1e-5)
        assert_allclose(magnitude, whole[:, place, 1], atol=1e-4)


def test_saved_predictions_are_made_again_and_impossible_ones_are_refused(loud):
    found = LinearPrediction.fit(loud[:3_000], loud[3_000:])
    again = LinearPrediction.from_arrays(found.arrays, SAMPLES)
    np.testing.assert_array_equal(again.predict(loud[:5]), found.predict(loud[:5]))
    for name, values in (
        ("numbers", np.ones(2)),
        ("numbers", -np.ones(3)),
        ("values", np.zeros(SAMPLES)),
        ("magnitudes", np.zeros((2, 2))),
    ):
        with pytest.raises(ValueError, match="impossible form"):
            LinearPrediction.from_arrays(found.arrays | {name: values}, SAMPLES)
    with pytest.raises(ValueError, match="stationary"):
        LinearPrediction.from_arrays(found.arrays | {"values": np.array([1.5])}, SAMPLES)


def test_noise_of_one_magnitude_has_a_constant_loudness():
    signs = np.where(np.random.default_rng(0).random((300, 20)) < 0.5, -1, 1).astype(np.float32)
    found = LinearPrediction.fit(signs[:200], signs[200:])
    loudness = found.predict(signs)[:, :, 1]
    assert_allclose(loudness, loudness[0, 0])
    assert_allclose(loudness, 0, atol=0.01)
