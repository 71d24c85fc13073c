"""Figure 1: the pipeline, "steps involved in the process" 1 to 9 and "Combined", each kept as a stage.

Nothing is computed before it is asked for, so a figure trains only the networks that it shows.
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
        store: Where the telemetry is placed and read back from; None for a Parquet file in the cache.
    """

    is_example = True  # `own_channel` has another one
    noise_unit = np.float32(1)  # of the GAN

    def __init__(self, settings: Settings, stages: Stages, store: Store | None = None):
        self.settings, self.stages, self.store = settings, stages, store
        # 1: construct lightweight, high-speed simulations
        self.simulator = square_wave.simulator(settings)
        self.truth = true_signal(settings)
        self.measured: dict[str, dict[str, float]] = {}  # what `claims` measured of it, by stage

    def draw(self, purpose: str) -> np.random.Generator:
        """The random generator of one purpose. Draws for one purpose do not change those for another."""
        return np.random.default_rng([self.settings.seed, zlib.crc32(purpose.encode())])

    # -- 4: high-fidelity simulation or real vehicle data source, placed in the store ("Goal") ------------------------

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

    # -- 2: generate approximate data ----------------------------------------------------------------------------------

    def windows(
        self, part: str, number: int | None = None, purpose: str = ""
    ) -> dict[str, np.ndarray]:
        """Windows of telemetry and the simulation of the same times.

        Args:
            part: One of `PARTS`.
            number: Number of windows at random offsets; None for all disjoint windows in the order of time.
            purpose: Name of the random draw.

        Returns:
            `coarse`, `target` (the telemetry) and `truth` (the signal without noise), float32 of shape `(windows, window)`, and `start`
            of shape `(windows,)`.
        """
        series, size = self.parts[part], self.settings.window
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

    # -- 3: train a neural network to map low-fidelity to high-fidelity data -------------------------------------------

    @functools.cached_property
    def enhancer_folder(self) -> Path:
        """Folder of the trained enhancer and its history."""
        _ = self.telemetry
        depends = self.settings.of("windows", "enhancer")
        return self.stages.run("enhancer", self._train_enhancer, depends, ["telemetry"])

    def _train_enhancer(self, folder: Path) -> None:
        train = self.windows("train", self.settings.num_windows, "training windows")
        held_out = self.windows(
            "test", min(200, self.settings.num_windows), "validation windows"
        )  # by which nothing is chosen
        told = self.stages.progress.loop("epoch", self.settings.epochs)
        watch = keras.callbacks.LambdaCallback(on_epoch_end=lambda epoch, logs: told(epoch + 1))
        network, validation = (
            build_enhancer(self.settings),
            (held_out["coarse"], held_out["target"]),
        )
        history = train_enhancer(
            network, train["coarse"], train["target"], self.settings, validation, [watch]
        )
        network.save_weights(folder / "enhancer.weights.h5")
        save_arrays(folder, history)

    @functools.cached_property
    def enhancer(self) -> keras.Sequential:
        """The trained enhancer."""
        return _load(build_enhancer(self.settings), self.enhancer_folder / "enhancer.weights.h5")

    # -- 5: convert simulation to accurate, clean data -----------------------------------------------------------------

    def enhance(self, coarse: np.ndarray) -> np.ndarray:
        """The clean signal of coarse windows."""
        return enhance(self.enhancer, coarse)

    # -- 6: environmental data source ----------------------------------------------------------------------------------

    def noise_windows(self, part: str, number: int | None = None, purpose: str = "") -> np.ndarray:
        """Windows of the noise of a part; the arguments are those of `windows`."""
        extracted, _ = noise.extract_noise(
            self.parts[part].values, self.settings.moving_average, self.settings.average
        )
        return cut_windows(
            extracted, self._starts(len(extracted), number, purpose), self.settings.window
        )

    # -- 7 and 8: latent space; train generative adversarial model (GAN) -----------------------------------------------

    @functools.cached_property
    def gan_folder(self) -> Path:
        """Folder of both networks after the paper's number of iterations, and of the history, which goes on beyond it."""
        _ = self.telemetry
        depends = self.settings.of("windows", "noise", "noise GAN")
        return self.stages.run("noise GAN", self._train_gan, depends, ["telemetry"])

    def _train_gan(self, folder: Path) -> None:
        chosen = self.settings
        real = self.noise_windows("train", chosen.num_windows, "noise windows") / self.noise_unit
        networks = noise.build_generator(chosen), noise.build_discriminator(chosen)
        gan, followed = noise.NoiseGAN(*networks, chosen), []
        gan.compile()
        told = self.stages.progress.loop("iteration", chosen.rounds * chosen.iterations)

        def follow(iteration: int) -> None:
            generated = noise.generate_noise(
                networks[0], FOLLOWED, chosen, self.draw("followed noise")
            )
            followed.append(
                {
                    "iteration": iteration,
                    "sd": np.std(generated),
                    "lag_one": autocorrelation(generated, 1)[1],
                }
            )
            told(iteration)

        history: dict[str, list[float]] = {}
        for done in range(chosen.rounds):
            found = noise.train_gan(
                gan, real, done * chosen.iterations, (done + 1) * chosen.iterations, follow
            )
            history = {name: history.get(name, []) + values for name, values in found.items()}
            if not done:
                for network in networks:
                    network.save_weights(folder / f"{network.name}.weights.h5")
        rows = {name: [row[name] for row in followed] for name in followed[0]}
        save_arrays(
            folder,
            history | rows | {"real_sd": np.std(real), "real_lag_one": autocorrelation(real, 1)[1]},
        )

    @functools.cached_property
    def history(self) -> dict[str, np.ndarray]:
        """Accuracy and loss of the discriminator, and `sd` and `lag_one` of generated noise, by `iteration`."""
        return load_arrays(self.gan_folder)

    @functools.cached_property
    def generator(self) -> keras.Sequential:
        """The generator after the paper's number of iterations."""
        return _load(noise.build_generator(self.settings), self.gan_folder / "generator.weights.h5")

    # -- 9: generate environmental influences --------------------------------------------------------------------------

    def generate_noise(self, number: int, rng: np.random.Generator) -> np.ndarray:
        """Windows of generated noise, float32 of shape `(number, window)`."""
        return self.noise_unit * noise.generate_noise(self.generator, number, self.settings, rng)

    # -- Combined ------------------------------------------------------------------------------------------------------

    def combine(self, coarse: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """The final signal: enhanced windows, "summed with the noise-generating neural network"."""
        return self.enhance(coarse) + self.generate_noise(len(coarse), rng)


def _load(network: keras.Sequential, weights: Path) -> keras.Sequential:
    network.load_weights(weights)
    return network
