"""Ageing of cells whose truth is known: a circuit that loses capacity."""

import numpy as np
import pandas as pd
import pytest

from studies.reference_or_source import ageing, uses
from studies.reference_or_source.cell_simulators import circuit
from studies.reference_or_source.detectors import MAIN, ONE_CLASS
from studies.reference_or_source.real_cells import (
    INTERVAL_S,
    JUDGED,
    KNOWN,
    NUM_KNOWN,
    AgeingCell,
    Discharge,
)
from studies.reference_or_source.summary import severity_at_half

LOSSES = np.array([0.0, 0.1, 0.3])


def cell_of(name, group, seed):
    """Ten known discharges, and one at each loss, which ends earlier; noise of a millivolt."""
    rng, discharges = np.random.default_rng(seed), []
    for number, loss in enumerate([*np.zeros(NUM_KNOWN), *LOSSES]):
        capacity = 0.9 * (1 - loss) * (1 + 0.002 * rng.standard_normal())
        current = np.full(int(110 * (1 - loss)), 4.0)
        run = circuit(current, 24.0, (capacity, 1.2, 0.8), lambda taken: 4.2 - taken)
        run += [1e-3, 0.05] * rng.standard_normal(run.shape)
        values = np.column_stack([run, current])
        charge = len(current) * INTERVAL_S * 4 / 3600
        use = KNOWN if number < NUM_KNOWN else JUDGED
        discharges.append(Discharge(number, values, charge, True, use))
    return AgeingCell(name, group, 24.0, tuple(discharges))


@pytest.fixture(scope="module", autouse=True)
def one_simulator():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ageing, "SIMULATORS", {"circuit": circuit})
        patch.setattr(ageing, "FEW", (0, 5))
        for name in set(ONE_CLASS) - {MAIN}:
            patch.delitem(ONE_CLASS, name)
        yield


@pytest.fixture(scope="module")
def cells():
    return [cell_of(f"{group}{seed}", group, seed) for group in "ab" for seed in range(3)]


@pytest.mark.slow
def test_a_reference_finds_lost_capacity_and_seldom_a_fresh_cell(cells):
    table = pd.DataFrame(ageing.ageing_rows(cells))
    rows = table[(table["use"] == uses.REFERENCE) & (table["simulator"] == "circuit, fitted")]
    losses = rows[rows["kind"] == JUDGED].groupby(rows["severity"].round(1))["found"].mean()
    assert losses.index.tolist() == [0.0, 0.1, 0.3]
    assert losses[0.0] < 0.3 and losses[0.3] == 1.0
    assert rows[rows["kind"] == KNOWN]["found"].mean() < 0.15


def test_each_number_of_known_discharges_has_rows_of_every_cell(cells):
    table = pd.DataFrame(ageing.family_rows(cells[:3]))
    assert table["level"].unique().tolist() == [
        "sisters and 0",
        "sisters and 5",
        "alone and 5",
    ]
    # for each cell a row of known windows and three discharges, in two uses
    assert (table.groupby("level").size() == 3 * 4 * 2).all()
    rows = table[(table["use"] == uses.REFERENCE) & (table["severity"] > 0.2)]
    assert rows.groupby("level")["found"].mean()["sisters and 5"] == 1.0


def test_half_is_found_where_an_isotonic_curve_crosses_one_half():
    severities = np.array([0.1, 0.2, 0.3, 0.4])
    assert severity_at_half(severities, np.array([0.0, 0.2, 0.6, 1.0])) == pytest.approx(
        0.275, abs=0.001
    )
    # 0.7 and 0.1 out of order are averaged to 0.4
    assert severity_at_half(severities, np.array([0.0, 0.7, 0.1, 0.4])) is None
