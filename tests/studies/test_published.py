"""The published findings come from the published tables, the pages quote them, and the figures are drawn from them."""

import importlib
import json

import pytest

from studies.common.command import PUBLISHED
from studies.common.replicates import save_all

STUDIES = ("battery", "few_windows", "noise_models", "spacecraft")


def findings(study):
    return json.loads((PUBLISHED / study / "results" / "findings.json").read_text(encoding="utf-8"))


def shared(kept, again):
    """The part of what is kept that is computed again: code of some findings has left, and the study's page names the last commit with it."""
    return {key: shared(kept[key], each) for key, each in again.items()} if isinstance(again, dict) else kept


@pytest.mark.parametrize("study", STUDIES)
def test_the_published_findings_are_those_of_the_published_tables(study, near):
    summary, kept = importlib.import_module(f"studies.{study}.summary"), findings(study)
    again = json.loads(json.dumps(summary.summarise(summary.KEPT.read(PUBLISHED / study / "results"))))
    assert again == near(shared(kept, again)) and kept["budget"] == "full"


@pytest.mark.parametrize("study", STUDIES)
def test_the_figures_are_drawn_from_the_findings(study, tmp_path):
    figures = importlib.import_module(f"studies.{study}.figure").FIGURES
    paths = save_all(figures, findings(study), tmp_path, f"python -m studies.{study}")
    assert {path.name for path in paths} == {f"{name}.{kind}" for name in figures for kind in ("png", "svg")}


def test_the_page_of_the_battery_has_the_numbers_of_the_findings(numbers_of):
    rows, regimes = numbers_of("battery"), findings("battery")["regimes"]
    shown = [use for use in regimes["gentle"]["uses"] if use in rows]
    assert len(shown) == 8
    for use in shown:
        about = [regimes[regime]["uses"][use] for regime in ("gentle", "hard")]
        values = [value for each in about for value in (*each["recall"].values(), each["false_alarms"]["mean"])]
        assert rows[use] == pytest.approx([100 * value for value in values], abs=0.051), use


def test_the_page_of_the_spacecraft_has_the_numbers_of_the_findings(numbers_of):
    rows, found = numbers_of("spacecraft"), findings("spacecraft")
    results = found["references"] | found["controls"] | found["sources"]
    shown = [name for name in results if name in rows]
    assert len(shown) == 11
    for name in shown:
        about = results[name]
        values = [about["auc_pr"]["mean"], 100 * about["false_alarms"]["mean"], 100 * about["found"]["0.01"]]
        assert rows[name][:1] == pytest.approx(values[:1], abs=0.0051) and rows[name][1:] == pytest.approx(values[1:], abs=0.51), name
