"""The paper's GAN, trained on any windows of noise."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from enhsim_tf.paper.settings import Settings

if TYPE_CHECKING:
    from enhsim_tf.common.backend import keras


class PaperGAN:
    """The trained generator of the paper's GAN.

    Args:
        generator: The generator.
        settings: The settings that it was trained with.
        unit: The unit of the noise in the network.
    """

    def __init__(self, generator: "keras.Model", settings: Settings, unit: float):
        self.generator, self.settings, self.unit = generator, settings, unit

    def generate(self, number: int, rng: np.random.Generator) -> np.ndarray:
        """Generates windows of noise, float32 of shape `(number, samples)`."""
        from enhsim_tf.paper.noise import generate_noise

        return np.float32(self.unit) * generate_noise(self.generator, number, self.settings, rng)


def fit_paper_gan(
    noise: np.ndarray, settings: Settings, unit: float = 1.0, on_record: Callable[[int], None] = lambda iteration: None
) -> PaperGAN:
    """Trains the paper's GAN.

    Args:
        noise: Windows of noise, float32 of shape `(windows, settings.window)`.
        settings: The paper's settings.
        unit: The unit of the noise in the networks, in which its standard deviation should be about 0.1.
        on_record: Called with the iteration at each record.
    """
    from enhsim_tf.paper.noise import NoiseGAN, build_discriminator, build_generator, train_gan

    gan = NoiseGAN(build_generator(settings), build_discriminator(settings), settings)
    gan.compile()
    train_gan(gan, np.asarray(noise / unit, np.float32), 0, settings.iterations, on_record)
    return PaperGAN(gan.generator, settings, unit)
