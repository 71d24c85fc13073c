"""Study of real telemetry with labelled anomalies: detectors trained on generated telemetry, tested on a real spacecraft.

The simulator of a channel is fitted to its nominal `train` part. Every detector is trained on each arm, sets its threshold on
further windows of that arm, and is tested on the `test` part. Finished channels are cached.
"""

import functools
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.coarse_simulator.degraded import MODES, Degraded
from enhsim_tf.detection import evaluation, metrics
from enhsim_tf.detection.registry import CONTROLS, DETECTORS
from enhsim_tf.enhancer.baselines import nearest_window_means, ridge_aligned_by_its_shape, ridge_windows
from enhsim_tf.enhancer.training_pairs import cut_pairs, window_errors
from enhsim_tf.noise.extraction import noise_unit
from enhsim_tf.noise.surrogates import BlockBootstrap, GaussianAutoregression, GaussianNoise
from enhsim_tf.reproduce.settings import Settings
from enhsim_tf.reproduce.stages import Stages
from enhsim_tf.telemetry.telemanom import LabelledChannel
from enhsim_tf.telemetry.windows import cut_windows_from_parts, disjoint_starts, evenly_spaced_starts

if TYPE_CHECKING:
    import pandas as pd

    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

TABLES = ("enhancement", "alarms", "sequences", "ranking")
ARMS = {
    "real": "the channel's own nominal train part",
    "coarse": "the coarse simulator at the levels of the train part",
    "enhanced": "the enhanced signal, clean",
    "enhanced + GAN": "plus noise of the paper's GAN",
    "enhanced + Gaussian": "plus Gaussian noise of the same standard deviation",
    "enhanced + AR": "plus a fitted autoregression",
    "enhanced + bootstrap": "plus blocks of the extracted noise itself",
    "enhanced + convolutional": "plus noise of the convolutional GAN: what `fit` and `generate` make",
    "real + generated": "as many windows of the train part as of `enhanced + convolutional`",
}
"""Training windows of detectors, in the order of the figures."""
DEGRADED_ARM = "nominal + degraded"
"""A classifier that separates generated nominal from generated degraded windows; it is not an arm for detectors without labels."""
GENERATED_ARM = "enhanced + convolutional"
_STRIDES = 8  # scored windows a window's length
_NUM_BLOCKS = 10  # of consecutive windows, that false alarms are counted in
_SEVERITIES = (0.25, 0.5, 0.75, 1.0)  # of the degraded windows that the classifier learns


