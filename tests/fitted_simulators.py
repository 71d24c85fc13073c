"""Telemetry of known waves, a coarse run of it, and fits that take little time; see the fixtures
`single`, `both` and `of_run`.
"""

import numpy as np

from enhsim_tf.fitting.options import FitOptions
from enhsim_tf.telemetry.series import Telemetry

PERIOD, WINDOW = 40, 80
START = "2024-01-01T00:00:00+00:00"
QUICK = FitOptions(window=WINDOW, num_windows=300, enhancer="ridge", noise="residual windows")
"""Options that choose neither the enhancer nor the noise, which takes most of the time of a fit."""
TINY = "--num-windows 40 --window 64 --enhancer ridge --noise residual-windows"
"""The same for the command line, with fewer and shorter windows."""


def smooth_wave(number, phase=0.0):
    """A square wave of period 40 after a moving average of nine samples: what an enhancer has to
    learn.
    """
    square = np.sign(np.sin(2 * np.pi * (np.arange(number + 8) / PERIOD + phase) + 1e-6))
    return np.convolve(square, np.ones(9) / 9, "valid")


def recorded(values, name="volts", start=START):
    """Telemetry or a run, one sample every ten seconds; a name for each of several columns."""
    return Telemetry.of(np.asarray(values, np.float32), 10.0, 0.0, start, name)


def series(number=3_000, seed=0, noise_sd=0.1):
    """Telemetry of one channel: the wave around 5, with white noise."""
    noise = noise_sd * np.random.default_rng(seed).standard_normal(number)
    return recorded(5 + 2 * smooth_wave(number) + noise)


def joint(number=3_000, seed=0):
    """Two channels whose noise has the correlation 0.8, in different units."""
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((number, 2)) @ np.linalg.cholesky([[1.0, 0.8], [0.8, 1.0]]).T
    waves = 5 + 2 * smooth_wave(number), 100 - 30 * smooth_wave(number, 0.25)
    return recorded(np.stack(waves, axis=1) + noise * (0.2, 3.0), ("volts", "watts"))


def coarse_run(number=3_000, start=START):
    """A recorded run of the square wave that `series` smooths."""
    square = np.sign(np.sin(2 * np.pi * (np.arange(number) + 4) / PERIOD + 1e-6))
    ramp = np.linspace(0, 1, number)
    return recorded(np.stack([square, ramp], axis=1), ("square", "ramp"), start)
