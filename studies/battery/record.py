"""Records the runs of both simulators that a replicate of the study works with: nominal orbits and faults, in one folder."""

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from enhsim_tf.common.atomic_files import write_json
from enhsim_tf.common.console import SILENT, Progress
from enhsim_tf.common.stages import load_arrays, save_arrays
from studies.battery.faults import ALL, Fault
from studies.battery.orbits import Regime, draw_load
from studies.battery.simulate import MODELS, simulate_all

PARTS = {
    "fit": ((None,), tuple(MODELS)),
    "more": ((None,), tuple(MODELS)),
    "test": ((None,), tuple(MODELS)),
    "fault": ((None, *ALL), tuple(MODELS)),
    "coarse": ((None,), ("coarse",)),
}
"""For each part its faults and its simulators. The enhanced simulator is fitted to `fit`. Detectors learn more real telemetry from
`more`, everything is judged on `test` and `fault`, and training data are generated from `coarse`."""


@dataclasses.dataclass(frozen=True)
class Recorded:
    """The runs of a replicate.

    Args:
        runs: float32 arrays of shape `(samples, 3)` with the columns `simulate.COLUMNS`, by `part/fault/model`.
        about: `num_runs`, and `reduced`: how often the current was reduced, for each run in which it was.
    """

    runs: dict[str, np.ndarray]
    about: dict[str, Any]

    def get(self, part: str, model: str, fault: Fault | None = None) -> np.ndarray:
        """Returns a run, shape `(samples, 3)`.

        Args:
            part: A key of `PARTS`.
            model: `coarse` or `fine`.
            fault: The fault; None for nominal.
        """
        return self.runs[f"{part}/{key_of(fault)}/{model}"]


def key_of(fault: Fault | None) -> str:
    """The name of a fault at its severity in files, or `nominal`."""
    return "nominal" if fault is None else f"{fault.kind} {fault.severity:g}"


def record(folder: Path, counts: Mapping[str, int], regime: Regime, seed: int, progress: Progress = SILENT) -> None:
    """Simulates all runs of a replicate and writes them.

    Each part has loads of its own, drawn with the seed. All faults of a part share one load, and begin after its first orbit.

    Args:
        folder: An existing folder, to which `runs.npz` and `about.json` are written.
        counts: Number of orbits of each of `PARTS`. Each run has one more, its first, in which the battery reaches its usual temperature.
        regime: How hard the battery is used.
        seed: Seed of the loads.
        progress: Reports the progress.

    Raises:
        InputError: If PyBaMM is not installed, or a solver fails at any current.
    """
    arrays: dict[str, np.ndarray] = {}
    reduced: dict[str, int] = {}
    told = progress.loop("part", len(PARTS))
    for number, (part, (faults, models)) in enumerate(PARTS.items()):
        load = draw_load(counts[part] + 1, regime, np.random.default_rng([seed, number]))
        for fault, runs in zip(faults, simulate_all(load, regime, faults, [MODELS[name] for name in models]), strict=True):
            for model, run in zip(models, runs, strict=True):
                arrays[f"{part}/{key_of(fault)}/{model}"] = run.values
            if runs[0].reductions:
                reduced[f"{part}/{key_of(fault)}"] = runs[0].reductions
        told(number + 1)
    save_arrays(folder, arrays, "runs")
    write_json(folder / "about.json", {"reduced": reduced, "num_runs": len(arrays)})


def read(folder: Path) -> Recorded:
    """Reads what `record` wrote."""
    return Recorded(load_arrays(folder, "runs"), json.loads((folder / "about.json").read_text(encoding="utf-8")))
