"""Training windows of one replicate of the factorial experiment: the signal of each enhancer and the noise of each generator."""

import functools
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.enhancer.ridge import fit_ridge
from enhsim_tf.enhancer.training_pairs import paired_windows
from enhsim_tf.noise.surrogates import GaussianAutoregression
from enhsim_tf.noise.window_bootstrap import WindowBootstrap
from enhsim_tf.telemetry.windows import random_window_starts
from studies.factorial.cells import (
    AUTOREGRESSION,
    CONVOLUTIONAL_GAN,
    FEW,
    MANY,
    MOVING_AVERAGE,
    NETWORK,
    PAPER_GAN,
    REFERENCES,
    WHOLE_WINDOWS,
    Cell,
)
from studies.robustness.replicate import Replicate

if TYPE_CHECKING:
    from enhsim_tf.noise.gan import NoiseGAN

Enhance = Callable[[np.ndarray], np.ndarray]
TRAINING, THRESHOLD = "arms, training", "arms, threshold"
"""Purposes of the windows of an arm; they draw the same windows as in the experiment on robustness."""


class Pipelines:
    """All pipelines of one environment and seed. Networks are trained when they are first needed.

    Args:
        replicate: The replicate of the experiment on robustness that provides the data and the paper's network.
    """

    def __init__(self, replicate: Replicate):
        self.replicate, self.settings = replicate, replicate.settings
        self.data, self.train = replicate.experiment.data, replicate.experiment.data.channels[0].train
        self.window, self.seed = self.settings.telemetry.window, self.settings.seed
        self._enhancers: dict[tuple[str, str], Enhance] = {}
        self._noise: tuple[tuple[str, str, str], np.ndarray] | None = None
        self._model: tuple[tuple[object, ...], object] | None = None

    def number(self, windows: str) -> int:
        """Number of windows that a level of the factor `windows` stands for."""
        return {FEW: self.settings.telemetry.num_windows, MANY: self.settings.second.num_windows}[windows]

    def arm(self, name: str | Cell, purpose: str) -> np.ndarray:
        """Windows of a cell or of a reference, of shape `(windows, samples)`.

        Args:
            name: The cell, or the name of a reference.
            purpose: `TRAINING` for the windows that train a detector, `THRESHOLD` for those that set its threshold.
        """
        number = self.settings.robustness.num_windows
        if name == "real":
            part = "train" if purpose == TRAINING else "calibration"
            return self.data.windows(part, number, f"{purpose}, real")["target"]
        coarse = self.data.windows("train", number, purpose)["coarse"]
        if name in REFERENCES:
            return coarse
        seed = int(self.data.draw(purpose).integers(2**31))
        return self.enhancer(name.enhancer, name.windows)(coarse) + self.generator(name).generate(number, seed)

    # -- enhancers -----------------------------------------------------------------------------------------------------

    def enhancer(self, enhancer: str, windows: str) -> Enhance:
        """The function that maps coarse windows to the signal of an enhancer."""
        key = (enhancer, windows)
        if key not in self._enhancers:
            make = {(NETWORK, FEW): self._paper_network, (NETWORK, MANY): self._second_network}
            self._enhancers[key] = make[key]() if enhancer == NETWORK else self._ridge(windows)
        return self._enhancers[key]

    def training_starts(self, windows: str) -> np.ndarray:
        """Start of each training window of the enhancers: those of the paper's network, and those of the residual pipeline."""
        rng = self.data.draw("training windows") if windows == FEW else np.random.default_rng(self.seed)
        return random_window_starts([self.train], self.window, self.number(windows), rng)

    def _pairs(self, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return paired_windows(self.train, self.data.channels[0].coarse, starts, self.window)

    def _ridge(self, windows: str) -> Enhance:
        starts = self.training_starts(windows)
        return fit_ridge(*self._pairs(starts), starts).predict

    def _paper_network(self) -> Enhance:
        from enhsim_tf.enhancer.network import enhance
        from enhsim_tf.keras_tools.backend import keras

        path = self.replicate.experiment.enhancer_folder / "enhancer.keras"
        return functools.partial(enhance, keras.saving.load_model(path, compile=False, safe_mode=True))

    def _second_network(self) -> Enhance:
        from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

        chosen, stages = self.settings, self.replicate.stages
        depends = (chosen.telemetry, chosen.split, chosen.second, chosen.seed)
        folder = stages.run("second network", self._make_second, depends, after=("telemetry",))
        return EnhancedSimulator.load(folder / "simulator").enhance

    def _make_second(self, folder: Path) -> None:
        from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator

        chosen = self.settings.second
        EnhancedSimulator.fit(
            self.train,
            self.data.channels[0].coarse,
            self.seed,
            chosen.num_windows,
            chosen.epochs,
            window=self.window,
            noise="none",  # that of the cells is fitted by `generator`
            held_out=chosen.held_out,
            verbose=0,
        ).save(folder / "simulator")

    # -- noise ---------------------------------------------------------------------------------------------------------

    def extracted(self, cell: Cell) -> np.ndarray:
        """Windows of the noise that the generator of a cell learns, of shape `(windows, samples)`. The last ones are kept."""
        if self._noise is None or self._noise[0] != cell.source:
            number = self.number(cell.windows)
            if cell.extraction == MOVING_AVERAGE:
                noise = self.data.noise_windows("train", number, "noise windows")
            else:
                starts = random_window_starts([self.train], self.window, number, np.random.default_rng([self.seed, 1]))
                coarse, target = self._pairs(starts)
                noise = target - self.enhancer(cell.enhancer, cell.windows)(coarse)
            self._noise = (cell.source, noise)
        return self._noise[1]

    def generator(self, cell: Cell) -> "WindowBootstrap | GaussianAutoregression | NoiseGAN":
        """The fitted noise model of a cell. The last one is kept, because both purposes and some cells share it."""
        key = (*cell.source, cell.generator)
        if self._model is None or self._model[0] != key:
            noise = self.extracted(cell)
            fit = {
                WHOLE_WINDOWS: WindowBootstrap.fit,
                AUTOREGRESSION: self._autoregression,
                PAPER_GAN: self._paper_gan,
                CONVOLUTIONAL_GAN: self._convolutional_gan,
            }[cell.generator]
            self._model = (key, fit(noise))
        return self._model[1]

    def _autoregression(self, noise: np.ndarray) -> GaussianAutoregression:
        return GaussianAutoregression.fit(noise, min(self.settings.robustness.max_order, self.window - 1))

    def _paper_gan(self, noise: np.ndarray) -> "NoiseGAN":
        from enhsim_tf.noise.gan import NoiseGAN

        training = self.settings.adversarial
        gan = NoiseGAN(
            *self.replicate.experiment.untrained_noise_networks(),
            batch_size=training.batch_size,
            learning_rate=training.learning_rate,
            latent_span=self.settings.noise.latent_span,
            mixed_batch=training.mixed_batch,
            generated_in_training_mode=training.generated_in_training_mode,
            scale=self.data.units[2],
            seed=self.seed,
        )
        gan.fit(noise, training.num_iterations, training.record_every, verbose=False)
        return gan

    def _convolutional_gan(self, noise: np.ndarray) -> "NoiseGAN":
        from enhsim_tf.noise.convolutional_gan import convolutional_noise_gan

        training = self.settings.adversarial
        gan = convolutional_noise_gan(noise, training.num_iterations, self.seed)
        gan.fit(noise, training.num_iterations, training.record_every, verbose=False)
        return gan
