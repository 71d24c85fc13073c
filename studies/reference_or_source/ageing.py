"""Real cells as a system of the study: ageing is the fault, and sisters set the thresholds."""

import itertools
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from enhsim_tf.telemetry.windows import cut
from studies.reference_or_source.cell_simulators import (
    CAPACITY_AH,
    FIRST_VALUES,
    SIMULATORS,
    fit_values,
    open_circuit_curve,
)
from studies.reference_or_source.detectors import MAIN
from studies.reference_or_source.inputs import inputs_of
from studies.reference_or_source.judging import NONE, flagged, scores_of
from studies.reference_or_source.real_cells import (
    JUDGED,
    KNOWN,
    NUM_KNOWN,
    ODD,
    AgeingCell,
    Discharge,
)
from studies.reference_or_source.uses import (
    NO_SIMULATOR,
    REFERENCE,
    Comparison,
    Scores,
)
from studies.reference_or_source.windows import Judged, Windows, join

WINDOW = 64
STRIDE = 16
"""Samples of a window, and from one window to the next: the shortest discharge has four windows."""
RATE = 0.05
"""Share of false alarms that thresholds are set for: sisters have too few windows for less."""
FITTED = ", fitted"
"""Ends the name of a simulator whose parameters were fitted to the cell's known discharges."""
FEW = (0, 1, 2, 5)
"""Numbers of known discharges of a new cell, beside its sisters or without them."""
_APART = 100_000  # samples from one discharge to the next on the clock of a cell
_CHANNELS = 2  # voltage and temperature; the current is the command


def ageing_rows(cells: Sequence[AgeingCell]) -> Iterator[dict[str, Any]]:
    """The rows of all cells: the share of windows flagged of each discharge that was not learnt.

    Args:
        cells: As `real_cells.load_cells` returns them.

    Yields:
        Rows with group, cell, simulator, use and detector; `kind`, one of `KNOWN`, `JUDGED` and
        `ODD`; `severity`, the loss of capacity; `found` at the threshold that the known windows of
        the other cells of the group set, and `found_alike` at the one that flags `RATE` of the
        known windows of the cell itself. Known discharges have one row, of the windows of all.
    """
    for group, sisters in _groups(cells):
        curve = open_circuit_curve(cells, group)
        scores: dict[tuple[tuple[str, str], ...], dict[str, Scores]] = {}
        for cell in sisters:
            known = cell.of_use(KNOWN)
            for name, simulator in SIMULATORS.items():
                fitted = fit_values(simulator, known, cell.ambient_c, curve)
                for values, suffix in ((FIRST_VALUES, ""), (fitted, FITTED)):
                    windows = windows_of(cell, simulator, values, curve)
                    with_others = (name, suffix) == (next(iter(SIMULATORS)), "")
                    for about, each in scores_of(windows, name + suffix, 0, with_others):
                        scores.setdefault(tuple(about.items()), {})[cell.name] = each
        for about, by_cell in scores.items():
            for cell in sisters:
                others = [each.known for name, each in by_cell.items() if name != cell.name]
                own = by_cell[cell.name]
                for row in _rows_of(cell, own.known, own.tested, others):
                    yield dict(about) | row


def family_rows(cells: Sequence[AgeingCell]) -> Iterator[dict[str, Any]]:
    """The rows of models of sister cells with a few discharges of the new one, as `ageing_rows`.

    Thresholds come from the sisters, each of which is judged like the new cell, by a model that has
    learnt from the others and from as many of its own discharges. Groups of three cells or more are
    tried: otherwise the sister has no sister. `found_alike` flags `RATE` of the windows of the
    second half of the known discharges, from which nothing learns.

    Yields:
        Rows with `level`, the source and number of known discharges, such as `sisters and 2`.
    """
    name, simulator = next(iter(SIMULATORS.items()))
    for group, sisters in _groups(cells):
        if len(sisters) < 3:
            continue
        curve = open_circuit_curve(cells, group)
        parts = {cell.name: windows_of(cell, simulator, FIRST_VALUES, curve) for cell in sisters}
        for with_sisters, number in itertools.product((True, False), FEW):
            if not with_sisters and not number:
                continue
            level = f"{'sisters' if with_sisters else 'alone'} and {number}"
            for cell in sisters:
                others = [sister.name for sister in sisters if sister is not cell]
                learnt = others if with_sisters else []
                # a sister is judged by models without the cell
                of_sisters = [
                    _few(
                        parts,
                        sister,
                        [other for other in learnt if other != sister],
                        number,
                        _later(parts[sister]),
                    )
                    for sister in others
                ]
                later = _later(parts[cell.name])
                tested = join([later, parts[cell.name].tested])
                own = _few(parts, cell.name, learnt, number, tested)
                for use, scores in own.items():
                    known, judged = np.split(scores, [len(later.starts)])
                    pooled = [each[use] for each in of_sisters]
                    simulated = name if use == REFERENCE else NONE
                    about = {"level": level, "use": use, "detector": MAIN, "simulator": simulated}
                    for row in _rows_of(cell, known, judged, pooled):
                        yield about | row


