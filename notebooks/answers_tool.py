"""Answers of the exercises of lessons 20 to 31, which their check cells compare with a student's answer."""

from collections.abc import Callable, Sequence

import numpy as np

from enhsim_tf.coarse.pairing import estimate_delay
from enhsim_tf.common import measures
from enhsim_tf.common.backend import keras
from enhsim_tf.enhancer.out_of_range import OutOfRange
from enhsim_tf.paper.pipeline import Pipeline
from enhsim_tf.scoring.metrics import finite_threshold
from enhsim_tf.telemetry.series import Telemetry

# -- 22 ------------------------------------------------------------------------------------------------------


def repaired_threshold(detector: tuple[np.ndarray, np.ndarray], windows: np.ndarray) -> float:
    """Lesson 22, exercise 1: the conformal threshold for 1 % from the scores of the given windows."""
    centre, directions = detector
    centred = windows - centre
    scores = np.mean((centred - centred @ directions @ directions.T) ** 2, axis=1)
    return finite_threshold(scores, 0.01)[0]


def louder_threshold(
    fit: Callable, score: Callable, threshold: Callable, halves: Sequence[np.ndarray], real: np.ndarray
) -> float:
    """Lesson 22, exercise 2: the threshold from the second half, divided by that from real windows."""
    detector = fit(halves[0])
    return threshold(score(detector, halves[1])) / threshold(score(detector, real))


# -- 23 ------------------------------------------------------------------------------------------------------


def least_flagged(scores: dict[str, np.ndarray], limit: float) -> list[str]:
    """Lesson 23, exercise 1: the modes of which the fewest windows exceed the limit."""
    shares = {mode: np.mean(values > limit) for mode, values in scores.items()}
    return [mode for mode, share in shares.items() if share == min(shares.values())]


def error_ratio(
    score: OutOfRange, limit: float, pipeline: Pipeline, coarse: np.ndarray, truth: np.ndarray
) -> float:
    """Lesson 23, exercise 2: the median error of windows above the limit, divided by that of the others."""
    errors = np.sqrt(np.mean((pipeline.enhance(coarse) - truth) ** 2, axis=1))
    above = score.score(coarse) > limit
    return float(np.median(errors[above]) / np.median(errors[~above]))


# -- 25 ------------------------------------------------------------------------------------------------------


def rank_when_drawn_again(windows: np.ndarray, number: int) -> float:
    """Lesson 25, exercise 2: the effective rank of as many windows, drawn from the given ones with replacement."""
    return measures.effective_rank(windows[np.random.default_rng(0).integers(0, len(windows), number)])


# -- 27 ------------------------------------------------------------------------------------------------------


def delay_s(telemetry: Telemetry, simulator: Telemetry, window: int) -> float:
    """Lesson 27, exercise 1: the delay of the simulator against the telemetry in seconds."""
    return estimate_delay(telemetry, simulator, window).seconds


def ratio_without_temperature(error_with: Callable[[list[str]], float]) -> float:
    """Lesson 27, exercise 2: the error without the temperature, divided by that with it."""
    return error_with(["volts", "amperes"]) / error_with(["volts", "amperes", "celsius"])


# -- 29 ------------------------------------------------------------------------------------------------------


def num_different_windows(pipeline: Pipeline, window: int) -> int:
    """Lesson 29, exercise 1: how many different windows of the simulator a long run contains."""
    series = pipeline.simulator(np.arange(2_000.0)).ravel()
    return len({each.tobytes() for each in np.lib.stride_tricks.sliding_window_view(series, window)})


def num_parameters(enhancer: keras.Model) -> int:
    """Lesson 29, exercise 2: the number of parameters of the enhancer."""
    return enhancer.count_params()


# -- 31 ------------------------------------------------------------------------------------------------------


def share_late(score: Callable, delayed: np.ndarray, residuals: np.ndarray) -> float:
    """Lesson 31, exercise 1: the share of late windows above the conformal threshold of the residuals."""
    return float(np.mean(score(delayed) > finite_threshold(score(residuals), 0.01)[0]))


def shared_quarters(features: np.ndarray) -> float:
    """Lesson 31, exercise 2: the correlation of the first quarters of both channels."""
    return np.corrcoef(features[:, 0], features[:, 1])[0, 1]
