"""The residual pipeline: an enhancer trained on more windows in fewer epochs, and its residual as the noise."""

import functools
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.common.stages import Stages
from studies.common.settings import Settings

if TYPE_CHECKING:
    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
    from enhsim_tf.reproduce.paper.data import Data


class SecondPipeline:
    """The enhancer of the residual pipeline and the noise that it leaves.

    Args:
        data: The telemetry and its windows.
        settings: All settings; `second` has those of the pipeline.
        stages: Runs stages and caches their results.
    """

    def __init__(self, data: "Data", settings: Settings, stages: Stages):
        self.data, self.settings, self.stages = data, settings, stages

    @functools.cached_property
    def simulator(self) -> "EnhancedSimulator":
        """The simulator with the trained enhancer, without noise."""
        from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

        chosen = self.settings
        folder = self.stages.run(
            "second network", self._make, (chosen.telemetry, chosen.split, chosen.second, chosen.seed), after=("telemetry",)
        )
        return EnhancedSimulator.load(folder / "simulator")

    def _make(self, folder: Path) -> None:
        from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

        channel, chosen = self.data.channels[0], self.settings.second
        EnhancedSimulator.fit(
            channel.train,
            channel.coarse,
            self.settings.seed,
            chosen.num_windows,
            chosen.epochs,
            window=self.data.window,
            noise="none",
            held_out=chosen.held_out,
            verbose=0,
            progress=self.stages.progress,
        ).save(folder / "simulator")

    def residuals(self) -> np.ndarray:
        """Windows of telemetry minus the enhanced signal, of shape `(windows, samples)`."""
        draws = np.random.default_rng([self.settings.seed, 1])
        return self.simulator.residual_windows(self.data.channels[0].train, self.settings.second.num_windows, draws)
