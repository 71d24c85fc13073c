"""Commands as a coarse run: traces of the commands that explain a channel (step 3 of the pipeline).

A command is one sample long, but its effect lasts. Commands after which the telemetry jumps, such as "on" and "off", become states: each is 1
from the command until another of this kind is sent. Other commands become traces that rise by 1 when the command is sent and decay
exponentially, as fast as suits the telemetry best.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from enhsim_tf.coarse_simulator.recording import Recording, Run
from enhsim_tf.common.errors import InputError

DECAYS = (0.0, 8.0, 64.0, 512.0)  # samples in which a trace falls to 1/e; 0 is the command itself
HELD = -1.0  # in place of a decay: a state that lasts until another command with a state is sent
MOST_COMMANDS = 8  # further commands add inputs of the enhancer, but seldom information
_AROUND = 8  # samples before and after a command whose means are compared
_LEAST_JUMP = 3.0  # mean jump after a command, in standard errors, from which the command counts as a state
_LEAST_SENT = 5  # times that such a command was sent


class CommandTraces:
    """Traces of chosen commands: of each the number, from 1 as the columns of the array, and its decay in samples, or `HELD`."""

    def __init__(self, chosen: Sequence[tuple[int, float]]):
        self.chosen = tuple((int(number), float(decay)) for number, decay in chosen)
        if not self.chosen:
            raise InputError("Expected at least one command. Received: none. Give telemetry with commands.")

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the coarse columns."""
        return tuple(
            f"command {number}" + (", until another" if decay == HELD else f", decay {decay:g}" if decay else "")
            for number, decay in self.chosen
        )

    @classmethod
    def fit(cls, values: np.ndarray, commands: np.ndarray, rows: np.ndarray | None = None) -> "CommandTraces | None":
        """Chooses at most `MOST_COMMANDS` commands of shape `(samples, commands)`, and the decay of each, that are most correlated with telemetry.

        The choice is made from these rows, None for all; the result is None if no command was sent.
        """
        rows = np.arange(len(values)) if rows is None else rows
        centred = np.asarray(values, np.float64)[rows] - np.mean(values[rows], dtype=np.float64)
        states = _states(np.asarray(values, np.float64), commands, rows)
        found = []
        for number in np.flatnonzero(np.ptp(commands, axis=0) > 0):
            if number + 1 in states:
                continue
            traces = np.stack([_trace(commands[:, number], decay)[rows] for decay in DECAYS])
            traces -= traces.mean(axis=1, keepdims=True)
            squared = (traces @ centred) ** 2 / np.maximum(np.sum(traces**2, axis=1), 1e-300)
            best = int(np.argmax(squared))
            found.append((float(squared[best]), int(number) + 1, DECAYS[best]))
        found = sorted(found, key=lambda each: -each[0])[: MOST_COMMANDS - len(states)]
        chosen = [(number, HELD) for number in states] + [(number, decay) for _, number, decay in found]
        return cls(sorted(chosen)) if chosen else None

    def traces(self, commands: np.ndarray) -> np.ndarray:
        """Computes the coarse columns, float32 of shape `(samples, traces)`; raises InputError for fewer commands than in the fit."""
        most = max(number for number, _ in self.chosen)
        if np.ndim(commands) != 2 or np.shape(commands)[1] < most:
            raise InputError(f"Expected at least {most} columns of commands, as in the fit. Received: shape {np.shape(commands)}.")
        held = _last_sent(commands, [number for number, decay in self.chosen if decay == HELD])
        traces = [held == number if decay == HELD else _trace(commands[:, number - 1], decay) for number, decay in self.chosen]
        return np.stack(traces, axis=1).astype(np.float32)

    def recording(self, commands: np.ndarray) -> Recording:
        """Returns the coarse run of telemetry without times, whose samples are counted from 0; see `traces`."""
        return Recording((Run(self.traces(commands)),), self.columns, name="the commands")

    def get_config(self) -> dict[str, Any]:
        """Returns the settings in plain JSON types."""
        return {"chosen": [list(each) for each in self.chosen]}

    @classmethod
    def from_config(cls, config: Mapping[str, Any]) -> "CommandTraces":
        """Restores the traces from the output of `get_config`."""
        return cls([(number, decay) for number, decay in config["chosen"]])


def _trace(command: np.ndarray, decay: float) -> np.ndarray:
    """Returns the trace of one command, float64: 1 where it is sent, and an exponential decay after it."""
    from scipy.signal import lfilter  # takes a second to import

    command = np.asarray(command, np.float64)
    return lfilter([1.0], [1.0, -np.exp(-1 / decay)], command) if decay else command.copy()


def _states(values: np.ndarray, commands: np.ndarray, rows: np.ndarray) -> list[int]:
    """Returns the numbers of the commands after which the telemetry jumps, those with the clearest jumps; none if there is only one."""
    sums = np.concatenate([[0.0], np.cumsum(values)])
    jumps = []
    for number in np.flatnonzero(np.ptp(commands, axis=0) > 0):
        at = np.intersect1d(np.flatnonzero(commands[:, number]), rows)
        at = at[(at >= _AROUND) & (at <= len(values) - _AROUND)]
        if len(at) < _LEAST_SENT:
            continue
        jump = (sums[at + _AROUND] - 2 * sums[at] + sums[at - _AROUND]) / _AROUND
        error = float(np.std(jump, ddof=1)) / np.sqrt(len(at))
        if abs(jump.mean()) > _LEAST_JUMP * error:
            jumps.append((abs(jump.mean()) / max(error, 1e-300), int(number) + 1))
    found = [number for _, number in sorted(jumps, reverse=True)[:MOST_COMMANDS]]
    return found if len(found) > 1 else []


def _last_sent(commands: np.ndarray, numbers: Sequence[int]) -> np.ndarray:
    """Returns, for each sample, which of the numbered commands was sent last, 0 before the first."""
    found = np.zeros(len(commands), np.int64)
    for number in numbers:
        found[np.flatnonzero(commands[:, number - 1])] = number
    last = np.maximum.accumulate(np.where(found > 0, np.arange(len(found)), -1))
    return np.where(last >= 0, found[last], 0)
