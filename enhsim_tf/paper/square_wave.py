"""Sections 1 and 2.1: the simple, fast simulation.

"This simulation can be quite coarse - for example a square wave can be used for nearly any periodic
waveform" (introduction).
"""

from collections.abc import Callable

import numpy as np

from enhsim_tf.paper.settings import Settings

Signal = Callable[[np.ndarray], np.ndarray]


def square_wave(time: np.ndarray, period: float, amplitude: float) -> np.ndarray:
    """A square wave at times in seconds: `amplitude` in the first half of each period and
    `-amplitude` in the second.
    """
    return np.where(np.mod(time / period, 1.0) < 0.5, amplitude, -amplitude)


def simulator(settings: Settings) -> Signal:
    """Step 1: the simulator of the example, here a square wave in place of each sine, as a function
    of the time in seconds.
    """

    def simulate(time: np.ndarray) -> np.ndarray:
        orbit = square_wave(time, settings.orbit_period, settings.orbit_amplitude)
        return orbit + square_wave(time, settings.rotation_period, settings.rotation_amplitude)

    return simulate
