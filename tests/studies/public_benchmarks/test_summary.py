"""Findings of a small table whose numbers are known."""

import numpy as np
import pandas as pd
import pytest

from studies.public_benchmarks.arms import CHOSEN, DIFFERENCE, TELEMETRY
from studies.public_benchmarks.onsets import ABRUPT, DRIFT
from studies.public_benchmarks.series import SPACECRAFT
from studies.public_benchmarks.summary import summarise

AREAS = {  # of the settings of a peer on three development series and on another one
    "narrow": {"A-1": 0.1, "E-1": 0.5, "G-1": 0.6, "Z-1": 0.2},
    "wide": {"A-1": 0.9, "E-1": 0.3, "G-1": 0.3, "Z-1": 0.8},
}


def row(series, method, area, setting="", **changed):
    values = {"auc_pr": area, "events": 2, "found": 1, "found_by_chance": 0.5, "false_alarms": 0.01}
    values |= {"found_at_0.01": 1, "found_at_0.05": 2, "onset_error": 3.0, "delay": 4.0, "cpu_s": 1}
    about = {"series": series, "data_set": SPACECRAFT, "method": method, "setting": setting}
    return about | {"is_development": series != "Z-1", "seed": 0} | values | changed


@pytest.fixture(scope="module")
def found():
    rows = [
        row(series, "PCA", area, setting)
        for setting, areas in AREAS.items()
        for series, area in areas.items()
    ]
    for series, area, flagged in (("A-1", 0.7, 0.5), ("E-1", 0.6, 0.1), ("G-1", 0.8, 0.0)):
        rows.append(row(series, TELEMETRY, area, false_alarms=flagged, found=2))
        rows.append(row(series, CHOSEN, area))
        rows.append(row(series, DIFFERENCE, area - 0.2, onset_error=np.nan))
    rows.append(row("Z-1", TELEMETRY, 0.9))
    told = [("stuck", 3.0), ("spike", 5.0), ("spike", np.nan), ("ramp", 40.0)]
    onsets = [
        {"data_set": SPACECRAFT, "kind": kind, "onset_error": error, "delay": 2 * error}
        for kind, error in told
    ]
    return summarise({"scores": pd.DataFrame(rows), "onsets": pd.DataFrame(onsets)})


def test_onsets_of_abrupt_anomalies_are_apart_from_those_of_drifts(found):
    abrupt, drift = (found["onsets"][SPACECRAFT][group] for group in (ABRUPT, DRIFT))
    assert (abrupt["number"], abrupt["found"]) == (3, pytest.approx(2 / 3))
    assert (abrupt["onset_error"], abrupt["delay"]) == (4, 8)
    assert (drift["onset_error"], drift["number"]) == (40, 1)


def test_each_series_has_the_setting_that_the_others_choose(found):
    development, others = found["groups"].values()
    # E-1 and G-1 choose narrow for A-1; with A-1 it is wide that is better, for both of the others
    assert development["methods"]["PCA"]["auc_pr"]["mean"] == pytest.approx((0.1 + 0.3 + 0.3) / 3)
    assert found["settings"][SPACECRAFT]["PCA"] == "wide"
    assert others["methods"]["PCA"]["auc_pr"] == {"mean": 0.8, "low": None, "high": None}


def test_results_by_hand(found):
    assert list(found["groups"]) == [f"{SPACECRAFT}, development", f"{SPACECRAFT}, others"]
    group = found["groups"][f"{SPACECRAFT}, development"]
    views = group["methods"][TELEMETRY]
    assert (group["series"], views["auc_pr"]["mean"]) == (3, pytest.approx(0.7))
    assert (views["found"], views["found_by_chance"], views["found_at_0.05"]) == (1, 0.25, 1)
    assert (views["false_alarms"], views["many_false_alarms"]) == (0.1, pytest.approx(1 / 3))
    assert group["methods"][DIFFERENCE]["onset_error"] is None


def test_contrasts_pair_the_series(found):
    contrasts = found["groups"][f"{SPACECRAFT}, development"]["contrasts"]
    ((name, uses),) = contrasts["uses"].items()
    assert name == f"{DIFFERENCE} - {TELEMETRY}"
    assert uses["low"] == pytest.approx(-0.2) and uses["high"] == pytest.approx(-0.2)
    assert uses["p"] == uses["p_holm"] == 0.25  # three of one sign: two of eight patterns
    ((_, peers),) = contrasts["peers"].items()
    assert peers["mean"] == pytest.approx((0.6 + 0.3 + 0.5) / 3)