class ChannelStudy:
    """One channel of the study.

    Args:
        channel: The channel with its labels.
        settings: All settings; `labelled` and `seed` are looked at.
        stages: Runs stages and caches their results.
        verbose: Progress bars: 0 none, 1 one for each training.
    """

    def __init__(self, channel: LabelledChannel, settings: Settings, stages: Stages, verbose: int = 0):
        self.channel, self.settings, self.stages, self.verbose = channel, settings, stages, verbose
        self.name, self.seed = channel.labels.channel, settings.seed

    @functools.cached_property
    def _depends(self) -> tuple:
        parts = (self.channel.train.values, self.channel.test.values)
        return (self.name, *(zlib.crc32(np.ascontiguousarray(part)) for part in parts), self.settings.labelled, self.seed)

    @functools.cached_property
    def simulator(self) -> "EnhancedSimulator":
        """The simulator that `python -m enhsim_tf fit --held-out 0` fits to the train part."""
        folder = self.stages.run(f"fit {self.name}", self._make_simulator, ("enhanced_simulator.fitting",), self._depends)
        from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

        return EnhancedSimulator.load(folder / "simulator")

    def _make_simulator(self, folder: Path) -> None:
        from enhsim_tf.enhanced_simulator.fit_options import FitOptions
        from enhsim_tf.enhanced_simulator.fitting import fit_simulator

        chosen = self.settings.labelled
        options = FitOptions(
            num_windows=chosen.num_windows, epochs=chosen.epochs, num_iterations=chosen.num_iterations, held_out=0.0, seed=self.seed
        )
        fit_simulator([self.channel.train], options, self.verbose, self.stages.progress).save(folder / "simulator")

    @functools.cached_property
    def tables(self) -> "dict[str, pd.DataFrame]":
        """Every table of `TABLES` by name."""
        import pandas as pd

        _ = self.simulator
        fit = f"fit {self.name}"
        folder = self.stages.run(f"study {self.name}", self._make, ("reproduce.spacecraft.study",), self._depends, after=(fit,))
        return {name: pd.read_parquet(folder / f"{name}.parquet") for name in TABLES}

    def _make(self, folder: Path) -> None:
        import pandas as pd

        rows: dict[str, list[dict]] = {name: [] for name in TABLES}
        rows["enhancement"] = self.enhancement()
        labels = np.array(self.channel.is_anomalous)
        training, held_out = self.arms(self.seed + 1), self.arms(self.seed + 2)
        told = self.stages.progress.loop("arm", len(ARMS))
        for number, arm in enumerate(ARMS):
            detectors = DETECTORS | (CONTROLS if arm == "real" else {})
            for done, (name, make) in enumerate(detectors.items(), 1):
                scorer = make(self.seed).fit(training[arm]).score
                self._judge(rows, arm, name, scorer, held_out[arm], labels)
                told(number + done / len(detectors))
            self.stages.tell(f"  {arm:26} false alarms {self._said(rows, arm)}")
        classify = _classifier(training[GENERATED_ARM], self.degraded(self.seed + 3), self.seed)
        self._judge(rows, DEGRADED_ARM, "boosted trees", classify, held_out[GENERATED_ARM], labels)
        perfect = labels.astype(float)
        rows["ranking"].append(self._ranking("real", "oracle", labels, perfect))
        for name, found in rows.items():
            pd.DataFrame(found).assign(channel=self.name, seed=self.seed).to_parquet(folder / f"{name}.parquet")

    @staticmethod
    def _said(rows: Mapping[str, list[dict]], arm: str) -> str:
        found = evaluation.false_alarm_rates([row for row in rows["alarms"] if row["arm"] == arm])
        return ", ".join(f"{rate:.0%}" for rate in found.values())

    # -- training windows of the detectors -------------------------------------------------------------------------------------

    @functools.cached_property
    def noises(self) -> dict[str, Any]:
        """Models of the residual noise of the train part, by name."""
        from enhsim_tf.noise.discriminator import build_discriminator
        from enhsim_tf.noise.gan import NoiseGAN
        from enhsim_tf.noise.generator import build_generator

        window, chosen = self.simulator.window, self.settings.labelled
        noise = self.simulator.residual_windows(self.channel.train, chosen.num_windows, np.random.default_rng([self.seed, 1]))
        networks = build_generator(window, seed=self.seed), build_discriminator(window, seed=self.seed)
        gan = NoiseGAN(*networks, scale=noise_unit(noise), seed=self.seed)
        told = self.stages.progress.loop("noise GAN, iteration", chosen.num_iterations)
        gan.fit(noise, chosen.num_iterations, verbose=bool(self.verbose), on_iteration=told)
        return {
            "GAN": gan,
            "Gaussian": GaussianNoise.fit(noise),
            "AR": GaussianAutoregression.fit(noise, min(chosen.max_order, window - 1)),
            "bootstrap": BlockBootstrap.fit(noise, min(chosen.block, window)),
            "convolutional": self.simulator.noise,
        }

    def arms(self, seed: int) -> dict[str, np.ndarray]:
        """Windows of every arm. For real windows, different seeds select different thirds of the train part.

        Args:
            seed: Seed of what is generated; `self.seed + 1` gives what detectors learn from, another what sets thresholds.
        """
        number, simulator = self.settings.labelled.num_arm_windows, self.simulator
        coarse, clean = simulator.generate_coarse(number, seed=seed), simulator.generate_clean(number, seed=seed)
        arms = {"coarse": coarse, "enhanced": clean}
        arms |= {f"enhanced + {name}": clean + noise.generate(number, seed) for name, noise in self.noises.items()}
        arms["real"] = self._real(number, seed == self.seed + 1)
        half = number // 2
        arms["real + generated"] = np.concatenate([arms["real"][:: max(1, len(arms["real"]) // half)][:half], arms[GENERATED_ARM][:half]])
        return {arm: arms[arm] for arm in ARMS}

    def _real(self, number: int, is_training: bool) -> np.ndarray:
        """Windows of the first two thirds of the train part or of its last third, with a gap of one window between them."""
        train, window = self.channel.train, self.simulator.window
        cut = 2 * len(train) // 3
        part = train.part(0, cut) if is_training else train.part(min(cut + window, len(train) - window), len(train))
        return cut_windows_from_parts([part], evenly_spaced_starts([part], window, number), window)[0]

    def degraded(self, seed: int) -> np.ndarray:
        """Windows of every degraded mode at every severity."""
        scenarios = [Degraded(mode, severity, 0.0) for mode in MODES for severity in _SEVERITIES]
        each = max(1, self.settings.labelled.num_arm_windows // len(scenarios))
        return np.concatenate([self.simulator.generate(each, scenario, seed + number) for number, scenario in enumerate(scenarios)])

    # -- evaluation -----------------------------------------------------------------------------------------------

    @functools.cached_property
    def _test(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """First samples of the scored windows of the test part, the windows, and which of them hold no labelled sample."""
        window, values = self.simulator.window, self.channel.test.values
        begins = np.arange(0, len(values) - window + 1, max(1, window // _STRIDES))
        return begins, cut_windows_from_parts([self.channel.test], begins, window)[0], self._is_nominal(begins)

    def _is_nominal(self, begins: np.ndarray) -> np.ndarray:
        """Which windows of the test part hold no labelled sample, by their first samples."""
        touched = np.concatenate([[0], np.cumsum(self.channel.is_anomalous)])
        return touched[begins + self.simulator.window] == touched[begins]

    def _judge(
        self,
        rows: dict[str, list[dict]],
        arm: str,
        name: str,
        score: Callable[[np.ndarray], np.ndarray],
        held_out: np.ndarray,
        labels: np.ndarray,
    ) -> None:
        """Adds the results of one detector and one arm to the tables."""
        begins, windows, is_nominal = self._test
        window, about = self.simulator.window, {"arm": arm, "detector": name}
        threshold = float(np.quantile(score(held_out), 1 - self.settings.labelled.false_alarm_rate))
        scores = score(windows)
        flags = scores > threshold
        for block, chosen in enumerate(np.array_split(np.flatnonzero(is_nominal), _NUM_BLOCKS)):
            rows["alarms"].append(about | {"block": block, "alarms": int(flags[chosen].sum()), "windows": len(chosen)})
        for number, (start, stop) in enumerate(self.channel.labels.sequences):
            meets = (begins < stop) & (begins + window > start)
            first = begins[meets & flags]
            delay = max(0, int(first[0]) + window - 1 - start) if len(first) else None
            kind = self.channel.labels.classes[number]
            rows["sequences"].append(
                about | {"sequence": number, "class": kind, "length": stop - start, "found": bool(len(first)), "delay": delay}
            )
        rows["ranking"].append(self._ranking(arm, name, labels, evaluation.mean_over_windows(scores, begins, window, len(labels))))

    def _ranking(self, arm: str, name: str, labels: np.ndarray, scores: np.ndarray) -> dict[str, Any]:
        from sklearn.metrics import average_precision_score

        buffer = round(self._period)
        return {
            "arm": arm,
            "detector": name,
            "vus_pr": metrics.vus_pr(labels, scores, buffer),
            "auc_pr": float(average_precision_score(labels, scores)),
        }

    @property
    def _period(self) -> float:
        """Period of the channel in samples."""
        return max(wave.period_s for wave in self.simulator.coarse.waves) / self.channel.train.interval_s

    def enhancement(self) -> list[dict]:
        """Error over nominal test windows that share no sample, of the coarse signal, ridge regression and the enhancer: quartiles."""
        window, simulator, train, test = self.simulator.window, self.simulator, self.channel.train, self.channel.test
        begins, places = disjoint_starts(len(test), window), evenly_spaced_starts([train], window, len(train))
        begins = begins[self._is_nominal(begins)]
        by_edges = cut_pairs([test], simulator.coarse, begins, window, follow=True)
        learnt, interval_s = cut_pairs([train], simulator.coarse, places, window, follow=True), simulator.interval_s
        by_shape = simulator.pairs(test, begins)  # aligned in phase and offset with the enhanced waveform
        windows = {
            "coarse": by_edges.coarse_rescaled,
            "ridge": ridge_windows(learnt, by_edges, interval_s),
            "ridge, same clock": ridge_windows(simulator.pairs(train, places), by_shape, interval_s),  # aligned by the network
            "ridge, own clock": ridge_aligned_by_its_shape(learnt, by_edges, simulator.coarse, interval_s),
            "nearest windows": nearest_window_means(learnt, by_edges, interval_s),
            "enhanced": simulator.follow(by_shape),
        }
        found = []
        for method, estimate in windows.items():
            errors = window_errors(estimate, by_edges.target)
            errors = errors[~np.isnan(errors)]
            quartiles = dict(zip(("lower", "nrmse", "upper"), np.quantile(errors, [0.25, 0.5, 0.75]).tolist(), strict=True))
            found.append({"method": method, **quartiles, "windows": len(errors), "window": window, "period": self._period})
        return found


def _classifier(nominal: np.ndarray, degraded: np.ndarray, seed: int) -> Callable[[np.ndarray], np.ndarray]:
    """Probability of being degraded, by boosted trees on the features of each window."""
    from sklearn.ensemble import HistGradientBoostingClassifier

    from enhsim_tf.realism.window_features import window_features

    features = window_features(np.concatenate([nominal, degraded]))
    trees = HistGradientBoostingClassifier(random_state=seed).fit(features, np.repeat([0, 1], [len(nominal), len(degraded)]))
    return lambda windows: trees.predict_proba(window_features(windows))[:, 1]