def windows_of(cell: AgeingCell, simulator: Any, values: Sequence[float], curve: Any) -> Judged:
    """Cuts the windows of a cell; faults are the discharges that are tested, with their losses."""

    def of_one(place: int, discharge: Discharge) -> Windows:
        current = discharge.values[:, _CHANNELS]
        run = simulator(current, cell.ambient_c, values, curve)
        coarse = np.concatenate([run, current[:, None]], axis=1)
        inputs = inputs_of(current[:, None] / CAPACITY_AH, len(current), WINDOW)
        starts = _starts(discharge)
        series = discharge.values[:, :_CHANNELS], coarse, inputs
        return Windows(
            *(cut([each], starts, WINDOW) for each in series),
            starts + place * _APART,
            np.full(len(starts), place),
        )

    known, tested = (
        join([of_one(place, discharge) for place, discharge in enumerate(discharges)])
        for discharges in (cell.of_use(KNOWN), _tested(cell))
    )
    scale = known.telemetry.std(axis=(0, 1))
    known, tested = (part._replace(telemetry=part.telemetry / scale) for part in (known, tested))
    faults = tuple((discharge.use, cell.loss(discharge)) for discharge in _tested(cell))
    return Judged(known, tested, tested.units, faults, known.coarse, scale)


def _few(
    parts: dict[str, Judged], name: str, sisters: list[str], number: int, tested: Windows
) -> dict[str, np.ndarray]:
    """Scores of windows of one cell in each use, by models of its sisters and of its own first
    discharges.
    """
    own = parts[name]
    first = own.known.take(own.known.units < number)
    learnt = [first] if number else []
    for place, sister in enumerate(sisters, 1):
        windows = parts[sister].known
        learnt.append(
            windows._replace(
                telemetry=windows.telemetry * parts[sister].scale / own.scale,  # of the new cell
                starts=windows.starts + place * NUM_KNOWN * _APART,
                units=windows.units + place * NUM_KNOWN,
            )
        )
    known = join(learnt)
    if len(np.unique(known.units)) < 3:  # the windows of one discharge are in all folds
        known = known._replace(units=np.arange(len(known.starts)))
    labels = np.zeros(len(tested.starts), int)
    comparison = Comparison(Judged(known, tested, labels, (), known.coarse, own.scale), 0)
    uses = (REFERENCE, NO_SIMULATOR)
    return {scores.use: scores.tested for scores in comparison.scores(uses, (MAIN,))}


def _later(windows: Judged) -> Windows:
    """The known windows from which no model of few discharges learns."""
    return windows.known.take(windows.known.units >= max(FEW))


def _groups(cells: Sequence[AgeingCell]) -> Iterator[tuple[str, list[AgeingCell]]]:
    for group in dict.fromkeys(cell.group for cell in cells):
        yield group, [cell for cell in cells if cell.group == group]


def _tested(cell: AgeingCell) -> list[Discharge]:
    return [discharge for discharge in cell.discharges if discharge.use in (JUDGED, ODD)]


def _starts(discharge: Discharge) -> np.ndarray:
    return np.arange(0, len(discharge.values) - WINDOW + 1, STRIDE)


def _rows_of(
    cell: AgeingCell, known: np.ndarray, tested: np.ndarray, others: Sequence[np.ndarray]
) -> Iterator[dict[str, Any]]:
    """The rows of one cell, from the scores of its known and tested windows, and from those of its
    sisters, which set the threshold.
    """
    discharges = _tested(cell)
    ends = np.cumsum([len(_starts(discharge)) for discharge in discharges])
    parts = [(KNOWN, 0.0, known)]
    for discharge, scores in zip(discharges, np.split(tested, ends[:-1]), strict=True):
        parts.append((discharge.use, cell.loss(discharge), scores))
    for row in flagged(parts, np.concatenate(others), known, RATE):
        yield {"group": cell.group, "cell": cell.name} | row
