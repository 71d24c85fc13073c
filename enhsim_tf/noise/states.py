"""What is saved of a noise model, and noise models made again from it.

The networks of a GAN are saved as networks. Every other model consists of arrays, from which it is built again without running saved
code.
"""

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from enhsim_tf.noise.surrogates import GaussianAutoregression, GaussianNoise
from enhsim_tf.noise.window_bootstrap import MatchedWindowBootstrap, WindowBootstrap

if TYPE_CHECKING:
    from enhsim_tf.keras_tools.backend import keras

_GAN = "networks"
_KINDS = {
    GaussianNoise: "gaussian",
    GaussianAutoregression: "autoregression",
    WindowBootstrap: "residual windows",
    MatchedWindowBootstrap: "matched residual windows",
}
_AUTOREGRESSIVE_NETWORK = "autoregressive network"
# beginnings of the names of its arrays
_WEIGHT, _PREDICTION, _PAST = "weight_", "prediction_", "past_"
_CALIBRATION, _SELECTION = "calibration_", "selection_"
_OLD_NAMES = {"resampled": "residual windows"}  # of models that were saved before


@dataclasses.dataclass(frozen=True)
class NoiseState:
    """What is saved of a noise model.

    Args:
        settings: Kind and numbers, in plain JSON types.
        networks: The networks of a GAN by name; otherwise empty.
        arrays: The arrays of any other model by name; otherwise empty.
    """

    settings: Mapping[str, Any]
    networks: "Mapping[str, keras.Model]" = dataclasses.field(default_factory=dict)
    arrays: Mapping[str, np.ndarray] = dataclasses.field(default_factory=dict)

    @property
    def is_finite(self) -> bool:
        """Whether all numbers of the model are finite."""
        weights = [weight for network in self.networks.values() for weight in network.get_weights()]
        numbers = [value for value in self.settings.values() if isinstance(value, float)]
        return all(np.isfinite(each).all() for each in (*weights, *self.arrays.values(), np.array(numbers)))


def state_of(model: Any) -> NoiseState:
    """Returns what is saved of a noise model.

    Args:
        model: A noise model of any rung of the ladder.

    Raises:
        TypeError: If the model is of another class.
    """
    kind = _KINDS.get(type(model))
    if kind == "gaussian":
        return NoiseState({"kind": kind, "window": model.window}, arrays={"standard_deviation": np.array(model.standard_deviation)})
    if kind == "autoregression":
        settings = {"kind": kind, "window": model.window, "innovation_sd": model.innovation_sd}
        return NoiseState(settings, arrays={"coefficients": model.coefficients})
    if kind in ("residual windows", "matched residual windows"):
        arrays = {name: getattr(model, name, None) for name in ("windows", "signals", "starts")}
        return NoiseState({"kind": kind}, arrays={name: each for name, each in arrays.items() if each is not None})
    from enhsim_tf.noise.autoregressive_network import TAILS, AutoregressiveNetwork
    from enhsim_tf.noise.gan import NoiseGAN

    if isinstance(model, AutoregressiveNetwork):
        arrays = {f"{_WEIGHT}{number:02}": weight for number, weight in enumerate(model.network.get_weights())}
        if model.prediction is not None:
            arrays |= {_PREDICTION + name: values for name, values in model.prediction.arrays.items()}
        if model.selection is not None:
            arrays |= {_SELECTION + name: values for name, values in model.selection.arrays.items()}
        if model.pasts is not None:
            arrays |= {_PAST + name: values for name, values in state_of(model.pasts).arrays.items()}
        if model.calibration is not None:
            arrays |= {_CALIBRATION + "edges": model.calibration.edges, _CALIBRATION + "density": model.calibration.density}
        return NoiseState({"kind": _AUTOREGRESSIVE_NETWORK, "tails": TAILS} | model.get_config(), arrays=arrays)
    if isinstance(model, NoiseGAN):
        return NoiseState({"kind": _GAN} | model.get_config(), {"generator": model.generator, "discriminator": model.discriminator})
    raise TypeError(f"Expected a noise model of the ladder. Received: {type(model).__name__}.")


def model_from(settings: Mapping[str, Any], networks: "Mapping[str, keras.Model]", arrays: Mapping[str, np.ndarray]) -> Any:
    """Makes a noise model again.

    Args:
        settings: As in `NoiseState`. Settings without a kind are those of a GAN.
        networks: As in `NoiseState`.
        arrays: As in `NoiseState`.

    Returns:
        The noise model.

    Raises:
        ValueError: If the settings do not describe a noise model, or a number is not finite.
    """
    kind = _OLD_NAMES.get(settings.get("kind", _GAN), settings.get("kind", _GAN))
    values = {name: value for name, value in settings.items() if name != "kind"}
    if not all(np.isfinite(np.asarray(each, np.float64)).all() for each in arrays.values()):
        raise ValueError("noise that is not finite")
    if kind == "gaussian":
        return GaussianNoise(abs(float(arrays["standard_deviation"])), values["window"])
    if kind == "autoregression":
        return GaussianAutoregression(arrays["coefficients"], _positive(values["innovation_sd"]), values["window"])
    if kind == "residual windows":
        return WindowBootstrap(arrays["windows"], arrays.get("starts"))
    if kind == "matched residual windows":
        return MatchedWindowBootstrap(arrays["windows"], arrays["signals"], arrays.get("starts"))
    if kind == _AUTOREGRESSIVE_NETWORK:
        from enhsim_tf.noise.autoregressive_network import AutoregressiveNetwork
        from enhsim_tf.noise.calibration import Calibration
        from enhsim_tf.noise.linear_prediction import LinearPrediction
        from enhsim_tf.noise.selection import Selection

        _positive(values["scale"])
        if not (2 <= values["window"] <= 1_000_000 and 0 < values["num_components"] * values["units"] <= 1_000_000):
            raise ValueError("a noise network of an impossible size")
        tails = str(values.pop("tails", "softplus"))  # models that were saved before do not say
        model = AutoregressiveNetwork(**{"sees_predictions": False, "sees_changes": False, "num_rare": 2} | values)
        model.set_weights([arrays[name] for name in sorted(arrays) if name.startswith(_WEIGHT)], tails)
        predictions, pasts, calibration, selection = (
            {name.removeprefix(kind): each for name, each in arrays.items() if name.startswith(kind)}
            for kind in (_PREDICTION, _PAST, _CALIBRATION, _SELECTION)
        )
        if model.sees_predictions:
            model.prediction = LinearPrediction.from_arrays(predictions, model.window)
        if pasts:
            model.pasts = model_from({"kind": "matched residual windows" if model.follows_signal else "residual windows"}, {}, pasts)
            if model.pasts.windows.shape[1] >= model.window:
                raise ValueError("a noise network with a past of a window or more")
        if selection:
            model.selection = Selection.from_arrays(selection, model.window)
        if calibration:
            model.calibration = Calibration(calibration["edges"], calibration["density"])
        return model
    if kind == _GAN:
        from enhsim_tf.noise.gan import NoiseGAN

        return NoiseGAN(networks["generator"], networks["discriminator"], **values)
    raise ValueError(f"unknown noise {str(kind)[:80]!r}")


def _positive(number: Any) -> float:
    if not (isinstance(number, int | float) and np.isfinite(number) and number > 0):
        raise ValueError(f"noise of scale {str(number)[:40]}")
    return float(number)
