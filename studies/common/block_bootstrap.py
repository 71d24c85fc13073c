"""Noise that concatenates random blocks of the real noise, a baseline of two studies."""

import numpy as np

from enhsim_tf.common.errors import InputError


class BlockBootstrap:
    """Block bootstrap (Künsch 1989): randomly drawn blocks of the real noise, concatenated; a non-parametric upper baseline.

    The noise is real within a block, and independent across the boundary of two blocks. The boundaries have random
    positions in a window, so that all samples have the same distribution.

    Args:
        windows: Noise windows of shape `(windows, samples)`.
        block: Number of samples in a block.

    Raises:
        InputError: If a block is longer than a window.
    """

    def __init__(self, windows: np.ndarray, block: int = 50):
        if not 1 <= block <= windows.shape[1]:
            raise InputError(f"Expected a block of 1 to the {windows.shape[1]} samples of a window. Received: block={block}.")
        self.windows, self.block = np.asarray(windows, np.float32), int(block)

    @classmethod
    def fit(cls, windows: np.ndarray, block: int = 50) -> "BlockBootstrap":
        """Stores noise windows of shape `(windows, samples)`, from which blocks of `block` samples are drawn."""
        return cls(windows, block)

    def generate(self, number: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws windows of noise, float32 of shape `(number, samples)`. The signal has no effect."""
        samples = self.windows.shape[1]
        chain = (number, -(-samples // self.block) + 1)
        sources = rng.integers(0, len(self.windows), chain)
        begins = rng.integers(0, self.windows.shape[1] - self.block + 1, chain)
        places = np.arange(samples) + rng.integers(0, self.block, (number, 1))  # a window starts at a random position of its first block
        rows, blocks = np.arange(number)[:, None], places // self.block
        return self.windows[sources[rows, blocks], begins[rows, blocks] + places % self.block]
