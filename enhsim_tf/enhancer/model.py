"""A fitted enhancer: maps coarse windows of all columns to telemetry windows of all channels, or a
whole run (section 2.2, without TensorFlow).
"""

import dataclasses

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.windows import average_windows, cut, run_starts

_CHUNK = 4_096  # windows that are mapped at a time


@dataclasses.dataclass(frozen=True, eq=False)
class Enhancer:
    """A map from coarse windows to telemetry windows: a linear map, a stack of Dense layers with
    relu, or the sum of both.
    """

    name: str  # one of `candidates.CANDIDATES`
    window: int  # samples of a window
    columns: int
    channels: int
    # of each coarse column, which is subtracted first, float32 of shape `(columns,)`
    centre: np.ndarray
    # output for coarse windows at their centre, float32 of shape `(window * channels,)`
    bias: np.ndarray
    # matrices whose product maps flat windows, shape `(windows, window * columns)`, to outputs
    factors: tuple[np.ndarray, ...] = ()
    # kernel and bias of each Dense layer of a network beside the linear map
    layers: tuple[tuple[np.ndarray, np.ndarray], ...] = ()
    # for candidates that keep the coarse shape: the column of each channel, and its gain
    main: tuple[np.ndarray, np.ndarray] | None = None

    def predict(self, inputs: np.ndarray) -> np.ndarray:
        """Maps coarse windows of shape `(windows, samples, columns)` to enhanced windows, float32
        of shape `(windows, samples, channels)`.
        """
        outputs = np.empty((len(inputs), self.window, self.channels), np.float32)
        for first in range(0, len(inputs), _CHUNK):
            self._map(
                np.asarray(inputs[first : first + _CHUNK], np.float32) - self.centre,
                outputs[first : first + _CHUNK],
            )
        return outputs

    def enhance(
        self, coarse: np.ndarray, shift: np.ndarray | None = None, gain: np.ndarray | None = None
    ) -> np.ndarray:
        """Enhances coarse windows of shape `(windows, samples, columns)`; no noise is added (step 5
        of the paper's pipeline).

        `shift` and `gain` are offset and factor of each window and channel, shape `(windows,
        channels)`. The result is float32 of shape `(windows, samples, channels)`, in the
        telemetry's unit. Raises InputError if the shape is wrong or a value is not finite.
        """
        if np.ndim(coarse) != 3 or np.shape(coarse)[1:] != (self.window, self.columns):
            raise InputError(
                f"Expected coarse windows of shape (windows, {self.window}, {self.columns}). "
                f"Received: {np.shape(coarse)}."
            )
        enhanced = self.predict(coarse)
        if shift is not None and gain is not None:
            enhanced *= gain[:, None].astype(np.float32)
            enhanced += shift[:, None].astype(np.float32)
        return check_finite(enhanced)

    def enhance_run(self, coarse: np.ndarray) -> np.ndarray:
        """Enhances one run without gaps, in overlapping windows that are averaged; no noise is
        added.

        The run has the shape `(samples, columns)` and at least a window of samples; the result is
        float32 of shape `(samples, channels)`.
        """
        coarse = np.asarray(coarse, np.float32)
        if coarse.ndim != 2 or coarse.shape[1] != self.columns or len(coarse) < self.window:
            raise InputError(
                f"Expected a run of shape (samples, {self.columns}) with at least {self.window} "
                f"samples. Received: {coarse.shape}."
            )
        starts = run_starts(len(coarse), self.window)
        return average_windows(
            lambda rows: self.enhance(cut([coarse], starts[rows], self.window)),
            starts,
            self.window,
            len(coarse),
        )

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


def check_finite(windows: np.ndarray) -> np.ndarray:
    """Returns generated telemetry; raises InputError if a value is not finite."""
    bad = np.size(windows) - np.count_nonzero(np.isfinite(windows))
    if bad:
        raise InputError(
            f"Expected a simulator that generates finite values. Received: {bad:,} of "
            f"{np.size(windows):,} values that are not. Fit it again."
        )
    return windows
