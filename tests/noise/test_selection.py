"""The selection of generated windows, against ratios of densities and shares in closed form."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy.stats import binom

from enhsim_tf.noise.selection import LEAST_DISJOINT, NUM_CANDIDATES, Selection, _gain, window_statistics

SAMPLES = 64


def _windows(number: int, share_loud: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """White windows, of which a share has a standard deviation of 2, the others of 0.5; and which these are."""
    rng = np.random.default_rng(seed)
    is_loud = rng.random(number) < share_loud
    return (rng.standard_normal((number, SAMPLES)) * np.where(is_loud, 2.0, 0.5)[:, None]).astype(np.float32), is_loud


@pytest.fixture(scope="module")
def fitted() -> Selection:
    """Loud windows are 20 % of the real windows and 50 % of the generated ones."""
    found = Selection.fit(_windows(2_000, 0.2, 1)[0], lambda rows: _windows(len(rows), 0.5, 2)[0])
    assert found is not None
    return found


def test_the_gain_is_the_divergence_of_two_normal_distributions():
    rng = np.random.default_rng(0)
    real, generated = 0.5 + rng.standard_normal(200_000), rng.standard_normal(200_000)
    log_ratio = [0.5 * each - 0.125 for each in (real, generated)]  # of the densities
    assert _gain(*log_ratio) == pytest.approx(0.125, abs=0.01)  # half the squared difference of the means
    assert _gain(-log_ratio[0], -log_ratio[1]) < 0


def test_one_of_several_candidates_is_drawn_in_proportion_to_the_ratio_of_densities(fitted):
    candidates, is_loud = _windows(8_000 * NUM_CANDIDATES, 0.5, 3)
    shape = (8_000, NUM_CANDIDATES)
    chosen = fitted.choose(candidates.reshape(*shape, SAMPLES), np.random.default_rng(4))
    number = np.arange(NUM_CANDIDATES + 1)
    loud, quiet = 0.2 / 0.5 * number, 0.8 / 0.5 * (NUM_CANDIDATES - number)  # sums of the ratios, if so many candidates are loud
    expected = binom.pmf(number, NUM_CANDIDATES, 0.5) @ (loud / (loud + quiet))
    assert 0.2 < expected < 0.3
    assert np.mean(is_loud.reshape(shape)[np.arange(8_000), chosen]) == pytest.approx(expected, abs=0.03)


def test_windows_that_do_not_differ_are_not_selected():
    assert Selection.fit(_windows(2_000, 0.3, 1)[0], lambda rows: _windows(len(rows), 0.3, 2)[0]) is None


def test_rounding_errors_of_telemetry_are_no_difference():
    """Noise of two levels, of which the real one is a difference of 32-bit numbers, and the generated one exactly on the levels."""

    def levels(number: int, seed: int) -> np.ndarray:
        return np.where(np.random.default_rng(seed).random((number, SAMPLES)) < 0.5, -1.0, 1.0).astype(np.float32)

    signal = np.float32(20) * np.sin(np.arange(SAMPLES, dtype=np.float32))
    real = (levels(1_000, 1) + signal) - signal
    assert 0 < np.abs(real - levels(1_000, 1)).max() < 1e-5
    assert Selection.fit(real, lambda rows: levels(len(rows), 2)) is None


def test_too_little_telemetry_is_not_judged():
    def generate(rows: np.ndarray) -> np.ndarray:
        raise AssertionError("nothing has to be generated")

    real = _windows(LEAST_DISJOINT - 1, 0.2, 1)[0]
    assert Selection.fit(real, generate) is None
    overlapping = _windows(10 * LEAST_DISJOINT, 0.2, 1)[0]
    assert Selection.fit(overlapping, generate, starts=6 * np.arange(len(overlapping))) is None
    assert Selection.fit(overlapping[:, :40], generate) is None, "windows that are too short"


def test_the_same_seed_chooses_the_same_candidates(fitted):
    candidates = _windows(400, 0.5, 3)[0].reshape(100, 4, SAMPLES)
    first, again, other = (fitted.choose(candidates, np.random.default_rng(seed)) for seed in (4, 4, 5))
    assert_array_equal(first, again)
    assert (first != other).any()


def test_statistics_show_where_a_period_is_and_whether_loudness_varies():
    time = np.arange(512)
    slow, fast = (np.sin(2 * np.pi * time / period)[None] for period in (128, 4))
    assert window_statistics(slow).shape == window_statistics(fast).shape
    assert abs(window_statistics(slow) - window_statistics(fast)).max() > 5  # nepers of power in a band
    steady = np.random.default_rng(0).standard_normal((200, 512))
    varying = steady * np.where(time < 256, 0.5, np.sqrt(2 - 0.25))  # of the same variance
    first, second = window_statistics(steady), window_statistics(varying)
    apart = np.abs(first.mean(axis=0) - second.mean(axis=0)) / first.std(axis=0)
    assert apart.max() > 10 and apart.min() < 0.3


def test_a_saved_selection_chooses_the_same_candidates(fitted):
    candidates = _windows(400, 0.5, 3)[0].reshape(100, 4, SAMPLES)
    again = Selection.from_arrays(fitted.arrays, SAMPLES)
    assert_array_equal(again.choose(candidates, np.random.default_rng(1)), fitted.choose(candidates, np.random.default_rng(1)))


@pytest.mark.parametrize(
    ("changed", "window", "words"),
    [
        ({"weights": np.zeros(3)}, SAMPLES, "belong together"),
        ({"centre": np.zeros((2, 2))}, SAMPLES, "belong together"),
        ({"spread": None}, SAMPLES, "does not vary"),
        ({}, 128, "this window"),
        ({}, 32, "this window"),
    ],
)
def test_a_damaged_selection_is_refused(fitted, changed, window, words):
    arrays = fitted.arrays
    changed = {name: 0 * arrays[name] if values is None else values for name, values in changed.items()}
    with pytest.raises(ValueError, match=words):
        Selection.from_arrays(arrays | changed, window)
