"""The runs of a system that one seed works with: nominal and under faults, of the real system and of every coarse simulator."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from enhsim_tf.common.console import SILENT, Progress
from enhsim_tf.common.stages import save_arrays

FITTED = "fitted physics"
"""The simulator with wrong physics after a few of its parameters were fitted to telemetry by least squares."""
CRUDE = "wrong physics"
COMMANDS = "commands only"
"""No simulator: the commands alone are what an enhancer maps to telemetry."""
_PARTS = ("fit", "test", "source")


def record(
    system: Any, counts: Mapping[str, int], seed: int, folder: Path, progress: Progress = SILENT
) -> None:
    """Simulates all runs of a seed and writes them to `runs.npz`.

    Args:
        system: A system, `aircraft.Aircraft` or `battery.Battery`.
        counts: Number of units of `fit`, `test`, `source`, of the telemetry that parameters are fitted to (`parameters`), and of a run
            under each fault (`fault`).
        seed: Seed of the commands.
        folder: An existing folder.
        progress: Reports the progress.
    """
    arrays: dict[str, np.ndarray] = {}
    commands = {
        part: _commands(system, counts[part], seed, number) for number, part in enumerate(_PARTS)
    }
    kinds = list(dict.fromkeys(fault.kind for fault in system.faults))
    told = progress.loop("runs", 1 + len(system.simulators))
    for number, part in enumerate(("fit", "test")):
        (arrays[f"{part}/real"],) = system.run_real(
            commands[part], rng=np.random.default_rng([seed, 60, number])
        )
    faulty = {
        kind: (_commands(system, counts["fault"], seed, 10 + number), _of_kind(system, kind))
        for number, kind in enumerate(kinds)
    }
    simulated = {
        kind: (_commands(system, counts["fault"], seed, 30 + number), _of_kind(system, kind))
        for number, kind in enumerate(kinds)
    }
    for number, (given, faults) in enumerate(faulty.values()):
        for fault, run in zip(
            faults,
            system.run_real(given, faults, np.random.default_rng([seed, 61, number])),
            strict=True,
        ):
            arrays[f"{key_of(fault)}/real"] = run
    told(1)
    # commands are drawn unit by unit, so that the first ones are those of `fit`
    few = counts["parameters"] * system.unit_samples
    measured = system.measure(arrays["fit/real"][:few], np.random.default_rng([seed, 50]))
    values = fit_parameters(system, _commands(system, counts["parameters"], seed, 0), measured)
    for number, simulator in enumerate((*system.simulators, FITTED), 1):
        name, given_values = (CRUDE, values) if simulator == FITTED else (simulator, None)
        for part in _PARTS:
            arrays[f"{part}/{simulator}"] = system.run_coarse(
                name, commands[part], values=given_values
            )[0]
        for kind in kinds:
            planned = system.run_coarse(name, faulty[kind][0], values=given_values)[0]
            given, faults = simulated[kind]
            able = system.can_simulate(name, kind)
            runs = system.run_coarse(name, given, [None, *faults] if able else [None], given_values)
            for place, fault in enumerate(faults, 1):
                arrays[f"{key_of(fault)}/{simulator}"] = planned
                if able:
                    arrays[f"{key_of(fault)}/{simulator}/simulated"] = runs[place]
            arrays[f"{kind}/{simulator}/nominal"] = runs[0]
        told(min(1 + number, 1 + len(system.simulators)))
    save_arrays(folder, arrays, "runs")


def key_of(fault: Any) -> str:
    """The name of a fault at its severity."""
    return f"{fault.kind} {fault.severity:g}"


def fit_parameters(system: Any, commands: np.ndarray, telemetry: np.ndarray) -> np.ndarray:
    """Fits the parameters of the simulator with wrong physics by least squares, as an engineer without networks would.

    Returns:
        The values of `system.parameters` that lead from the commands to telemetry of shape `(samples, channels)`.
    """
    scale, number = telemetry.std(axis=0), telemetry.shape[1]

    def values(moved: np.ndarray) -> np.ndarray:
        return (
            system.first_values + (moved - 1) * system.steps
        )  # from 1, since the steps of the derivative are relative

    def errors(moved: np.ndarray) -> np.ndarray:
        run = system.run_coarse(CRUDE, commands, values=values(moved))[0]
        apart = (run[:, :number] - telemetry) / scale
        return (apart - apart.mean(axis=0)).ravel()  # detectors do not mind an offset either

    bounds = 1 + np.asarray(system.bounds[0]), 1 + np.asarray(system.bounds[1])
    return values(
        least_squares(
            errors, np.ones(len(system.parameters)), diff_step=0.1, max_nfev=15, bounds=bounds
        ).x
    )


def _commands(system: Any, number: int, seed: int, stream: int) -> np.ndarray:
    return system.draw_commands(number, np.random.default_rng([seed, stream]))


def _of_kind(system: Any, kind: str) -> list[Any]:
    return [fault for fault in system.faults if fault.kind == kind]
