"""Replicates of the experiment on robustness: one environment and one seed each, with all networks trained again.

Finished replicates are cached, so an interrupted run continues after the last one.
"""

import dataclasses
import functools
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.common.stages import Stages
from enhsim_tf.detection import evaluation
from enhsim_tf.detection.registry import CONTROLS, DETECTORS
from enhsim_tf.noise.surrogates import BlockBootstrap, GaussianAutoregression, GaussianNoise
from enhsim_tf.realism import real_floor
from enhsim_tf.reproduce.paper.pipeline import Experiment
from studies.common.noise_processes import NOISES
from studies.common.settings import Settings

if TYPE_CHECKING:
    import pandas as pd

    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

ENVIRONMENTS = ("white", "autoregressive", "heteroscedastic", "shot")
TABLES = {  # tables by stage
    "arms": ("alarms", "recall", "traces"),
    "variations": ("variations",),
    "realism": ("realism", "parameters"),
}
PAPER, RESIDUAL = "paper", "residual"
"""The two pipelines: the paper's, which extracts noise with a moving average and learns it with the paper's GAN; and the one that
extracts noise as the residual of the enhancer and learns it with the convolutional GAN."""
PREFIXES = {PAPER: "enhanced", RESIDUAL: "residual"}
"""Prefix of the names of each pipeline's arms."""
CLEAN = {"enhanced": "enhanced", "residual": "residual, no noise"}
"""The arm without noise of each prefix."""
GANS = {PAPER: "GAN", RESIDUAL: "convolutional GAN"}
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
"""Training windows of detectors, in the order of the figures."""
SCALES, SCALED = (0.5, 0.75, 1.0, 1.5, 2.0), ("enhanced + GAN", "enhanced + AR", "residual + convolutional GAN", "residual + AR")
SHARES, MIXED = (0.0, 0.01, 0.05, 0.25), ("enhanced", "enhanced + GAN", "residual, no noise", "residual + convolutional GAN")
VARIATIONS = tuple(
    dict.fromkeys(
        [
            *((arm, scale, 0.0, True) for arm in SCALED for scale in SCALES),
            *((arm, 1.0, share, True) for arm in MIXED for share in SHARES),
            *((arm, 1.0, share, False) for arm in MIXED for share in SHARES[1:]),
            ("real", 1.0, 1.0, True),
        ]
    )
)
"""Arm, scale of its noise, share of its training windows that are replaced by real windows (the same for all arms), and
whether the same share of the windows that set the threshold is replaced."""
# The seed of a random draw depends on its name. The published results were drawn under these names, so that a new run repeats them.
_DRAW_NAMES = {"residual, no noise": "ours", "residual + convolutional GAN": "ours + GAN", "residual + AR": "ours + AR"}
NUM_BLOCKS = 10  # blocks of windows for which the parameters of a noise are estimated
QUICK_DETECTORS = ("limit check", "PCA residual", "nearest neighbours", "isolation forest", "one-class SVM")


