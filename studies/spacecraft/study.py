"""Study of real telemetry with labelled anomalies: detectors trained on generated telemetry, tested on a real spacecraft.

Every arm learns from all of a channel's nominal `train` part, directly or through a simulator that is fitted to it. Every
detector is trained on each arm, sets its threshold on windows that it was not trained on, and is judged on the `test` part.
Finished channels are cached.
"""

import functools
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.coarse_simulator.degraded import MODES, Degraded
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.stages import Stages, load_arrays, save_arrays
from enhsim_tf.detection.registry import CONTROLS, DETECTORS
from enhsim_tf.enhanced_simulator.checks import check_finite
from enhsim_tf.noise.extraction import noise_unit
from enhsim_tf.noise.surrogates import BlockBootstrap, GaussianAutoregression, GaussianNoise
from enhsim_tf.telemetry.telemanom import LabelledChannel
from enhsim_tf.telemetry.windows import cut_windows_from_parts, evenly_spaced_starts
from studies.common.settings import Settings
from studies.spacecraft.enhancement import errors_of_methods
from studies.spacecraft.judging import Judge, cross_fitted_scores
from studies.spacecraft.no_network import RidgeSimulator

if TYPE_CHECKING:
    import pandas as pd

    from enhsim_tf.enhanced_simulator.fit_options import FitOptions
    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

