"""One replicate of the study of robustness: a kind of noise and a seed, with all networks trained again."""

import dataclasses
import functools
import types
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.common.stages import Stages
from enhsim_tf.detection.registry import CONTROLS, DETECTORS
from enhsim_tf.noise.surrogates import GaussianAutoregression, GaussianNoise
from studies.common import evaluation
from studies.common.block_bootstrap import BlockBootstrap
from studies.common.example import Example
from studies.common.settings import Settings
from studies.robustness import real_floor
from studies.robustness.second_pipeline import SecondPipeline

if TYPE_CHECKING:
    import pandas as pd

ARMS = {
    "coarse": "the coarse simulator",
    "truth": "the noiseless signal, as from a perfect simulator without environmental noise",
    "enhanced": "the enhanced signal of the paper's pipeline, without noise",
    "enhanced + GAN": "plus noise of the paper's GAN",
    "enhanced + Gaussian": "plus Gaussian noise of the same standard deviation",
    "enhanced + AR": "plus a fitted autoregression",
    "enhanced + bootstrap": "plus blocks of the extracted noise itself",
    "residual, no noise": "the enhanced signal of the residual pipeline, without noise",
    "residual + convolutional GAN": "plus noise of the convolutional GAN",
    "residual + Gaussian": "plus Gaussian noise of the same standard deviation",
    "residual + AR": "plus an autoregression fitted to the same noise",
    "residual + bootstrap": "plus blocks of the same noise",
    "real": "real nominal telemetry",
}
"""Training windows of detectors. *Enhanced* arms extract the noise with a moving average, as the paper does; *residual* arms use
the residual of an enhancer that is trained on more windows."""
TABLES = {
    "alarms": ["arm", "detector", "block", "alarms", "windows"],
    "recall": ["arm", "detector", "kind", "severity", "recall", "recall_at_real_rate"],
}
"""Columns of the tables, beside `environment` and `seed`."""


class Replicate:
    """One replicate of the study.

    Args:
        settings: All settings; `noise` is the environment, the seed covers data, networks and detectors.
        stages: Runs stages and caches their results.
    """

    def __init__(self, settings: Settings, stages: Stages):
        self.settings, self.stages = settings, stages
        self.example = Example(settings, stages)

    @functools.cached_property
    def second(self) -> SecondPipeline:
        """The residual pipeline."""
        return SecondPipeline(self.example, self.settings, self.stages)

    @functools.cached_property
    def tables(self) -> "dict[str, pd.DataFrame]":
        """The tables `alarms` and `recall`."""
        import pandas as pd

        _ = self.example.enhancer_folder, self.example.gan_folder, self.second.simulator
        after = ("telemetry", "enhancer", "noise GAN", "second network")
        # the number of replicates does not affect a replicate
        which = dataclasses.replace(self.settings.robustness, num_seeds=0, first_seed=0)
        folder = self.stages.run("arms", self._make_arms, (self.settings.paper.of("windows"), which), after)
        return {name: pd.read_parquet(folder / f"{name}.parquet") for name in TABLES}

    def _make_arms(self, folder: Path) -> None:
        import pandas as pd

        trial, seed = self.trial(), self.settings.seed
        training, held_out = self.arms("arms, training"), self.arms("arms, threshold")
        rows: dict[str, list[dict]] = {name: [] for name in TABLES}
        told = self.stages.progress.loop("arm", len(ARMS))
        for number, arm in enumerate(ARMS):
            detectors = DETECTORS | (CONTROLS if arm == "real" else {})

            def on_detector(done: float, before: int = number, of: int = len(detectors)) -> None:
                told(before + done / of)

            judged = evaluation.evaluate_arm(training[arm], held_out[arm], trial, detectors, seed, on_detector=on_detector)
            for name in TABLES:
                rows[name] += [{"arm": arm, **row} for row in judged[name]]
            rates = evaluation.false_alarm_rates(judged["alarms"]).values()
            self.stages.tell(f"  {arm:28} false alarms " + ", ".join(f"{rate:.1%}" for rate in rates))
        for name, each in rows.items():
            table = pd.DataFrame(each, columns=TABLES[name])
            table.assign(environment=self.settings.noise, seed=seed).to_parquet(folder / f"{name}.parquet")

    def trial(self, num_anomalous: int | None = None) -> evaluation.Trial:
        """The test data: held-out nominal windows, and the same windows with anomalies.

        Args:
            num_anomalous: Anomalous windows of each kind and severity; None for the number in the settings.
        """
        chosen = self.settings.robustness
        nominal, reference = (self.example.windows(part, None)["target"] for part in ("test", "calibration"))
        return evaluation.make_trial(
            nominal,
            reference,
            None,
            self.settings.paper.noise_sd,
            self.settings.seed,
            chosen.num_anomalous if num_anomalous is None else num_anomalous,
            rate=chosen.false_alarm_rate,
        )

    def floor(self) -> tuple[real_floor.RealFloor, np.ndarray]:
        """The real-vs-real baseline of two samples of true noise, and held-out windows of a third sample, for measures of realism."""
        every = (self.example.windows(part, None) for part in ("test", "train", "calibration"))
        real, again, held_out = (windows["target"] - windows["truth"] for windows in every)
        number = min(self.settings.robustness.num_windows, len(real), len(again), len(held_out))
        floor = real_floor.RealFloor(real[:number], again[:number], self.settings.robustness.num_resplits, seed=self.settings.seed)
        return floor, held_out[:number]

    @functools.cached_property
    def noises(self) -> "Mapping[str, Mapping[str, Any]]":
        """The fitted noise models of both pipelines by name; each learns the noise that its pipeline extracts."""
        from studies.noise_models.networks.convolutional_gan import fit_convolutional_gan

        chosen, residual = self.settings, self.second.residuals()
        averaged = self.example.noise_windows("train", chosen.paper.num_windows, "noise windows")
        gan = fit_convolutional_gan(residual, chosen.paper.iterations, chosen.seed)
        return {
            "enhanced": {"GAN": types.SimpleNamespace(generate=self.example.generate_noise), **self._fitted(averaged)},
            "residual": {"convolutional GAN": gan, **self._fitted(residual)},
        }

    def _fitted(self, noise: np.ndarray) -> dict[str, Any]:
        chosen = self.settings.robustness
        return {
            "Gaussian": GaussianNoise.fit(noise),
            "AR": GaussianAutoregression.fit(noise, min(chosen.max_order, noise.shape[1] - 1)),
            "bootstrap": BlockBootstrap.fit(noise, chosen.block),
        }

    def arms(self, purpose: str) -> dict[str, np.ndarray]:
        """Windows of every arm.

        Args:
            purpose: `arms, training` for the windows that train detectors, `arms, threshold` for those that set thresholds.
        """
        example, number = self.example, self.settings.robustness.num_windows
        simulated = example.windows("train", number, purpose)
        coarse = simulated["coarse"]
        part = "train" if purpose == "arms, training" else "calibration"
        arms = {
            "coarse": coarse,
            "truth": simulated["truth"],
            "enhanced": example.enhance(coarse),
            "residual, no noise": self.second.simulator.enhance(coarse),
            "real": example.windows(part, number, f"{purpose}, real")["target"],
        }
        seed = int(example.draw(purpose).integers(2**31))
        for pipeline, clean in (("enhanced", "enhanced"), ("residual", "residual, no noise")):
            for noise, model in self.noises[pipeline].items():
                arms[f"{pipeline} + {noise}"] = arms[clean] + model.generate(number, np.random.default_rng(seed))
        return {arm: arms[arm] for arm in ARMS}
