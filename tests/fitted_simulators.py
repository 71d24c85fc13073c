"""Telemetry of known waves, a coarse run of it, and fits that take little time; see the fixtures
`single`, `both` and `of_run`.
"""

import numpy as np

from enhsim_tf.fitting.options import FitOptions
from enhsim_tf.telemetry.series import Part, Telemetry
from tests.known_simulators import parts_of

PERIOD, WINDOW = 40, 80
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


def series(number=3_000, seed=0, noise_sd=0.1, name="volts"):
    """Telemetry of one channel: the wave around 5, with white noise."""
    values = (
        5 + 2 * smooth_wave(number) + noise_sd * np.random.default_rng(seed).standard_normal(number)
    )
    return Telemetry.of(values.astype(np.float32), 10.0, 0.0, "2024-01-01T00:00:00+00:00", name)


def joint(number=3_000, seed=0):
    """Two channels whose noise has the correlation 0.8, in different units."""
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((number, 2)) @ np.linalg.cholesky([[1.0, 0.8], [0.8, 1.0]]).T
    values = np.stack(
        [5 + 2 * smooth_wave(number), 100 - 30 * smooth_wave(number, 0.25)], axis=1
    ) + noise * (0.2, 3.0)
    return parts_of(
        (Part(values.astype(np.float32)),),
        ("volts", "watts"),
        10.0,
        "2024-01-01T00:00:00+00:00",
        "volts, watts",
    )


def coarse_run(number=3_000, start="2024-01-01T00:00:00+00:00"):
    """A recorded run of the square wave that `series` smooths."""
    square = np.sign(np.sin(2 * np.pi * (np.arange(number) + 4) / PERIOD + 1e-6))
    ramp = np.linspace(0, 1, number)
    return parts_of(
        (Part(np.stack([square, ramp], axis=1).astype(np.float32)),),
        ("square", "ramp"),
        10.0,
        start,
        "the run",
    )
