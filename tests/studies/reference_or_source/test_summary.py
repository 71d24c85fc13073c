"""The findings of the study: with a hand-made table, and from the published one."""

import json

import numpy as np
import pandas as pd
import pytest

from studies.common.command import PUBLISHED
from studies.reference_or_source.summary import KEPT, summarise

RESULTS = PUBLISHED / "reference_or_source" / "results"


def test_recall_is_the_mean_over_kinds_and_seeds_and_false_alarms_are_those_of_nominal_windows():
    about = {"axis": "main", "level": "", "simulator": "wrong physics", "units": 20, "error": 0.1, "coarse_error": 0.4, "system": "battery"}
    windows = (("nominal", 0.0, 0.01, 3.0), ("a", 0.5, 0.2, np.nan), ("a", 1.0, 0.6, np.nan), ("b", 1.0, 1.0, np.nan))
    rows = [
        about | {"use": "reference", "detector": name, "seed": seed, "kind": kind, "severity": severity, "alarms": alarms, "events": events}
        for name in ("joint size", "size")
        for seed in (1, 2)
        for kind, severity, alarms, events in windows
    ]
    found = summarise({"alarms": pd.DataFrame(rows)})["systems"]["battery"]["points"][0]["uses"]["reference"]
    means = {name: found[name]["mean"] for name in ("recall", "false_alarms", "events", "mean_recall")}
    assert means == pytest.approx({"recall": 0.7, "false_alarms": 0.01, "events": 3, "mean_recall": 0.7})  # of .4 and 1
    assert found["by_kind"] == pytest.approx({"a": 0.4, "b": 1.0})
    assert found["best"] == {"detector": "joint size", "recall": pytest.approx(0.7)}


def test_the_published_findings_come_from_the_published_table(near):
    published = json.loads((RESULTS / "findings.json").read_text(encoding="utf-8"))
    table = KEPT.read(RESULTS)["alarms"]
    some = table[(table["axis"] == "main") & (table["simulator"] == "wrong physics")]
    found = summarise({"alarms": some})
    for system, about in found["systems"].items():
        points = {(each["axis"], each["simulator"], each["units"]): each for each in published["systems"][system]["points"]}
        for point in about["points"]:
            assert points[point["axis"], point["simulator"], point["units"]] == near(point)
