"""Joint noise on four systems of three channels whose relations are known: what is generated keeps them, and what breaks them is found.

The fault keeps every channel as it is: one channel is that of another time, a whole number of periods away. A model of each channel on its
own sees nominal windows only, so it finds no more of them than it raises false alarms.
"""

import dataclasses
import functools
from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import lfilter

from enhsim_tf.simulator.fitting import fit
from enhsim_tf.simulator.options import ScoreOptions
from enhsim_tf.simulator.scoring import Scorer
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.series import Telemetry

pytestmark = pytest.mark.slow
NUM_SAMPLES, PERIOD = 20_000, 90
DELAY = 15  # samples
RATE, NUM_FAULTS = 0.01, 300
LAGS = (-30, -15, -5, 0, 5, 15, 30)


def _waves(number: int) -> np.ndarray:
    phase = 2 * np.pi * np.arange(number)[:, None] / PERIOD
    return np.array([1.0, 0.6, 0.8]) * np.sin(phase + np.array([0.0, 1.0, 2.0]))


def _process(number: int, memory: float, rng: np.random.Generator) -> np.ndarray:
    """An autoregression of order 1 with a standard deviation of 1."""
    return np.sqrt(1 - memory**2) * lfilter([1.0], [1.0, -memory], rng.standard_normal(number + 2_000))[2_000:]


