"""A fitted enhancer: maps coarse windows of all columns to telemetry windows of all channels, or a whole run (section 2.2, without TensorFlow)."""

import dataclasses
from collections.abc import Callable

import numpy as np

_CHUNK = 4_096  # windows that are mapped at a time
_AVERAGED = 512  # overlapping windows that are enhanced at a time


@dataclasses.dataclass(frozen=True, eq=False)
class Enhancer:
    """A map from coarse windows to telemetry windows: a linear map, a stack of Dense layers with relu, or the sum of both."""

    name: str  # one of `candidates.CANDIDATES`
    window: int  # samples of a window
    columns: int
    channels: int
    centre: (
        np.ndarray
    )  # of each coarse column, which is subtracted first, float32 of shape `(columns,)`
    bias: (
        np.ndarray
    )  # output for coarse windows at their centre, float32 of shape `(window * channels,)`
    factors: tuple[
        np.ndarray, ...
    ] = ()  # matrices whose product maps flat windows, shape `(windows, window * columns)`, to outputs
    layers: tuple[
        tuple[np.ndarray, np.ndarray], ...
    ] = ()  # kernel and bias of each Dense layer of a network beside the linear map
    main: tuple[np.ndarray, np.ndarray] | None = (
        None  # for candidates that keep the coarse shape: the column of each channel, and its gain
    )

    def predict(self, inputs: np.ndarray) -> np.ndarray:
        """Maps coarse windows of shape `(windows, samples, columns)` to enhanced windows, float32 of shape `(windows, samples, channels)`."""
        outputs = np.empty((len(inputs), self.window, self.channels), np.float32)
        for first in range(0, len(inputs), _CHUNK):
            self._map(
                np.asarray(inputs[first : first + _CHUNK], np.float32) - self.centre,
                outputs[first : first + _CHUNK],
            )
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


def run_starts(num_samples: int, window: int, hop: int | None = None) -> np.ndarray:
    """Returns the starts of windows that cover a run, one each `hop` samples (None: a quarter of a window) and the last one at its end."""
    return np.unique(
        np.append(
            np.arange(0, num_samples - window + 1, hop or max(1, window // 4)), num_samples - window
        )
    )


def average_windows(
    windows_at: Callable[[slice], np.ndarray], starts: np.ndarray, window: int, num_samples: int
) -> np.ndarray:
    """Averages overlapping windows into one series `(num_samples, channels)`, with weights that fall to zero at both ends of a window.

    `windows_at` returns some of the windows, given by a slice of their numbers, and `starts` are their first samples.
    """
    fade = (np.sin(np.pi * (np.arange(window) + 0.5) / window) ** 2)[:, None]
    series, total = None, np.zeros((num_samples, 1))
    for first in range(0, len(starts), _AVERAGED):
        rows = slice(first, min(first + _AVERAGED, len(starts)))
        windows = windows_at(rows)
        series = np.zeros((num_samples, windows.shape[2])) if series is None else series
        for start, values in zip(starts[rows], windows, strict=True):
            series[start : start + window] += fade * values
            total[start : start + window] += fade
    return (series / total).astype(np.float32)
