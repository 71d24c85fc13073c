"""The summary, from tables made by hand, and what the page says of tables that the study no longer computes."""

import functools
import json

import numpy as np
import pandas as pd
import pytest

from studies.battery.detectors import QUICK, REAL_120, WITH_RESIDUALS
from studies.battery.faults import ALL, columns_of
from studies.battery.summary import KEPT, summarise
from studies.common.command import PUBLISHED
from studies.common.faults import SEVERITIES

near = functools.partial(pytest.approx, rel=1e-4)  # tables hold float32


@pytest.fixture(scope="module")
def about(tmp_path_factory):
    rows = []
    for seed in (1, 2):
        for kind, severity in (columns_of(fault).values() for fault in (None, *ALL)):
            for training in (REAL_120, WITH_RESIDUALS):
                for name in (*QUICK, *(["of one seed"] if seed == 1 else [])):
                    false = 0.05 if training == WITH_RESIDUALS and name in ("limit check", "PCA residual", "of one seed") else 0.01
                    case = {"fault": kind, "severity": severity, "seed": seed, "training": training, "detector": name}
                    rows.append(case | {"alarms": false if kind == "nominal" else severity})
    folder = tmp_path_factory.mktemp("tables")
    KEPT.write({"alarms": pd.DataFrame(rows).assign(regime="hard")}, folder)
    return summarise(KEPT.read(folder))["regimes"]["hard"]


def test_the_target_by_hand(about):
    target = about["targets"]["alarms"]
    assert (target["within"], target["of"], target["is_reached"]) == (3, 6, False)  # three of six are 4 points away


def test_recall_and_false_alarms_are_means_over_seeds_and_the_detectors_that_ran_with_every_seed(about):
    real, generated = (about["uses"][name] for name in (REAL_120, WITH_RESIDUALS))
    assert real["false_alarms"]["mean"] == near(0.01) and generated["false_alarms"]["mean"] == near(0.026)  # two of five have 0.05
    assert real["recall"]["mean"] == near(np.mean(SEVERITIES)) and real["by_fault"]["lost capacity"] == near(list(SEVERITIES))


@pytest.mark.parametrize("regime", ["gentle", "hard"])
def test_the_published_errors_and_times_are_those_of_the_tables(regime):
    folder = PUBLISHED / "battery" / "results"
    found = json.loads((folder / "findings.json").read_text())["regimes"][regime]
    errors, speed = (pd.read_parquet(folder / f"{name}.parquet", filters=[("regime", "==", regime)]) for name in ("errors", "speed"))
    for is_nominal, rows in errors.groupby(errors["fault"] == "nominal"):
        for enhancer, values in rows.groupby("enhancer", observed=True)["nrmse"]:
            kept = found["nominal"][enhancer]["mean"] if is_nominal else found["on_faults"][enhancer]
            assert float(values.astype(float).mean()) == near(kept)
    seconds = speed.groupby("what", observed=True)["seconds"].mean().astype(float)
    assert seconds.to_dict() == near(found["seconds"])
    slowest = max(seconds[name] for name in found["chosen"])
    assert seconds["fine simulator"] / (slowest + seconds["coarse simulator"]) == near(found["targets"]["speed"]["with_coarse"])
