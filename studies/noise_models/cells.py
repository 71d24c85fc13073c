"""One cell of the study: a family of noise and a seed, with every noise model.

The noise models learn the true noise, so that errors of the enhancer have no effect. Detectors are
trained on the true waves with generated noise and judged on nominal windows with real noise, as in
the study of robustness.
"""

import functools
from typing import TYPE_CHECKING

import numpy as np

from studies.common import evaluation
from studies.common.detectors import DETECTORS
from studies.common.gaussian_noise import CANDIDATES, Draw, fit_candidate
from studies.common.tables import stage_tables
from studies.noise_models.networks.mixture_density import MixtureDensityNoise
from studies.noise_models.real_floor import RealFloor, Row
from studies.noise_models.summary import KEPT, REAL
from studies.robustness.replicate import Replicate

if TYPE_CHECKING:
    import pandas as pd

LEARNT = "mixture density network"
MODELS = (*CANDIDATES, LEARNT)
"""The noise models that are tried, the simplest first."""
# of as many generated windows as there are real ones: measures of realism are means over them
_NUM_DRAWS = 3
# numbers of random draws, and the names of draws below, are those of the published tables
_STREAMS = {
    "none": 0,
    "gaussian": 1,
    "autoregression": 2,
    "residual windows": 3,
    "matched residual windows": 7,
    LEARNT: 8,
}
_DRAW = 71


class Cell(Replicate):
    """A family of noise and a seed, with the telemetry and the test data of the study of
    robustness; `noise` of the settings is the family.
    """

    @functools.cached_property
    def tables(self) -> "dict[str, pd.DataFrame]":
        """The tables of real windows and of all models; each is a stage of its own, so that an
        interrupted run goes on.
        """
        import pandas as pd

        _ = self.example.telemetry
        chosen = self.settings
        counts = (
            chosen.robustness.num_windows,
            chosen.robustness.num_anomalous,
            chosen.noise_models,
        )
        depends = (chosen.paper.of("windows"), *counts)
        parts = []
        for model in (REAL, *MODELS):
            name = "noise model " + model.replace(" ", "_")
            compute = functools.partial(self._tables, model)
            parts.append(
                stage_tables(self.stages, name, compute, (model, *depends), ("telemetry",))
            )
        return {
            name: pd.concat([part[name] for part in parts], ignore_index=True)
            for name in KEPT.names
        }

    def _tables(self, model: str) -> "dict[str, pd.DataFrame]":
        floor, held_out = self._floor()
        if model == REAL:
            number = self.settings.robustness.num_windows
            arms = [
                self.example.windows(part, number, f"ladder, real, {part}")["target"]
                for part in ("train", "calibration")
            ]
            compared = [held_out]
        else:
            arms, compared = self._generated(model, len(held_out))
        about = {"family": self.settings.noise, "seed": self.settings.seed, "model": model}
        tables = {"detectors": self._detected(arms), "realism": _measured(floor, compared)}
        return {name: table.assign(**about) for name, table in tables.items()}

    def _generated(self, name: str, number: int) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Windows that train detectors and set their thresholds, and draws of noise for the
        measures of realism.
        """
        draw = self._fit(name)
        seed = self.settings.seed
        rng = np.random.default_rng([seed, _STREAMS[name], _DRAW])
        purposes = ("ladder, training", "ladder, threshold")
        waves = [
            self.example.windows("train", self.settings.robustness.num_windows, purpose)["truth"]
            for purpose in purposes
        ]
        arms = [clean + draw(clean, rng) for clean in waves]
        more = self.example.windows("calibration", number, "ladder, realism")["truth"]
        # the noise of generated telemetry, with the rounding errors of 32-bit sums that the noise
        # of real telemetry has
        compared = [more + draw(more, rng) - more for _ in range(_NUM_DRAWS)]
        return arms, compared

    def _fit(self, name: str) -> Draw:
        """Fits a model, and returns a function that draws noise below windows of the signal, both
        of shape `(windows, samples)`.
        """
        noise, signal, starts = self._learnt
        if name == LEARNT:
            learner = MixtureDensityNoise(self.settings.seed, self.settings.noise_models.num_steps)
            learner.fit(noise, signal, starts)
            return lambda clean, rng: learner.generate(len(clean), rng, clean)
        return fit_candidate(name, noise, signal)

    def _floor(self) -> tuple[RealFloor, np.ndarray]:
        """The real-vs-real baseline of two samples of true noise, and held-out windows of a third
        sample.
        """
        every = (self.example.windows(part, None) for part in ("test", "train", "calibration"))
        samples = [windows["target"] - windows["truth"] for windows in every]
        number = min(self.settings.robustness.num_windows, *map(len, samples))
        real, again, held_out = (noise[:number] for noise in samples)
        return RealFloor(
            real, again, self.settings.robustness.num_resplits, self.settings.seed
        ), held_out

    def _detected(self, arms: list[np.ndarray]) -> "pd.DataFrame":
        """False alarms and recall of every detector, trained on the first windows, with the
        threshold of the second ones.
        """
        trial = self.trial(self.settings.noise_models.num_anomalous)
        judged = evaluation.evaluate_arm(*arms, trial, DETECTORS, self.settings.seed)
        return evaluation.by_detector(judged)

    @functools.cached_property
    def _learnt(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Windows of noise of the training part, from which the models learn, the signal below
        them, and their first samples.
        """
        windows = self.example.windows(
            "train", self.settings.noise_models.num_windows, "ladder, learnt"
        )
        return windows["target"] - windows["truth"], windows["truth"], windows["start"]


def _measured(floor: RealFloor, compared: list[np.ndarray]) -> "pd.DataFrame":
    """Measures of realism, means over draws; what cannot be computed once has no mean."""
    import pandas as pd

    rows = [row for each in compared for row in floor.evaluate(each)]
    return (
        pd.DataFrame(rows, columns=Row._fields)
        .groupby("measure", sort=False)
        .agg(lambda each: each.mean(skipna=False))
        .reset_index()
    )
