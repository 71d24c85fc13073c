"""The residual pipeline: an enhancer trained on more windows in fewer epochs, and its residual as the noise."""

import functools
import types
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.coarse_simulator.square_waves import SquareWaveSimulator
from enhsim_tf.common.stages import Stages
from enhsim_tf.enhancer.names import NETWORK
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import cut_windows, random_window_starts
from studies.common.settings import Settings

if TYPE_CHECKING:
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
    def simulator(self) -> types.SimpleNamespace:
        """The trained enhancer: its function `enhance` maps windows of shape `(windows, samples)`."""
        from enhsim_tf.enhancer.model import Enhancer

        _ = self.example.telemetry
        depends = (self.settings.paper.of("windows"), self.settings.second)
        folder = self.stages.run("second network", self._make, depends, after=("telemetry",), version=2)
        with np.load(folder / "enhancer.npz") as arrays:
            sizes = {"name": NETWORK, "window": self.settings.paper.window, "columns": 1, "channels": 1}
            enhancer = Enhancer.from_arrays(sizes, dict(arrays))
        return types.SimpleNamespace(enhance=lambda coarse: enhancer.predict(coarse[:, :, None])[:, :, 0])

    def _make(self, folder: Path) -> None:
        from enhsim_tf.enhancer.candidates import fit_enhancer

        learnt, chosen, seed, window = self.example.train, self.settings.second, self.settings.seed, self.settings.paper.window
        learnt = learnt.part(0, len(learnt) - round(chosen.held_out * len(learnt)))
        starts = random_window_starts([learnt], window, chosen.num_windows, np.random.default_rng(seed))
        self.stages.progress.step("enhancer network")
        pairs = paired_windows(learnt, self.example.coarse, starts, window)
        np.savez(folder / "enhancer.npz", **fit_enhancer(NETWORK, *pairs, starts, seed, chosen.epochs).arrays)


def paired_windows(telemetry: Telemetry, coarse: SquareWaveSimulator, starts: np.ndarray, window: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns the coarse windows and the telemetry windows of the same times (steps 3 and 4 of the paper's pipeline).

    Args:
        telemetry: The telemetry.
        coarse: The coarse simulator.
        starts: First sample of each window, shape `(windows,)`.
        window: Number of samples in a window.

    Returns:
        `(coarse, target)`, two float32 arrays of shape `(windows, window)`.
    """
    times = telemetry.offset_s + telemetry.interval_s * (np.asarray(starts)[:, None] + np.arange(window))
    return coarse.simulate(times), cut_windows(telemetry.values, starts, window)
