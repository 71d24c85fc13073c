"""The experiment on robustness, replicate by replicate: one environment and one seed, everything trained anew.

A replicate is kept once it is done: a killed run goes on behind the last one.
"""

import dataclasses
import functools
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf import robustness
from enhsim_tf.detectors import CONTROLS, DETECTORS
from enhsim_tf.noise import BlockBootstrap, GaussianAutoregression, GaussianNoise
from enhsim_tf.reproduce.experiments import Experiment
from enhsim_tf.reproduce.settings import Settings
from enhsim_tf.reproduce.stages import Stages
from enhsim_tf.terminal import start_tensorflow

if TYPE_CHECKING:
    import pandas as pd

    from enhsim_tf.enhanced_simulator import EnhancedSimulator

ENVIRONMENTS = ("white", "autoregressive", "heteroscedastic", "shot")
TABLES = ("alarms", "recall", "traces")
PAPER, OURS = "paper", "ours"  # the two pipelines: moving average and the paper's GAN; residual and the convolutional one
ARMS = {
    "coarse": "the coarse simulator",
    "truth": "the noiseless signal: a perfect simulator without environment",
    "enhanced": "the paper's enhanced signal, clean",
    "enhanced + GAN": "plus noise of the paper's GAN",
    "enhanced + Gaussian": "plus Gaussian noise of the same standard deviation",
    "enhanced + AR": "plus a fitted autoregression",
    "enhanced + bootstrap": "plus blocks of the extracted noise itself",
    "ours": "the second pipeline's enhanced signal, clean",
    "ours + GAN": "plus noise of the convolutional GAN",
    "ours + AR": "plus an autoregression fitted to the same noise",
    "ours + bootstrap": "plus blocks of the same noise",
    "real": "real nominal telemetry",
}
"""What detectors are trained on, in the order of the figures."""


