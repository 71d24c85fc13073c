"""The cells of one replicate: the signal of each enhancer, the noise of each generator, and the
detectors that are trained on their sum.
"""

import functools
import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.common.atomic_files import write_json
from enhsim_tf.common.stages import Stages, load_arrays, save_arrays
from enhsim_tf.enhancer.names import NETWORK
from enhsim_tf.enhancer.ridge import fit_ridge
from enhsim_tf.noise.window_bootstrap import WindowBootstrap
from enhsim_tf.paper.telemetry import cut_windows
from enhsim_tf.telemetry.windows import random_window_starts
from studies.common import detectors, evaluation
from studies.common.gaussian_noise import GaussianAutoregression
from studies.common.paper_gan import PaperGAN
from studies.common.settings import Settings
from studies.common.tables import stage_tables
from studies.factorial.cells import (
    AUTOREGRESSION,
    DETECTORS,
    FEW,
    MANY,
    MOVING_AVERAGE,
    REFERENCES,
    RIDGE,
    WHOLE_WINDOWS,
    Cell,
    cells_by_source,
)
from studies.robustness.replicate import Replicate

if TYPE_CHECKING:
    import pandas as pd

Enhance = Callable[[np.ndarray], np.ndarray]
NoiseModel = WindowBootstrap | GaussianAutoregression | PaperGAN
TRAINING = "arms, training"
THRESHOLD = "arms, threshold"
"""Purposes of windows: to train a detector, and to set its threshold."""


