"""One cell of the experiment on noise: a family of the gallery and a seed, with every rung of the noise ladder.

The noise models learn the true noise, so that errors of the enhancer have no effect. Detectors are trained on the true waves with
generated noise and judged on nominal windows with real noise, as in the experiment on robustness.
"""

import dataclasses
import functools
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.common.stages import Stages
from enhsim_tf.detection import evaluation
from enhsim_tf.detection.registry import DETECTORS
from enhsim_tf.enhanced_simulator.noise_fitting import MOST_JUDGED, HeldOutJudge, NoiseTraining, NoiseWindows
from enhsim_tf.noise import ladder
from enhsim_tf.noise.rung_names import BY_OPTION, GAN_RUNGS, STREAMS
from studies.common.settings import Settings
from studies.noise_models.names import PRESENT, REAL
from studies.robustness.replicate import Replicate

if TYPE_CHECKING:
    import pandas as pd

TABLES = ("detectors", "realism", "choice")
_NUM_DRAWS = 3  # of as many generated windows as there are real ones: measures of realism are means over them
OPTIONS = {rung: option for option, rung in BY_OPTION.items()}


class Cell:
    """A family of the gallery and a seed.

    Args:
        settings: All settings; `telemetry.noise` is the family.
        stages: Runs stages and caches their results.
    """

    def __init__(self, settings: Settings, stages: Stages):
        self.settings, self.stages = settings, stages
        self.one = Replicate(settings, stages)
        self.data = self.one.experiment.data

    @functools.cached_property
    def learnt(self) -> dict[str, np.ndarray]:
        """Windows of the training part, from which the models learn: `target`, `truth` and their difference, the noise."""
        return self._with_noise("train", self.settings.ladder.num_windows, "ladder, learnt")

    def _with_noise(self, part: str, number: int, purpose: str) -> dict[str, np.ndarray]:
        windows = self.data.windows(part, number, purpose)
        return {**windows, "noise": windows["target"] - windows["truth"]}

    def tables(self, rungs: Sequence[str]) -> "dict[str, pd.DataFrame]":
        """The tables of the rungs and of real windows; each rung is a stage of its own, so that an interrupted run goes on."""
        import pandas as pd

        _ = self.one.experiment.data
        chosen = self.settings
        depends = (
            chosen.telemetry,
            chosen.split,
            chosen.robustness.num_windows,
            chosen.robustness.num_anomalous,
            chosen.ladder,
            chosen.seed,
        )
        parts: dict[str, list[pd.DataFrame]] = {name: [] for name in TABLES}
        for rung in (REAL, *rungs):

            def make(folder: Path, rung: str = rung) -> None:
                self._make(rung, folder)

            name = "noise rung " + rung.replace(" ", "_")
            folder = self.stages.run(name, make, (rung, *depends), ("telemetry",))
            for table, found in parts.items():
                found.append(pd.read_parquet(folder / f"{table}.parquet"))
        return {name: pd.concat([each for each in found if len(each)], ignore_index=True) for name, found in parts.items()}

    def _make(self, rung: str, folder: Path) -> None:
        import pandas as pd

        chosen, seed = self.settings, self.settings.seed
        number = chosen.robustness.num_windows
        floor, held_out = self.one.floor()
        if rung == REAL:
            arms = [self.data.windows(part, number, f"ladder, real, {part}")["target"] for part in ("train", "calibration")]
            compared = [held_out]
            choice = []
        else:
            number_of_iterations = chosen.ladder.gan_iterations if rung in GAN_RUNGS else chosen.ladder.num_iterations
            task = ladder.FitTask(self.learnt["noise"], self.learnt["truth"], number_of_iterations, seed, self.learnt["start"])
            model = ladder.RUNGS[rung](task)
            draws = np.random.default_rng([seed, STREAMS[OPTIONS[rung]], 71])
            waves = [self.data.windows("train", number, f"ladder, {part}")["truth"] for part in ("training", "threshold")]
            arms = [clean + ladder.generate(model, len(clean), draws, clean) for clean in waves]
            more = self.data.windows("calibration", len(held_out), "ladder, realism")["truth"]
            # the noise of generated telemetry, with the rounding errors of 32-bit sums that the noise of real telemetry has
            compared = [more + ladder.generate(model, len(held_out), draws, more) - more for _ in range(_NUM_DRAWS)]
            judgement = dataclasses.replace(self._judge.judge(OPTIONS[rung], model), rung=rung)
            choice = [{"rule": PRESENT} | dataclasses.asdict(judgement)]
        judged = evaluation.evaluate_arm(*arms, self.trial, DETECTORS, seed)
        rates = evaluation.false_alarm_rates(judged["alarms"])
        detectors = [
            {
                "detector": name,
                "alarms": sum(row["alarms"] for row in judged["alarms"] if row["detector"] == name),
                "windows": sum(row["windows"] for row in judged["alarms"] if row["detector"] == name),
                "recall": float(np.mean([row["recall"] for row in judged["recall"] if row["detector"] == name])),
                "recall_at_real_rate": float(np.mean([row["recall_at_real_rate"] for row in judged["recall"] if row["detector"] == name])),
            }
            for name in rates
        ]
        measured = [
            {"measure": row.measure, "value": row.value, "ratio": row.ratio} for each in compared for row in floor.evaluate(each).rows
        ]
        by_measure = pd.DataFrame(measured).groupby("measure", sort=False)
        realism = by_measure.agg(lambda each: each.mean(skipna=False)).reset_index()  # what cannot be computed once has no mean
        for name, rows in {"detectors": detectors, "realism": realism, "choice": choice}.items():
            table = pd.DataFrame(rows).assign(family=self.settings.telemetry.noise, seed=seed, rung=rung)
            table.to_parquet(folder / f"{name}.parquet")
        self.stages.tell(f"  {rung:24} false alarms {np.mean(list(rates.values())):.2%}")

    @functools.cached_property
    def _judge(self) -> HeldOutJudge:
        """Judges noise models as `fit` does, by windows of the same telemetry that they have not seen."""
        held_out = self._with_noise("calibration", min(MOST_JUDGED, self.settings.ladder.num_windows), "ladder, judged")
        learnt, judged = (NoiseWindows(each["noise"], each["truth"], each["start"]) for each in (self.learnt, held_out))
        return HeldOutJudge(learnt, judged, NoiseTraining(0, self.settings.seed, to_unit=lambda clean: clean))

    @functools.cached_property
    def trial(self) -> evaluation.Trial:
        """Real nominal windows, and the same with anomalies; without a continuous trace."""
        return dataclasses.replace(self.one.trial(self.settings.ladder.num_anomalous), trace=None, labels=None)
