"""The implementations of enhsim_tf, called as by its users. Each function returns a `Work` (see `benchmarks.examples`)."""

import os
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from benchmarks.examples import Work, epoch_clock, example_windows, minor_faults
from enhsim_tf import EnhancedSimulator, SquareWave, SquareWaveSimulator
from enhsim_tf.enhancer.network import build_enhancer
from enhsim_tf.keras_tools.backend import keras, tf
from enhsim_tf.keras_tools.training import fit_windows
from enhsim_tf.noise.autoregressive_network import AutoregressiveNetwork
from enhsim_tf.noise.convolutional_gan import convolutional_noise_gan
from enhsim_tf.noise.discriminator import build_discriminator
from enhsim_tf.noise.gan import NoiseGAN
from enhsim_tf.noise.generator import build_generator

_COMPILED = 5  # iterations before the time is taken, because the first one compiles


def enhancer_step(num_steps: int, window: int = 500, hidden_units: int = 3_200) -> Work:
    """Prepares training steps of 15 windows by `fit_windows`."""
    source, target = example_windows(15 * num_steps, window)
    model = build_enhancer(window, hidden_units)

    def run() -> tuple[float, int]:
        clock, of_last = epoch_clock()
        fit_windows(model, source, target, epochs=2, batch_size=15, seed=0, verbose=0, callbacks=[clock])
        return of_last()  # the first epoch compiles

    return run, num_steps


def gan_iteration(num_iterations: int, dropout: float = 0.0, window: int = 500, filters: int = 500) -> Work:
    """Prepares iterations of the paper's GAN, with 200 real and 200 generated rows for the discriminator and 200 for the generator."""
    return _iterations(NoiseGAN(build_generator(window), build_discriminator(window, filters, dropout=dropout)), num_iterations, window)


def convolutional_iteration(num_iterations: int, window: int = 500) -> Work:
    """Prepares iterations of the convolutional GAN with the same numbers of rows."""
    return _iterations(convolutional_noise_gan(_example_noise(window)), num_iterations, window)


def network_iteration(num_iterations: int, window: int = 500) -> Work:
    """Prepares iterations of the autoregressive network of noise, with 200 windows and 50 positions."""
    noise = _example_noise(window)
    network = AutoregressiveNetwork.untrained(noise)

    def run() -> tuple[float, int]:
        notes = []
        network.fit(noise, _COMPILED + num_iterations, on_iteration=lambda number: notes.append((time.perf_counter(), minor_faults())))
        (began, before), (ended, after) = notes[_COMPILED - 1], notes[-1]
        return ended - began, after - before

    return run, num_iterations


def _example_noise(window: int) -> np.ndarray:
    return np.random.default_rng(0).normal(0, 0.1, (1_500, window))


def _iterations(gan: NoiseGAN, num_iterations: int, window: int) -> Work:
    noise = tf.constant(_example_noise(window)[:, :, None] / gan.scale, tf.float32)

    def run() -> None:
        for _ in range(num_iterations):
            gan._step(noise)  # what `fit` calls, without its records and progress bar

    return run, num_iterations


def simulator(window: int = 500, hidden_units: int = 3_200) -> EnhancedSimulator:
    """Builds an untrained simulator of the paper's size. Its speed does not depend on its weights."""
    waves = [SquareWave(period_s=480, low=-0.5, high=0.5), SquareWave(period_s=120, low=-0.25, high=0.25)]
    networks = NoiseGAN(build_generator(window), build_discriminator(window))
    return EnhancedSimulator(SquareWaveSimulator(waves), build_enhancer(window, hidden_units), networks)


def enhance_and_noise(num_windows: int, **size: int) -> Work:
    """Prepares the enhancement of existing coarse windows and the generation of their noise, in memory."""
    made = simulator(**size)
    coarse = made.generate_coarse(num_windows)

    def run() -> np.ndarray:
        windows = made.enhance(coarse)
        windows += made.noise.generate(num_windows, seed=0)
        return windows

    return run, num_windows


def generate(num_windows: int, **size: int) -> Work:
    """Prepares `EnhancedSimulator.generate`, including the coarse simulator, in memory."""
    made = simulator(**size)
    return lambda: made.generate(num_windows), num_windows


def generate_to_parquet(num_windows: int, **size: int) -> Work:
    """Prepares `EnhancedSimulator.generate_to_parquet` into a temporary folder."""
    made, folder = simulator(**size), tempfile.TemporaryDirectory()

    def run() -> None:
        made.generate_to_parquet(os.path.join(folder.name, "windows.parquet"), num_windows)

    return run, num_windows


def generate_any(**size: int) -> Work:
    """Prepares the same for a number of windows that each repetition receives. The warm-up generates 2 chunks."""
    made, folder = simulator(**size), tempfile.TemporaryDirectory()
    return lambda number=5_000: made.generate_to_parquet(os.path.join(folder.name, "windows.parquet"), number), 1


def load_simulator(**size: int) -> Work:
    """Prepares `EnhancedSimulator.load`, including the verification of checksums."""
    folder = tempfile.TemporaryDirectory()
    simulator(**size).save(os.path.join(folder.name, "saved"))
    return lambda: EnhancedSimulator.load(os.path.join(folder.name, "saved")), 1


def load_networks(**size: int) -> Work:
    """Prepares the comparison: `keras.saving.load_model` on the same three files, without verification."""
    folder = tempfile.TemporaryDirectory()
    simulator(**size).save(os.path.join(folder.name, "saved"))
    names = ("enhancer", "generator", "discriminator")
    return lambda: [keras.saving.load_model(os.path.join(folder.name, "saved", f"{name}.keras"), compile=False) for name in names], 1


def matrix_product(size: int = 3_200) -> Work:
    """Prepares the limit of the machine for generation: a large float32 matrix product, in floating-point operations."""
    matrix = tf.random.normal((size, size), seed=0)
    product = tf.function(lambda: tf.matmul(matrix, matrix)[0, 0])
    return lambda: product().numpy(), 2 * size**3


def copy(num_bytes: int = 548_000_000) -> Work:
    """Prepares the limit of the machine for training: all cores copy `num_bytes` in total, without allocating memory."""
    num_cores = os.cpu_count() or 1
    source, target = (np.ones((num_cores, num_bytes // 8 // num_cores), np.float32) for _ in range(2))
    pool = ThreadPoolExecutor(num_cores)
    return lambda: list(pool.map(np.copyto, target, source)), num_bytes