class Pipelines(Replicate):
    """All cells of one environment and seed, with the data and the paper's networks of the study of
    robustness. Networks are trained when they are first needed.

    Args:
        settings: All settings.
        stages: Runs stages and caches their results.
    """

    def __init__(self, settings: Settings, stages: Stages):
        super().__init__(settings, stages)
        self.window = self.settings.paper.window
        self.seed = self.settings.seed
        self.enhancer = functools.cache(self._enhancer)
        self.extracted = functools.lru_cache(maxsize=1)(self._extracted)
        # the last one is kept, because both purposes and some cells share it
        self._fitted = functools.lru_cache(maxsize=1)(self._fit)

    @functools.cached_property
    def tables(self) -> "dict[str, pd.DataFrame]":
        """The table `cells`. The cells whose noise is learnt from the same windows are a stage, so
        that an interrupted run goes on.
        """
        import pandas as pd

        _ = self.example.telemetry
        chosen = self.settings
        depends = (chosen.paper.of("windows", "enhancer", "noise", "noise GAN"), chosen.second)
        depends += (
            chosen.robustness.num_windows,
            chosen.robustness.num_anomalous,
            chosen.factorial.max_order,
        )
        parts = {"references": list(REFERENCES)} | {
            " ".join(filter(None, source)): cells for source, cells in cells_by_source().items()
        }
        found = []
        for name, cells in parts.items():
            compute = functools.partial(self._rows, cells)
            stage = f"cells {name}"
            tables = stage_tables(self.stages, stage, compute, depends, ("telemetry",))
            found.append(tables["cells"])
        return {"cells": pd.concat(found, ignore_index=True)}

    def _rows(self, cells: list[str | Cell]) -> dict[str, list[dict[str, object]]]:
        about = {"environment": self.settings.noise, "seed": self.seed}
        rows = [
            {**about, "cell": getattr(cell, "name", cell), **row}
            for cell in cells
            for row in self.judged(cell)
        ]
        return {"cells": rows}

    @functools.cached_property
    def _trial(self) -> evaluation.Trial:
        return self.trial()

    def judged(self, cell: str | Cell) -> list[dict[str, object]]:
        """Trains the detectors on a cell or a reference and judges them on real telemetry.

        Returns:
            A row for each detector: alarms and windows over all blocks of time, and recall as the
            mean over kinds and severities.
        """
        makers = {name: detectors.DETECTORS[name] for name in DETECTORS}
        training, held_out = (self.arm(cell, purpose) for purpose in (TRAINING, THRESHOLD))
        tables = evaluation.evaluate_arm(training, held_out, self._trial, makers, self.seed)
        return evaluation.by_detector(tables).to_dict("records")

    def arm(self, cell: str | Cell, purpose: str) -> np.ndarray:
        """Windows of a cell or of a reference, of shape `(windows, samples)`.

        Args:
            cell: The cell, or the name of a reference.
            purpose: `TRAINING` for the windows that train a detector, `THRESHOLD` for those that
                set its threshold.
        """
        number = self.settings.robustness.num_windows
        if cell == "real":
            part = "train" if purpose == TRAINING else "calibration"
            return self.example.windows(part, number, f"{purpose}, real")["target"]
        coarse = self.example.windows("train", number, purpose)["coarse"]
        if cell == "coarse":
            return coarse
        rng = np.random.default_rng(int(self.example.draw(purpose).integers(2**31)))
        signal = self.enhancer(cell.enhancer, cell.windows)(coarse)
        return signal + self.generator(cell).generate(number, rng)

    def number(self, windows: str) -> int:
        """Number of windows that a level of the factor `windows` stands for."""
        return {FEW: self.settings.paper.num_windows, MANY: self.settings.second.num_windows}[
            windows
        ]

    def training_starts(self, windows: str) -> np.ndarray:
        """Start of each training window of the enhancers: those of the paper's network, and those
        of the residual pipeline.
        """
        rng = (
            self.example.draw("training windows")
            if windows == FEW
            else np.random.default_rng(self.seed)
        )
        return random_window_starts([self.example.train], self.window, self.number(windows), rng)

    def pairs(self, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Coarse windows and telemetry of the training part, float32 of shape `(windows, samples)`,
        that begin at these samples.
        """
        train = self.example.train
        times = train.offset_s + train.interval_s * (starts[:, None] + np.arange(self.window))
        return self.example.coarse.simulate(times), cut_windows(
            train.values[:, 0], starts, self.window
        )

    def _enhancer(self, enhancer: str, windows: str) -> Enhance:
        """The function that maps coarse windows to the signal of an enhancer."""
        if enhancer == RIDGE:
            starts = self.training_starts(windows)
            return fit_ridge(*self.pairs(starts), starts).predict
        return self.example.enhance if windows == FEW else self.second_network

    @functools.cached_property
    def second_network(self) -> Enhance:
        """The network of the residual pipeline, which is trained on more windows in fewer
        epochs.
        """
        from enhsim_tf.simulator.packing import unpacked

        _ = self.example.telemetry
        depends = (self.settings.paper.of("windows"), self.settings.second)
        folder = self.stages.run(
            "second network", self._train_second, depends, ("telemetry",), version=4
        )
        state = json.loads((folder / "enhancer.json").read_text())
        enhancer = unpacked(state, load_arrays(folder))
        return lambda coarse: enhancer.predict(coarse[:, :, None])[:, :, 0]

    def _train_second(self, folder: Path) -> None:
        from enhsim_tf.enhancer.candidates import Training
        from enhsim_tf.simulator.packing import packed

        self.stages.progress.step("enhancer network")
        starts = self.training_starts(MANY)
        training = Training(*(each[:, :, None] for each in self.pairs(starts)), starts)
        enhancer = training.fit(NETWORK, self.seed, self.settings.second.epochs)
        arrays: dict[str, np.ndarray] = {}
        write_json(folder / "enhancer.json", packed(enhancer, arrays, "enhancer"))
        save_arrays(folder, arrays)

    def _extracted(self, windows: str, extraction: str, enhancer: str) -> np.ndarray:
        """Windows of the noise that a generator learns, of shape `(windows, samples)`; the
        arguments are `Cell.source`.
        """
        number = self.number(windows)
        if extraction == MOVING_AVERAGE:
            return self.example.noise_windows("train", number, "noise windows")
        starts = random_window_starts(
            [self.example.train], self.window, number, np.random.default_rng([self.seed, 1])
        )
        coarse, target = self.pairs(starts)
        return target - self.enhancer(enhancer, windows)(coarse)

    def generator(self, cell: Cell) -> NoiseModel:
        """The fitted noise model of a cell."""
        return self._fitted(cell.source, cell.generator)

    def _fit(self, source: tuple[str, str, str], generator: str) -> NoiseModel:
        noise = self.extracted(*source)
        if generator == WHOLE_WINDOWS:
            return WindowBootstrap(noise)
        if generator == AUTOREGRESSION:
            order = min(self.settings.factorial.max_order, self.window - 1)
            return GaussianAutoregression.fit(noise, order)
        return PaperGAN(noise, self.settings.paper)
