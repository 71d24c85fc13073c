"""The paper's GAN, trained on any windows of noise."""

from collections.abc import Callable

import numpy as np

from enhsim_tf.paper.settings import Settings


class PaperGAN:
    """The paper's GAN, which is trained when it is made.

    Args:
        noise: Windows of noise, float32 of shape `(windows, settings.window)`.
        settings: The paper's settings.
        unit: The unit of the noise in the networks, in which its standard deviation should be about
            0.1.
        on_record: Called with the iteration at each record.
    """

    def __init__(
        self,
        noise: np.ndarray,
        settings: Settings,
        unit: float = 1.0,
        on_record: Callable[[int], None] = lambda iteration: None,
    ):
        from enhsim_tf.paper.noise import build_discriminator, build_generator, connect, train_gan

        self.settings = settings
        self.unit = unit
        gan = connect(build_generator(settings), build_discriminator(settings), settings)
        rows = np.asarray(noise / unit, np.float32)

        def draw(number: int, rng: np.random.Generator) -> np.ndarray:
            return rows[rng.integers(0, len(rows), number)]

        train_gan(gan, draw, 0, settings.iterations, on_record)
        self.generator = gan.generator

    def generate(self, number: int, rng: np.random.Generator) -> np.ndarray:
        """Generates windows of noise, float32 of shape `(number, samples)`."""
        from enhsim_tf.paper.noise import generate_noise

        return np.float32(self.unit) * generate_noise(self.generator, number, self.settings, rng)
