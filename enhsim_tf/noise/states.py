"""What is saved of a noise model: its kind, numbers and arrays, from which it is built again without running saved code."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.noise.candidates import NoiseModel
from enhsim_tf.noise.surrogates import GaussianAutoregression, GaussianNoise
from enhsim_tf.noise.window_bootstrap import MatchedWindowBootstrap, WindowBootstrap


@dataclasses.dataclass(frozen=True)
class NoiseState:
    """What is saved of a noise model.

    Args:
        settings: Kind and numbers, in plain JSON types.
        arrays: Its arrays by name.
    """

    settings: Mapping[str, Any]
    arrays: Mapping[str, np.ndarray]


def state_of(model: NoiseModel) -> NoiseState:
    """Returns what is saved of a noise model.

    Args:
        model: A noise model of `candidates`.

    Raises:
        InputError: If it is a model of another class, which is not saved.
    """
    match model:
        case GaussianNoise():
            kind = "gaussian" if model.standard_deviation else "none"
            return NoiseState({"kind": kind, "window": model.window}, {"standard_deviation": np.array(model.standard_deviation)})
        case GaussianAutoregression():
            settings = {"kind": "autoregression", "window": model.window, "innovation_sd": model.innovation_sd}
            return NoiseState(settings, {"coefficients": model.coefficients})
        case WindowBootstrap() | MatchedWindowBootstrap():
            kind = "residual windows" if isinstance(model, WindowBootstrap) else "matched residual windows"
            arrays = {name: getattr(model, name, None) for name in ("windows", "signals", "starts")}
            return NoiseState({"kind": kind}, {name: each for name, each in arrays.items() if each is not None})
    raise InputError(f"Expected a noise model of arrays. Received: {type(model).__name__}, which is not saved. Fit another noise model.")


def model_from(settings: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> NoiseModel:
    """Makes a noise model again.

    Args:
        settings: As in `NoiseState`.
        arrays: As in `NoiseState`.

    Raises:
        ValueError: If the settings do not describe a noise model, or a number is not finite.
    """
    if not all(np.isfinite(np.asarray(each, np.float64)).all() for each in arrays.values()):
        raise ValueError("noise that is not finite")
    match settings["kind"]:
        case "none" | "gaussian":
            return GaussianNoise(abs(float(arrays["standard_deviation"])), settings["window"])
        case "autoregression":
            return GaussianAutoregression(arrays["coefficients"], _positive(settings["innovation_sd"]), settings["window"])
        case "residual windows":
            return WindowBootstrap(arrays["windows"], arrays.get("starts"))
        case "matched residual windows":
            return MatchedWindowBootstrap(arrays["windows"], arrays["signals"], arrays.get("starts"))
    raise ValueError(f"unknown noise {str(settings['kind'])[:80]!r}")


def _positive(number: Any) -> float:
    if not (isinstance(number, int | float) and np.isfinite(number) and number > 0):
        raise ValueError(f"noise of scale {str(number)[:40]}")
    return float(number)
