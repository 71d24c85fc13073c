"""The package's own ways, called as its users call them. Each function returns what to repeat and its units of work."""

import os
import tempfile
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from benchmarks.examples import Work, epoch_clock, example_windows
from enhsim_tf import EnhancedSimulator, SquareWave, SquareWaveSimulator
from enhsim_tf.enhancer.network import build_enhancer
from enhsim_tf.keras_tools.backend import keras, tf
from enhsim_tf.keras_tools.training import fit_windows
from enhsim_tf.noise.convolutional_gan import convolutional_noise_gan
from enhsim_tf.noise.discriminator import build_discriminator
from enhsim_tf.noise.gan import NoiseGAN
from enhsim_tf.noise.generator import build_generator


def enhancer_step(num_steps: int, window: int = 500, hidden_units: int = 3_200) -> Work:
    """Steps of 15 windows through `fit_windows`."""
    source, target = example_windows(15 * num_steps, window)
    model = build_enhancer(window, hidden_units)

    def run() -> tuple[float, int]:
        clock, of_last = epoch_clock()
        fit_windows(model, source, target, epochs=2, batch_size=15, seed=0, verbose=0, callbacks=[clock])
        return of_last()  # the first epoch compiles

    return run, num_steps


def gan_iteration(num_iterations: int, dropout: float = 0.0, window: int = 500, filters: int = 500) -> Work:
    """Iterations of 200 real, 200 generated and 200 judged rows."""
    return _iterations(NoiseGAN(build_generator(window), build_discriminator(window, filters, dropout=dropout)), num_iterations, window)


def convolutional_iteration(num_iterations: int, window: int = 500) -> Work:
    """Iterations of as many rows through the second pair of networks."""
    return _iterations(convolutional_noise_gan(_example_noise(window)), num_iterations, window)


def _example_noise(window: int) -> np.ndarray:
    return np.random.default_rng(0).normal(0, 0.1, (1_500, window))


def _iterations(gan: NoiseGAN, num_iterations: int, window: int) -> Work:
    noise = tf.constant(_example_noise(window)[:, :, None] / gan.scale, tf.float32)

    def run() -> None:
        for _ in range(num_iterations):
            gan._step(noise)  # what `fit` calls, without its records and progress bar

    return run, num_iterations


def simulator(window: int = 500, hidden_units: int = 3_200) -> EnhancedSimulator:
    """An untrained simulator of the paper's size; its speed does not depend on its weights."""
    waves = [SquareWave(period_s=480, low=-0.5, high=0.5), SquareWave(period_s=120, low=-0.25, high=0.25)]
    networks = NoiseGAN(build_generator(window), build_discriminator(window))
    return EnhancedSimulator(SquareWaveSimulator(waves), build_enhancer(window, hidden_units), networks)


def enhance_and_noise(num_windows: int, **size: int) -> Work:
    """Enhancer and generated noise on coarse windows that are there, in memory."""
    made = simulator(**size)
    coarse = made.generate_coarse(num_windows)

    def run() -> np.ndarray:
        windows = made.enhance(coarse)
        windows += made.noise.generate(num_windows, seed=0)
        return windows

    return run, num_windows


def generate(num_windows: int, **size: int) -> Work:
    """`EnhancedSimulator.generate`, coarse simulator included, in memory."""
    made = simulator(**size)
    return lambda: made.generate(num_windows), num_windows


def generate_to_parquet(num_windows: int, **size: int) -> Work:
    """`EnhancedSimulator.generate_to_parquet`; the file goes to a temporary folder."""
    made, folder = simulator(**size), tempfile.TemporaryDirectory()

    def run() -> None:
        made.generate_to_parquet(os.path.join(folder.name, "windows.parquet"), num_windows)

    return run, num_windows


def generate_any(**size: int) -> Work:
    """The same for a number of windows that each repetition is told; it warms up on 2 chunks."""
    made, folder = simulator(**size), tempfile.TemporaryDirectory()
    return lambda number=5_000: made.generate_to_parquet(os.path.join(folder.name, "windows.parquet"), number), 1


def load_simulator(**size: int) -> Work:
    """`EnhancedSimulator.load`, checksums included."""
    folder = tempfile.TemporaryDirectory()
    simulator(**size).save(os.path.join(folder.name, "saved"))
    return lambda: EnhancedSimulator.load(os.path.join(folder.name, "saved")), 1


def load_networks(**size: int) -> Work:
    """The comparison: `keras.saving.load_model` on the same three files, nothing checked."""
    folder = tempfile.TemporaryDirectory()
    simulator(**size).save(os.path.join(folder.name, "saved"))
    names = ("enhancer", "generator", "discriminator")
    return lambda: [keras.saving.load_model(os.path.join(folder.name, "saved", f"{name}.keras"), compile=False) for name in names], 1


def matrix_product(size: int = 3_200) -> Work:
    """The machine's limit for generation: a large float32 matrix product, counted in floating-point operations."""
    matrix = tf.random.normal((size, size), seed=0)
    product = tf.function(lambda: tf.matmul(matrix, matrix)[0, 0])
    return lambda: product().numpy(), 2 * size**3


def copy(num_bytes: int = 548_000_000) -> Work:
    """The machine's limit for the enhancer's training: `num_bytes` read and written in all, by every core, into no new memory."""
    num_cores = os.cpu_count() or 1
    source, target = (np.ones((num_cores, num_bytes // 8 // num_cores), np.float32) for _ in range(2))
    pool = ThreadPoolExecutor(num_cores)
    return lambda: list(pool.map(np.copyto, target, source)), num_bytes
