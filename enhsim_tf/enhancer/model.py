"""A fitted enhancer: maps coarse windows of all columns to telemetry windows of all channels (section 2.2). It needs no TensorFlow."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

_CHUNK = 4_096  # windows that are mapped at a time
_MOST_LAYERS = 100


@dataclasses.dataclass(frozen=True, eq=False)
class Enhancer:
    """A map from coarse windows to telemetry windows: a linear map, a stack of Dense layers with relu, or the sum of both.

    Args:
        name: Name of the candidate, one of `candidates.CANDIDATES`.
        window: Length of a window in samples.
        columns: Number of coarse columns.
        channels: Number of channels.
        centre: Centre of each coarse column, float32 of shape `(columns,)`, which is subtracted first.
        bias: Output for coarse windows at their centre, float32 of shape `(window * channels,)`.
        factors: Matrices whose product maps flat windows, shape `(windows, window * columns)`, to outputs; none for no linear map.
        layers: Kernel and bias of each Dense layer of a network beside the linear map.
        main: For the candidates that keep the shape of the coarse simulator: for each channel its column, and its gain; otherwise None.
        penalties: Penalty of each channel in the ridge regression; they are not saved.
    """

    name: str
    window: int
    columns: int
    channels: int
    centre: np.ndarray
    bias: np.ndarray
    factors: tuple[np.ndarray, ...] = ()
    layers: tuple[tuple[np.ndarray, np.ndarray], ...] = ()
    main: tuple[np.ndarray, np.ndarray] | None = None
    penalties: tuple[float, ...] = ()

    def predict(self, inputs: np.ndarray) -> np.ndarray:
        """Maps coarse windows to enhanced windows.

        Args:
            inputs: Coarse windows, shape `(windows, samples, columns)`.

        Returns:
            float32 array of shape `(windows, samples, channels)`.
        """
        outputs = np.empty((len(inputs), self.window, self.channels), np.float32)
        for first in range(0, len(inputs), _CHUNK):
            self._map(np.asarray(inputs[first : first + _CHUNK], np.float32) - self.centre, outputs[first : first + _CHUNK])
        return outputs

    def _map(self, inputs: np.ndarray, outputs: np.ndarray) -> None:
        if self.main is not None:
            column, gain = self.main
            outputs[:] = inputs[:, :, column] * gain + self.bias.reshape(self.window, self.channels)
            return
        rows = mapped = inputs.reshape(len(inputs), -1)
        flat = outputs.reshape(len(inputs), -1)  # a view
        for factor in self.factors[:-1]:
            mapped = mapped @ factor
        if self.factors:
            np.matmul(mapped, self.factors[-1], out=flat)
            flat += self.bias
        else:
            flat[:] = self.bias
        if self.layers:
            for number, (kernel, bias) in enumerate(self.layers, 1):
                rows = rows @ kernel
                rows += bias
                if number < len(self.layers):
                    np.maximum(rows, 0, out=rows)
            flat += rows

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """All numbers by name, from which `from_arrays` builds the enhancer again."""
        found = {"centre": self.centre, "bias": self.bias}
        found |= {f"factor_{number}": each for number, each in enumerate(self.factors)}
        for number, (kernel, bias) in enumerate(self.layers):
            found |= {f"kernel_{number}": kernel, f"bias_{number}": bias}
        return found | (dict(zip(("column", "gain"), self.main, strict=True)) if self.main else {})

    @property
    def settings(self) -> dict[str, Any]:
        """Name and sizes, in plain JSON types."""
        return {name: getattr(self, name) for name in ("name", "window", "columns", "channels")}

    @classmethod
    def from_arrays(cls, settings: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> "Enhancer":
        """Builds an enhancer again.

        Args:
            settings: As `Enhancer.settings`.
            arrays: As `Enhancer.arrays`.

        Raises:
            ValueError: If they are not those of an enhancer; the message gives the reason.
        """
        window, columns, channels = (int(settings[name]) for name in ("window", "columns", "channels"))
        factors = tuple(arrays[f"factor_{number}"] for number in range(2) if f"factor_{number}" in arrays)
        number = sum(name.startswith("kernel_") for name in arrays)
        if number > _MOST_LAYERS or min(window, columns, channels) < 1:
            raise ValueError("an enhancer of impossible size")
        layers = tuple((arrays[f"kernel_{each}"], arrays[f"bias_{each}"]) for each in range(number))
        main = (arrays["column"], arrays["gain"]) if "column" in arrays else None
        for chain in (factors, [kernel for kernel, _ in layers]):
            sizes = [window * columns, *(each.shape[-1] if each.ndim == 2 else -1 for each in chain)]
            fits = all(each.ndim == 2 and len(each) == size for each, size in zip(chain, sizes, strict=False))
            if chain and not (fits and sizes[-1] == window * channels):
                raise ValueError("matrices of the enhancer that do not fit together")
        if arrays["centre"].shape != (columns,) or arrays["bias"].shape != (window * channels,):
            raise ValueError("an enhancer whose centre or bias has another shape")
        if any(bias.shape != kernel.shape[1:] for kernel, bias in layers):
            raise ValueError("a layer of the enhancer with a bias of another shape")
        if main is not None and not (main[0].shape == main[1].shape == (channels,) and ((main[0] >= 0) & (main[0] < columns)).all()):
            raise ValueError("an enhancer with columns that do not exist")
        if not (factors or layers or main) or not all(np.isfinite(each).all() for each in arrays.values()):
            raise ValueError("an enhancer without a map, or whose numbers are not finite")
        as_float = {name: each.astype(np.float32) for name, each in arrays.items()}
        factors = tuple(each.astype(np.float32) for each in factors)
        layers = tuple((kernel.astype(np.float32), bias.astype(np.float32)) for kernel, bias in layers)
        if main is not None:
            main = (main[0].astype(np.int64), main[1].astype(np.float32))
        return cls(str(settings["name"]), window, columns, channels, as_float["centre"], as_float["bias"], factors, layers, main)
