"""The paper's experiment as cached stages.

Each property is computed once, when a figure or a claim needs it, and cached by `stages`; `--only fig02` trains nothing.
"""

import functools
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.coarse_simulator.degraded import MODES, Degraded
from enhsim_tf.common.atomic_files import sha256
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.stages import Stages, load_arrays, save_arrays
from enhsim_tf.noise.surrogates import GaussianNoise
from enhsim_tf.reproduce.paper import measurements
from enhsim_tf.reproduce.paper.data import Data, Source, fill_store
from enhsim_tf.reproduce.settings import Settings
from enhsim_tf.telemetry.parquet_store import ParquetStore

if TYPE_CHECKING:
    from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
    from enhsim_tf.keras_tools.backend import keras


class Experiment:
    """The reproduction on the paper's example, or the same pipeline on a real channel.

    Args:
        settings: All settings.
        stages: Runs stages and caches their results.
        source: A file of real telemetry, or None for the paper's example.
        verbose: Progress bars: 0 none, 1 one for each training.
    """

    def __init__(self, settings: Settings, stages: Stages, source: Source | None = None, verbose: int = 0):
        self.settings, self.stages, self.source, self.verbose = settings, stages, source, verbose

    @property
    def is_paper(self) -> bool:
        """Whether this is the paper's own example, for which the true signal is known."""
        return self.source is None

    @functools.cached_property
    def store(self) -> ParquetStore:
        """The store that holds the telemetry ("Goal" of the paper's Figure 1)."""
        if self.is_paper:
            depends = (self.settings.telemetry, self.settings.seed)
        elif self.source.path.is_file():
            depends = (self.source.path.name, self.source.column, self.source.time, sha256(self.source.path))
        else:
            raise InputError(
                f"Expected a telemetry file. Received: {self.source.path}, which does not exist or is no file. Check the path."
            )
        return ParquetStore(self.stages.run("telemetry", self._make_telemetry, depends))

    def _make_telemetry(self, folder: Path) -> None:
        fill_store(ParquetStore(folder), self.settings, self.source)

    @functools.cached_property
    def data(self) -> Data:
        """The telemetry read back from the store, and its windows."""
        return Data(self.store, self.settings, self.is_paper)

    # -- the two networks ----------------------------------------------------------------------------------------------

    @functools.cached_property
    def enhancer_folder(self) -> Path:
        """Folder of the trained enhancer (the paper's first network) and its history."""
        _ = self.data
        depends = (
            self.settings.telemetry,
            self.settings.split,
            self.settings.enhancer,
            self.settings.noise.moving_average,
            self.settings.seed,
        )
        return self.stages.run("enhancer", self._make_enhancer, depends, ("telemetry",))

    def untrained_enhancer(self) -> "keras.Model":
        """The enhancer before training."""
        from enhsim_tf.enhancer.network import build_enhancer

        chosen = self.settings.enhancer
        return build_enhancer(self.data.window, chosen.hidden_units, chosen.num_hidden, self.settings.seed, chosen.initialiser)

    def _make_enhancer(self, folder: Path) -> None:
        from enhsim_tf.keras_tools.training import EpochProgress, fit_windows

        chosen, seed, number = self.settings.enhancer, self.settings.seed, self.settings.telemetry.num_windows
        offset, scale, _ = self.data.units
        train = self.data.windows("train", number, "training windows")
        held_out = self.data.windows("test", min(200, number), "validation windows")
        wanted = "truth" if self.settings.telemetry.target == "clean" else "target"
        pairs = (train["coarse"], train[wanted], held_out["coarse"], held_out[wanted])
        source, target, *validation = ((windows - offset) / scale for windows in pairs)
        network = self.untrained_enhancer()
        history = fit_windows(
            network,
            source,
            target,
            chosen.epochs,
            chosen.batch_size,
            seed,
            chosen.learning_rate,
            tuple(validation),
            callbacks=[EpochProgress(self.stages.progress.loop("epoch", chosen.epochs))],
            verbose=self.verbose,
            loss=chosen.loss,
        )
        network.save(folder / "enhancer.keras", include_optimizer=False)
        save_arrays(folder, history)

    @functools.cached_property
    def noise_folder(self) -> Path:
        """Folder of the trained noise GAN (the paper's second network), its history and the statistics of its noise during training."""
        _ = self.data
        depends = (self.settings.telemetry, self.settings.split, self.settings.noise, self.settings.adversarial, self.settings.seed)
        return self.stages.run("noise GAN", self._make_noise, depends, ("telemetry",))

    def untrained_noise_networks(self) -> "tuple[keras.Model, keras.Model]":
        """The generator and the discriminator before training."""
        from enhsim_tf.noise.discriminator import build_discriminator
        from enhsim_tf.noise.generator import build_generator

        chosen, seed, window = self.settings.noise, self.settings.seed, self.data.window
        return (
            build_generator(window, chosen.latent, chosen.generator_units, chosen.generator_activation, seed, chosen.initialiser),
            build_discriminator(
                window, chosen.filters, chosen.filter_width, chosen.stride, chosen.narrow_units, chosen.dropout, seed, chosen.initialiser
            ),
        )

    def _make_noise(self, folder: Path) -> None:
        from enhsim_tf.noise.gan import NoiseGAN
        from enhsim_tf.realism import measures

        training, seed = self.settings.adversarial, self.settings.seed
        gan = NoiseGAN(
            *self.untrained_noise_networks(),
            batch_size=training.batch_size,
            learning_rate=training.learning_rate,
            latent_span=self.settings.noise.latent_span,
            mixed_batch=training.mixed_batch,
            generated_in_training_mode=training.generated_in_training_mode,
            scale=self.data.units[2],
            seed=seed,
        )
        real = self.data.noise_windows("train", self.settings.telemetry.num_windows, "noise windows")
        followed = []

        def follow(iteration: int, gan: NoiseGAN) -> None:
            noise = gan.generate(200, seed=seed)
            followed.append(
                (
                    np.std(noise, dtype=np.float64) / np.std(real, dtype=np.float64),
                    measures.autocorrelation(noise, 1)[1],
                    measures.effective_rank(noise),
                )
            )

        number, rounds = training.num_iterations, []
        told = self.stages.progress.loop("iteration", training.num_rounds * number)
        for done in range(training.num_rounds):  # training goes on after the paper's number, at which the networks are saved
            rounds.append(gan.fit(real, number, training.record_every, follow, bool(self.verbose), told.within(done * number)))
            rounds[-1]["iteration"] += done * number
            for name in () if done else ("generator", "discriminator"):
                getattr(gan, name).save(folder / f"{name}.keras", include_optimizer=False)
        rows = dict(zip(("sd_ratio", "lag_one", "rank"), np.transpose(followed), strict=True))
        rows |= {key: np.concatenate([each[key] for each in rounds]) for key in rounds[0]}
        _, once = np.unique(rows["iteration"], return_index=True)  # a round begins with the record that the one before ended with
        of_real = {"real_lag_one": measures.autocorrelation(real, 1)[1], "real_rank": measures.effective_rank(real[:200])}
        save_arrays(folder, {key: values[once] for key, values in rows.items()} | of_real)

    @functools.cached_property
    def enhancer_history(self) -> dict[str, np.ndarray]:
        """`loss` and `val_loss` by epoch."""
        return load_arrays(self.enhancer_folder)

    @functools.cached_property
    def noise_history(self) -> dict[str, np.ndarray]:
        """Accuracy and loss by iteration of the paper's training, and scale, lag-1 correlation and rank of the noise generated there."""
        longer, last = self.longer_noise_history, self.settings.adversarial.num_iterations
        chosen = longer["iteration"] <= last
        return {key: values[chosen] if values.ndim else values for key, values in longer.items()}

    @functools.cached_property
    def longer_noise_history(self) -> dict[str, np.ndarray]:
        """The same for as long as the training was followed after the paper's number of iterations."""
        return load_arrays(self.noise_folder)

    @functools.cached_property
    def simulator(self) -> "EnhancedSimulator":
        """The `EnhancedSimulator` of the first channel, made of both networks."""
        from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
        from enhsim_tf.keras_tools.backend import keras
        from enhsim_tf.noise.gan import NoiseGAN

        def load(folder: Path, name: str) -> keras.Model:
            return keras.saving.load_model(folder / f"{name}.keras", compile=False, safe_mode=True)

        offset, scale, noise_scale = self.data.units
        enhancer = load(self.enhancer_folder, "enhancer")
        networks = [load(self.noise_folder, name) for name in ("generator", "discriminator")]
        noise = NoiseGAN(*networks, latent_span=self.settings.noise.latent_span, scale=noise_scale, seed=self.settings.seed)
        channel = self.data.channels[0]
        return EnhancedSimulator(channel.coarse, enhancer, noise, channel.telemetry.interval_s, offset, scale)

    # -- measurements for the claims ---------------------------------------------------------------------------------

    def _measure(self, name: str, make: Callable[[Path], None]) -> dict[str, np.ndarray]:
        _ = self.enhancer_folder, self.noise_folder
        return load_arrays(self.stages.run(name, make, self.settings, after=("telemetry", "enhancer", "noise GAN")))

    @functools.cached_property
    def enhancement(self) -> dict[str, np.ndarray]:
        """Error of the enhancer against its baselines (C1, C3)."""
        return self._measure("enhancement", self._make_enhancement)

    def _make_enhancement(self, folder: Path) -> None:
        train = self.data.windows("train", self.settings.telemetry.num_windows, "training windows")
        test = self.data.windows("test", None)
        found = measurements.enhancement(self.simulator.enhance, train, test)
        if not self.is_paper:  # the period of a real channel varies: also report the error without the phase error
            in_step = measurements.enhancement(self.simulator.enhance, train, self.data.windows("test", None, synchronised=True))
            found |= {f"synchronised_{key}": value for key, value in in_step.items() if key.endswith("nrmse")}
        save_arrays(folder, found)

    @functools.cached_property
    def resemblance(self) -> dict[str, np.ndarray]:
        """Similarity of the generated noise (C6) and of the sum (C7) to real windows, with real-vs-real baselines."""
        return self._measure("resemblance", self._make_resemblance)

    def _make_resemblance(self, folder: Path) -> None:
        seed, noise_of, told = self.settings.seed, self.simulator.noise.generate, self.stages.progress.loop("comparison", 4)
        # disjoint windows in order of time: overlapping windows in different folds would bias the classifier
        real, again = (self.data.noise_windows(part, None) for part in ("test", "train"))
        noise = measurements.resemblance(noise_of(len(real), seed + 1), real, again, seed, told.within(0))
        real, again = (self.data.windows(part, None) for part in ("test", "train"))
        combined = self.simulator.enhance(real["coarse"]) + noise_of(len(real["coarse"]), seed + 2)
        combined = measurements.resemblance(combined, real["target"], again["target"], seed, told.within(2))
        save_arrays(
            folder, {f"noise_{key}": value for key, value in noise.items()} | {f"sum_{key}": value for key, value in combined.items()}
        )

    @functools.cached_property
    def speed(self) -> dict[str, np.ndarray]:
        """Seconds of telemetry generated per second of computation (C2)."""
        return self._measure("speed", self._make_speed)

    def _make_speed(self, folder: Path) -> None:
        save_arrays(folder, measurements.speed(self.simulator, self.settings.detectors.num_speed_windows))

    @functools.cached_property
    def false_alarms(self) -> dict[str, np.ndarray] | None:
        """False-alarm rate and recall by training arm (C3, C8); None for a real channel, whose true degraded signal is unknown."""
        return self._measure("false alarms", self._make_false_alarms) if self.is_paper else None

    def _make_false_alarms(self, folder: Path) -> None:
        chosen, simulator, windows = self.settings.detectors, self.simulator, self.data.windows
        gaussian = GaussianNoise.fit(self.data.noise_windows("train", self.settings.telemetry.num_windows, "noise windows"))

        def arms_of(purpose: str) -> dict[str, np.ndarray]:
            coarse = windows("train", chosen.num_windows, purpose)["coarse"]
            clean, seed = simulator.enhance(coarse), int(self.data.draw(purpose).integers(2**31))
            return {
                "coarse": coarse,
                "enhanced": clean,
                "enhanced + GAN noise": clean + simulator.noise.generate(len(clean), seed),
                "enhanced + Gaussian noise": clean + gaussian.generate(len(clean), np.random.default_rng(seed)),
            }

        training, threshold = arms_of("arms, training"), arms_of("arms, threshold")
        arms = {name: (training[name], threshold[name]) for name in training}
        arms["real"] = (windows("train", chosen.num_windows, "arms, real")["target"], windows("calibration", None)["target"])
        degraded = {mode: self.data.degraded_truth(Degraded(mode, chosen.severity), noisy=True) for mode in MODES}
        nominal, seed = windows("test", None)["target"], self.settings.seed
        save_arrays(folder, measurements.false_alarms(arms, nominal, degraded, chosen, seed, self.stages.progress))

    @functools.cached_property
    def degraded(self) -> dict[str, np.ndarray] | None:
        """Error of the enhanced signal in each degraded mode (C9); None for a real channel."""
        return self._measure("degraded", self._make_degraded) if self.is_paper else None

    def _make_degraded(self, folder: Path) -> None:
        enhance, coarse = self.simulator.enhance, self.data.degraded_coarse
        truth = functools.partial(self.data.degraded_truth, noisy=False)
        save_arrays(folder, measurements.degraded_error(enhance, coarse, truth, list(MODES), self.settings.detectors.severity))
