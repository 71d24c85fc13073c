"""The published findings come from the published tables, the pages quote them, and the figures are
drawn from them.
"""

import importlib
import json
import re

import pytest

from studies.common.command import PUBLISHED
from studies.common.replicates import save_all
from studies.public_benchmarks.arms import ARMS

STUDIES = (
    "battery",
    "factorial",
    "few_windows",
    "noise_models",
    "public_benchmarks",
    "reference_or_source",
    "robustness",
)


def findings(study):
    return json.loads((PUBLISHED / study / "results" / "findings.json").read_text(encoding="utf-8"))


def numbers_of(study):
    """The numbers of the tables in a study's README, by the first cell of a row."""
    text = (PUBLISHED / study / "README.md").read_text(encoding="utf-8").replace("−", "-")
    rows = (line.strip("| ").split(" | ", 1) for line in text.splitlines() if line.startswith("| "))
    return {
        name: [float(number) for number in re.findall(r"-?\d+(?:\.\d+)?", cells)]
        for name, cells in rows
    }


def shared(kept, again):
    """The part of what is kept that is computed again: code of some findings has left, and the
    study's page names the last commit with it.
    """
    if not isinstance(again, dict):
        return kept
    return {key: shared(kept[key], values) for key, values in again.items()}


@pytest.mark.parametrize(
    "study",
    [
        pytest.param(study, marks=[pytest.mark.slow] * (study == "reference_or_source"))
        for study in STUDIES
    ],
)
def test_the_published_findings_are_those_of_the_published_tables(study, near):
    summary, kept = importlib.import_module(f"studies.{study}.summary"), findings(study)
    tables = summary.KEPT.read(PUBLISHED / study / "results")
    again = json.loads(json.dumps(summary.summarise(tables)))
    about = {"budget", "versions", "skipped", "left_out"}
    assert set(kept) - set(again) <= about and kept["budget"] == "full"
    assert again == near(shared(kept, again))


@pytest.mark.parametrize("study", STUDIES)
def test_the_figures_are_drawn_from_the_findings(study, tmp_path):
    figures = importlib.import_module(f"studies.{study}.figure").FIGURES
    paths = save_all(figures, findings(study), tmp_path, f"python -m studies.{study}")
    assert {path.name for path in paths} == {
        f"{name}.{kind}" for name in figures for kind in ("png", "svg")
    }


def percent(values):
    return [100 * value for value in values]


def of_battery(found):
    regimes = [found["regimes"][regime]["uses"] for regime in ("gentle", "hard")]
    for use in regimes[0]:
        values = []
        for uses in regimes:
            values += [*uses[use]["recall"].values(), uses[use]["false_alarms"]["mean"]]
        yield use, percent(values)


def of_factorial(found):
    for name, about in found["cells"].items():
        rest = about["recall_at_real_rate"], about["gap_closed"]
        yield name, percent([*about["false_alarms"].values(), *rest])
    for environment, about in found["contrasts"]["no network, real"]["by_environment"].items():
        yield environment, percent(about["false_alarms"].values())


def of_robustness(found):
    for arm, about in found["arms"].items():
        values = (*about["false_alarms"].values(), about["recall_at_real_rate"])
        yield arm, [*percent(values), *about["criterion"].values()]


def of_public_benchmarks(found):
    spacecraft, plant = (group["methods"] for group in found["groups"].values())
    for name, about in spacecraft.items():
        shares = ("found_at_0.01", "found_at_0.05", "false_alarms", "many_false_alarms", "found")
        values = [about["auc_pr"]["mean"], plant[name]["auc_pr"]["mean"]]
        values += percent(about[share] for share in (*shares, "found_by_chance"))
        if name not in ARMS:
            values += [about[time] for time in ("onset_error", "delay", "cpu_s")]
        yield name, values


def of_reference_or_source(found):
    systems = ("battery", "aircraft", "cells")
    shown = (*found["contrasts"]["cells"], "no simulator - no simulator")
    for use in dict.fromkeys(name.split(" - ")[0] for name in shown if name.endswith("simulator")):
        values = []
        for system in systems:
            about = found["uses"][system][use]
            values += [about["found_alike"]["mean"], about["false_alarms"]]
            difference = found["contrasts"][system].get(f"{use} - no simulator")
            values += difference["alike"].values() if difference else []
        yield use, percent(values)


@pytest.mark.parametrize(
    ("study", "values", "number", "within"),
    [
        ("battery", of_battery, 8, [0.051] * 8),
        ("factorial", of_factorial, 14, [0.051] * 4 + [0.51]),
        (
            "public_benchmarks",
            of_public_benchmarks,
            13,
            [0.0051] * 2 + [0.51] * 2 + [0.051] + [0.51] * 5 + [0.0051],
        ),
        ("reference_or_source", of_reference_or_source, 8, [0.051, 0.051, 0.051, 0.51, 0.51] * 3),
        ("robustness", of_robustness, 6, [0.051] * 6),
    ],
)
def test_the_tables_of_a_page_have_the_numbers_of_the_findings(study, values, number, within):
    rows = numbers_of(study)
    shown = {name: expected for name, expected in values(findings(study)) if name in rows}
    assert len(shown) == number
    for name, expected in shown.items():
        assert len(rows[name]) == len(expected)
        for number_told, true, most in zip(rows[name], expected, within, strict=False):
            assert abs(number_told - true) <= most, name
