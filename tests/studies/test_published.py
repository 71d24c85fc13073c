"""The published findings come from the published tables, the pages quote them, and the figures are drawn from them."""

import importlib
import json
import re

import pandas as pd
import pytest

from studies.common.command import PUBLISHED
from studies.common.replicates import save_all

STUDIES = ("battery", "factorial", "few_windows", "noise_models", "robustness", "spacecraft")


def findings(study):
    return json.loads((PUBLISHED / study / "results" / "findings.json").read_text(encoding="utf-8"))


def numbers_of(study):
    """The numbers of the tables in a study's README, by the first cell of a row."""
    text = (PUBLISHED / study / "README.md").read_text(encoding="utf-8")
    rows = (line.strip("| ").split(" | ", 1) for line in text.splitlines() if line.startswith("| "))
    return {
        name: [float(number) for number in re.findall(r"-?\d+(?:\.\d+)?", cells)]
        for name, cells in rows
    }


def shared(kept, again):
    """The part of what is kept that is computed again: code of some findings has left, and the study's page names the last commit with it."""
    return (
        {key: shared(kept[key], each) for key, each in again.items()}
        if isinstance(again, dict)
        else kept
    )


@pytest.mark.parametrize("study", STUDIES)
def test_the_published_findings_are_those_of_the_published_tables(study, near):
    summary, kept = importlib.import_module(f"studies.{study}.summary"), findings(study)
    again = json.loads(
        json.dumps(summary.summarise(summary.KEPT.read(PUBLISHED / study / "results")))
    )
    assert set(kept) - set(again) <= {"budget", "versions", "skipped"} and kept["budget"] == "full"
    assert again == near(shared(kept, again))


def test_the_main_findings_on_references_and_sources_are_those_of_the_published_table(near):
    summary = importlib.import_module("studies.reference_or_source.summary")
    table = summary.KEPT.read(PUBLISHED / "reference_or_source" / "results")["alarms"]
    found = summary.summarise(
        {"alarms": table[(table["axis"] == "main") & (table["simulator"] == "wrong physics")]}
    )
    for system, about in found["systems"].items():
        kept = findings("reference_or_source")["systems"][system]
        points = {(each["axis"], each["simulator"], each["units"]): each for each in kept["points"]}
        kept["points"] = [
            points[each["axis"], each["simulator"], each["units"]] for each in about["points"]
        ]
        assert kept == near(about)


@pytest.mark.parametrize("regime", ["gentle", "hard"])
def test_the_errors_and_times_of_the_battery_that_are_no_longer_computed_are_those_of_its_tables(
    regime,
):
    folder, found = PUBLISHED / "battery" / "results", findings("battery")["regimes"][regime]
    errors, speed = (
        pd.read_parquet(folder / f"{name}.parquet", filters=[("regime", "==", regime)])
        for name in ("errors", "speed")
    )
    for is_nominal, rows in errors.groupby(errors["fault"] == "nominal"):
        for enhancer, values in rows.groupby("enhancer", observed=True)["nrmse"]:
            kept = (
                found["nominal"][enhancer]["mean"] if is_nominal else found["on_faults"][enhancer]
            )
            assert float(values.astype(float).mean()) == pytest.approx(
                kept, rel=1e-4
            )  # tables hold float32
    seconds = speed.groupby("what", observed=True)["seconds"].mean().astype(float)
    assert seconds.to_dict() == pytest.approx(found["seconds"], rel=1e-4)


@pytest.mark.parametrize("study", [*STUDIES, "reference_or_source"])
def test_the_figures_are_drawn_from_the_findings(study, tmp_path):
    figures = importlib.import_module(f"studies.{study}.figure").FIGURES
    paths = save_all(figures, findings(study), tmp_path, f"python -m studies.{study}")
    assert {path.name for path in paths} == {
        f"{name}.{kind}" for name in figures for kind in ("png", "svg")
    }


def of_battery(found):
    for use in found["regimes"]["gentle"]["uses"]:
        about = [found["regimes"][regime]["uses"][use] for regime in ("gentle", "hard")]
        yield (
            use,
            [
                100 * value
                for each in about
                for value in (*each["recall"].values(), each["false_alarms"]["mean"])
            ],
        )


def of_factorial(found):
    for name, about in found["cells"].items():
        yield (
            name,
            [
                100 * value
                for value in (
                    *about["false_alarms"].values(),
                    about["recall_at_real_rate"],
                    about["gap_closed"],
                )
            ],
        )
    for environment, about in found["contrasts"]["no network, real"]["by_environment"].items():
        yield environment, [100 * value for value in about["false_alarms"].values()]


def of_robustness(found):
    for arm, about in found["arms"].items():
        values = (*about["false_alarms"].values(), about["recall_at_real_rate"])
        yield arm, [*(100 * value for value in values), *about["criterion"].values()]


def of_spacecraft(found):
    for name, about in (found["references"] | found["controls"] | found["sources"]).items():
        yield (
            name,
            [
                about["auc_pr"]["mean"],
                100 * about["false_alarms"]["mean"],
                100 * about["found"]["0.01"],
            ],
        )


def of_reference_or_source(found):
    shown = {
        "reference, enhanced run": "reference",
        "source, detectors of nominal windows": "source",
        "no simulator": "no simulator",
    }
    for name, use in shown.items():
        values = []
        for about in found["systems"].values():
            middle = next(each["units"] for each in about["points"] if each["axis"] != "main")
            of_main = {
                each["units"]: each["uses"].get(use)
                for each in about["points"]
                if (each["axis"], each["simulator"]) == ("main", "wrong physics")
            }
            values += [
                100 * value
                for value in (
                    *of_main[middle]["recall"].values(),
                    of_main[middle]["false_alarms"]["mean"],
                )
            ]
        yield name, values


@pytest.mark.parametrize(
    ("study", "values", "number", "within"),
    [
        ("battery", of_battery, 8, [0.051] * 8),
        ("factorial", of_factorial, 14, [0.051] * 4 + [0.51]),
        ("reference_or_source", of_reference_or_source, 3, [0.051, 0.51, 0.51, 0.051] * 2),
        ("robustness", of_robustness, 6, [0.051] * 6),
        ("spacecraft", of_spacecraft, 11, [0.0051, 0.051, 0.51]),
    ],
)
def test_the_tables_of_a_page_have_the_numbers_of_the_findings(study, values, number, within):
    rows = numbers_of(study)
    shown = {name: expected for name, expected in values(findings(study)) if name in rows}
    assert len(shown) == number
    for name, expected in shown.items():
        assert len(rows[name]) == len(expected)
        assert all(
            abs(told - true) <= most
            for told, true, most in zip(rows[name], expected, within, strict=False)
        ), name
