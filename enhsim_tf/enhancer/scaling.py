"""Standardisation for an enhancer with several coarse columns: each column and the target are centred and scaled."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

_NEGLIGIBLE = 1e-6  # a deviation below this share of the largest value is rounding, and the column counts as constant


@dataclasses.dataclass(frozen=True)
class Scaling:
    """Centres and scales of the coarse columns and of the target.

    Each column has one scale for all samples of a window, so that samples that are always the same do no harm. A constant
    column has the scale 1.

    Args:
        input_centre: Mean of each column.
        input_scale: Standard deviation of each column.
        target_centre: Mean of the targets.
        target_scale: Standard deviation of the targets.
    """

    input_centre: tuple[float, ...]
    input_scale: tuple[float, ...]
    target_centre: float
    target_scale: float

    @classmethod
    def fit(cls, inputs: np.ndarray, targets: np.ndarray) -> "Scaling":
        """Measures the scaling of windows.

        Args:
            inputs: Coarse windows, shape `(windows, samples, columns)`.
            targets: Telemetry windows, shape `(windows, outputs)`.
        """
        columns = [_centre_and_scale(inputs[:, :, number]) for number in range(inputs.shape[2])]
        return cls(tuple(each[0] for each in columns), tuple(each[1] for each in columns), *_centre_and_scale(targets))

    def scale_inputs(self, inputs: np.ndarray) -> np.ndarray:
        """Converts coarse windows to the rows of a network.

        Args:
            inputs: Coarse windows, shape `(windows, samples, columns)` or, for one column, `(windows, samples)`.

        Returns:
            float32 array of shape `(windows, samples * columns)`; the columns of one sample are adjacent.
        """
        inputs = np.asarray(inputs)
        inputs = inputs[:, :, None] if inputs.ndim == 2 else inputs
        scaled = (inputs - np.asarray(self.input_centre)) / np.asarray(self.input_scale)
        return scaled.reshape(len(inputs), inputs.shape[1] * inputs.shape[2]).astype(np.float32)

    def scale_target(self, targets: np.ndarray) -> np.ndarray:
        """Converts telemetry windows to the units of a network, float32 of the same shape."""
        return ((np.asarray(targets, np.float64) - self.target_centre) / self.target_scale).astype(np.float32)

    def unscale_target(self, outputs: np.ndarray) -> np.ndarray:
        """Converts outputs of a network to the unit of the telemetry, float32 of the same shape."""
        return (self.target_centre + self.target_scale * np.asarray(outputs, np.float64)).astype(np.float32)

    def get_config(self) -> dict[str, Any]:
        """Returns the scaling in plain JSON types."""
        return {name: list(value) if isinstance(value, tuple) else value for name, value in dataclasses.asdict(self).items()}

    @classmethod
    def from_config(cls, config: Mapping[str, Any]) -> "Scaling":
        """Restores a scaling from the output of `get_config`."""

        def numbers(values: Sequence[float]) -> tuple[float, ...]:
            return tuple(float(value) for value in values)

        return cls(
            numbers(config["input_centre"]),
            numbers(config["input_scale"]),
            float(config["target_centre"]),
            float(config["target_scale"]),
        )


def _centre_and_scale(values: np.ndarray) -> tuple[float, float]:
    centre, scale = float(np.mean(values, dtype=np.float64)), float(np.std(values, dtype=np.float64))
    return centre, scale if scale > _NEGLIGIBLE * float(np.abs(values).max(initial=0)) else 1.0
