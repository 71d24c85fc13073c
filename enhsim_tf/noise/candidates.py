"""The noise models among which a fit chooses (an extension of section 2.3): how they are fitted, saved and made again."""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.noise.names import CANDIDATES
from enhsim_tf.noise.surrogates import GaussianAutoregression, GaussianNoise, JointAutoregression
from enhsim_tf.noise.window_bootstrap import MatchedWindowBootstrap, WindowBootstrap

_MOST_ORDER = 200  # of the autoregression


class NoiseModel(Protocol):
    """What every noise model can do. Models that do not depend on the signal ignore it."""

    def generate(self, number: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws noise for `number` windows; `signal` is the enhanced signal of the same shape, in the telemetry's unit."""

    def generate_series(self, num_samples: int, rng: np.random.Generator, signal: np.ndarray | None = None) -> np.ndarray:
        """Draws one series of noise; `signal` is the enhanced signal of the same shape."""


def fit_candidate(name: str, noise: np.ndarray, signal: np.ndarray, starts: np.ndarray | None = None) -> NoiseModel:
    """Fits a noise model, one of `names.CANDIDATES`, to windows of noise; raises InputError if it cannot be fitted to this noise.

    Noise and the enhanced signal below it have the shape `(windows, samples, channels)`, or no last axis. `starts` are the first samples of the
    windows; None: no two overlap.
    """
    window = noise.shape[1]
    match name:
        case "none":
            return GaussianNoise(0.0 if noise.ndim == 2 else np.zeros((noise.shape[2],) * 2), window)
        case "gaussian":
            return GaussianNoise.fit(noise)
        case "autoregression":
            kind = GaussianAutoregression if noise.ndim == 2 else JointAutoregression
            return kind.fit(noise, min(_MOST_ORDER, window - 1))
        case "residual windows":
            return WindowBootstrap(noise, starts)
        case "matched residual windows":
            return MatchedWindowBootstrap.fit(noise, signal, starts)
    raise InputError(f"Expected a noise model among {', '.join(CANDIDATES)}. Received: {name!r}.")


def state_of(model: NoiseModel) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Returns what is saved of a noise model of all channels: its settings in plain JSON types, and its arrays by name."""
    match model:
        case GaussianNoise():
            return {"kind": "gaussian" if model.root.any() else "none", "window": model.window}, {"root": model.root}
        case JointAutoregression():
            settings = {"kind": "autoregression", "window": model.window, "innovation_sd": [each.innovation_sd for each in model.channels]}
            arrays = {f"coefficients_{number}": each.coefficients for number, each in enumerate(model.channels)}
            return settings, arrays | {"correlation": model.correlation}
        case WindowBootstrap() | MatchedWindowBootstrap():
            kind = "residual windows" if isinstance(model, WindowBootstrap) else "matched residual windows"
            arrays = {name: getattr(model, name, None) for name in ("windows", "signals", "starts")}
            return {"kind": kind}, {name: each for name, each in arrays.items() if each is not None}
    raise InputError(f"Expected a noise model of arrays. Received: {type(model).__name__}, which is not saved. Fit another noise model.")


def model_from(settings: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> NoiseModel:
    """Makes a noise model again from what `state_of` returned; raises ValueError if that is none, or a number is not finite."""
    if not all(np.isfinite(np.asarray(each, np.float64)).all() for each in arrays.values()):
        raise ValueError("noise that is not finite")
    match settings["kind"]:
        case "none" | "gaussian":
            return GaussianNoise(arrays["root"], settings["window"])
        case "autoregression":
            scales = settings["innovation_sd"]
            if not (np.isfinite(scales).all() and min(scales) > 0):
                raise ValueError(f"noise of scale {str(scales)[:40]}")
            channels = [GaussianAutoregression(arrays[f"coefficients_{k}"], scale, settings["window"]) for k, scale in enumerate(scales)]
            return JointAutoregression(channels, arrays["correlation"])
        case "residual windows":
            return WindowBootstrap(arrays["windows"], arrays.get("starts"))
        case "matched residual windows":
            return MatchedWindowBootstrap(arrays["windows"], arrays["signals"], arrays.get("starts"))
    raise ValueError(f"unknown noise {str(settings['kind'])[:80]!r}")
