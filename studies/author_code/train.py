"""Trains the author's class in a process of its own, with legacy Keras: `python -m
studies.author_code.train CODE SERIES SEED SPAN ITERATIONS RECORD_EVERY SIDE OUT`.

His: the networks (`define_discriminator`, `define_generator`, `define_gan`), the latent rows, and
`train` with all that it calls, among it the updates and `evaluate`. Not his: the real rows, which
`generate_real_samples` draws from our series (he leaves it to be overridden), and pyplot, in whose
place `NotDrawn` keeps the rows that he would draw.
"""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import tf_keras


class NotDrawn:
    """Takes the place of pyplot, its figures and its axes in the author's module.

    It draws nothing. `rows` are the arrays that were to be plotted, each of shape `(rows,
    window)`.
    """

    def __init__(self):
        self.rows: list[np.ndarray] = []

    def plot(self, columns: np.ndarray) -> None:
        """Keeps the columns of an array of shape `(window, rows)`."""
        self.rows.append(columns.T)

    def __getitem__(self, place: tuple[int, int]) -> "NotDrawn":
        return self

    def __getattr__(self, name: str) -> Any:
        return lambda *arguments, **options: self


def load(code: Path) -> ModuleType:
    """Imports the author's file from where it lies, unchanged."""
    spec = importlib.util.spec_from_file_location(code.stem, code)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def train(
    code: Path,
    series: np.ndarray,
    seed: int,
    span: float,
    iterations: int,
    record_every: int,
    side: int,
) -> dict[str, Any]:
    """Trains his GAN with 200 rows and 16 latent numbers, as in the paper.

    Args:
        code: His file, OneDGAN2.py.
        series: Noise, of which every update gets windows of 500 samples at random offsets.
        seed: Seed of all draws.
        span: His variable for the scale of the latent rows.
        iterations: Iterations, a multiple of `side ** 2`.
        record_every: Iterations between two measurements by his `evaluate`.
        side: His `train` shows generated rows at `side ** 2` iterations.

    Returns:
        His history, the generated rows that he would draw as `followed`, and the weights of the
        generator as `weight_0` and so on.
    """
    module = load(code)
    module.plt = drawn = NotDrawn()
    offsets = np.random.default_rng(seed)

    class OnNoise(module.OneDGAN2):
        def generate_real_samples(self) -> tuple[np.ndarray, np.ndarray]:
            starts = offsets.integers(0, len(series) - self.vector_size + 1, self.num_samples)
            rows = series[starts[:, None] + np.arange(self.vector_size)]
            return rows[:, :, None], np.ones((self.num_samples, 1))

    tf_keras.utils.disable_interactive_logging()  # one bar for each call of `predict`
    tf_keras.utils.set_random_seed(seed)  # his code draws from the global generators
    gan = OnNoise()
    gan.latent_dimension = 16
    gan.num_samples = 200
    gan.vector_size = 500
    gan.span = span
    gan.define_discriminator()
    gan.define_generator()
    gan.define_gan()
    before = [weight.copy() for weight in gan.d_model.get_weights()]
    history = gan.train(iterations, record_every, side)
    if any(np.array_equal(*pair) for pair in zip(before, gan.d_model.get_weights(), strict=True)):
        raise RuntimeError("Expected a discriminator that learns. Received: unchanged weights.")
    latent = np.random.default_rng(seed).standard_normal((10, 16), np.float32)
    return history | {
        "followed": np.stack(drawn.rows),
        "latent": latent,
        "generated": gan.g_model.predict(latent),
        **{f"weight_{at}": value for at, value in enumerate(gan.g_model.get_weights())},
    }


if __name__ == "__main__":
    code, series, seed, span, iterations, record_every, side, out = sys.argv[1:]
    numbers = int(seed), float(span), int(iterations), int(record_every), int(side)
    np.savez_compressed(out, **train(Path(code), np.load(series), *numbers))
