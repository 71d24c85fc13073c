"""The training data of detectors, all from the nominal train part of a channel: its own windows, and windows that simulators generate."""

import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.common.console import Progress
from enhsim_tf.paper.telemetry import cut_windows
from enhsim_tf.simulator.simulator import check_finite
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import evenly_spaced_starts, random_window_starts
from studies.common.controls import CONTROLS
from studies.common.detectors import DETECTORS
from studies.common.evaluation import cross_fitted_scores
from studies.common.settings import Settings
from studies.spacecraft.judging import Judge

if TYPE_CHECKING:
    from enhsim_tf.simulator.simulator import EnhancedSimulator

REAL = "real"
"""The name of the channel's own nominal train part."""


def generators(
    train: Telemetry,
    simulator: "EnhancedSimulator",
    ridge: "EnhancedSimulator",
    settings: Settings,
    progress: Progress,
) -> dict[str, Callable[[int], np.ndarray]]:
    """Functions from a seed to generated windows, by the name of the training data.

    `enhanced` is the paper's network, plus noise of the paper's GAN or blocks of the residuals; `ridge` has no network.

    Args:
        train: The train part, whose residuals the models of noise learn.
        simulator: A simulator that was fitted to it, with the paper's network as its enhancer.
        ridge: A simulator that was fitted to it without a network.
        settings: All settings; `spacecraft` and `seed` are used.
        progress: Reports the progress of the GAN.
    """
    chosen, window = settings.spacecraft, simulator.window
    number = chosen.num_arm_windows
    starts = random_window_starts(
        [train], window, chosen.num_windows, np.random.default_rng([settings.seed, 1])
    )
    windows = cut_windows(train.values, starts, window)[:, :, None]
    residuals = (windows - simulator.enhance(*simulator.alignment.align(windows)))[:, :, 0]
    noises = {
        "GAN": _fit_paper_gan(residuals, chosen.num_iterations, settings.seed, progress),
        "bootstrap": BlockBootstrap(residuals, min(chosen.block, window)),
    }

    def enhanced(noise: Any, seed: int) -> np.ndarray:
        return simulator.generate(number, seed=seed, with_noise=False)[:, :, 0] + noise.generate(
            number, np.random.default_rng(seed)
        )

    return {
        f"enhanced + {name}": functools.partial(enhanced, noise) for name, noise in noises.items()
    } | {"ridge + residual windows": lambda seed: ridge.generate(number, seed=seed)[:, :, 0]}


def _fit_paper_gan(
    residuals: np.ndarray, num_iterations: int, seed: int, progress: Progress
) -> Any:
    from enhsim_tf.paper.settings import make_settings
    from studies.common.paper_gan import PaperGAN

    told = progress.loop("noise GAN, iteration", num_iterations)
    chosen = make_settings(
        seed=seed,
        window=residuals.shape[1],
        iterations=num_iterations,
        record_every=min(100, num_iterations),
    )
    return PaperGAN(residuals, chosen, 10 * float(np.std(residuals, dtype=np.float64)), told)


class BlockBootstrap:
    """Block bootstrap (Künsch 1989): randomly drawn blocks of the real noise, concatenated; a non-parametric upper baseline.

    The noise is real within a block, and independent across the boundary of two blocks. The boundaries have random
    positions in a window, so that all samples have the same distribution.

    Args:
        windows: Noise windows of shape `(windows, samples)`.
        block: Number of samples in a block, at most those of a window.
    """

    def __init__(self, windows: np.ndarray, block: int):
        self.windows, self.block = np.asarray(windows, np.float32), block

    def generate(self, number: int, rng: np.random.Generator) -> np.ndarray:
        """Draws windows of noise, float32 of shape `(number, samples)`."""
        samples = self.windows.shape[1]
        chain = (number, -(-samples // self.block) + 1)
        sources = rng.integers(0, len(self.windows), chain)
        begins = rng.integers(0, samples - self.block + 1, chain)
        places = np.arange(samples) + rng.integers(
            0, self.block, (number, 1)
        )  # a window starts at a random position of its first block
        rows, blocks = np.arange(number)[:, None], places // self.block
        return self.windows[sources[rows, blocks], begins[rows, blocks] + places % self.block]


def source_rows(
    judge: Judge,
    train: Telemetry,
    generated: dict[str, Callable[[int], np.ndarray]],
    settings: Settings,
) -> list[dict[str, Any]]:
    """Trains every detector on all training data, and the controls on the real windows, and judges them on the test part.

    Thresholds of detectors that learn windows of the train part are cross-fitted over blocks of time. Generated windows of another seed
    set the thresholds of the others.

    Raises:
        InputError: If generated windows are not finite.
    """
    starts = evenly_spaced_starts([train], judge.window, settings.spacecraft.num_arm_windows)
    windows = cut_windows(train.values, starts, judge.window)
    rows, seed = [], settings.seed
    for name, make in (DETECTORS | CONTROLS).items():
        past = cross_fitted_scores(
            functools.partial(make, seed), windows, starts, settings.spacecraft.num_folds
        )
        found = judge.judge(make(seed).fit(windows).score(judge.windows), past, past)
        rows.append({"training": REAL, "detector": name} | found)
    for training, generate in generated.items():
        learnt, held_out = (check_finite(generate(seed + number)) for number in (1, 2))
        for name, make in DETECTORS.items():
            score = make(seed).fit(learnt).score
            rows.append(
                {"training": training, "detector": name}
                | judge.judge(score(judge.windows), score(held_out), score(windows))
            )
    return rows
