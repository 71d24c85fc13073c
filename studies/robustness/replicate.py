"""One replicate of the study of robustness: a kind of noise and a seed, with all networks trained
again.
"""

import dataclasses
import functools
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.common.stages import Stages
from enhsim_tf.enhancer.ridge import Ridge, fit_ridge
from enhsim_tf.noise.window_bootstrap import WindowBootstrap
from studies.common import evaluation
from studies.common.detectors import CONTROLS, DETECTORS
from studies.common.example import Example
from studies.common.settings import Settings
from studies.common.tables import stage_tables

if TYPE_CHECKING:
    import pandas as pd

ARMS = {
    "coarse": "the coarse simulator",
    "truth": "the noiseless signal, as from a perfect simulator without environmental noise",
    "enhanced": "the signal of the paper's enhancer, without noise",
    "enhanced + GAN": "plus noise of the paper's GAN",
    "ridge + residual windows": (
        "ridge regression on the same windows, plus whole windows of what it leaves of the "
        "telemetry"
    ),
    "real": "real nominal telemetry",
}
"""Training windows of detectors."""


class Replicate:
    """One replicate of the study.

    Args:
        settings: All settings; `noise` is the environment, the seed covers data, networks and
            detectors.
        stages: Runs stages and caches their results.
    """

    def __init__(self, settings: Settings, stages: Stages):
        self.settings = settings
        self.stages = stages
        self.example = Example(settings, stages)

    @functools.cached_property
    def tables(self) -> "dict[str, pd.DataFrame]":
        """The tables `alarms` and `recall`."""
        _ = self.example.enhancer_folder, self.example.gan_folder
        # the number of replicates does not affect a replicate
        which = dataclasses.replace(self.settings.robustness, num_seeds=0, first_seed=0)
        depends = (self.settings.paper.of("windows"), which)
        after = ("telemetry", "enhancer", "noise GAN")
        return stage_tables(self.stages, "arms", self._judged, depends, after, version=2)

    def _judged(self) -> dict[str, list[dict]]:
        trial = self.trial()
        seed = self.settings.seed
        training = self.arms("arms, training")
        held_out = self.arms("arms, threshold")
        rows: dict[str, list[dict]] = {"alarms": [], "recall": []}
        about = {"environment": self.settings.noise, "seed": seed}
        told = self.stages.progress.loop("arm", len(ARMS))
        for done, arm in enumerate(ARMS, 1):
            detectors = DETECTORS | (CONTROLS if arm == "real" else {})
            judged = evaluation.evaluate_arm(training[arm], held_out[arm], trial, detectors, seed)
            for name, each in rows.items():
                each += [{"arm": arm, **row, **about} for row in judged[name]]
            told(done)
        return rows

    def trial(self, num_anomalous: int | None = None) -> evaluation.Trial:
        """The test data: held-out nominal windows, and the same windows with anomalies.

        Args:
            num_anomalous: Anomalous windows of each kind and severity; None for the number in the
                settings.
        """
        chosen = self.settings.robustness
        nominal, reference = (
            self.example.windows(part, None)["target"] for part in ("test", "calibration")
        )
        return evaluation.make_trial(
            nominal,
            reference,
            self.settings.paper.noise_sd,
            self.settings.seed,
            chosen.num_anomalous if num_anomalous is None else num_anomalous,
            rate=chosen.false_alarm_rate,
        )

    def arms(self, purpose: str) -> dict[str, np.ndarray]:
        """Windows of every arm.

        Args:
            purpose: `arms, training` for the windows that train detectors, `arms, threshold` for
                those that set thresholds.
        """
        example = self.example
        number = self.settings.robustness.num_windows
        simulated = example.windows("train", number, purpose)
        coarse = simulated["coarse"]
        rng = example.draw(f"{purpose}, noise")
        enhanced = example.enhance(coarse)
        (ridge, residuals) = self._without_network
        part = "train" if purpose == "arms, training" else "calibration"
        return {
            "coarse": coarse,
            "truth": simulated["truth"],
            "enhanced": enhanced,
            "enhanced + GAN": enhanced + example.generate_noise(number, rng),
            "ridge + residual windows": ridge.predict(coarse) + residuals.generate(number, rng),
            "real": example.windows(part, number, f"{purpose}, real")["target"],
        }

    @functools.cached_property
    def _without_network(self) -> tuple[Ridge, WindowBootstrap]:
        """Ridge regression on the windows from which the paper's enhancer learns, and as many
        windows of what it leaves.
        """
        number = self.settings.paper.num_windows
        learnt, others = (
            self.example.windows("train", number, each)
            for each in ("training windows", "residual windows")
        )
        ridge = fit_ridge(learnt["coarse"], learnt["target"], learnt["start"])
        return ridge, WindowBootstrap(others["target"] - ridge.predict(others["coarse"]))
