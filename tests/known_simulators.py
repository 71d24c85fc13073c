"""Simulators that are not fitted: what they generate is known in closed form, and they need no
network.
"""

from collections.abc import Sequence

import numpy as np

from enhsim_tf.coarse.square_waves import SquareWaveSimulator, level_offset_and_scale
from enhsim_tf.coarse.waves import Waves
from enhsim_tf.enhancer.model import Enhancer
from enhsim_tf.noise.window_bootstrap import WindowBootstrap
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.series import Clock, Part, Telemetry


def parts_of(
    parts: Sequence[Part],
    columns: Sequence[str],
    interval_s: float = 1.0,
    start: str | None = None,
    name: str | None = None,
) -> Telemetry:
    """Telemetry or a run of several parts, on a clock with a zero as text."""
    return Telemetry(tuple(parts), tuple(columns), Clock.of(interval_s, start), name)


def unchanged(window: int, number: int = 1, gain: float = 1.0) -> Enhancer:
    """An enhancer that multiplies each of its columns by a gain and changes nothing else.

    Args:
        window: Length of a window in samples.
        number: Number of columns and channels.
        gain: The gain.
    """
    main = np.arange(number), np.full(number, gain, np.float32)
    return Enhancer(
        "level and gain",
        window,
        number,
        number,
        np.zeros(number, np.float32),
        np.zeros(window * number, np.float32),
        main=main,
    )


def of_waves(
    waves: Sequence[SquareWaveSimulator],
    window: int,
    noise_sd: float = 0.1,
    interval_s: float = 1.0,
    **others,
) -> EnhancedSimulator:
    """A simulator whose telemetry are the waves themselves plus white noise.

    Args:
        waves: The waves of each channel.
        window: Length of a window in samples.
        noise_sd: Standard deviation of the noise of each channel.
        interval_s: Sampling interval in seconds.
        **others: Further arguments of `EnhancedSimulator`, which replace those of this function.
    """
    channels = others.pop("channels", ("volts", "amps")[: len(waves)])
    levels = others.pop("levels", [[level_offset_and_scale(wave) for wave in waves]])
    given = {
        "alignment": Waves(waves, channels, interval_s, window, levels=np.array(levels)),
        "enhancer": unchanged(window, len(waves)),
        "noise": WindowBootstrap(
            noise_sd * np.random.default_rng(9).standard_normal((500, window, len(waves)))
        ),
        "trained": {"seed": 0},
    }
    return EnhancedSimulator(**given | others, channels=channels, interval_s=interval_s)
