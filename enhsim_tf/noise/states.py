"""What is saved of a noise model: its kind, numbers and arrays, from which it is built again without running saved code."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.noise.candidates import NoiseModel
from enhsim_tf.noise.surrogates import GaussianAutoregression, GaussianNoise, JointAutoregression
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
            return NoiseState({"kind": "gaussian" if model.root.any() else "none", "window": model.window}, {"root": model.root})
        case JointAutoregression():
            settings = {"kind": "autoregression", "window": model.channels[0].window}
            settings["innovation_sd"] = [each.innovation_sd for each in model.channels]
            arrays = {f"coefficients_{number}": each.coefficients for number, each in enumerate(model.channels)}
            return NoiseState(settings, arrays | {"correlation": model.correlation})
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
            return GaussianNoise(arrays["root"], settings["window"])
        case "autoregression":
            scales = [_positive(each) for each in settings["innovation_sd"]]
            orders = (arrays[f"coefficients_{number}"] for number in range(len(scales)))
            channels = [GaussianAutoregression(each, scale, settings["window"]) for each, scale in zip(orders, scales, strict=True)]
            return JointAutoregression(channels, arrays["correlation"])
        case "residual windows":
            return WindowBootstrap(arrays["windows"], arrays.get("starts"))
        case "matched residual windows":
            return MatchedWindowBootstrap(arrays["windows"], arrays["signals"], arrays.get("starts"))
    raise ValueError(f"unknown noise {str(settings['kind'])[:80]!r}")


def _positive(number: Any) -> float:
    if not (isinstance(number, int | float) and np.isfinite(number) and number > 0):
        raise ValueError(f"noise of scale {str(number)[:40]}")
    return float(number)
