"""Answers of the exercises of lessons 20 to 31, which their check cells compare with a student's answer."""

from collections.abc import Callable, Sequence

import numpy as np

from enhsim_tf.coarse_simulator.pairing import estimate_delay
from enhsim_tf.coarse_simulator.recording import Recording
from enhsim_tf.common import measures
from enhsim_tf.detection.metrics import finite_threshold
from enhsim_tf.enhancer.out_of_range import OutOfRange
from enhsim_tf.paper.pipeline import Pipeline
from enhsim_tf.telemetry.series import Telemetry

# -- 21 ------------------------------------------------------------------------------------------------------


def fall_of_the_rank(windows: np.ndarray, number: int) -> float:
    """Lesson 21, exercise 1: the effective rank of the first windows, divided by that of all."""
    return measures.effective_rank(windows[:number]) / measures.effective_rank(windows)


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


# -- 26 ------------------------------------------------------------------------------------------------------


def enough_features(error_with: Callable[[int], float], numbers: Sequence[int]) -> int:
    """Lesson 26, exercise 1: the smallest number whose error is at most 5 % above that of the best."""
    errors = {number: error_with(number) for number in numbers}
    return min(number for number, error in errors.items() if error <= 1.05 * min(errors.values()))


def penalty_in_kilovolts(penalty: float) -> float:
    """Lesson 26, exercise 2: the penalty is compared with sums of squares, which are smaller by 1,000²."""
    return penalty / 1_000**2


# -- 27 ------------------------------------------------------------------------------------------------------


def delay_s(telemetry: Telemetry, simulator: Recording, window: int) -> float:
    """Lesson 27, exercise 1: the delay of the simulator against the telemetry in seconds."""
    return estimate_delay([telemetry], simulator, window).seconds


def ratio_without_temperature(error_with: Callable[[list[str]], float]) -> float:
    """Lesson 27, exercise 2: the error without the temperature, divided by that with it."""
    return error_with(["volts", "amperes"]) / error_with(["volts", "amperes", "celsius"])


# -- 28 ------------------------------------------------------------------------------------------------------


def suffices_from(found: dict, environment: str, limit: float) -> int | None:
    """Lesson 28, exercise 2: the smallest number of real windows from which on the excess stays within the limit, or None."""
    excess, numbers = found["environments"][environment]["arms"]["real"]["excess"], found["numbers"]
    too_many = [place for place, number in enumerate(numbers) if excess[str(number)] > limit]
    return dict(enumerate(numbers)).get(max(too_many, default=-1) + 1)


# -- 29 ------------------------------------------------------------------------------------------------------


def num_different_windows(pipeline: Pipeline, window: int) -> int:
    """Lesson 29, exercise 1: how many different windows of the simulator a long run contains."""
    series = pipeline.simulator(np.arange(2_000.0)).ravel()
    return len({each.tobytes() for each in np.lib.stride_tricks.sliding_window_view(series, window)})


def num_parameters(pipeline: Pipeline) -> int:
    """Lesson 29, exercise 2: the number of parameters of the enhancer."""
    return pipeline.enhancer.count_params()


# -- 30 ------------------------------------------------------------------------------------------------------


def share_when_late(
    judge: Callable, view: Callable, telemetry: np.ndarray, known: np.ndarray, shift: int = 50
) -> float:
    """Lesson 30, exercise 1: the share of false alarms if the simulator is late in all judged time."""

    def seen(learnt: np.ndarray, simulated: np.ndarray, real: np.ndarray, starts: np.ndarray) -> np.ndarray:
        in_time = real is telemetry and starts[-1] <= known[-1]
        return view(learnt, simulated if in_time else np.roll(simulated, shift, axis=0), real, starts)

    return judge(seen)["false alarms"]


# -- 31 ------------------------------------------------------------------------------------------------------


def share_late(score: Callable, delayed: np.ndarray, residuals: np.ndarray) -> float:
    """Lesson 31, exercise 1: the share of late windows above the conformal threshold of the residuals."""
    return float(np.mean(score(delayed) > finite_threshold(score(residuals), 0.01)[0]))


def shared_quarters(features: np.ndarray) -> float:
    """Lesson 31, exercise 2: the correlation of the first quarters of both channels."""
    return np.corrcoef(features[:, 0], features[:, 1])[0, 1]
