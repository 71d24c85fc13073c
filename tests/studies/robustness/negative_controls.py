"""Noises with a known error, which show what each measure of realism can detect and what it cannot.

The real process has memory (AR(1), 0.7), heavy tails (innovations of Student's t with 5 degrees of freedom) and a scale that
differs between windows. A measure that accepts a control cannot detect its error; no control is accepted by all measures.
"""

from collections.abc import Callable, Mapping

import numpy as np

from enhsim_tf.common.measures import autocorrelation
from studies.common.noise_processes import AutoregressiveNoise

Control = Callable[[np.ndarray, np.random.Generator], np.ndarray]


def process(num_windows: int, samples: int, rng: np.random.Generator) -> np.ndarray:
    """Windows of the process, float32 of shape `(num_windows, samples)`."""
    from scipy.signal import lfilter

    values = lfilter([1.0], [1.0, -0.7], rng.standard_t(5, (num_windows, samples + 100)), axis=1)[:, 100:]
    scale = np.exp(0.3 * rng.standard_normal((num_windows, 1)))
    return (scale * values).astype(np.float32)


def _gaussian(real: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return rng.normal(0, np.std(real), real.shape)


def _autoregression(real: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    fitted = AutoregressiveNoise(float(autocorrelation(real, 1)[1]), float(np.std(real)))
    return np.stack([fitted.draw(real.shape[1], rng) for _ in real])


def _phase_randomised(real: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    transformed = np.fft.rfft(real, axis=1)
    return np.fft.irfft(transformed * np.exp(2j * np.pi * rng.random(transformed.shape)), real.shape[1], axis=1)


def _louder(real: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return 1.5 * real


def _memorised(real: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return real[rng.integers(0, 20, len(real))]


def _linear_latent(real: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    _, energy, directions = np.linalg.svd(real - real.mean(axis=0), full_matrices=False)
    latent = rng.standard_normal((len(real), 16)) * energy[:16] / np.sqrt(len(real))
    return real.mean(axis=0) + latent @ directions[:16]


NEGATIVE_CONTROLS: Mapping[str, Control] = {
    "Gaussian of the same scale": _gaussian,
    "fitted Gaussian AR(1)": _autoregression,
    "real, phases randomised": _phase_randomised,
    "real, 1.5 times as loud": _louder,
    "twenty windows memorised": _memorised,
    "sixteen linear dimensions": _linear_latent,
}
"""Functions from real windows and a random generator to as many windows with a known error."""
