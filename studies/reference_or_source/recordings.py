"""The runs of a simulated system that one seed works with: nominal and under faults, of the real
system and of the coarse simulator, as published and fitted.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from enhsim_tf.common.console import SILENT, Progress
from enhsim_tf.common.stages import save_arrays

FITTED = "fitted physics"
"""The simulator with wrong physics after a few of its parameters were fitted to telemetry by least
squares.
"""
CRUDE = "wrong physics"
_PARTS = ("fit", "test", "source")


def record(
    system: Any, counts: Mapping[str, int], seed: int, folder: Path, progress: Progress = SILENT
) -> None:
    """Simulates all runs of a seed and writes them to `runs.npz`.

    Args:
        system: A system, `aircraft.Aircraft` or `battery.Battery`.
        counts: Number of units of `fit`, `test`, `source`, of the telemetry that parameters are
            fitted to (`parameters`), and of a run under each fault (`fault`).
        seed: Seed of the commands.
        folder: An existing folder.
        progress: Reports the progress.
    """
    arrays: dict[str, np.ndarray] = {}
    commands = {part: commands_of(system, part, counts[part], seed) for part in _PARTS}
    for number, part in enumerate(("fit", "test")):
        (arrays[f"{part}/real"],) = system.run_real(
            commands[part], rng=np.random.default_rng([seed, 60, number])
        )
    kinds = kinds_of(system)
    told = progress.loop("kinds of faults", len(kinds))
    for number, kind in enumerate(kinds):
        commands[kind] = commands_of(system, kind, counts["fault"], seed)
        faults = [fault for fault in system.faults if fault.kind == kind]
        rng = np.random.default_rng([seed, 61, number])
        for fault, run in zip(faults, system.run_real(commands[kind], faults, rng), strict=True):
            arrays[f"{key_of(fault)}/real"] = run
        told(number + 1)
    # commands are drawn unit by unit, so that the first ones are those of `fit`
    few = counts["parameters"] * system.unit_samples
    measured = system.measure(arrays["fit/real"][:few], np.random.default_rng([seed, 50]))
    fitted = fit_parameters(
        system, commands_of(system, "fit", counts["parameters"], seed), measured
    )
    for part, given in commands.items():
        arrays[f"{part}/{CRUDE}"] = system.run_coarse(given, system.first_values)
        arrays[f"{part}/{FITTED}"] = system.run_coarse(given, fitted)
    save_arrays(folder, arrays, "runs")


def commands_of(system: Any, part: str, num_units: int, seed: int) -> np.ndarray:
    """Draws the commands of a part of the runs: `fit`, `test`, `source` or a kind of fault."""
    streams = {name: number for number, name in enumerate(_PARTS)}
    streams |= {kind: 10 + number for number, kind in enumerate(kinds_of(system))}
    return system.draw_commands(num_units, np.random.default_rng([seed, streams[part]]))


def kinds_of(system: Any) -> list[str]:
    """The kinds of faults of a system."""
    return list(dict.fromkeys(fault.kind for fault in system.faults))


def key_of(fault: Any) -> str:
    """The name of a fault at its severity."""
    return f"{fault.kind} {fault.severity:g}"


def fit_parameters(system: Any, commands: np.ndarray, telemetry: np.ndarray) -> np.ndarray:
    """Fits the parameters of the simulator with wrong physics by least squares, as an engineer
    without networks would.

    Returns:
        The values of `system.parameters` that lead from the commands to telemetry of shape
        `(samples, channels)`.
    """
    number = telemetry.shape[1]

    def values(moved: np.ndarray) -> np.ndarray:
        # from 1, since the steps of the derivative are relative
        return system.first_values + (moved - 1) * system.steps

    def errors(moved: np.ndarray) -> np.ndarray:
        run = system.run_coarse(commands, values(moved))
        return errors_of(run[:, :number], telemetry)

    bounds = 1 + np.asarray(system.bounds[0]), 1 + np.asarray(system.bounds[1])
    return values(
        least_squares(
            errors, np.ones(len(system.parameters)), diff_step=0.1, max_nfev=15, bounds=bounds
        ).x
    )


def errors_of(run: np.ndarray, telemetry: np.ndarray) -> np.ndarray:
    """The differences of a run from telemetry whose squares a fit makes least, in standard
    deviations of each channel and without an offset, which detectors do not mind either.
    """
    apart = (run - telemetry) / telemetry.std(axis=0)
    return (apart - apart.mean(axis=0)).ravel()
