"""Commands as a coarse run: traces of the commands that explain a channel (step 3 of the pipeline).

A command is one sample long, but its effect lasts: its trace rises by 1 when the command is sent and decays exponentially, as fast as suits the
telemetry best.
"""

from collections.abc import Sequence

import numpy as np

from enhsim_tf.coarse_simulator.recording import Recording, Run
from enhsim_tf.common.errors import InputError

DECAYS = (0.0, 8.0, 64.0, 512.0)  # samples in which a trace falls to 1/e; 0 is the command itself
MOST_COMMANDS = 8  # further commands add inputs of the enhancer, but seldom information


class CommandTraces:
    """Traces of chosen commands: of each the number, from 1 as the columns of the array, and its decay in samples."""

    def __init__(self, chosen: Sequence[tuple[int, float]]):
        self.chosen = tuple((int(number), float(decay)) for number, decay in chosen)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the coarse columns."""
        return tuple(
            f"command {number}" + (f", decay {decay:g}" if decay else "")
            for number, decay in self.chosen
        )

    @classmethod
    def fit(
        cls, values: np.ndarray, commands: np.ndarray, rows: np.ndarray | None = None
    ) -> "CommandTraces | None":
        """Chooses at most `MOST_COMMANDS` commands of shape `(samples, commands)`, and the decay of each, that are most correlated with telemetry.

        The choice is made from these rows, None for all; the result is None if no command was sent.
        """
        rows = np.arange(len(values)) if rows is None else rows
        centred = np.asarray(values, np.float64)[rows] - np.mean(values[rows], dtype=np.float64)
        found = []
        for number in np.flatnonzero(np.ptp(commands, axis=0) > 0):
            traces = np.stack([_trace(commands[:, number], decay)[rows] for decay in DECAYS])
            traces -= traces.mean(axis=1, keepdims=True)
            squared = (traces @ centred) ** 2 / np.maximum(np.sum(traces**2, axis=1), 1e-300)
            best = int(np.argmax(squared))
            found.append((float(squared[best]), int(number) + 1, DECAYS[best]))
        found = sorted(found, key=lambda each: -each[0])[:MOST_COMMANDS]
        return cls(sorted((number, decay) for _, number, decay in found)) if found else None

    def traces(self, commands: np.ndarray) -> np.ndarray:
        """Computes the coarse columns, float32 of shape `(samples, traces)`; raises InputError for fewer commands than in the fit."""
        most = max(number for number, _ in self.chosen)
        if np.ndim(commands) != 2 or np.shape(commands)[1] < most:
            raise InputError(
                f"Expected at least {most} columns of commands, as in the fit. Received: shape {np.shape(commands)}."
            )
        return np.stack(
            [_trace(commands[:, number - 1], decay) for number, decay in self.chosen], axis=1
        ).astype(np.float32)

    def recording(self, commands: np.ndarray) -> Recording:
        """Returns the coarse run of telemetry without times, whose samples are counted from 0; see `traces`."""
        return Recording((Run(self.traces(commands)),), self.columns, name="the commands")


def _trace(command: np.ndarray, decay: float) -> np.ndarray:
    """Returns the trace of one command, float64: 1 where it is sent, and an exponential decay after it."""
    from scipy.signal import lfilter  # takes a second to import

    command = np.asarray(command, np.float64)
    return lfilter([1.0], [1.0, -np.exp(-1 / decay)], command) if decay else command.copy()
