"""The autoregressive network recovers known processes, and the same seed gives the same noise."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.special import softmax
from scipy.stats import kstest, t

from enhsim_tf.common.errors import InputError
from enhsim_tf.keras_tools.backend import tf
from enhsim_tf.noise.autoregressive_network import AutoregressiveNetwork
from enhsim_tf.noise.calibration import mixture_probabilities
from enhsim_tf.noise.selection import LEAST_DISJOINT, Selection, window_statistics
from enhsim_tf.realism.measures import autocorrelation, effective_rank, log_scales
from studies.common.noise_processes import AutoregressiveNoise

SAMPLES = 64


@pytest.fixture(scope="module")
def coloured():
    """An AR(1) process of coefficient 0.7, and a network that learnt it."""
    noise = AutoregressiveNoise(0.7, 0.2).draw(1_500 * SAMPLES, np.random.default_rng(1)).reshape(-1, SAMPLES)
    return noise, AutoregressiveNetwork.untrained(noise, seed=3).fit(noise, 400)


def test_the_parameter_of_a_known_process_is_recovered(coloured):
    noise, network = coloured
    generated = network.generate(800, 5)
    assert generated.shape == (800, SAMPLES) and generated.dtype == np.float32
    assert np.std(generated) == pytest.approx(0.2, rel=0.05)
    assert_allclose(autocorrelation(generated, 5)[1:], 0.7 ** np.arange(1, 6), atol=0.05)
    assert effective_rank(generated) == pytest.approx(effective_rank(noise[:800]), rel=0.1)


def test_the_likelihood_reaches_the_entropy_of_the_process(coloured):
    _, network = coloured
    # a Gaussian innovation has the entropy log(sd sqrt(2 pi e)); samples with less than half a window before them are not judged
    entropy = 0.5 * np.log(2 * np.pi * np.e) + np.log(np.sqrt(1 - 0.7**2))
    assert network.held_out_loss == pytest.approx(entropy, abs=0.03)
    assert network.held_out_loss <= min(held for _, _, held in network.losses) + 1e-4


def test_a_series_has_no_seams_and_the_same_process(coloured):
    _, network = coloured
    series = network.generate_series(6_000, 2)
    assert series.shape == (6_000,)
    steps = np.diff(series)
    at_seams = steps[SAMPLES - 1 :: SAMPLES]
    assert np.std(at_seams) == pytest.approx(np.std(steps), rel=0.25)  # 93 seams
    assert np.sum(series[1:] * series[:-1]) / np.sum(series**2) == pytest.approx(0.7, abs=0.06)


def test_the_same_seed_gives_the_same_noise_and_the_owner_moves_on(coloured):
    _, network = coloured
    owner = np.random.default_rng(7)
    assert_array_equal(network.generate(5, 7), network.generate(5, 7))
    assert_array_equal(network.generate(5, 7), network.generate(5, owner))
    assert (network.generate(5, owner) != network.generate(5, 7)).any()


def test_the_same_seed_gives_the_same_training():
    noise = np.random.default_rng(0).normal(size=(60, 20))
    first, again = (AutoregressiveNetwork.untrained(noise, seed=2).fit(noise, 5).generate(4, 1) for _ in range(2))
    assert_array_equal(first, again)


def test_numpy_draws_from_the_density_that_training_maximises():
    """The density of the first sample, by hand from the layers, against draws of it."""
    noise = np.random.default_rng(0).normal(size=(200, 8))
    network = AutoregressiveNetwork.untrained(noise, seed=1)
    width = network.network.input_shape[1]
    features = np.zeros((1, width), np.float32)
    features[0, len(network.lags) + len(network.octaves) :][: len(network.octaves)] = np.log(1e-3)  # no past has no magnitude
    features[0, len(network.lags) + 2 * len(network.octaves) + 1] = 1.0  # 1 / sqrt(1 + 0)
    features[0, -1] = np.log(np.sqrt(2 / np.pi))  # the predicted magnitude of white noise
    logits, means, log_scales, degrees = (np.asarray(each, np.float64)[0] for each in network.network(features))
    drawn = network.generate(20_000, 3)[:, 0] / network.scale
    for value in np.linspace(-5, 5, 21):  # below the limit of generated samples
        expected = softmax(logits) @ t.cdf((value - means) / np.exp(log_scales), degrees)
        assert np.mean(drawn <= value) == pytest.approx(expected, abs=0.012)  # three standard errors of a share of 20,000


def test_the_density_is_that_of_students_distribution_for_few_and_many_degrees_of_freedom():
    values, degrees = np.linspace(-4, 4, 9, dtype=np.float32)[:, None], np.array([2.2, 5.0, 80.0, 2_983.0])
    rows = np.repeat(degrees[None].astype(np.float32), 9, axis=0)
    found = AutoregressiveNetwork._log_density(values, 0.5, np.float32(np.log(0.7)), rows)
    assert_allclose(found, t.logpdf((values - 0.5) / 0.7, degrees) - np.log(0.7), atol=3e-5, rtol=1e-5)


def test_the_largest_samples_are_as_large_as_those_of_the_process():
    """Independent Laplace samples: the quantile of the magnitude in closed form, far beyond where most of the samples are."""
    noise = np.random.default_rng(2).laplace(size=(4_000, 32))
    generated = AutoregressiveNetwork.untrained(noise, seed=3).fit(noise, 400).generate(20_000, 1)
    for share in (1e-2, 1e-3, 1e-4):  # of 640,000 samples
        assert np.quantile(np.abs(generated), 1 - share) == pytest.approx(-np.log(share), rel=0.1)


def test_samples_after_a_past_have_the_density_that_training_sees():
    """What the network predicts of drawn windows, computed as in training, is calibrated: probabilities of the drawn samples are uniform."""
    rng = np.random.default_rng(3)
    loudness = np.where(rng.random((1_500, 1)) < 0.5, 0.3, 1.2)  # the density depends on the past in value and in loudness
    noise = AutoregressiveNoise(0.7, 1.0).draw(1_500 * 32, rng).reshape(-1, 32) * loudness
    network = AutoregressiveNetwork.untrained(noise, seed=3).fit(noise, 300)
    network.calibration = None  # the density itself
    drawn = network.generate(2_000, 5)[:, :16]
    past = network._draw_pasts(2_000, 32, np.zeros((2_000, 0)), np.random.default_rng(5))  # the first that the seed draws
    windows = np.concatenate([past, drawn / network.scale], axis=1).astype(np.float32)
    for place in (16, 17, 24, 31):
        where = tf.constant([place], tf.int32)
        features, targets = network._features(tf.constant(windows), tf.zeros((2_000, 0)), tf.constant(network._derived(windows)), where)
        logits, means, log_scales, _ = (np.asarray(each, np.float64) for each in network.network(features))
        targets = np.asarray(targets, np.float64)[:, 0]
        below = mixture_probabilities(targets, logits, means, log_scales, network.degrees)
        assert kstest(below, "uniform").statistic < 0.04  # 0.036 is exceeded by chance once in a hundred
        below = mixture_probabilities(targets, logits[::-1], means[::-1], log_scales[::-1], network.degrees)
        assert kstest(below, "uniform").statistic > 0.06, "the past of another window would not be noticed"


def test_inputs_of_the_hidden_layers_are_standardised(coloured):
    noise, network = coloured
    windows = (noise[:1_000] / network.scale).astype(np.float32)
    features, _ = network._features(
        tf.constant(windows), tf.zeros((1_000, 0)), tf.constant(network._derived(windows)), tf.constant(network._places(40))
    )
    found = network.network.get_layer("standardise")(features).numpy()
    plain = np.std(features, axis=0, dtype=np.float64)
    varies, samples = plain > 1e-6, len(network.lags) + 2 * len(network.octaves)
    whole_window, size_of_errors = len(network.lags) - 1, samples + 2 + 7  # after the two ages, and the predictions of seven samples
    assert set(np.flatnonzero(~varies)) == {whole_window, size_of_errors}, "before the window's beginning; which this noise does not tell"
    assert (plain[varies] < 0.5).any(), "some inputs vary little"
    assert np.abs(found.mean(axis=0)).max() < 0.1 and np.abs(found.std(axis=0)[varies] - 1).max() < 0.1


def test_a_saved_network_whose_inputs_have_no_spread_is_refused(coloured):
    _, network = coloured
    weights, names = network.network.get_weights(), [each.path for each in network.network.weights]
    (place,) = [number for number, name in enumerate(names) if name.endswith("spread")]
    weights[place] = 0 * weights[place]
    with pytest.raises(ValueError, match="spread"):
        AutoregressiveNetwork(**network.get_config()).set_weights(weights)


def test_a_series_goes_on_from_the_window_that_was_chosen():
    """After each window, one of four candidates is chosen: what follows has the density that training sees after this one, not another."""
    noise = AutoregressiveNoise(0.9, 1.0).draw(1_000 * SAMPLES, np.random.default_rng(4)).reshape(-1, SAMPLES)
    noise *= np.where(np.random.default_rng(5).random((1_000, 1)) < 0.5, 0.3, 1.2)
    network = AutoregressiveNetwork.untrained(noise, seed=3).fit(noise, 200)
    network.calibration = None
    size = window_statistics(np.zeros((1, SAMPLES))).shape[1]
    network.selection = Selection(np.zeros(size), np.ones(size), np.zeros(2 * size))  # any candidate, as often
    series = network.generate_series(600 * SAMPLES, 6) / network.scale
    starts = 1 + SAMPLES * np.arange(598)
    for after in (0, 1, 5):  # samples after the beginning of a window; each is the last one of what training would see
        windows = np.stack([series[start + after :][:SAMPLES] for start in starts])
        for place in (0, 7):
            moved = np.roll(windows[:, :-1], place, axis=0)  # with a past of its own, or of another window
            seen = np.concatenate([moved, windows[:, -1:]], axis=1).astype(np.float32)
            where = tf.constant([SAMPLES - 1], tf.int32)
            features, targets = network._features(tf.constant(seen), tf.zeros((598, 0)), tf.constant(network._derived(seen)), where)
            logits, means, log_scales, _ = (np.asarray(each, np.float64) for each in network.network(features))
            below = mixture_probabilities(np.asarray(targets, np.float64)[:, 0], logits, means, log_scales, network.degrees)
            statistic = kstest(below, "uniform").statistic
            assert statistic < 0.067 if place == 0 else statistic > 0.15  # 0.067 is exceeded by chance once in a hundred


class Rotating:
    """Chooses the first candidate of the first window, the second one of the second window, and so on."""

    def __init__(self):
        self.number = -1

    def choose(self, candidates, rng):
        self.number += 1
        return np.full(len(candidates), self.number % candidates.shape[1])


def test_all_that_a_series_continues_is_of_the_candidate_that_was_chosen():
    """The densities are those of the chosen samples drawn again one after the other, without candidates."""
    rng, number = np.random.default_rng(4), 5 * SAMPLES
    loudness = np.repeat(np.where(rng.random(4_000) < 0.5, 0.3, 1.2), 16)
    noise = (AutoregressiveNoise(0.9, 1.0).draw(64_000, rng) * loudness).reshape(-1, SAMPLES)
    network = AutoregressiveNetwork.untrained(noise, seed=3).fit(noise, 3)
    network.calibration, network.selection = None, Rotating()
    assert len(network.prediction.values.coefficients) and len(network.prediction.magnitudes.coefficients)
    standardised = {id(each) for each in network.network.get_layer("standardise").weights}
    weights = zip(network.network.weights, network.network.get_weights(), strict=True)
    network.network.set_weights(  # so that each input counts
        [own if id(each) in standardised else rng.normal(0, 0.2, own.shape) for each, own in weights]
    )
    given, values, again, sample = [], [], [], network._sample

    def draw(*numbers):
        given.append(numbers[:3])
        values.append(sample(*numbers))
        return values[-1]

    def draw_again(*numbers):
        again.append(numbers[:3])
        return values[len(again) - 1][[(len(again) - 1) // SAMPLES % 4]]

    network._sample = draw
    series = network.generate_series(number, 6)
    past = network._draw_pasts(4, number, np.zeros((4, 0)), np.random.default_rng(6))[:1]  # the first that the seed draws
    network._sample = draw_again
    replayed = network._continue(past, number, np.zeros((1, 0)), 1, rng)[0]
    np.testing.assert_allclose(replayed, series, atol=1e-5)
    for place, (candidates, alone) in enumerate(zip(given, again, strict=True)):
        for found, expected in zip(candidates, alone, strict=True):
            np.testing.assert_allclose(found[place // SAMPLES % 4], expected[0], atol=1e-3)


def test_hardly_anything_is_selected_where_the_network_is_right(coloured):
    """An autoregression is learnt so well that windows are told apart by chance alone, if at all."""
    noise, network = coloured
    assert len(noise) >= LEAST_DISJOINT, "it is judged"
    if network.selection is not None:
        odds = network.selection._expand(window_statistics(noise[:500] / network.scale)) @ network.selection.weights
        assert np.std(odds) < 0.25, "of their logarithm"


def test_windows_are_selected_where_the_network_is_wrong():
    """White noise, and a network that is made too loud by a known factor: the mean logarithm of the loudness of one of four candidates."""
    noise = np.random.default_rng(8).standard_normal((3_000, SAMPLES)).astype(np.float32)
    network = AutoregressiveNetwork.untrained(noise, seed=2).fit(noise, 100)
    too_loud = 0.06
    kernel, bias = network.network.get_layer("last").get_weights()
    network.network.get_layer("last").set_weights([kernel, bias + too_loud * (np.arange(len(bias)) >= 2 * network.num_components)])
    network._select(noise / np.float32(network.scale), np.zeros((3_000, 0), np.float32), None)
    spread = np.std(log_scales(noise))
    candidates = too_loud / spread + np.random.default_rng(1).standard_normal((100_000, 4))
    odds = np.exp(-too_loud / spread * candidates)  # of two normal distributions
    expected = {"selected": spread * np.mean(np.sum(candidates * odds, axis=1) / np.sum(odds, axis=1)), "drawn": too_loud}
    assert expected["selected"] < 0.4 * too_loud
    for name, selection in (("selected", network.selection), ("drawn", None)):
        network.selection = selection
        windows = network.generate(2_000, 3)
        assert windows.shape == (2_000, SAMPLES)
        assert np.mean(log_scales(windows)) - np.mean(log_scales(noise)) == pytest.approx(expected[name], abs=0.012)


@pytest.mark.parametrize("window", [2, 7, 9])
def test_short_and_odd_windows_and_short_series_are_drawn(window):
    rng = np.random.default_rng(1)
    noise, signal = rng.normal(size=(60, window)), rng.normal(size=(60, window)).astype(np.float32)
    network = AutoregressiveNetwork.untrained(noise, signal, seed=1).fit(noise, 3, signal)
    assert np.isfinite(network.generate(5, 2, signal[:5])).all()
    for number in (0, 1, 3, 40):
        series = network.generate_series(number, 2, rng.normal(size=number))
        assert series.shape == (number,) and np.isfinite(series).all()


def test_an_edge_and_a_tail_that_no_component_has_are_drawn():
    """Independent exponential samples: their distribution function in closed form."""
    noise = np.random.default_rng(6).exponential(size=(8_000, 32)) - 1
    network = AutoregressiveNetwork.untrained(noise, seed=3).fit(noise, 300)
    generated = network.generate(10_000, 1)
    assert network.calibration is not None
    for value in (-0.9, -0.5, 0.0, 1.0, 3.0):
        assert np.mean(generated <= value) == pytest.approx(1 - np.exp(-(value + 1)), abs=0.005)
    assert np.quantile(generated, 0.999) == pytest.approx(-np.log(1e-3) - 1, abs=0.25)  # four standard errors of the training data
    assert np.mean(generated < -1.05) < 0.002


def test_generated_noise_continues_real_noise():
    """Each window has a loudness of its own, which no first sample tells: 0.1 or 1, as often."""
    rng = np.random.default_rng(8)
    noise = rng.standard_normal((1_000, 40)) * np.where(rng.random((1_000, 1)) < 0.5, 0.1, 1.0)
    network = AutoregressiveNetwork.untrained(noise, seed=2).fit(noise, 400)
    scales = np.std(network.generate(2_000, 3), axis=1)
    assert np.mean(scales < 0.3) == pytest.approx(0.5, abs=0.05)
    assert np.mean((scales > 0.17) & (scales < 0.6)) < 0.03  # of the real windows fewer than one in a thousand: some drift
    before = network.pasts.windows * network.scale
    np.testing.assert_allclose(before, noise[:, :20], rtol=1e-5)  # real noise, as long as half a window


def test_noise_that_follows_the_signal_continues_noise_before_a_similar_signal():
    rng = np.random.default_rng(9)
    is_rising = rng.random((400, 1)) < 0.5
    signal = np.where(is_rising, np.linspace(-1, 1, 40), np.linspace(1, -1, 40))
    noise = rng.standard_normal((400, 40)) * np.where(is_rising, 0.1, 1.0)
    network = AutoregressiveNetwork.untrained(noise, signal, seed=2).fit(noise, 5, signal)
    after_rising = signal[is_rising[:, 0]][:1, 20:]
    wanted = np.repeat(np.concatenate([after_rising, -after_rising], axis=0), 50, axis=0)
    wanted = np.concatenate([wanted, wanted], axis=1).astype(np.float32)
    drawn = network._draw_pasts(100, 40, wanted, np.random.default_rng(1)) * network.scale
    assert (np.std(drawn[:50], axis=1) < 0.3).all() and (np.std(drawn[50:], axis=1) > 0.3).all()


def test_noise_whose_scale_follows_the_signal_is_learnt():
    rng = np.random.default_rng(4)
    signal = rng.uniform(-1, 1, (1_000, 1)) * np.ones((1, 30))
    noise = rng.standard_normal((1_000, 30)) * np.where(signal > 0, 1.0, 0.2)
    network = AutoregressiveNetwork.untrained(noise, signal, seed=1).fit(noise, 300, signal)
    quiet, loud = (network.generate(300, 2, np.full((300, 30), level)) for level in (-0.5, 0.5))
    assert np.std(quiet) == pytest.approx(0.2, rel=0.2) and np.std(loud) == pytest.approx(1.0, rel=0.2)
    with pytest.raises(InputError, match="Expected the enhanced signal of shape"):
        network.generate(3, 2)


@pytest.mark.parametrize("origin", [0.0, 0.1])
def test_quantised_noise_stays_on_its_grid(origin):
    rng = np.random.default_rng(0)
    grid = origin + 0.25 * np.rint(rng.normal(size=(300, 40)) / 0.25)
    signal = rng.normal(size=grid.shape).astype(np.float32)
    noise = (grid + signal).astype(np.float32) - signal  # a difference of float32 values, which is only almost on the grid
    assert len(np.unique(noise)) > 2 * len(np.unique(grid))
    network = AutoregressiveNetwork.untrained(noise, seed=1).fit(noise, 50)
    generated = (network.generate(20, 1) - origin) / 0.25
    assert network.step == pytest.approx(0.25)
    np.testing.assert_allclose(generated, np.rint(generated), atol=1e-4)


@pytest.mark.parametrize("log_scale", [-6.0, -2.0, 0.0, 2.0])
@pytest.mark.parametrize("error", [1.0, 0.05])
def test_the_likelihoods_of_all_levels_add_up_to_one(error, log_scale):
    """Also where the error of the linear prediction is a tenth of a step, and a component is far narrower than a step."""
    network = AutoregressiveNetwork(8, 1.0, step=0.5)
    levels = 0.5 * np.arange(-100, 101)
    targets = np.stack([(levels - 0.13) / error, np.full(201, error)], axis=1).astype(np.float32)
    logits, means, log_scales, degrees = (np.full((1, 2), each, np.float32) for each in (0.0, 0.4, log_scale, 30.0))
    losses = [float(network._negative_log_likelihood(row[None], logits, means, log_scales, degrees)) for row in targets]
    assert np.sum(np.exp(-np.array(losses))) * network.step == pytest.approx(1, abs=0.01)


def test_quantised_noise_keeps_its_scale_and_correlation():
    rng = np.random.default_rng(5)
    latent = np.zeros((1_000, 48))
    for place in range(1, 48):
        latent[:, place] = 0.8 * latent[:, place - 1] + 0.6 * rng.normal(size=1_000)
    noise = np.rint(
        latent[:, 16:]
    )  # a step of one standard deviation: noise that is spread over its step loses a fifth of this correlation
    generated = AutoregressiveNetwork.untrained(noise, seed=3).fit(noise, 400).generate(1_000, 1)
    lag = [np.mean(each[:, 8:-1] * each[:, 9:]) / np.var(each) for each in (noise, generated)]
    assert np.std(generated) == pytest.approx(np.std(noise), rel=0.05) and lag[1] == pytest.approx(lag[0], abs=0.08)
    shares = [[np.mean(each == level) for level in (-2, -1, 0, 1, 2)] for each in (noise, generated)]
    np.testing.assert_allclose(shares[1], shares[0], atol=0.02)


def test_noise_that_cannot_be_learnt_is_refused():
    for noise in (np.zeros((20, 10)), np.full((20, 10), np.nan)):
        with pytest.raises(InputError, match="Expected finite noise that varies"):
            AutoregressiveNetwork.untrained(noise)
