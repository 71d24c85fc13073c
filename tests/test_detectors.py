"""Each detector finds planted anomalies, beside the degenerate scores that find none."""

import numpy as np
import pytest

from enhsim_tf.detectors import DenseAutoencoder, IsolationForestOnFeatures, PCAResidual

DETECTORS = {
    "PCA residual": lambda seed=0: PCAResidual(seed=seed),
    "isolation forest": lambda seed=0: IsolationForestOnFeatures(num_trees=50, seed=seed),
    "dense autoencoder": lambda seed=0: DenseAutoencoder(num_hidden=64, epochs=20, seed=seed),
}


def area(anomalous, nominal):
    """Area under the ROC curve: the share of pairs in the right order, ties for half."""
    difference = np.asarray(anomalous)[:, None] - np.asarray(nominal)[None]
    return np.mean((difference > 0) + 0.5 * (difference == 0))


def waves(number, seed, noise_sd=0.1):
    """Sines of 40 samples at random phases, in noise, around 5."""
    rng = np.random.default_rng(seed)
    phases = rng.uniform(0, 2 * np.pi, (number, 1))
    return (5 + np.sin(2 * np.pi * np.arange(100) / 40 + phases) + noise_sd * rng.standard_normal((number, 100))).astype(np.float32)


def stuck(windows):
    windows = windows.copy()
    windows[:, 30:] = windows[:, 30:31]
    return windows


ANOMALIES = {"stuck": stuck(waves(60, 1)), "noisy": waves(60, 2, noise_sd=0.4)}


@pytest.fixture(scope="module", params=DETECTORS)
def fitted(request):
    """A detector that learnt 400 nominal windows."""
    return DETECTORS[request.param]().fit(waves(400, 0))


@pytest.mark.parametrize("anomaly", ANOMALIES)
def test_planted_anomalies_are_found(fitted, anomaly):
    nominal, scores = fitted.score(waves(60, 3)), fitted.score(ANOMALIES[anomaly])
    assert scores.shape == nominal.shape == (60,)
    assert area(scores, nominal) > 0.95


def test_nominal_windows_are_not_told_from_nominal_windows(fitted):
    assert area(fitted.score(waves(100, 4)), fitted.score(waves(100, 5))) == pytest.approx(0.5, abs=5 * np.sqrt(201 / (12 * 100**2)))


def test_degenerate_scores_find_nothing():
    rng = np.random.default_rng(0)
    assert area(rng.random(400), rng.random(400)) == pytest.approx(0.5, abs=5 * np.sqrt(801 / (12 * 400**2)))
    assert area(np.ones(60), np.ones(60)) == 0.5  # flags all or none
    assert area([2, 3], [0, 2]) == (3 + 0.5) / 4


@pytest.mark.parametrize("name", DETECTORS)
def test_same_seed_same_scores(name):
    training, windows = waves(120, 0), waves(20, 1)
    first, again, other = (DETECTORS[name](seed).fit(training).score(windows) for seed in (3, 3, 4))
    assert (first == again).all()
    if name == "PCA residual":  # its solver is random, its components are not
        np.testing.assert_allclose(first, other, rtol=0.1)
    else:
        assert (first != other).any()


def test_pca_residual_is_the_energy_outside_the_span():
    rng = np.random.default_rng(0)
    basis = np.linalg.qr(rng.standard_normal((50, 50)))[0].T
    training = 7 + rng.standard_normal((200, 3)) @ basis[:3]
    detector = PCAResidual(num_components=3).fit(training)
    inside = 7 + 4 * rng.standard_normal((20, 3)) @ basis[:3]
    assert detector.score(inside) == pytest.approx(np.zeros(20), abs=1e-20)
    energies = rng.uniform(0.1, 4, 20)
    outside = inside + np.sqrt(energies)[:, None] * basis[10]
    assert detector.score(outside) == pytest.approx(energies / 50)


def test_pca_takes_no_more_components_than_there_are_windows():
    windows = waves(10, 0)
    assert PCAResidual(num_components=20).fit(windows).score(windows) == pytest.approx(np.zeros(10), abs=1e-6)


def test_autoencoder_scores_in_units_of_the_training_variance():
    training, windows = waves(150, 0), waves(30, 1)
    plain, stretched = DenseAutoencoder(64, 16, 4).fit(training), DenseAutoencoder(64, 16, 4).fit(-900 + 64 * training)
    np.testing.assert_allclose(plain.score(windows), stretched.score(-900 + 64 * windows), rtol=0.02)
    # an untrained network answers next to nothing of the input: about its variance; a trained one less
    assert DenseAutoencoder(64, 16, 40).fit(training).score(windows).mean() < 0.2 < plain.score(windows).mean()
