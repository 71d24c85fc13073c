"""Joint noise on four systems of three channels whose relations are known: what is generated keeps them, and what breaks them is found.

The fault keeps every channel as it is: one channel is that of another time, a whole number of periods away. A model of each channel on its
own sees nominal windows only, so it finds no more of them than it raises false alarms.
"""

import numpy as np
import pytest
from scipy.signal import lfilter

from enhsim_tf.simulator.fitting import fit
from enhsim_tf.simulator.options import ScoreOptions
from enhsim_tf.simulator.scoring import Scorer
from enhsim_tf.telemetry.series import Telemetry

pytestmark = pytest.mark.slow
NUM_SAMPLES, PERIOD = 20_000, 90
DELAY = 15  # samples
RATE, NUM_FAULTS = 0.01, 300
LAGS = (-30, -15, -5, 0, 5, 15, 30)


def process(number, memory, rng):
    """An autoregression of order 1 with a standard deviation of 1."""
    return (
        np.sqrt(1 - memory**2)
        * lfilter([1.0], [1.0, -memory], rng.standard_normal(number + 2_000))[2_000:]
    )


def static_mixing(waves, rng):
    """Two common processes in all three channels."""
    common = np.stack([process(len(waves), memory, rng) for memory in (0.8, 0.5)], axis=1)
    return common @ np.array([[0.4, 0.3, -0.3], [0.0, 0.2, 0.3]])


def delayed_coupling(waves, rng):
    """The second channel follows the first one `DELAY` samples later, the third one earlier."""
    common = process(len(waves) + 2 * DELAY, 0.8, rng)
    return 0.4 * np.stack([common[DELAY:-DELAY], common[: -2 * DELAY], common[2 * DELAY :]], axis=1)


def common_drift(waves, rng):
    """A slow process moves the level of all channels."""
    return process(len(waves), 0.998, rng)[:, None] * np.array([0.5, -0.4, 0.3])


def coupling_by_signal(waves, rng):
    """Where the wave of the first channel is high, the second follows a common process; where it is low, it moves against it."""
    common = process(len(waves), 0.8, rng)
    return 0.4 * np.stack([common, np.sign(waves[:, 0]) * common, common], axis=1)


SYSTEMS = (static_mixing, delayed_coupling, common_drift, coupling_by_signal)


def telemetry_of(system, seed, number=NUM_SAMPLES):
    """Waves, what couples the channels, and noise of their own, float32 of shape `(samples, channels)`."""
    phase, rng = (
        2 * np.pi * np.arange(number)[:, None] / PERIOD,
        np.random.default_rng([seed, SYSTEMS.index(system)]),
    )
    waves = np.array([1.0, 0.6, 0.8]) * np.sin(phase + np.array([0.0, 1.0, 2.0]))
    return (waves + system(waves, rng) + 0.15 * rng.standard_normal(waves.shape)).astype(np.float32)


def windows_of(values, window):
    """Windows that share no sample, with gaps between them so that they begin at all phases of the wave, as generated ones do."""
    starts = np.arange(0, len(values) - window + 1, window + 37)
    return np.lib.stride_tricks.sliding_window_view(values, window, axis=0)[starts].transpose(
        0, 2, 1
    )


def relations(noise, clean):
    """Correlations of every pair of channels at several lags: over all samples, and where the clean first channel is high minus where it is low.

    The last three are those of the levels of windows, which drift together.
    """
    rest = (noise - noise.mean(axis=(0, 1))) / noise.std(axis=(0, 1))
    sign = np.sign(clean[:, :, 0] - clean[:, :, 0].mean(axis=1, keepdims=True))
    found = []
    for first, second in ((0, 1), (0, 2), (1, 2)):
        for lag in LAGS:
            here, there = (
                slice(max(each, 0), rest.shape[1] + min(each, 0)) for each in (lag, -lag)
            )
            product = rest[:, here, first] * rest[:, there, second]
            found += [product.mean(), (product * sign[:, here]).mean()]
    return np.append(found, np.corrcoef((noise + clean).mean(axis=1).T)[np.triu_indices(3, 1)])


@pytest.fixture(scope="module", params=SYSTEMS, ids=lambda system: system.__name__)
def fitted(request):
    values = telemetry_of(request.param, 1)
    return request.param, fit(
        {
            name: Telemetry(values[:, channel].copy(), 1.0, name=name)
            for channel, name in enumerate("abc")
        }
    )[0]


def test_generated_noise_keeps_the_relations_of_the_channels(fitted):
    system, simulator = fitted

    def real(seed, number=NUM_SAMPLES):
        windows = windows_of(telemetry_of(system, seed, number), simulator.window)
        clean = simulator.enhance(*simulator.alignment.align(windows))
        return relations(windows - clean, clean)

    true = real(
        1_000, 20 * NUM_SAMPLES
    )  # of very much real noise; the floor is that of as much as the fit had
    clean = simulator.generate(2_000, seed=1, with_noise=False)
    apart = np.abs(relations(simulator.draw_noise(clean, np.random.default_rng(4)), clean) - true)
    floors = [np.abs(real(seed) - true) for seed in range(10, 18)]
    noise, levels = (
        apart[some].max() / np.mean([each[some].max() for each in floors])
        for some in (slice(0, -3), slice(-3, None))
    )
    assert levels <= 3 and noise <= 3


def test_a_channel_of_another_time_is_found_and_nominal_telemetry_is_not(fitted):
    system, simulator = fitted
    scorer, window = Scorer(simulator, ScoreOptions(false_alarm_rate=RATE)), simulator.window
    new, rng = telemetry_of(system, 2, 3 * NUM_SAMPLES), np.random.default_rng(3)
    assert (
        np.mean(scorer.score_series(new) > 1) <= 0.03
    )  # of a single record of telemetry; thresholds are set for 1 %
    limit = np.quantile(scorer.score_windows(windows_of(new, window)), 1 - RATE)
    begins = rng.integers(0, len(new) // 2 - window, NUM_FAULTS)
    others = begins + PERIOD * rng.integers(20, len(new) // (2 * PERIOD), NUM_FAULTS)
    faulty = np.stack([new[begin : begin + window] for begin in begins])
    for number, (other, channel) in enumerate(
        zip(others, rng.integers(0, 3, NUM_FAULTS), strict=True)
    ):
        faulty[number, :, channel] = new[other : other + window, channel]
    recall = np.mean(scorer.score_windows(faulty) > limit)
    assert (
        recall >= 0.9 if system in (static_mixing, delayed_coupling) else recall > 3 * RATE
    )  # more than models of single channels find