def static_mixing(waves: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Two common processes in all three channels, and noise of their own."""
    common = np.stack([_process(len(waves), memory, rng) for memory in (0.8, 0.5)], axis=1)
    return common @ np.array([[0.4, 0.3, -0.3], [0.0, 0.2, 0.3]]) + 0.15 * rng.standard_normal(waves.shape)


def delayed_coupling(waves: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The second channel follows the first one `DELAY` samples later, the third one earlier."""
    common = _process(len(waves) + 2 * DELAY, 0.8, rng)
    late = np.stack([common[DELAY:-DELAY], common[: -2 * DELAY], common[2 * DELAY :]], axis=1)
    return 0.4 * late + 0.15 * rng.standard_normal(waves.shape)


def common_drift(waves: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A slow process moves the level of all channels."""
    drift = _process(len(waves), 0.998, rng)
    return drift[:, None] * np.array([0.5, -0.4, 0.3]) + 0.15 * rng.standard_normal(waves.shape)


def coupling_by_signal(waves: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Where the wave of the first channel is high, the second follows a common process; where it is low, it moves against it."""
    common = _process(len(waves), 0.8, rng)
    sign = np.sign(waves[:, 0])
    return 0.4 * np.stack([common, sign * common, common], axis=1) + 0.15 * rng.standard_normal(waves.shape)


SYSTEMS = (static_mixing, delayed_coupling, common_drift, coupling_by_signal)


def telemetry_of(system: Callable[[np.ndarray, np.random.Generator], np.ndarray], seed: int, number: int = NUM_SAMPLES) -> np.ndarray:
    """Telemetry of a system, float32 of shape `(samples, channels)`."""
    waves = _waves(number)
    return (waves + system(waves, np.random.default_rng([seed, SYSTEMS.index(system)]))).astype(np.float32)


def windows_of(values: np.ndarray, window: int) -> np.ndarray:
    """Windows that share no sample, with gaps between them so that they begin at all phases of the wave, as generated ones do."""
    starts = np.arange(0, len(values) - window + 1, window + 37)
    return np.lib.stride_tricks.sliding_window_view(values, window, axis=0)[starts].transpose(0, 2, 1)


def relations(noise: np.ndarray, clean: np.ndarray) -> np.ndarray:
    """Correlations of every pair of channels at several lags: over all samples, and where the clean first channel is high minus where it is low.

    Args:
        noise: Windows of noise, shape `(windows, samples, channels)`.
        clean: The signal below them.
    """
    rest = (noise - noise.mean(axis=(0, 1))) / noise.std(axis=(0, 1))
    sign = np.sign(clean[:, :, 0] - clean[:, :, 0].mean(axis=1, keepdims=True))
    found = []
    for first, second in ((0, 1), (0, 2), (1, 2)):
        for lag in LAGS:
            here, there = (slice(max(each, 0), rest.shape[1] + min(each, 0)) for each in (lag, -lag))
            product = rest[:, here, first] * rest[:, there, second]
            found += [product.mean(), (product * sign[:, here]).mean()]
    return np.array(found)


@dataclasses.dataclass(frozen=True)
class Fitted:
    """A system and the simulator that was fitted to it."""

    system: Callable
    simulator: EnhancedSimulator

    def real(self, seed: int, number: int = NUM_SAMPLES) -> np.ndarray:
        """Relations of the noise of new telemetry: what the aligned simulator leaves of it."""
        windows = windows_of(telemetry_of(self.system, seed, number), self.simulator.window)
        clean = self.simulator.enhance(*self.simulator.alignment.align(windows))
        return relations(windows - clean, clean)

    @functools.cached_property
    def apart_and_floor(self) -> tuple[float, float]:
        """Largest difference of a relation from that of very much real noise: of generated noise, and of as much real noise as the fit had."""
        true = self.real(1_000, 20 * NUM_SAMPLES)
        floor = np.mean([np.abs(self.real(seed) - true).max() for seed in range(10, 18)])
        clean = self.simulator.generate_clean(2_000, seed=1)
        generated = relations(self.simulator.draw_noise(clean, np.random.default_rng(4)), clean)
        return float(np.abs(generated - true).max()), float(floor)

    @functools.cached_property
    def levels_apart_and_floor(self) -> tuple[float, float]:
        """The same of the correlations of the levels of windows, which drift together."""

        def of(windows: np.ndarray) -> np.ndarray:
            return np.corrcoef(windows.mean(axis=1).T)[np.triu_indices(3, 1)]

        def real(seed: int, number: int = NUM_SAMPLES) -> np.ndarray:
            return of(windows_of(telemetry_of(self.system, seed, number), self.simulator.window))

        true = real(1_000, 20 * NUM_SAMPLES)
        floor = np.mean([np.abs(real(seed) - true).max() for seed in range(10, 18)])
        return float(np.abs(of(self.simulator.generate(2_000, seed=1)) - true).max()), float(floor)

    @functools.cached_property
    def alarms_and_recall(self) -> tuple[float, float]:
        """False alarms at the detector's own threshold on new telemetry; share of faulty windows above what 1 % of nominal ones exceed."""
        scorer, window = Scorer(self.simulator, ScoreOptions(false_alarm_rate=RATE)), self.simulator.window
        new = telemetry_of(self.system, 2, 3 * NUM_SAMPLES)
        alarms = float(np.mean(scorer.score_series(new) > 1))
        nominal = windows_of(new, window)
        limit = np.quantile(scorer.score_windows(nominal), 1 - RATE)
        rng = np.random.default_rng(3)
        begins = rng.integers(0, len(new) // 2 - window, NUM_FAULTS)
        others = begins + PERIOD * rng.integers(20, len(new) // (2 * PERIOD), NUM_FAULTS)
        faulty = np.stack([new[begin : begin + window] for begin in begins])
        for number, (other, channel) in enumerate(zip(others, rng.integers(0, 3, NUM_FAULTS), strict=True)):
            faulty[number, :, channel] = new[other : other + window, channel]
        return alarms, float(np.mean(scorer.score_windows(faulty) > limit))


@pytest.fixture(scope="module", params=SYSTEMS, ids=lambda system: system.__name__)
def fitted(request):
    values = telemetry_of(request.param, 1)
    simulator, _ = fit({name: Telemetry(values[:, channel].copy(), 1.0, name=name) for channel, name in enumerate("abc")})
    return Fitted(request.param, simulator)


def test_generated_noise_keeps_the_relations_of_the_channels(fitted):
    apart, floor = fitted.apart_and_floor
    if fitted.system is coupling_by_signal and apart > 3 * floor:
        pytest.xfail(f"matched residual windows keep half of a coupling that changes its sign with the signal ({apart / floor:.0f} floors)")
    assert apart <= 3 * floor


def test_the_levels_of_generated_windows_move_together_as_those_of_real_ones(fitted):
    apart, floor = fitted.levels_apart_and_floor
    assert apart <= 3 * floor


def test_a_channel_of_another_time_is_found_and_nominal_telemetry_is_not(fitted):
    alarms, recall = fitted.alarms_and_recall
    assert alarms <= 0.03  # of a single record of telemetry; thresholds are set for 1 %
    if fitted.system in (static_mixing, delayed_coupling):
        assert recall >= 0.9
    else:
        assert recall > 3 * RATE  # more than models of single channels can find
