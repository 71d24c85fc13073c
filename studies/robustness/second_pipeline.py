"""The residual pipeline: an enhancer trained on more windows in fewer epochs, and its residual as the noise."""

import functools
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.common.stages import Stages
from studies.common.settings import Settings

if TYPE_CHECKING:
    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

    from studies.common.example import Example


class SecondPipeline:
    """The enhancer of the residual pipeline and the noise that it leaves.

    Args:
        example: The telemetry and its windows.
        settings: All settings; `second` has those of the pipeline.
        stages: Runs stages and caches their results.
    """

    def __init__(self, example: "Example", settings: Settings, stages: Stages):
        self.example, self.settings, self.stages = example, settings, stages

    @functools.cached_property
    def simulator(self) -> "EnhancedSimulator":
        """The simulator with the trained enhancer, without noise."""
        from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

        _ = self.example.telemetry
        depends = (self.settings.paper.of("windows"), self.settings.second)
        folder = self.stages.run("second network", self._make, depends, after=("telemetry",))
        return EnhancedSimulator.load(folder / "simulator")

    def _make(self, folder: Path) -> None:
        from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

        chosen = self.settings.second
        EnhancedSimulator.fit(
            self.example.train,
            self.example.coarse,
            self.settings.seed,
            chosen.num_windows,
            chosen.epochs,
            window=self.settings.paper.window,
            noise="none",
            held_out=chosen.held_out,
            verbose=0,
            progress=self.stages.progress,
        ).save(folder / "simulator")

    def residuals(self) -> np.ndarray:
        """Windows of telemetry minus the enhanced signal, of shape `(windows, samples)`."""
        draws = np.random.default_rng([self.settings.seed, 1])
        return self.simulator.residual_windows(self.example.train, self.settings.second.num_windows, draws)
