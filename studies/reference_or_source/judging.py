"""Rows of the table: for each use and detector the share of windows that are flagged."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from studies.reference_or_source.detectors import conformal_threshold
from studies.reference_or_source.recordings import CRUDE, FITTED
from studies.reference_or_source.uses import OF_SIMULATOR, WITHOUT, Comparison, Scores
from studies.reference_or_source.windows import Judged, windows_of

NOMINAL = "nominal"
NONE = "none"
"""The simulator of a use that needs none."""
RATE = 0.01
"""Share of false alarms that thresholds are set for in simulated systems."""


def rows_of(system: Any, runs: Mapping[str, np.ndarray], seed: int) -> list[dict[str, Any]]:
    """The rows of a simulated system and seed, of every use and detector.

    Args:
        system: The system.
        runs: The arrays that `recordings.record` wrote.
        seed: The seed.
    """
    rows = []
    for simulator in (CRUDE, FITTED):
        windows = windows_of(system, runs, simulator, seed)
        for about, scores in scores_of(windows, simulator, seed, simulator == CRUDE):
            rows += [about | row for row in judged(windows, scores)]
    return rows


def scores_of(
    windows: Judged, simulator: str, seed: int, with_others: bool
) -> Iterator[tuple[dict[str, str], Scores]]:
    """The scores of all uses of a simulator and, if wanted, of those that need none, with the
    columns that name them.
    """
    uses = OF_SIMULATOR + (WITHOUT if with_others else ())
    for scores in Comparison(windows, seed).scores(uses):
        name = simulator if scores.use in OF_SIMULATOR else NONE
        yield {"simulator": name, "use": scores.use, "detector": scores.detector}, scores


def judged(windows: Judged, scores: Scores) -> list[dict[str, Any]]:
    """Counts alarms of one detector in one use.

    Returns:
        A row for nominal windows and one for each fault and severity. `found` is the share of
        windows beyond the threshold that known windows set; `found_alike` the share beyond the one
        that flags `RATE` of the nominal tested windows, so that uses can be compared at equal false
        alarms.
    """
    parts = [
        (kind, severity, scores.tested[windows.labels == number])
        for number, (kind, severity) in enumerate(((NOMINAL, 0.0), *windows.faults), -1)
    ]
    return list(flagged(parts, scores.known, parts[0][2], RATE))


def flagged(
    parts: Iterable[tuple[str, float, np.ndarray]],
    known: np.ndarray,
    alike: np.ndarray,
    rate: float,
) -> Iterator[dict[str, Any]]:
    """The shares of scores beyond thresholds.

    Args:
        parts: Kind, severity and scores of each part of what is judged.
        known: Scores that set the threshold of `found`.
        alike: Scores of which that of `found_alike` flags the rate.
        rate: Share of false alarms.

    Yields:
        A row for each part.
    """
    limits = {
        "found": conformal_threshold(known, rate),
        "found_alike": float(np.quantile(alike, 1 - rate)),
    }
    for kind, severity, scores in parts:
        shares = {name: float(np.mean(scores > limit)) for name, limit in limits.items()}
        yield {"kind": kind, "severity": severity} | shares
