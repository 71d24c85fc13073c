"""The findings of the study of robustness: with hand-made tables, and from the published ones."""

import json
from pathlib import Path

import pandas as pd
import pytest

from enhsim_tf.coarse_simulator.degraded import MODES
from enhsim_tf.common.errors import InputError
from enhsim_tf.detection.registry import DETECTORS
from studies.common.controls import CONTROLS
from studies.common.environments import NOISES
from studies.robustness import summary
from studies.robustness.degraded_modes import METHODS
from studies.robustness.replicate import ARMS

PUBLISHED = Path(summary.__file__).parent / "results"
SEEDS = (1000, 1001, 1002)
# false alarms of 100 windows in each of two blocks, by arm: what every number below is worked out from
ALARMS = dict.fromkeys(ARMS, 50) | {"enhanced": 90, "enhanced + GAN": 60, "ridge + residual windows": 3, "real": 2}


def tables():
    """Tables of three seeds in four environments, in which every detector of an arm does the same."""
    rows = {name: [] for name in summary.KEPT.names}
    for environment in NOISES:
        for seed in SEEDS:
            for arm in ARMS:
                for detector in DETECTORS | (CONTROLS if arm == "real" else {}):
                    about = {"environment": environment, "seed": seed, "arm": arm, "detector": detector}
                    rows["alarms"] += [{**about, "block": block, "alarms": ALARMS[arm], "windows": 100} for block in range(2)]
                    for severity, recall in ((1.0, 0.2), (2.0, 0.6)):
                        found = {"recall": recall, "recall_at_real_rate": recall / 2}
                        rows["recall"].append({**about, "kind": "ramp", "severity": severity, **found})
    for seed in SEEDS:
        for method in METHODS:
            about = {"seed": seed, "method": method}
            rows["degraded"].append({**about, "mode": "nominal", "severity": 0.0, "nrmse": 0.1})
            for mode in MODES:
                rows["degraded"].append({**about, "mode": mode, "severity": 0.5, "nrmse": 0.4})
                rows["degraded"].append({**about, "mode": mode, "severity": 1.0, "nrmse": 0.8})
    return {name: pd.DataFrame(each) for name, each in rows.items()}


@pytest.fixture(scope="module")
def found():
    return summary.summarise(tables())


def test_tables_come_back_as_they_were_written(tmp_path):
    written = tables()
    summary.KEPT.write(written, tmp_path)
    for name, table in summary.KEPT.read(tmp_path).items():
        pd.testing.assert_frame_equal(table, written[name], check_dtype=False, rtol=1e-4, check_column_type=False)


def test_a_missing_table_is_named(tmp_path):
    with pytest.raises(InputError, match="alarms.parquet"):
        summary.KEPT.read(tmp_path)


def test_rates_and_recall(found):
    arms = found["arms"]
    assert list(arms) == list(ARMS) and found["num_replicates"] == 12 and found["num_windows"] == 200
    assert arms["enhanced + GAN"]["false_alarms"] == pytest.approx({"mean": 0.6, "low": 0.6, "high": 0.6})
    assert arms["real"]["recall"] == pytest.approx(0.4) and arms["real"]["recall_at_real_rate"] == pytest.approx(0.2)
    assert arms["real"]["by_environment"]["shot"]["detectors"] == pytest.approx(dict.fromkeys(DETECTORS, 0.02))
    assert found["controls"]["random score"] == pytest.approx({"false_alarms": 0.02, "recall": 0.4, "recall_at_real_rate": 0.2})


def test_the_criterion_allows_twice_the_rate_of_real_training_plus_a_point(found):
    assert {arm: about["criterion"]["met"] for arm, about in found["arms"].items() if about["criterion"]["met"]} == {
        "ridge + residual windows": 28,  # 3 % of at most 2 x 2 % + 1 %
        "real": 28,
    }


def test_the_criterion_allows_five_points_less_recall():
    index = pd.MultiIndex.from_product([["real", "arm"], ["a", "b"]], names=["arm", "detector"])
    kept = summary.keeps_the_rule(pd.Series([0.01, 0.01, 0.03, 0.03], index), pd.Series([0.5, 0.5, 0.451, 0.449], index))
    assert kept["arm"].to_dict() == {"a": True, "b": False}


def test_contrasts_are_differences_of_false_alarms(found):
    for contrast, expected in zip(found["contrasts"], (0.6 - 0.9, 0.6 - 0.03, 0.03 - 0.02), strict=True):
        for each in (contrast["difference"], *contrast["by_environment"].values()):
            assert each == pytest.approx({"mean": expected, "low": expected, "high": expected})


def test_blocks_of_unequal_length_add_up_to_the_rate():
    alarms = tables()["alarms"]
    alarms.loc[alarms["block"] == 0, ["alarms", "windows"]] = [0, 50]
    blocks = summary.by_block(alarms)["enhanced + GAN"]
    assert blocks.mean() == pytest.approx(60 / 150) and blocks.nunique() == 2


def test_errors_inside_and_outside_the_severities_of_training(found):
    assert found["modes"]["nrmse"]["paper"] == pytest.approx({"nominal": 0.1, "inside": 0.4, "outside": 0.8})
    assert found["modes"]["by_mode"]["ridge"]["stuck"] == [[0.5, pytest.approx(0.4)], [1.0, pytest.approx(0.8)]]


def test_published_findings_come_from_the_published_tables(near):
    kept = json.loads((PUBLISHED / "findings.json").read_text(encoding="utf-8"))
    again = summary.summarise(summary.KEPT.read(PUBLISHED))
    assert json.loads(json.dumps(again)) == near({key: kept[key] for key in again})


def test_the_readme_has_the_numbers_of_the_findings(numbers_of):
    found, rows = json.loads((PUBLISHED / "findings.json").read_text(encoding="utf-8")), numbers_of("robustness")
    for arm in ARMS:
        about = found["arms"][arm]
        values = [*about["false_alarms"].values(), about["recall_at_real_rate"]]
        assert rows[arm] == pytest.approx([*(100 * value for value in values), *about["criterion"].values()], abs=0.051), arm
