"""What a moving average leaves, against its closed forms."""

import numpy as np
import pytest

from enhsim_tf.noise import GaussianNoise, extract_noise, noise_unit


def gain(width, frequency):
    """Of a centred moving average, for a sine of `frequency` cycles a sample."""
    return np.sin(np.pi * width * frequency) / (width * np.sin(np.pi * frequency))


def test_moving_average_by_hand():
    noise, average = extract_noise(np.array([1.0, 2, 6, 4, -4, 3, 0]), width=3)
    assert average.tolist() == [3, 4, 2, 1, np.float32(-1 / 3)]
    assert noise == pytest.approx([-1, 2, 2, -5, 10 / 3])
    noise, average = extract_noise(np.array([1.0, 2, 6, 4, -4, 3, 0]), width=7)
    assert (average, noise) == (pytest.approx([12 / 7]), pytest.approx([4 - 12 / 7]))


@pytest.mark.parametrize("width", [3, 25, 101])
def test_noise_and_average_add_up_to_the_middle_of_the_series(width):
    values = np.random.default_rng(0).normal(5, 2, 300).astype(np.float32)
    noise, average = extract_noise(values, width)
    assert len(noise) == len(average) == 300 - width + 1
    assert noise.dtype == average.dtype == np.float32
    assert noise + average == pytest.approx(values[width // 2 : 300 - width // 2], abs=1e-5)


@pytest.mark.parametrize(("width", "seed"), [(3, 0), (5, 1), (25, 2)])
def test_residual_of_white_noise(width, seed):
    number, sd = 400_000, 0.3
    noise, average = extract_noise(np.random.default_rng(seed).normal(0, sd, number), width)
    error = 5 * np.sqrt(2 / number)
    assert np.var(noise, dtype=np.float64) == pytest.approx(sd**2 * (1 - 1 / width), rel=error)
    assert np.var(average, dtype=np.float64) == pytest.approx(sd**2 / width, rel=error * np.sqrt(width))


@pytest.mark.parametrize(("width", "period"), [(25, 480), (25, 120), (5, 12.5), (25, 18)])
def test_leak_of_a_sine(width, period):
    sine = 0.5 * np.sin(2 * np.pi * np.arange(2_000) / period + 0.3)
    noise, average = extract_noise(sine, width)
    middle = sine[width // 2 : 2_000 - width // 2]
    assert average == pytest.approx(gain(width, 1 / period) * middle, abs=1e-6)
    assert noise == pytest.approx((1 - gain(width, 1 / period)) * middle, abs=1e-6)


def test_large_offset_leaves_no_trace():
    values = np.random.default_rng(3).integers(-8, 8, 1_000)
    assert extract_noise(values + 2.0**20, 5)[0] == pytest.approx(extract_noise(values, 5)[0], abs=1e-6)


@pytest.mark.parametrize("width", [24, 1, 0, -3, 101])
def test_widths_that_are_refused(refused, width):
    with refused(f"width={width}"):
        extract_noise(np.arange(100.0), width)


def test_noise_unit_puts_the_standard_deviation_at_a_tenth():
    noise = np.random.default_rng(0).normal(0, 7, 1_000)
    assert np.std(noise / noise_unit(noise)) == pytest.approx(0.1)


def test_gaussian_noise_recovers_the_standard_deviation():
    windows = np.random.default_rng(0).normal(0, 0.3, (400, 500)).astype(np.float32)
    fitted = GaussianNoise.fit(windows)
    assert fitted.standard_deviation == pytest.approx(0.3, rel=5 / np.sqrt(2 * windows.size))
    noise = fitted.generate(300, seed=1)
    assert noise.shape == (300, 500) and noise.dtype == np.float32
    assert np.std(noise) == pytest.approx(fitted.standard_deviation, rel=5 / np.sqrt(2 * noise.size))
    assert np.mean(noise[:, 1:] * noise[:, :-1]) / 0.09 == pytest.approx(0, abs=5 / np.sqrt(noise.size))


def test_gaussian_noise_owns_its_draws():
    noise = GaussianNoise(0.1, 40)
    np.random.seed(0)  # noqa: NPY002 - the global state must not matter
    first = noise.generate(3, seed=5)
    np.random.seed(1)  # noqa: NPY002
    assert (first == noise.generate(3, seed=5)).all()
    assert (first != noise.generate(3, seed=6)).all()
