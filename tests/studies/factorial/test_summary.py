"""The findings of the factorial study: with hand-made cells, and from the published table."""

import itertools
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from studies.factorial import summary
from studies.factorial.cells import CELLS, DETECTORS, LEVELS, PAPER_CELL, REFERENCES, WHOLE_WINDOWS, WITHOUT_NETWORK

PUBLISHED = Path(summary.__file__).parent / "results"
ENVIRONMENTS, SEEDS = ("white", "shot"), (1, 2, 3)
EFFECTS = {"windows": 50, "extraction": 100, "enhancer": 150, "generator": 300}  # alarms of 1,000 windows that switching a factor avoids


def alarms_of(name):
    """The coarse simulator gives 900 alarms, real telemetry 100, and the paper's pipeline 700; every switched factor avoids some."""
    if name not in CELLS:
        return {"coarse": 900, "real": 100}[name]
    cell = CELLS[name]
    return 700 - sum(EFFECTS[factor] for factor, levels in LEVELS.items() if getattr(cell, factor) != levels[0])


def table():
    return pd.DataFrame(
        {"environment": environment, "seed": seed, "cell": name, "detector": detector}
        | {"alarms": alarms_of(name), "windows": 1_000, "recall": 0.5, "recall_at_real_rate": 0.3}
        for environment, seed, name, detector in itertools.product(ENVIRONMENTS, SEEDS, [*REFERENCES, *CELLS], DETECTORS)
    )


@pytest.fixture(scope="module")
def found():
    return summary.summarise({"cells": table()})


def test_cells_are_means_over_detectors_and_replicates(found):
    paper = found["cells"][PAPER_CELL.name]
    assert paper["false_alarms"] == pytest.approx({"mean": 0.7, "low": 0.7, "high": 0.7})
    assert paper["gap_closed"] == pytest.approx((0.9 - 0.7) / (0.9 - 0.1))
    assert found["cells"][WITHOUT_NETWORK.name]["gap_closed"] == pytest.approx(1.0)
    assert found["cells"]["coarse"]["gap_closed"] == 0 and found["cells"]["real"]["gap_closed"] == 1


def test_without_interactions_each_factor_contributes_its_own_effect(found):
    for about in found["shares"].values():
        closed = about["gap_closed"]
        for factor, effect in EFFECTS.items():
            for when in ("share", "first", "last"):
                assert closed["factors"][factor][when]["mean"] == pytest.approx(effect / 800), (factor, when)
        assert closed["paper"]["mean"] == pytest.approx(0.25) and closed["switched"]["mean"] == pytest.approx(1.0)
        assert about["recall_at_real_rate"]["factors"]["generator"]["share"]["mean"] == pytest.approx(0.0)


def test_an_interaction_is_split_between_its_factors():
    worth = {frozenset(each): float(set(each) >= {"a", "b"}) for size in range(4) for each in itertools.combinations("abc", size)}
    assert [summary.contribution(worth, factor) for factor in "abc"] == pytest.approx([0.5, 0.5, 0.0])


def test_contributions_add_up_and_agree_with_the_orders():
    rng = np.random.default_rng(0)
    worth = {frozenset(each): rng.standard_normal() for size in range(5) for each in itertools.combinations(LEVELS, size)}
    for factor in LEVELS:  # the definition: the mean change over all orders of switching
        changes = []
        for order in itertools.permutations(LEVELS):
            before = frozenset(order[: order.index(factor)])
            changes.append(worth[before | {factor}] - worth[before])
        assert summary.contribution(worth, factor) == pytest.approx(np.mean(changes))
    total = sum(summary.contribution(worth, factor) for factor in LEVELS)
    assert total == pytest.approx(worth[frozenset(LEVELS)] - worth[frozenset()])


def test_corners_switch_the_named_factors():
    assert summary.corner([], WHOLE_WINDOWS) == PAPER_CELL.name and summary.corner(LEVELS, WHOLE_WINDOWS) == WITHOUT_NETWORK.name
    assert summary.corner(["extraction"], WHOLE_WINDOWS) == "few / residual / network / paper's GAN"


def test_contrasts_are_the_first_cell_minus_the_second(found):
    assert found["contrasts"]["no network, real"]["false_alarms"]["mean"] == pytest.approx(0.0)
    assert found["contrasts"]["no network, paper"]["false_alarms"]["mean"] == pytest.approx(-0.6)
    assert found["contrasts"]["network, ridge"]["by_environment"]["shot"]["false_alarms"]["mean"] == pytest.approx(0.15)


def test_published_findings_come_from_the_published_table(near):
    kept = json.loads((PUBLISHED / "findings.json").read_text(encoding="utf-8"))
    again = summary.summarise(summary.KEPT.read(PUBLISHED))
    assert json.loads(json.dumps(again, allow_nan=False)) == near({key: kept[key] for key in again})


def test_the_readme_has_the_numbers_of_the_findings(numbers_of):
    found, rows = json.loads((PUBLISHED / "findings.json").read_text(encoding="utf-8")), numbers_of("factorial")
    shown = [name for name in found["cells"] if name in rows]
    assert len(shown) == 10
    for name in shown:
        about = found["cells"][name]
        values = [100 * value for value in (*about["false_alarms"].values(), about["recall_at_real_rate"], about["gap_closed"])]
        assert rows[name][:4] == pytest.approx(values[:4], abs=0.051) and rows[name][4] == pytest.approx(values[4], abs=0.51), name
    for environment, about in found["contrasts"]["no network, real"]["by_environment"].items():
        assert rows[environment] == pytest.approx([100 * value for value in about["false_alarms"].values()], abs=0.051)
