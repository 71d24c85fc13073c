"""The cells of the study: a main grid over simulators and known telemetry, and the other axes one at a time."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from studies.reference_or_source.detectors import THRESHOLDS
from studies.reference_or_source.recordings import COMMANDS, CRUDE, FITTED
from studies.reference_or_source.uses import (
    NO_SIMULATOR,
    REFERENCE,
    REFERENCE_FAULTS,
    SOURCE,
    SOURCE_FAULTS,
    USES,
    Cell,
    Scores,
)
from studies.reference_or_source.windows import Judged, windows_of

NOMINAL = "nominal"
MAIN = "main"
_OF_SIMULATOR = tuple(use for use in USES if use != NO_SIMULATOR)


@dataclasses.dataclass(frozen=True)
class Point:
    """A point of the map.

    Args:
        axis: `main`, or the axis that is varied.
        level: Where on the axis.
        simulator: The coarse simulator.
        units: Known flights or orbits.
        uses: The uses that are tried.
        windows: What differs in the windows, see `windows.windows_of`.
        cell: What differs in the cell, see `uses.Cell`.
        by_severity: Whether each severity has a row; otherwise a kind of fault has one.
    """

    axis: str
    level: str
    simulator: str
    units: int
    uses: tuple[str, ...] = USES
    windows: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    cell: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    by_severity: bool = False


def points(system: Any, units: Sequence[int], middle: int) -> list[Point]:
    """The points of the map.

    Args:
        system: The system.
        units: Numbers of known units of the main grid.
        middle: The number of known units at which the other axes are tried.
    """
    found = [
        Point(
            MAIN,
            "",
            simulator,
            number,
            USES if simulator == CRUDE else _OF_SIMULATOR,
            by_severity=(simulator, number) == (CRUDE, middle),
        )
        for number in units
        for simulator in (CRUDE, FITTED, *(name for name in system.simulators if name != CRUDE))
    ]
    found += [Point(MAIN, "", COMMANDS, number, (REFERENCE,)) for number in units]
    one = {"simulator": CRUDE, "units": middle}
    found += [
        Point("noise", f"{factor:g} times", **one, windows={"noise": factor})
        for factor in (3.0, 10.0)
    ]
    found += [
        Point("commands", f"delayed, {how}", **one, uses=_OF_SIMULATOR, windows={"delay": how})
        for how in ("ignored", "aligned")
    ]
    found.append(Point("commands", "unknown", **one, uses=_OF_SIMULATOR, cell={"is_unknown": True}))
    found += [
        Point("enhancer", name, **one, uses=_OF_SIMULATOR, cell={"enhancer": name})
        for name in ("random features", "convolution")
    ]
    found += [
        Point(
            "noise draw",
            name,
            **one,
            uses=(SOURCE, SOURCE_FAULTS, REFERENCE_FAULTS),
            cell={"draws": name},
        )
        for name in ("separate", "randomised")
    ]
    found.append(Point("relations", "", **one, windows={"with_relations": True}))
    found.append(Point("threshold", "Pareto tail", **one))
    found.append(Point("kind", "not simulated", **one, uses=(SOURCE_FAULTS, REFERENCE_FAULTS)))
    return found


def rows_of(
    system: Any,
    runs: Mapping[str, np.ndarray],
    point: Point,
    seed: int,
    alone: dict[str, Scores] | None = None,
) -> list[dict[str, Any]]:
    """The rows of one point of the map: false alarms, and the share of windows found of each kind of fault.

    Args:
        system: The system.
        runs: The arrays that `recordings.record` wrote.
        point: The point.
        seed: The seed.
        alone: Scores without a simulator of points with the same telemetry, see `uses.Cell`.
    """
    windows = windows_of(system, runs, point.simulator, point.units, seed, **point.windows)
    cell, rows = Cell(windows, seed, **point.cell, alone=alone), []
    number = len(system.channels)
    coarse = (
        windows.known.telemetry - windows.known.coarse[:, :, :number] / windows.scale
        if point.simulator != COMMANDS
        else cell.residuals
    )
    errors = {"error": cell.residuals, "coarse_error": coarse - coarse.mean(axis=(0, 1))}
    limit = THRESHOLDS[point.level if point.axis == "threshold" else "conformal"]
    about = {
        "axis": point.axis,
        "level": point.level,
        "simulator": point.simulator,
        "units": point.units,
    }
    about |= {name: float(np.sqrt(np.mean(each**2))) for name, each in errors.items()}
    if point.axis == "kind":
        numbers = np.arange(len(windows.faults))
        for kind in dict.fromkeys(kind for kind, _ in windows.faults):
            left = [
                each
                for each in numbers
                if each in windows.simulated and windows.faults[each][0] != kind
            ]
            for scores in cell.classified(left, point.uses):
                rows += [
                    row
                    for row in judged(system, windows, scores, limit, False)
                    if row["kind"] in (kind, NOMINAL)
                ]
    else:
        for scores in cell.scores(point.uses):
            rows += judged(system, windows, scores, limit, point.by_severity)
    return [about | row for row in rows]


def judged(
    system: Any,
    windows: Judged,
    scores: Scores,
    limit: Callable[[np.ndarray], float],
    by_severity: bool,
) -> list[dict[str, Any]]:
    """Counts alarms of one detector in one use at the threshold that `limit` sets on the known windows.

    Returns:
        A row for nominal windows, with `events`: the number of times a day that alarms begin; and one for each fault or kind of fault, whose
        severity is 0.
    """
    alarms = scores.tested > limit(scores.known)
    nominal = alarms[windows.labels < 0]
    days = len(nominal) * (system.window // 2) * system.interval_s / 86_400
    begins = int(nominal[0]) + int(np.sum(nominal[1:] & ~nominal[:-1]))
    about = {"use": scores.use, "detector": scores.detector}
    rows = [
        about
        | {
            "kind": NOMINAL,
            "severity": 0.0,
            "alarms": float(nominal.mean()),
            "events": begins / days,
        }
    ]
    found: dict[tuple[str, float], list[float]] = {}
    for number, (kind, severity) in enumerate(windows.faults):
        share = float(alarms[windows.labels == number].mean())
        found.setdefault((kind, severity if by_severity else 0.0), []).append(share)
    return rows + [
        about
        | {"kind": kind, "severity": severity, "alarms": float(np.mean(each)), "events": np.nan}
        for (kind, severity), each in found.items()
    ]
