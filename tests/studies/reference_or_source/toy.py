"""A system whose truth is known in closed form: two channels that follow a command, one twice as
strongly in reality as in the simulator.
"""

import dataclasses

import numpy as np


@dataclasses.dataclass(frozen=True)
class Offset:
    kind: str
    severity: float


class Toy:
    is_continuous = False
    unit_samples, window, onset = 200, 20, 50
    faults = (Offset("offset", 0.5), Offset("offset", 1.0), Offset("silence", 1.0))
    parameters, first_values = ("gain",), np.array([1.0])
    steps, bounds = np.array([0.5]), ((-10.0,), (10.0,))
    sd = 0.1

    def draw_commands(self, num_units, rng):
        return np.repeat(rng.standard_normal((num_units * self.unit_samples // 10, 1)), 10, axis=0)

    def _faulty(self, values, fault):
        values = values.copy()
        inside = np.arange(len(values)) % self.unit_samples >= self.onset
        if fault is not None and fault.kind == "offset":
            values[inside] += fault.severity * np.array([2.0, -1.0])  # like a command
        return values.astype(np.float32)

    def run_real(self, commands, faults=(None,), rng=None):
        return [
            self._faulty(np.concatenate([2 * commands, -commands], axis=1), fault)
            for fault in faults
        ]

    def run_coarse(self, commands, values):
        run = np.concatenate([values[0] * commands, -commands, commands], axis=1)
        return run.astype(np.float32)

    def as_inputs(self, commands):
        return commands

    def measure(self, values, rng):
        common = rng.standard_normal((len(values), 1))  # noise that the channels share
        return (values + self.sd * common).astype(np.float32)