class Replicate:
    """One environment and one seed of the experiment.

    Args:
        settings: Every number; `telemetry.noise` is the environment, `seed` covers data, networks and detectors.
        stages: Keeps what is done.
        verbose: Progress bars: 0 none, 1 one for each training.
    """

    def __init__(self, settings: Settings, stages: Stages, verbose: int = 0):
        self.settings, self.stages, self.verbose = settings, stages, verbose
        self.experiment = Experiment(settings, stages, verbose=verbose)

    @functools.cached_property
    def second_simulator(self) -> "EnhancedSimulator":
        """The second pipeline: more windows in fewer epochs, noise by the enhancer, the convolutional GAN."""
        _ = self.experiment.data
        chosen = self.settings.robustness
        depends = (self.settings.telemetry, self.settings.split, self.settings.adversarial, chosen.enhancer_windows)
        depends += (chosen.enhancer_epochs, chosen.held_out)
        rooms = ("reproduce.data", "enhanced_simulator")
        folder = self.stages.run("second", self._make_second, rooms, (depends, self.settings.seed), after=("telemetry",))
        start_tensorflow()
        from enhsim_tf.enhanced_simulator import EnhancedSimulator

        return EnhancedSimulator.load(folder / "simulator")

    def _make_second(self, folder: Path) -> None:
        start_tensorflow()
        from enhsim_tf.enhanced_simulator import EnhancedSimulator

        channel, chosen = self.experiment.data.channels[0], self.settings.robustness
        EnhancedSimulator.fit(
            channel.train,
            channel.coarse,
            self.settings.seed,
            chosen.enhancer_windows,
            chosen.enhancer_epochs,
            self.settings.adversarial.num_iterations,
            window=self.settings.telemetry.window,
            noise="convolutional",
            extraction="enhancer",
            held_out=chosen.held_out,
            decay=True,
            verbose=self.verbose,
        ).save(folder / "simulator")

    @functools.cached_property
    def tables(self) -> "dict[str, pd.DataFrame]":
        """Alarms, recall and traces by arm and detector."""
        import pandas as pd

        _ = self.experiment.enhancer_folder, self.experiment.noise_folder, self.second_simulator
        rooms = ("reproduce.replicates", "robustness")
        after = ("telemetry", "enhancer", "noise GAN", "second")
        folder = self.stages.run("replicate", self._make_tables, rooms, self.settings, after)
        return {name: pd.read_parquet(folder / f"{name}.parquet") for name in TABLES}

    def _make_tables(self, folder: Path) -> None:
        import pandas as pd

        trial, seed = self.trial(), self.settings.seed
        training, held_out = self.arms("arms, training"), self.arms("arms, threshold")
        rows: dict[str, list[dict]] = {name: [] for name in TABLES}
        for arm in training:
            judged = robustness.judge_arm(training[arm], held_out[arm], trial, DETECTORS | (CONTROLS if arm == "real" else {}), seed)
            for name in TABLES:
                rows[name] += [{"arm": arm, **row} for row in judged[name]]
            self.stages.tell(
                f"  {arm:22} false alarms " + ", ".join(f"{rate:.1%}" for rate in robustness.summary(judged["alarms"]).values())
            )
        oracle = robustness.detection.vus_pr(trial.labels, trial.labels.astype(float), trial.max_buffer)
        rows["traces"].append({"arm": "real", "detector": "oracle", "vus_pr": oracle})
        for name in TABLES:
            table = pd.DataFrame(rows[name]).assign(environment=self.settings.telemetry.noise, seed=seed)
            table.to_parquet(folder / f"{name}.parquet")

    def trial(self) -> robustness.Trial:
        """The real side: held-out nominal windows, anomalies put into them, and a trace."""
        chosen, data = self.settings.robustness, self.experiment.data
        channel = data.channels[0]
        nominal, reference = (data.windows(part, None)["target"] for part in ("test", "calibration"))
        return robustness.make_trial(
            nominal,
            reference,
            channel.test.values[: chosen.num_trace_samples],
            self.settings.telemetry.noise_sd,
            self.settings.seed,
            chosen.num_anomalous,
            rate=chosen.false_alarm_rate,
            max_buffer=round(min(channel.periods_s) / channel.telemetry.interval_s),
        )

    @functools.cached_property
    def surrogates(self) -> Mapping[str, Mapping[str, object]]:
        """The noises of both pipelines by name, fitted to the noise that their GAN learnt from."""
        data, chosen, number = self.experiment.data, self.settings.robustness, self.settings.telemetry.num_windows
        by_average = data.noise_windows("train", number, "noise windows")
        learnt = np.random.default_rng([self.settings.seed, 1])  # the very windows that the second GAN learnt from
        by_enhancer = self.second_simulator.residual_windows(data.channels[0].train, number, learnt)
        return {
            PAPER: {"GAN": self.experiment.simulator.noise, "Gaussian": GaussianNoise.fit(by_average)} | self._fitted(by_average, chosen),
            OURS: {"GAN": self.second_simulator.noise} | self._fitted(by_enhancer, chosen),
        }

    @staticmethod
    def _fitted(noise: np.ndarray, chosen: object) -> dict[str, object]:
        order = min(chosen.max_order, noise.shape[1] - 1)
        return {"AR": GaussianAutoregression.fit(noise, order), "bootstrap": BlockBootstrap.fit(noise, chosen.block)}

    def arms(self, purpose: str) -> dict[str, np.ndarray]:
        """Windows of every arm; one purpose draws what detectors learn from, another what sets their thresholds."""
        data, number = self.experiment.data, self.settings.robustness.num_windows
        simulated = data.windows("train", number, purpose)
        clean = {PAPER: self.experiment.simulator.enhance(simulated["coarse"]), OURS: self.second_simulator.enhance(simulated["coarse"])}
        seed = int(data.draw(purpose).integers(2**31))
        arms = {"coarse": simulated["coarse"], "truth": simulated["truth"]}
        for pipeline, name in ((PAPER, "enhanced"), (OURS, "ours")):
            arms[name] = clean[pipeline]
            for noise, model in self.surrogates[pipeline].items():
                arms[f"{name} + {noise}"] = clean[pipeline] + model.generate(number, seed)
        part = "train" if purpose == "arms, training" else "calibration"
        arms["real"] = data.windows(part, number, f"{purpose}, real")["target"]
        return {arm: arms[arm] for arm in ARMS}


def replicate(settings: Settings, stages: Stages, environment: str, number: int, verbose: int = 0) -> Replicate:
    """The replicate of an environment and of one of the reporting seeds.

    Args:
        settings: Every other number.
        stages: Keeps what is done.
        environment: One of `ENVIRONMENTS`.
        number: Which of the reporting seeds, counted from 0.
        verbose: Progress bars: 0 none, 1 one for each training.
    """
    seed = settings.robustness.first_seed + number
    telemetry = dataclasses.replace(settings.telemetry, noise=environment)
    return Replicate(dataclasses.replace(settings, telemetry=telemetry, seed=seed), stages, verbose)
