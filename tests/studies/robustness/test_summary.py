"""The findings of the study of robustness: with hand-made tables, and from the published ones."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.coarse_simulator.degraded import MODES
from enhsim_tf.common.errors import InputError
from enhsim_tf.detection.registry import DETECTORS
from studies.common.controls import CONTROLS
from studies.common.environments import NOISES
from studies.robustness import summary
from studies.robustness.degraded_modes import METHODS, SCORED
from studies.robustness.replicate import ARMS

PUBLISHED = Path(summary.__file__).parent / "results"
SEEDS = (1000, 1001, 1002)
# false alarms of 100 windows in each of two blocks, by arm: what every number below is worked out from
ALARMS = dict.fromkeys(ARMS, 50) | {"enhanced": 90, "enhanced + GAN": 60, "residual + convolutional GAN": 3, "residual + AR": 10, "real": 2}


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
            rows["degraded"].append({**about, "mode": "nominal", "severity": 0.0, "nrmse": 0.1, "score": 1.0})
            for mode in MODES:
                rows["degraded"].append({**about, "mode": mode, "severity": 0.5, "nrmse": 0.4, "score": 2.0})
                rows["degraded"].append({**about, "mode": mode, "severity": 1.0, "nrmse": 0.8, "score": 9.0})
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


def test_rates_gaps_and_recall(found):
    arms = found["arms"]
    assert list(arms) == list(ARMS) and found["num_replicates"] == 12 and found["num_windows"] == 200
    assert arms["enhanced + GAN"]["false_alarms"] == pytest.approx({"mean": 0.6, "low": 0.6, "high": 0.6})
    assert arms["residual + convolutional GAN"]["gap_closed"] == pytest.approx((0.50 - 0.03) / (0.50 - 0.02))
    assert arms["enhanced"]["gap_closed"] == pytest.approx((0.50 - 0.90) / (0.50 - 0.02))  # worse than the coarse signal
    assert arms["real"]["recall"] == pytest.approx(0.4) and arms["real"]["recall_at_real_rate"] == pytest.approx(0.2)
    assert arms["real"]["by_environment"]["shot"]["detectors"] == pytest.approx(dict.fromkeys(DETECTORS, 0.02))
    assert found["controls"]["random score"] == pytest.approx({"false_alarms": 0.02, "recall": 0.4, "recall_at_real_rate": 0.2})


def test_the_criterion_allows_twice_the_rate_of_real_training_plus_a_point(found):
    assert {arm: about["criterion"]["met"] for arm, about in found["arms"].items() if about["criterion"]["met"]} == {
        "residual + convolutional GAN": 28,  # 3 % of at most 2 x 2 % + 1 %
        "real": 28,
    }


def test_the_criterion_allows_five_points_less_recall():
    index = pd.MultiIndex.from_product([["real", "arm"], ["a", "b"]], names=["arm", "detector"])
    kept = summary.keeps_the_rule(pd.Series([0.01, 0.01, 0.03, 0.03], index), pd.Series([0.5, 0.5, 0.451, 0.449], index))
    assert kept["arm"].to_dict() == {"a": True, "b": False}


def test_contrasts_are_differences_of_log_odds(found):
    contrast = found["contrasts"]["second"][0]
    odds = np.log(6.5 / 194.5) - np.log(20.5 / 180.5)  # 6 and 20 alarms of 200, half a count added to both sides
    assert (contrast["first"], contrast["second"]) == ("residual + convolutional GAN", "residual + AR")
    assert contrast["log_odds"] == pytest.approx({"mean": odds, "low": odds, "high": odds})
    assert contrast["adjusted_p_value"] == pytest.approx(3 * 2 / 2**3)  # all three seeds' signs agree, in all three contrasts


def test_blocks_of_unequal_length_add_up_to_the_rate():
    alarms = tables()["alarms"]
    alarms.loc[alarms["block"] == 0, ["alarms", "windows"]] = [0, 50]
    blocks = summary.by_block(alarms)["enhanced + GAN"]
    assert blocks.mean() == pytest.approx(60 / 150) and blocks.nunique() == 2


def test_errors_inside_and_outside_the_severities_of_training(found):
    assert found["modes"]["nrmse"]["paper"] == pytest.approx({"nominal": 0.1, "inside": 0.4, "outside": 0.8})
    assert found["modes"]["by_mode"]["ridge"]["stuck"] == [[0.5, pytest.approx(0.4)], [1.0, pytest.approx(0.8)]]
    assert found["modes"]["score_correlation"] == pytest.approx(dict.fromkeys(SCORED, 1.0))


def test_published_findings_come_from_the_published_tables(near):
    kept = json.loads((PUBLISHED / "findings.json").read_text(encoding="utf-8"))
    again = summary.summarise(summary.KEPT.read(PUBLISHED))
    assert json.loads(json.dumps(again)) == near({key: kept[key] for key in again})


def test_the_readme_has_the_numbers_of_the_findings(numbers_of):
    found, rows = json.loads((PUBLISHED / "findings.json").read_text(encoding="utf-8")), numbers_of("robustness")
    shown = [arm for arm in ARMS if arm in rows]
    assert len(shown) == 8
    for arm in shown:
        about = found["arms"][arm]
        rates = [about["false_alarms"], *(each["false_alarms"] for each in about["by_environment"].values())]
        values = [*rates[0].values(), *(rate["mean"] for rate in rates[1:]), about["recall_at_real_rate"]]
        assert rows[arm] == pytest.approx([*(100 * value for value in values), *about["criterion"].values()], abs=0.051), arm