TABLES = ("channels", "sequences", "enhancement", "scores", "thresholds", "ranking")
ARMS = {
    "real": "the channel's own nominal train part",
    "coarse": "the coarse simulator at the levels of the train part",
    "enhanced": "the enhanced signal, clean",
    "enhanced + GAN": "plus noise of the paper's GAN",
    "enhanced + Gaussian": "plus Gaussian noise of the same standard deviation",
    "enhanced + AR": "plus a fitted autoregression",
    "enhanced + bootstrap": "plus blocks of the extracted noise itself",
    "enhanced + convolutional": "plus noise of the convolutional GAN, which `fit` trains",
    "ridge + residual windows": "no network: tuned ridge regression, plus whole windows of its residuals, drawn again",
}
"""Training windows of detectors, in the order of the figures."""
GENERATED_ARM = "enhanced + convolutional"
RIDGE_ARM = "ridge + residual windows"
DEGRADED_ARM = "nominal + degraded"
"""A classifier that separates generated nominal from generated degraded windows; it is not an arm for detectors without labels."""
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
        self.dropped: dict[str, str] = {}  # arms that could not be made for this channel, with the reasons

    @functools.cached_property
    def _data(self) -> tuple:
        """Name of the channel and checksums of its two parts."""
        parts = (self.channel.train.values, self.channel.test.values)
        return (self.name, *(zlib.crc32(np.ascontiguousarray(part)) for part in parts))

    @functools.cached_property
    def simulator(self) -> "EnhancedSimulator":
        """The simulator that `python -m enhsim_tf fit --held-out 0 --enhancer network --noise convolutional` fits to the train part."""
        depends = (*self._data, self._options)
        folder = self.stages.run(f"fit {self.name}", self._make_simulator, depends)
        from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

        return EnhancedSimulator.load(folder / "simulator")

    @property
    def _options(self) -> "FitOptions":
        from enhsim_tf.enhanced_simulator.fit_options import FitOptions

        chosen = self.settings.labelled
        counts = {"num_windows": chosen.num_windows, "epochs": chosen.epochs, "num_iterations": chosen.num_iterations}
        return FitOptions(**counts, noise="convolutional", held_out=0.0, seed=self.seed, enhancer="network")

    def _make_simulator(self, folder: Path) -> None:
        from enhsim_tf.enhanced_simulator.fitting import fit_simulator

        fit_simulator([self.channel.train], self._options, self.verbose, self.stages.progress).save(folder / "simulator")

    @functools.cached_property
    def gan_noise(self) -> dict[str, np.ndarray]:
        """Noise of the paper's GAN that learnt the simulator's residuals: `training` and `held_out`, shape `(windows, samples)`."""
        simulator, chosen = self.simulator, self.settings.labelled
        depends = (chosen.num_windows, chosen.num_iterations, chosen.num_arm_windows, self.seed, simulator.window)
        return load_arrays(self.stages.run(f"GAN {self.name}", self._make_gan_noise, depends, after=(f"fit {self.name}",)))

    def _make_gan_noise(self, folder: Path) -> None:
        from enhsim_tf.noise.discriminator import build_discriminator
        from enhsim_tf.noise.gan import NoiseGAN
        from enhsim_tf.noise.generator import build_generator

        window, chosen = self.simulator.window, self.settings.labelled
        networks = build_generator(window, seed=self.seed), build_discriminator(window, seed=self.seed)
        gan = NoiseGAN(*networks, scale=noise_unit(self.residuals), seed=self.seed)
        told = self.stages.progress.loop("noise GAN, iteration", chosen.num_iterations)
        gan.fit(self.residuals, chosen.num_iterations, verbose=bool(self.verbose), on_iteration=told)
        seeds = {"training": self.seed + 1, "held_out": self.seed + 2}
        save_arrays(folder, {name: check_finite(gan.generate(chosen.num_arm_windows, seed)) for name, seed in seeds.items()})

    @functools.cached_property
    def residuals(self) -> np.ndarray:
        """Windows of the difference between the train part and the enhanced signal, shape `(windows, samples)`."""
        rng = np.random.default_rng([self.seed, 1])
        return self.simulator.residual_windows(self.channel.train, self.settings.labelled.num_windows, rng)

    @functools.cached_property
    def tables(self) -> "dict[str, pd.DataFrame]":
        """Every table of `TABLES` by name."""
        import pandas as pd

        _ = self.simulator  # a channel without a simulator is left out
        try:
            _ = self.gan_noise
        except InputError as error:  # the channel keeps its other arms
            self.dropped["enhanced + GAN"] = str(error)
        after = (f"fit {self.name}", f"GAN {self.name}")
        depends = (*self._data, self.settings.labelled, self.seed)
        folder = self.stages.run(f"study {self.name}", self._make, depends, after=after)
        return {name: pd.read_parquet(folder / f"{name}.parquet") for name in TABLES}

    def _make(self, folder: Path) -> None:
        import pandas as pd

        if getattr(self.simulator.coarse, "is_constant", False):
            raise InputError(
                f"Expected a periodic channel, because the study compares enhancers of square waves. Received: {self.name}, whose coarse simulator is "
                "a constant level. Use another channel."
            )
        judge = Judge(self.channel, self.simulator.window, self._period, self.settings.labelled.false_alarm_rate)
        real, starts = self.real_windows
        training, held_out = self.arms(training=True), self.arms(training=False)
        for arm, reason in self.dropped.items():
            self.stages.tell(f"  {arm:26} left out: {reason}")
        kept = [arm for arm in ARMS if arm not in self.dropped]
        told = self.stages.progress.loop("arm", len(kept))
        for number, arm in enumerate(kept):
            detectors = DETECTORS | (CONTROLS if arm == "real" else {})
            for done, (name, make) in enumerate(detectors.items(), 1):
                score = make(self.seed).fit(training[arm]).score
                if arm == "real":
                    own = past = cross_fitted_scores(functools.partial(make, self.seed), real, starts, self.settings.labelled.num_folds)
                else:
                    own, past = score(held_out[arm]), score(real)
                judge.add(arm, name, score(judge.windows), own, past)
                told(number + done / len(detectors))
            alarms = judge.share_of_alarms(arm).values()
            self.stages.tell(f"  {arm:26} false alarms {', '.join(f'{rate:.0%}' for rate in alarms)}")
        if GENERATED_ARM in kept:
            classify = _classifier(training[GENERATED_ARM], self.degraded(self.seed + 3), self.seed)
            judge.add(DEGRADED_ARM, "boosted trees", classify(judge.windows), classify(held_out[GENERATED_ARM]), classify(real))
        judge.rank("real", "oracle", judge.labels.astype(float))
        for name, found in (judge.rows | self._descriptions(judge)).items():
            pd.DataFrame(found).assign(channel=self.name, seed=self.seed).to_parquet(folder / f"{name}.parquet")

    def _descriptions(self, judge: Judge) -> dict[str, list[dict[str, Any]]]:
        labels, simulator = self.channel.labels, self.simulator
        stride = int(judge.begins[1] - judge.begins[0]) if len(judge.begins) > 1 else judge.window
        record = {"samples": len(self.channel.test), "train_samples": len(self.channel.train), "penalty": self.no_network.ridge.penalty}
        record |= {"dropped": "; ".join(f"{arm}: {reason}" for arm, reason in self.dropped.items())}
        return {
            "channels": [record | {"window": judge.window, "stride": stride, "period": self._period}],
            "sequences": [
                {"sequence": number, "class": kind, "start": start, "stop": stop}
                for number, (kind, (start, stop)) in enumerate(zip(labels.classes, labels.sequences, strict=True))
            ],
            "enhancement": errors_of_methods(simulator, self.no_network, self.channel),
        }

    @property
    def _period(self) -> float:
        """Period of the channel in samples."""
        return max(wave.period_s for wave in self.simulator.coarse.waves) / self.channel.train.interval_s

    # -- training windows of the detectors -------------------------------------------------------------------------------------

    @functools.cached_property
    def no_network(self) -> RidgeSimulator:
        """Tuned ridge regression and its residual windows, from the same train part."""
        return RidgeSimulator.fit(self.channel.train, self.simulator.coarse, self.simulator.window, self.settings.labelled.num_windows)

    @property
    def noises(self) -> dict[str, Callable[[], Any]]:
        """Functions that return the models of the residual noise of the train part, by name, except the paper's GAN."""
        window, chosen = self.simulator.window, self.settings.labelled
        return {
            "Gaussian": lambda: GaussianNoise.fit(self.residuals),
            "AR": lambda: GaussianAutoregression.fit(self.residuals, min(chosen.max_order, window - 1)),
            "bootstrap": lambda: BlockBootstrap.fit(self.residuals, min(chosen.block, window)),
            "convolutional": lambda: self.simulator.noise,
        }

    @functools.cached_property
    def real_windows(self) -> tuple[np.ndarray, np.ndarray]:
        """Windows that are spread evenly over the train part, and their first samples."""
        train, window = self.channel.train, self.simulator.window
        starts = evenly_spaced_starts([train], window, self.settings.labelled.num_arm_windows)
        return cut_windows_from_parts([train], starts, window)[0], starts

    def arms(self, training: bool) -> dict[str, np.ndarray]:
        """Windows of every arm, generated with other seeds for training than for thresholds.

        Args:
            training: Whether detectors are trained on these windows. If not, they set thresholds, and `real` is missing, because the
                thresholds of that arm are cross-fitted.

        An arm that cannot be made, because its noise diverged or cannot be fitted, is missing, and `dropped` says why.
        """
        number, simulator = self.settings.labelled.num_arm_windows, self.simulator
        seed = self.seed + (1 if training else 2)
        clean = simulator.generate_clean(number, seed=seed)
        make: dict[str, Callable[[], np.ndarray]] = {
            "coarse": lambda: simulator.generate_coarse(number, seed=seed),
            "enhanced": lambda: clean,
            "enhanced + GAN": lambda: clean + self.gan_noise["training" if training else "held_out"],
        }
        make |= {f"enhanced + {name}": lambda fit=fit: clean + fit().generate(number, seed) for name, fit in self.noises.items()}
        make[RIDGE_ARM] = lambda: self.no_network.generate(number, seed)
        arms = {"real": self.real_windows[0]} if training else {}
        for arm, each in make.items():
            if arm not in self.dropped:
                try:
                    arms[arm] = check_finite(each())
                except InputError as error:
                    self.dropped[arm] = str(error)
        return arms

    def degraded(self, seed: int) -> np.ndarray:
        """Windows of every degraded mode at every severity."""
        scenarios = [Degraded(mode, severity, 0.0) for mode in MODES for severity in _SEVERITIES]
        each = max(1, self.settings.labelled.num_arm_windows // len(scenarios))
        return np.concatenate([self.simulator.generate(each, scenario, seed + number) for number, scenario in enumerate(scenarios)])


def _classifier(nominal: np.ndarray, degraded: np.ndarray, seed: int) -> Callable[[np.ndarray], np.ndarray]:
    """Probability of being degraded, by boosted trees on the features of each window."""
    from sklearn.ensemble import HistGradientBoostingClassifier

    from enhsim_tf.realism.window_features import window_features

    features = window_features(np.concatenate([nominal, degraded]))
    trees = HistGradientBoostingClassifier(random_state=seed).fit(features, np.repeat([0, 1], [len(nominal), len(degraded)]))
    return lambda windows: trees.predict_proba(window_features(windows))[:, 1]
