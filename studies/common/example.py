"""The paper's pipeline on its example with other kinds of noise, and its parts as the tool takes
them.
"""

import functools
from typing import Any

import numpy as np

from enhsim_tf.coarse.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.common.stages import Stages
from enhsim_tf.paper import settings as of_paper
from enhsim_tf.paper import telemetry as of_example
from enhsim_tf.paper.pipeline import Pipeline
from enhsim_tf.telemetry.series import Telemetry
from studies.common.noise_processes import GALLERY
from studies.common.settings import Settings


def draw_noise(kind: str, signal: np.ndarray, sd: float, rng: np.random.Generator) -> np.ndarray:
    """Draws noise.

    Args:
        kind: Name of a process in `noise_processes.GALLERY`.
        signal: The signal without noise, shape `(samples,)`, on which one of the processes depends.
        sd: Standard deviation of the noise.
        rng: Random generator.

    Returns:
        float64 array of shape `(samples,)`.
    """
    process = GALLERY[kind]
    given = (signal,) if process.follows_signal else ()
    return sd / process.standard_deviation * process.draw(len(signal), rng, *given)


def coarse_simulator(settings: of_paper.Settings) -> SquareWaveSimulator:
    """The simulator of the example."""
    waves = (
        (settings.orbit_period, settings.orbit_amplitude),
        (settings.rotation_period, settings.rotation_amplitude),
    )
    return SquareWaveSimulator([SquareWave(period, low=-size, high=size) for period, size in waves])


class Example(Pipeline):
    """The paper's pipeline on its example with one of several kinds of noise.

    Args:
        settings: All settings.
        stages: Runs stages and caches their results.
    """

    def __init__(self, settings: Settings, stages: Stages):
        super().__init__(settings.paper, stages)
        self.noise = settings.noise
        self.coarse = coarse_simulator(settings.paper)

    @property
    def telemetry_settings(self) -> dict[str, Any]:
        """What the telemetry depends on; with white noise it is the paper's."""
        return super().telemetry_settings | ({} if self.noise == "white" else {"noise": self.noise})

    def new_telemetry(self) -> of_example.Telemetry:
        """The telemetry before it is placed in the store."""
        if self.noise == "white":
            return super().new_telemetry()
        chosen = self.settings
        clean = self.truth(chosen.interval * np.arange(chosen.num_samples))
        noisy = clean + draw_noise(self.noise, clean, chosen.noise_sd, self.draw("telemetry"))
        return of_example.Telemetry(noisy.astype(np.float32), chosen.interval)

    @functools.cached_property
    def train(self) -> Telemetry:
        """The training part, as the tool takes it."""
        part = self.parts["train"]
        return Telemetry.of(
            part.values, part.interval, name=part.name, offset_s=part.interval * part.first
        )
