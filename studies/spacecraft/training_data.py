"""The training data of detectors, all from the nominal train part of a channel: its own windows, and windows that simulators generate."""

import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.common.console import Progress
from enhsim_tf.common.errors import InputError
from enhsim_tf.detection.registry import CONTROLS, DETECTORS
from enhsim_tf.noise.surrogates import GaussianAutoregression, GaussianNoise
from enhsim_tf.simulator.simulator import check_finite
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import cut_windows, evenly_spaced_starts, random_window_starts
from studies.common.block_bootstrap import BlockBootstrap
from studies.common.settings import Settings
from studies.spacecraft.judging import Judge, cross_fitted_scores

if TYPE_CHECKING:
    from enhsim_tf.simulator.simulator import EnhancedSimulator

REAL = "real"
_START_RANGE = 1_000_000  # generated windows begin at a random sample below this one
TRAINING = {
    REAL: "the channel's own nominal train part",
    "coarse": "the coarse simulator at the levels of the train part",
    "enhanced": "the paper's network, without noise",
    "enhanced + GAN": "plus noise of the paper's GAN",
    "enhanced + Gaussian": "plus Gaussian noise of the same standard deviation",
    "enhanced + AR": "plus a fitted autoregression",
    "enhanced + bootstrap": "plus blocks of the residuals",
    "ridge + residual windows": "no network: tuned ridge regression, plus whole windows of its residuals",
}
"""Training data by name, in the order of the tables."""


def real_windows(train: Telemetry, window: int, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Windows that are spread evenly over the train part, shape `(windows, samples)`, and their first samples."""
    starts = evenly_spaced_starts([train], window, number)
    return cut_windows(train.values, starts, window), starts


def generators(
    train: Telemetry, simulator: "EnhancedSimulator", ridge: "EnhancedSimulator", settings: Settings, progress: Progress
) -> dict[str, Callable[[int], np.ndarray]]:
    """Functions from a seed to generated windows, by the name of the training data.

    Args:
        train: The train part, whose residuals the models of noise learn.
        simulator: A simulator that was fitted to it, with the paper's network as its enhancer.
        ridge: A simulator that was fitted to it without a network.
        settings: All settings; `labelled` and `seed` are used.
        progress: Reports the progress of the GAN.
    """
    chosen, window = settings.labelled, simulator.window
    number = chosen.num_arm_windows
    starts = random_window_starts([train], window, chosen.num_windows, np.random.default_rng([settings.seed, 1]))
    windows = cut_windows(train.values, starts, window)[:, :, None]
    residuals = (windows - simulator.enhance(*simulator.alignment.align(windows)))[:, :, 0]
    noises = {
        "GAN": lambda: _fit_paper_gan(residuals, chosen.num_iterations, settings.seed, progress),
        "Gaussian": lambda: GaussianNoise.fit(residuals),
        "AR": lambda: GaussianAutoregression.fit(residuals, min(chosen.max_order, window - 1)),
        "bootstrap": lambda: BlockBootstrap.fit(residuals, min(chosen.block, window)),
    }

    def with_noise(fit: Callable[[], Any]) -> Callable[[int], np.ndarray]:
        fit = functools.cache(fit)  # one model for training and thresholds
        return lambda seed: simulator.generate_clean(number, seed=seed)[:, :, 0] + fit().generate(number, np.random.default_rng(seed))

    return {
        "coarse": lambda seed: _coarse_windows(simulator, number, seed),
        "enhanced": lambda seed: simulator.generate_clean(number, seed=seed)[:, :, 0],
        **{f"enhanced + {name}": with_noise(fit) for name, fit in noises.items()},
        "ridge + residual windows": lambda seed: ridge.generate(number, seed=seed)[:, :, 0],
    }


def _coarse_windows(simulator: "EnhancedSimulator", number: int, seed: int) -> np.ndarray:
    """Square waves of random phases, at offsets and gains of the train part."""
    rng = np.random.default_rng(seed)
    drawn = simulator.alignment.draw(rng.integers(0, _START_RANGE, number), [None] * number, rng).coarse[:, :, 0]
    shift, gain = simulator.levels[rng.integers(0, len(simulator.levels), number), 0].T
    return (shift[:, None] + gain[:, None] * drawn).astype(np.float32)


def _fit_paper_gan(residuals: np.ndarray, num_iterations: int, seed: int, progress: Progress) -> Any:
    from enhsim_tf.paper.settings import make_settings
    from studies.common.paper_gan import fit_paper_gan

    told = progress.loop("noise GAN, iteration", num_iterations)
    chosen = make_settings(seed=seed, window=residuals.shape[1], iterations=num_iterations, record_every=min(100, num_iterations))
    return fit_paper_gan(residuals, chosen, 10 * float(np.std(residuals, dtype=np.float64)), told)


def source_rows(
    judge: Judge,
    real: tuple[np.ndarray, np.ndarray],
    generated: dict[str, Callable[[int], np.ndarray]],
    settings: Settings,
    tell: Callable[[str], None],
) -> list[dict[str, Any]]:
    """Trains every detector on all training data and judges it.

    Training data that cannot be made, because a model of noise diverged or cannot be fitted, are left out, with a line that says why.

    Args:
        judge: The test part.
        real: What `real_windows` returns. Thresholds of these training data are cross-fitted over blocks of time.
        generated: What `generators` returns. Windows of another seed set the thresholds.
        settings: All settings; `labelled` and `seed` are used.
        tell: Called with a line about training data that are left out.

    Returns:
        A row for each detector and training data, and one for each control, which is trained on the real windows.
    """
    windows, starts = real
    rows, seed = [], settings.seed
    for name, make in (DETECTORS | CONTROLS).items():
        past = cross_fitted_scores(functools.partial(make, seed), windows, starts, settings.labelled.num_folds)
        found = judge.judge(make(seed).fit(windows).score(judge.windows), past, past)
        rows.append({"training": REAL, "detector": name} | found)
    for training, generate in generated.items():
        try:
            learnt, held_out = (check_finite(generate(seed + number)) for number in (1, 2))
        except InputError as error:
            tell(f"  {training} left out: {error}")
            continue
        for name, make in DETECTORS.items():
            score = make(seed).fit(learnt).score
            rows.append({"training": training, "detector": name} | judge.judge(score(judge.windows), score(held_out), score(windows)))
    return rows
