"""Each detector finds injected anomalies, and degenerate scores find none."""

import numpy as np
import pytest

from enhsim_tf.detection import registry
from enhsim_tf.detection.autoencoders import ConvolutionalAutoencoder, DenseAutoencoder
from enhsim_tf.detection.detectors import (
    IsolationForestOnFeatures,
    LargestStep,
    LimitCheck,
    MovingDeviation,
    NearestNeighbours,
    OneClassSVMOnFeatures,
    PCAResidual,
    RandomScore,
)

DETECTORS = {
    "limit check": lambda seed=0: LimitCheck(),
    "PCA residual": lambda seed=0: PCAResidual(seed=seed),
    "nearest neighbours": lambda seed=0: NearestNeighbours(),
    "isolation forest": lambda seed=0: IsolationForestOnFeatures(num_trees=50, seed=seed),
    "one-class SVM": lambda seed=0: OneClassSVMOnFeatures(),
    "dense autoencoder": lambda seed=0: DenseAutoencoder(num_hidden=64, epochs=20, seed=seed),
    "convolutional autoencoder": lambda seed=0: ConvolutionalAutoencoder(epochs=20, seed=seed),
    "largest step": lambda seed=0: LargestStep(),
    "moving deviation": lambda seed=0: MovingDeviation(width=20),
}
SEEDED = ("isolation forest", "dense autoencoder", "convolutional autoencoder")
MUST_SEE = {  # anomalies that each detector should find; a constant window is not anomalous for a network with a short receptive field
    "limit check": ["spike", "noisy", "shifted"],
    "PCA residual": ["stuck", "noisy", "spike"],
    "nearest neighbours": ["stuck", "noisy", "shifted"],
    "isolation forest": ["stuck", "noisy", "shifted"],
    "one-class SVM": ["stuck", "noisy", "spike", "shifted"],
    "dense autoencoder": ["stuck", "noisy"],
    "convolutional autoencoder": ["noisy", "spike"],
    "largest step": ["noisy", "spike", "shifted"],
    "moving deviation": ["spike", "shifted"],
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


def changed(windows, change):
    windows = windows.copy()
    change(windows)
    return windows


def stick(windows):
    windows[:, 30:] = windows[:, 30:31]


def strike(windows):
    windows[:, 50] += 3


def shift(windows):
    windows[:, 40:70] += 3


ANOMALIES = {
    "stuck": changed(waves(60, 1), stick),
    "noisy": waves(60, 2, noise_sd=0.4),
    "spike": changed(waves(60, 6), strike),
    "shifted": changed(waves(60, 7), shift),
}


@pytest.fixture(scope="module", params=DETECTORS)
def fitted(request):
    """The name of a detector, and the detector fitted to 400 nominal windows."""
    return request.param, DETECTORS[request.param]().fit(waves(400, 0))


@pytest.mark.parametrize("anomaly", ANOMALIES)
def test_planted_anomalies_are_found(fitted, anomaly):
    name, detector = fitted
    nominal, scores = detector.score(waves(60, 3)), detector.score(ANOMALIES[anomaly])
    assert scores.shape == nominal.shape == (60,) and np.isfinite(scores).all()
    if anomaly in MUST_SEE[name]:
        assert area(scores, nominal) > 0.95


def test_nominal_windows_are_not_told_from_nominal_windows(fitted):
    detector = fitted[1]
    assert area(detector.score(waves(100, 4)), detector.score(waves(100, 5))) == pytest.approx(0.5, abs=5 * np.sqrt(201 / (12 * 100**2)))


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
    if name in SEEDED:
        assert (first != other).any()
    else:  # the PCA's solver is random, its components are not
        np.testing.assert_allclose(first, other, rtol=0.1)


def test_every_detector_and_control_has_a_name():
    assert {name for name in DETECTORS if name not in registry.CONTROLS} <= set(registry.DETECTORS)  # others have tests of their own
    assert list(registry.CONTROLS) == ["random score", "largest step", "moving deviation"]
    made = {name: make(5) for name, make in {**registry.DETECTORS, **registry.CONTROLS}.items()}
    assert {name: type(detector) for name, detector in made.items() if name in DETECTORS} == {
        name: type(make()) for name, make in DETECTORS.items()
    }
    assert [made[name].seed for name in (*SEEDED, "PCA residual")] == [5] * 4


def test_limit_check_by_hand():
    detector = LimitCheck(low=0.25, high=0.75).fit(np.arange(5.0)[None])  # limits 1 and 3
    assert detector.score(np.array([[2.0, 2.5], [2, 3.5], [-1, 3.5], [1, 3], [9, -9]])).tolist() == [-0.5, 0.5, 2, 0, 10]
    training = waves(400, 0)
    low, high = np.quantile(training, [0.001, 0.999])
    flat = np.full((1, 100), high + 0.25, np.float32)
    assert LimitCheck().fit(training).score(flat) == pytest.approx(0.25, abs=1e-5)


def test_distance_to_the_neighbours_by_hand():
    training = np.array([[0.0, 0], [3, 4], [0, 1], [100, 100]])
    detector = NearestNeighbours(num_neighbours=2).fit(training)
    assert detector.score(np.array([[0.0, 0], [6, 8], [100, 100]])) == pytest.approx([0.5, (5 + np.hypot(6, 7)) / 2, np.hypot(97, 96) / 2])
    assert NearestNeighbours(9).fit(training).score(training[:1]) == pytest.approx((0 + 5 + 1 + np.hypot(100, 100)) / 4)
    # a large offset leaves the distances as they are
    assert NearestNeighbours(2).fit(training + 2.0**30).score(np.array([[6.0, 8]]) + 2.0**30) == pytest.approx((5 + np.hypot(6, 7)) / 2)


def test_controls_by_hand():
    windows = np.array([[0.0, 1, -2, -2], [5, 5, 5, 5]])
    assert LargestStep().fit(windows).score(windows).tolist() == [3, 0]
    assert MovingDeviation(2).fit(windows).score(windows) == pytest.approx([1.5, 0])
    assert MovingDeviation(4).fit(windows).score(windows) == pytest.approx(np.std(windows, axis=1))
    random = waves(5, 0) + 1e4
    stretches = np.lib.stride_tricks.sliding_window_view(random.astype(np.float64), 25, axis=1)
    assert MovingDeviation().score(random) == pytest.approx(stretches.std(axis=2).max(axis=1))


def test_random_scores_depend_on_the_seed_only():
    detector, again = RandomScore(3), RandomScore(3)
    first, second = detector.fit(waves(5, 0)).score(waves(200, 0)), detector.score(waves(200, 0))
    assert (first == again.score(waves(200, 1))).all() and (first != second).all()
    assert area(first, second) == pytest.approx(0.5, abs=5 * np.sqrt(401 / (12 * 200**2)))


@pytest.mark.parametrize("samples", [48, 50, 63])
def test_convolutional_autoencoder_takes_windows_of_any_length(samples):
    windows = waves(40, 0)[:, :samples]
    assert ConvolutionalAutoencoder(epochs=1).fit(windows).score(windows[:7]).shape == (7,)


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