class Replicate:
    """One replicate of the experiment: an environment and a seed.

    Args:
        settings: All settings; `telemetry.noise` is the environment, `seed` covers data, networks and detectors.
        stages: Runs stages and caches their results.
        verbose: Progress bars: 0 none, 1 one for each training.
    """

    def __init__(self, settings: Settings, stages: Stages, verbose: int = 0):
        self.settings, self.stages, self.verbose = settings, stages, verbose
        once = dataclasses.replace(settings.adversarial, num_rounds=1)  # only claim C4 looks beyond the paper's number of iterations
        self.experiment = Experiment(dataclasses.replace(settings, adversarial=once), stages, verbose=verbose)

    @functools.cached_property
    def second_simulator(self) -> "EnhancedSimulator":
        """The simulator of the residual pipeline, with more windows in fewer epochs and the convolutional GAN."""
        _ = self.experiment.data
        chosen = self.settings
        depends = (chosen.telemetry, chosen.split, chosen.adversarial, chosen.second, chosen.seed)
        folder = self.stages.run("second", self._make_second, depends, after=("telemetry",))
        from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

        return EnhancedSimulator.load(folder / "simulator")

    def _make_second(self, folder: Path) -> None:
        from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

        channel, chosen = self.experiment.data.channels[0], self.settings.second
        EnhancedSimulator.fit(
            channel.train,
            channel.coarse,
            self.settings.seed,
            chosen.num_windows,
            chosen.epochs,
            self.settings.adversarial.num_iterations,
            window=self.settings.telemetry.window,
            noise="convolutional",
            extraction="enhancer",
            held_out=chosen.held_out,
            decay=True,
            verbose=self.verbose,
            progress=self.stages.progress,
        ).save(folder / "simulator")

    @functools.cached_property
    def tables(self) -> "dict[str, pd.DataFrame]":
        """All tables of `TABLES` by name. Each of the three parts of the replicate is a stage."""
        import pandas as pd

        _ = self.experiment.enhancer_folder, self.experiment.noise_folder, self.second_simulator
        after = ("telemetry", "enhancer", "noise GAN", "second")
        chosen = self.settings
        which = dataclasses.replace(chosen.robustness, num_seeds=0, first_seed=0)  # the number of replicates does not affect a replicate
        depends = (chosen.telemetry, chosen.split, chosen.enhancer, chosen.noise, chosen.adversarial, which, chosen.seed)
        folders = {
            name: self.stages.run(name, make, depends, after)
            for name, make in (("arms", self._make_arms), ("variations", self._make_variations), ("realism", self._make_realism))
        }
        return {name: pd.read_parquet(folders[stage] / f"{name}.parquet") for stage, names in TABLES.items() for name in names}

    def _make_arms(self, folder: Path) -> None:
        trial, seed = self.trial(), self.settings.seed
        training, held_out = self.arms("arms, training"), self.arms("arms, threshold")
        rows: dict[str, list[dict]] = {"alarms": [], "recall": [], "traces": []}
        told = self.stages.progress.loop("arm", len(ARMS))
        for number, arm in enumerate(ARMS):
            detectors = DETECTORS | (CONTROLS if arm == "real" else {})
            on_detector = told.within(number, len(detectors))
            judged = evaluation.evaluate_arm(training[arm], held_out[arm], trial, detectors, seed, on_detector=on_detector)
            for name, found in judged.items():
                rows[name] += [{"arm": arm, **row} for row in found]
            rates = evaluation.false_alarm_rates(judged["alarms"]).values()
            self.stages.tell(f"  {arm:28} false alarms " + ", ".join(f"{rate:.1%}" for rate in rates))
        oracle = evaluation.metrics.vus_pr(trial.labels, trial.labels.astype(float), trial.max_buffer)
        rows["traces"].append({"arm": "real", "detector": "oracle", "vus_pr": oracle})
        self._save(folder, rows)

    def _make_variations(self, folder: Path) -> None:
        """Varies the scale of the noise and the share of real windows, with detectors that train in a second."""
        chosen, seed = self.settings.robustness, self.settings.seed
        trial = self.trial(chosen.num_anomalous_varied)
        quick = {name: DETECTORS[name] for name in QUICK_DETECTORS}
        learnt, limiting = self.arms("arms, training"), self.arms("arms, threshold")
        rows, told = [], self.stages.progress.loop("variation", len(VARIATIONS))
        for number, (arm, scale, share, both) in enumerate(VARIATIONS):
            draws = self.experiment.data.draw(f"mixed windows, {_DRAW_NAMES.get(arm, arm)}, {scale}, {share}")
            training, held_out = (
                evaluation.mix_real_and_simulated(_scaled(arms, arm, scale), arms["real"], part, draws)
                for arms, part in ((learnt, share), (limiting, share if both else 0.0))
            )
            judged = evaluation.evaluate_arm(training, held_out, trial, quick, seed, on_detector=told.within(number, len(quick)))
            recall, alarms = ({name: [] for name in quick} for _ in range(2))
            for row in judged["recall"]:
                recall[row["detector"]].append(row["recall"])
            for row in judged["alarms"]:
                alarms[row["detector"]].append((row["alarms"], row["windows"]))
            for name in quick:
                raised, windows = np.sum(alarms[name], axis=0).tolist()
                about = {"arm": arm, "scale": scale, "real_share": share, "real_threshold": both, "detector": name}
                rows.append({**about, "alarms": raised, "windows": windows, "recall": float(np.mean(recall[name]))})
        self._save(folder, {"variations": rows})

    def _make_realism(self, folder: Path) -> None:
        """Compares every noise with the true noise by measures A1 to A7, and estimates its parameters."""
        floor, held_out = self.floor()
        number, seed = len(held_out), int(self.experiment.data.draw("realism").integers(2**31))
        judged = {"real": held_out}
        for pipeline, name in PREFIXES.items():
            extracted = self.disjoint_extracted[pipeline]
            judged[f"{name}: extracted"] = extracted[np.arange(number) % len(extracted)]
            judged |= {f"{name} + {noise}": model.generate(number, seed) for noise, model in self.surrogates[pipeline].items()}
        rows, told = [], self.stages.progress.loop("noise", len(judged))
        for done, (noise, windows) in enumerate(judged.items(), 1):
            rows += [{"noise": noise, **dataclasses.asdict(row)} for row in floor.evaluate(windows).rows]
            told(done)
        process = NOISES[self.settings.telemetry.noise]
        parameters = [
            {"noise": noise, "block": block, "parameter": parameter, "value": value}
            for noise, windows in judged.items()
            for block, part in enumerate(np.array_split(windows, NUM_BLOCKS))
            for parameter, value in process.estimate(part).items()
        ]
        self._save(folder, {"realism": rows, "parameters": parameters})

    def _save(self, folder: Path, tables: Mapping[str, list[dict]]) -> None:
        import pandas as pd

        for name, rows in tables.items():
            table = pd.DataFrame(rows).assign(environment=self.settings.telemetry.noise, seed=self.settings.seed)
            table.to_parquet(folder / f"{name}.parquet")

    def trial(self, num_anomalous: int | None = None) -> evaluation.Trial:
        """The test data: held-out nominal windows, the same windows with anomalies, and a continuous trace.

        Args:
            num_anomalous: Anomalous windows of each kind and severity; None for the number in the settings.
        """
        chosen, data = self.settings.robustness, self.experiment.data
        channel = data.channels[0]
        nominal, reference = (data.windows(part, None)["target"] for part in ("test", "calibration"))
        return evaluation.make_trial(
            nominal,
            reference,
            channel.test.values[: chosen.num_trace_samples],
            self.settings.telemetry.noise_sd,
            self.settings.seed,
            chosen.num_anomalous if num_anomalous is None else num_anomalous,
            rate=chosen.false_alarm_rate,
            max_buffer=round(min(channel.periods_s) / channel.telemetry.interval_s),
        )

    def floor(self) -> tuple[real_floor.RealFloor, np.ndarray]:
        """The real-vs-real baseline of two samples of true noise, and held-out windows of a third sample."""
        real, again, held_out = (self.true_noise(part) for part in ("test", "train", "calibration"))
        number = min(self.settings.robustness.num_windows, len(real), len(again), len(held_out))
        floor = real_floor.RealFloor(real[:number], again[:number], self.settings.robustness.num_resplits, seed=self.settings.seed)
        return floor, held_out[:number]

    def true_noise(self, part: str, num_windows: int | None = None, purpose: str = "") -> np.ndarray:
        """Windows of the true noise, which is the telemetry minus the noiseless signal.

        Args:
            part: `train`, `calibration` or `test`.
            num_windows: Number of windows at random starts; None for all disjoint windows in order of time.
            purpose: Name of the random draw of the starts.
        """
        windows = self.experiment.data.windows(part, num_windows, purpose)
        return windows["target"] - windows["truth"]

    @functools.cached_property
    def extracted(self) -> dict[str, np.ndarray]:
        """The extracted noise of each pipeline, to which its GAN and the other noise models are fitted."""
        data, number = self.experiment.data, self.settings.telemetry.num_windows
        draws = np.random.default_rng([self.settings.seed, 1])
        return {
            PAPER: data.noise_windows("train", number, "noise windows"),
            RESIDUAL: self.second_simulator.residual_windows(data.channels[0].train, self.settings.second.num_windows, draws),
        }

    @property
    def disjoint_extracted(self) -> dict[str, np.ndarray]:
        """The extracted noise of each pipeline in disjoint windows, as the measures of realism require."""
        data, windows = self.experiment.data, self.experiment.data.windows("train", None)
        return {PAPER: data.noise_windows("train", None), RESIDUAL: windows["target"] - self.second_simulator.enhance(windows["coarse"])}

    @functools.cached_property
    def surrogates(self) -> Mapping[str, Mapping[str, object]]:
        """The noise models of both pipelines by name."""
        chosen, noise = self.settings.robustness, self.extracted
        return {
            PAPER: {GANS[PAPER]: self.experiment.simulator.noise, "Gaussian": GaussianNoise.fit(noise[PAPER])}
            | self._fitted(noise[PAPER], chosen),
            RESIDUAL: {GANS[RESIDUAL]: self.second_simulator.noise, "Gaussian": GaussianNoise.fit(noise[RESIDUAL])}
            | self._fitted(noise[RESIDUAL], chosen),
        }

    @staticmethod
    def _fitted(noise: np.ndarray, chosen: object) -> dict[str, object]:
        order = min(chosen.max_order, noise.shape[1] - 1)
        return {"AR": GaussianAutoregression.fit(noise, order), "bootstrap": BlockBootstrap.fit(noise, chosen.block)}

    def arms(self, purpose: str) -> dict[str, np.ndarray]:
        """Windows of every arm. One purpose draws the training windows, and another the windows that set thresholds."""
        data, number = self.experiment.data, self.settings.robustness.num_windows
        simulated = data.windows("train", number, purpose)
        clean = {
            PAPER: self.experiment.simulator.enhance(simulated["coarse"]),
            RESIDUAL: self.second_simulator.enhance(simulated["coarse"]),
        }
        seed = int(data.draw(purpose).integers(2**31))
        arms = {"coarse": simulated["coarse"], "truth": simulated["truth"]}
        for pipeline, name in PREFIXES.items():
            arms[CLEAN[name]] = clean[pipeline]
            for noise, model in self.surrogates[pipeline].items():
                arms[f"{name} + {noise}"] = clean[pipeline] + model.generate(number, seed)
        part = "train" if purpose == "arms, training" else "calibration"
        arms["real"] = data.windows(part, number, f"{purpose}, real")["target"]
        return {arm: arms[arm] for arm in ARMS}


def _scaled(arms: Mapping[str, np.ndarray], arm: str, scale: float) -> np.ndarray:
    """Windows of an arm with its noise scaled by a factor; an arm without noise is returned unchanged."""
    prefix, plus, _ = arm.partition(" + ")
    clean = arms[CLEAN[prefix] if plus else arm]
    return clean + np.float32(scale) * (arms[arm] - clean)


def replicate(settings: Settings, stages: Stages, environment: str, number: int, verbose: int = 0) -> Replicate:
    """The replicate of an environment and of one of the reporting seeds.

    Args:
        settings: All other settings.
        stages: Runs stages and caches their results.
        environment: One of `ENVIRONMENTS`.
        number: Which of the reporting seeds, counted from 0.
        verbose: Progress bars: 0 none, 1 one for each training.
    """
    seed = settings.robustness.first_seed + number
    telemetry = dataclasses.replace(settings.telemetry, noise=environment)
    return Replicate(dataclasses.replace(settings, telemetry=telemetry, seed=seed), stages, verbose)
