"""The implementations of enhsim_tf, called as by its users. Each function returns a `Work` (see
`benchmarks.examples`).
"""

import os
import tempfile

import numpy as np

from benchmarks.examples import HIDDEN_UNITS, WINDOW, Work, epoch_clock, example_windows
from enhsim_tf import EnhancedSimulator, SquareWave, SquareWaveSimulator
from enhsim_tf.coarse.waves import Waves
from enhsim_tf.common.backend import tf
from enhsim_tf.datasets.labelled_windows import make_plan, write_windows
from enhsim_tf.enhancer.model import Enhancer
from enhsim_tf.enhancer.names import NETWORK
from enhsim_tf.noise.window_bootstrap import WindowBootstrap
from enhsim_tf.paper import noise as of_paper
from enhsim_tf.paper.enhancer import build_enhancer, enhance, train_enhancer
from enhsim_tf.paper.settings import make_settings


def enhancer_step(num_steps: int) -> Work:
    """Prepares training steps of 15 windows by `train_enhancer`."""
    source, target = example_windows(15 * num_steps)
    settings = make_settings(epochs=2)
    model = build_enhancer(settings)

    def run() -> float:
        clock, seconds_of_last = epoch_clock()
        train_enhancer(model, source, target, settings, callbacks=[clock])
        return seconds_of_last()  # the first epoch compiles

    return run, num_steps


def gan_iteration(num_iterations: int, dropout: float = 0.0) -> Work:
    """Prepares iterations of the paper's GAN: two updates of the discriminator on 200 rows and one
    of the generator, as in the compared code.
    """
    settings = make_settings(
        iterations=num_iterations,
        record_every=num_iterations,
        rounds=1,
        update="two of 200",
        dropout=dropout,
    )
    networks = of_paper.build_generator(settings), of_paper.build_discriminator(settings)
    gan = of_paper.connect(*networks, settings)
    noise = np.random.default_rng(0).normal(0, 0.1, (1_500, WINDOW)).astype(np.float32)
    rows = of_paper.Rows(
        lambda number, rng: noise[rng.integers(0, len(noise), number)],
        settings.rows_of_each_kind,
        num_iterations,
        np.random.default_rng(0),
    )

    def run() -> None:
        gan.fit(rows, epochs=1, shuffle=False, verbose=0)

    return run, num_iterations


def simulator() -> EnhancedSimulator:
    """Builds an untrained simulator of the paper's size, with residual windows. Its speed does not
    depend on its weights.
    """
    waves = [
        SquareWave(period_s=480, low=-0.5, high=0.5),
        SquareWave(period_s=120, low=-0.25, high=0.25),
    ]
    layers = tuple(tuple(layer.get_weights()) for layer in build_enhancer(make_settings()).layers)
    enhancer = Enhancer(
        NETWORK, WINDOW, 1, 1, np.zeros(1, np.float32), np.zeros(WINDOW, np.float32), layers=layers
    )
    residuals = np.random.default_rng(0).normal(0, 0.1, (1_500, WINDOW, 1)).astype(np.float32)
    levels = np.array([[[0.0, 1.0]]])
    alignment = Waves([SquareWaveSimulator(waves)], ("telemetry",), 1.0, WINDOW, levels=levels)
    return EnhancedSimulator(alignment, enhancer, WindowBootstrap(residuals))


def enhance_and_noise(num_windows: int) -> Work:
    """Prepares the enhancement of existing coarse windows by the paper's networks and the
    generation of their noise, in memory.
    """
    settings = make_settings()
    enhancer, generator = build_enhancer(settings), of_paper.build_generator(settings)
    coarse = example_windows(num_windows)[0]
    noise = np.random.default_rng(0)
    return (
        lambda: (
            enhance(enhancer, coarse)
            + of_paper.generate_noise(generator, num_windows, settings, noise)
        ),
        num_windows,
    )


def generate(num_windows: int) -> Work:
    """Prepares `EnhancedSimulator.generate`, including the coarse simulator, in memory."""
    made = simulator()
    return lambda: made.generate(num_windows), num_windows


def generate_to_parquet(num_windows: int) -> Work:
    """Prepares the writing of labelled windows to a Parquet file in a temporary folder."""
    made, folder = simulator(), tempfile.TemporaryDirectory()
    made.save(os.path.join(folder.name, "model"))
    plan = make_plan(made, os.path.join(folder.name, "model"), (), 1.0, num_windows, seed=0)
    return lambda: write_windows(
        os.path.join(folder.name, "windows.parquet"), plan, made
    ), num_windows


def matrix_product() -> Work:
    """Prepares the limit of the machine for generation: a large float32 matrix product, in
    floating-point operations.
    """
    matrix = tf.random.normal((HIDDEN_UNITS, HIDDEN_UNITS), seed=0)
    product = tf.function(lambda: tf.matmul(matrix, matrix)[0, 0])
    return lambda: product().numpy(), 2 * HIDDEN_UNITS**3
