"""The paper's GAN, trained on any windows of noise."""

import numpy as np

from enhsim_tf.paper.settings import Settings


class PaperGAN:
    """The paper's GAN, which is trained when it is made.

    Args:
        noise: Windows of noise, float32 of shape `(windows, settings.window)`.
        settings: The paper's settings.
    """

    def __init__(self, noise: np.ndarray, settings: Settings):
        from enhsim_tf.paper.noise import build_discriminator, build_generator, connect, train_gan

        self.settings = settings
        gan = connect(build_generator(settings), build_discriminator(settings), settings)

        def draw(number: int, rng: np.random.Generator) -> np.ndarray:
            return noise[rng.integers(0, len(noise), number)]

        train_gan(gan, draw, 0, settings.iterations)
        self.generator = gan.generator

    def generate(self, number: int, rng: np.random.Generator) -> np.ndarray:
        """Generates windows of noise, float32 of shape `(number, samples)`."""
        from enhsim_tf.paper.noise import generate_noise

        return generate_noise(self.generator, number, self.settings, rng)
