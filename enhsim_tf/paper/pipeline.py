"""Figure 1: the pipeline, "steps involved in the process" 1 to 9 and "Combined".

The telemetry and both trained networks are kept as stages. Nothing is computed before it is asked
for, so a figure trains only the networks that it shows.
"""

import functools
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from enhsim_tf.common.backend import keras
from enhsim_tf.common.measures import autocorrelation
from enhsim_tf.common.stages import Stages, load_arrays, save_arrays
from enhsim_tf.paper import noise, square_wave
from enhsim_tf.paper.enhancer import build_enhancer, enhance, train_enhancer
from enhsim_tf.paper.settings import Settings
from enhsim_tf.paper.telemetry import (
    ParquetStore,
    Store,
    Telemetry,
    cut_windows,
    disjoint_starts,
    make_telemetry,
    random_starts,
    split,
    true_signal,
)

FOLLOWED = 200  # generated windows whose statistics are followed in training


class Pipeline:
    """The paper's pipeline on its example.

    Args:
        settings: All settings.
        stages: Keeps the results.
        store: Where the telemetry is placed and read back from; None for a Parquet file in the
            cache.
    """

    # other telemetry overrides these
    noise_unit = np.float32(1)  # the GAN learns noise in this unit
    truth_name = "true signal"
    allowed_nrmse = 0.15  # by which C1 is decided
    not_measured: tuple[str, ...] = ()  # claims for which the truth must be known

    def __init__(self, settings: Settings, stages: Stages, store: Store | None = None):
        self.settings = settings
        self.stages = stages
        self.store = store
        self.measured: dict[str, dict[str, float]] = {}  # by stage, see `claims.kept`
        # 1: construct lightweight, high-speed simulations
        self.simulator = square_wave.simulator(settings)
        self.truth = true_signal(settings)

    def draw(self, purpose: str) -> np.random.Generator:
        """The random generator of one purpose. Draws for one purpose do not change those for
        another.
        """
        # `hash` of a text differs between runs
        return np.random.default_rng([self.settings.seed, zlib.crc32(purpose.encode())])

    # -- 4: high-fidelity simulation or real vehicle data source, placed in the store ("Goal") -----

    @functools.cached_property
    def telemetry(self) -> Telemetry:
        """The telemetry, read back from the store."""
        folder = self.stages.run("telemetry", self._make_telemetry, self.telemetry_settings)
        kept = ParquetStore(folder / "telemetry.parquet")
        if self.store is None:
            return kept.read()
        self.store.write(kept.read())
        return self.store.read()

    def _make_telemetry(self, folder: Path) -> None:
        ParquetStore(folder / "telemetry.parquet").write(self.new_telemetry())

    @property
    def telemetry_settings(self) -> dict[str, Any]:
        """What the telemetry depends on."""
        return self.settings.of("telemetry")

    def new_telemetry(self) -> Telemetry:
        """The telemetry before it is placed in the store."""
        return make_telemetry(self.settings, self.draw("telemetry"))

    @functools.cached_property
    def parts(self) -> dict[str, Telemetry]:
        """The parts of the telemetry; see `telemetry.PARTS`."""
        return split(self.telemetry, self.settings.window, self.settings.moving_average)

    # -- 2: generate approximate data ------------------------------------------------------------

    def windows(
        self, part: str, number: int | None = None, purpose: str = ""
    ) -> dict[str, np.ndarray]:
        """Windows of telemetry and the simulation of the same times.

        Args:
            part: One of `PARTS`.
            number: Number of windows at random offsets; None for all disjoint windows in the order
                of time.
            purpose: Name of the random draw.

        Returns:
            `coarse`, `target` (the telemetry) and `truth` (the signal without noise), float32 of
            shape `(windows, window)`, and `start` of shape `(windows,)`.
        """
        series = self.parts[part]
        size = self.settings.window
        starts = self._starts(len(series.values), number, purpose)
        times, target = (
            cut_windows(values, starts, size) for values in (series.time, series.values)
        )
        coarse, truth = (
            signal(times).astype(np.float32) for signal in (self.simulator, self.truth)
        )
        return {"coarse": coarse, "target": target, "truth": truth, "start": starts}

    def _starts(self, num_samples: int, number: int | None, purpose: str) -> np.ndarray:
        if number is None:
            return disjoint_starts(num_samples, self.settings.window)
        return random_starts(num_samples, self.settings.window, number, self.draw(purpose))

    # -- 3: train a neural network to map low-fidelity to high-fidelity data -----------------------

    @functools.cached_property
    def enhancer_folder(self) -> Path:
        """Folder of the trained enhancer and its history."""
        _ = self.telemetry  # the stage must have run
        depends = self.settings.of("windows", "enhancer")
        return self.stages.run("enhancer", self._train_enhancer, depends, ["telemetry"])

    def _train_enhancer(self, folder: Path) -> None:
        train = self.windows("train", self.settings.num_windows, "training windows")
        # followed in training, and nothing is chosen by them
        held_out = self.windows("test", min(200, self.settings.num_windows), "validation windows")
        told = self.stages.progress.loop("epoch", self.settings.epochs)
        watch = keras.callbacks.LambdaCallback(on_epoch_end=lambda epoch, logs: told(epoch + 1))
        network = build_enhancer(self.settings)
        validation = (held_out["coarse"], held_out["target"])
        history = train_enhancer(
            network, train["coarse"], train["target"], self.settings, validation, [watch]
        )
        network.save_weights(folder / "enhancer.weights.h5")
        save_arrays(folder, history)

    @functools.cached_property
    def enhancer(self) -> keras.Sequential:
        """The trained enhancer."""
        return _load(build_enhancer(self.settings), self.enhancer_folder / "enhancer.weights.h5")

    # -- 5: convert simulation to accurate, clean data -------------------------------------------

    def enhance(self, coarse: np.ndarray) -> np.ndarray:
        """The clean signal of coarse windows."""
        return enhance(self.enhancer, coarse)

    # -- 6: environmental data source ------------------------------------------------------------

    def noise_series(self, part: str) -> np.ndarray:
        """The noise of a part, float32 of shape `(samples,)`: what the moving average leaves, or,
        without an average, what was added to the true signal.
        """
        series = self.parts[part]
        settings = self.settings
        if settings.average == "none":
            return series.values - self.truth(series.time).astype(np.float32)
        return noise.extract_noise(series.values, settings.moving_average, settings.average)[0]

    def noise_windows(self, part: str, number: int | None = None, purpose: str = "") -> np.ndarray:
        """Windows of the noise of a part; the arguments are those of `windows`."""
        series = self.noise_series(part)
        return cut_windows(series, self._starts(len(series), number, purpose), self.settings.window)

    # -- 7 and 8: latent space; train generative adversarial model (GAN) ---------------------------

    @functools.cached_property
    def gan_folder(self) -> Path:
        """Folder of both networks after the paper's number of iterations, and of the history, which
        goes on beyond it.
        """
        _ = self.telemetry  # the stage must have run
        return self.stages.run("noise GAN", self._train_gan, self.gan_settings, ["telemetry"])

    @property
    def gan_settings(self) -> dict[str, Any]:
        """What the trained GAN depends on."""
        return self.settings.of("windows", "noise", "noise GAN")

    def _train_gan(self, folder: Path) -> None:
        settings = self.settings
        series = self.noise_series("train") / self.noise_unit
        generator = noise.build_generator(settings)
        discriminator = noise.build_discriminator(settings)
        gan = noise.connect(generator, discriminator, settings)
        told = self.stages.progress.loop("iteration", settings.rounds * settings.iterations)
        history: dict[str, list[float]] = {"iteration": [], "sd": [], "lag_one": []}

        def follow(iteration: int) -> None:
            # always the same latent vectors: what differs is the generator
            rng = self.draw("followed noise")
            generated = noise.generate_noise(generator, FOLLOWED, settings, rng)
            history["iteration"].append(iteration)
            history["sd"].append(np.std(generated))
            history["lag_one"].append(autocorrelation(generated, 1)[1])
            told(iteration)

        def draw_rows(number: int, rng: np.random.Generator) -> np.ndarray:
            starts = random_starts(len(series), settings.window, number, rng)
            return cut_windows(series, starts, settings.window)

        for first in range(0, settings.rounds * settings.iterations, settings.iterations):
            last = first + settings.iterations
            for name, values in noise.train_gan(gan, draw_rows, first, last, follow).items():
                history.setdefault(name, []).extend(values)
            if first == 0:  # the paper's number of iterations; only C4 looks further
                generator.save_weights(folder / "generator.weights.h5")
                discriminator.save_weights(folder / "discriminator.weights.h5")
        real = {"real_sd": np.std(series), "real_lag_one": autocorrelation(series[None], 1)[1]}
        save_arrays(folder, history | real)

    @functools.cached_property
    def history(self) -> dict[str, np.ndarray]:
        """Losses of training, accuracy and loss of the discriminator, and `sd` and `lag_one` of
        generated noise, by `iteration`; `real_sd` and `real_lag_one` of the real noise.
        """
        return load_arrays(self.gan_folder)

    @functools.cached_property
    def generator(self) -> keras.Sequential:
        """The generator after the paper's number of iterations."""
        return _load(noise.build_generator(self.settings), self.gan_folder / "generator.weights.h5")

    # -- 9: generate environmental influences ----------------------------------------------------

    def generate_noise(self, number: int, rng: np.random.Generator) -> np.ndarray:
        """Windows of generated noise, float32 of shape `(number, window)`."""
        return self.noise_unit * noise.generate_noise(self.generator, number, self.settings, rng)

    # -- Combined --------------------------------------------------------------------------------

    def combine(self, coarse: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """The final signal: enhanced windows, "summed with the noise-generating neural network"."""
        return self.enhance(coarse) + self.generate_noise(len(coarse), rng)


def _load(network: keras.Sequential, weights: Path) -> keras.Sequential:
    network.load_weights(weights)
    return network
