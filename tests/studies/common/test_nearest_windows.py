"""The mean of the nearest windows: by hand, and a number of neighbours that grows with the noise."""

import numpy as np

from studies.common.nearest_windows import fit_nearest_windows


def test_windows_that_come_again_have_one_neighbour():
    inputs, targets = np.array([[0.0, 0.0], [1.0, 1.0], [5.0, 5.0]]), np.array([[10.0], [20.0], [60.0]])
    predict = fit_nearest_windows(np.tile(inputs, (5, 1)), np.tile(targets, (5, 1)))  # each block of time has all three
    np.testing.assert_array_equal(predict(np.array([[0.2, 0.2], [4.0, 4.0]])), [[10], [60]])


def test_more_noise_takes_more_neighbours_and_units_do_not_matter():
    rng = np.random.default_rng(0)
    inputs = rng.uniform(size=(400, 1, 2)) * [1.0, 1e6]
    clean = np.sin(20 * inputs[:, 0, :1])
    errors = {}
    for noise in (0.0, 3.0):
        targets = clean + noise * rng.standard_normal((400, 3))
        predicted = fit_nearest_windows(inputs, targets)(inputs)
        np.testing.assert_allclose(
            predicted, fit_nearest_windows(inputs * [1e3, 1e-3], targets)(inputs * [1e3, 1e-3]), rtol=1e-4, atol=1e-4
        )
        errors[noise] = np.mean((predicted - clean) ** 2)
    assert errors[0.0] < 0.1  # few neighbours follow the sine
    assert errors[3.0] < 1.1 * np.var(clean) + 9 / 100  # many average the noise away
