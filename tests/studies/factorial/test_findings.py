"""Tests the findings of the factorial experiment with hand-made cells, and the committed files against each other."""

import itertools
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from enhsim_tf.reproduce.publish import factorial_text, objections, practice, report

from enhsim_tf.common.errors import InputError
from studies.factorial import findings
from studies.factorial.cells import CELLS, LEVELS, PAPER_CELL, WHOLE_WINDOWS, WITHOUT_NETWORK
from studies.factorial.run import FOLDER, TABLE, read_cells

KEPT = Path(__file__).parents[3] / "figures" / FOLDER
ENVIRONMENTS, SEEDS, DETECTORS = ("white", "shot"), (1, 2, 3), ("PCA residual", "isolation forest")
EFFECTS = {"windows": 50, "extraction": 100, "enhancer": 150, "generator": 300}  # alarms of 1,000 windows that switching a factor avoids


def alarms_of(name):
    """Coarse telemetry gives 900 alarms, real telemetry 100, and the paper's pipeline 700; every switched factor avoids some."""
    if name not in CELLS:
        return {"coarse": 900, "real": 100}[name]
    cell = CELLS[name]
    return 700 - sum(EFFECTS[factor] for factor, levels in LEVELS.items() if getattr(cell, factor) != levels[0])


def table(without=()):
    rows = [
        {"environment": environment, "seed": seed, "cell": name, "detector": detector}
        | {"alarms": alarms_of(name), "windows": 1_000, "recall": 0.5, "recall_at_real_rate": 0.3}
        for environment, seed, name, detector in itertools.product(ENVIRONMENTS, SEEDS, ["coarse", "real", *CELLS], DETECTORS)
        if (environment, seed, name) not in without
    ]
    return pd.DataFrame(rows)


@pytest.fixture(scope="module")
def found():
    return findings.summarise(table())


def test_cells_are_means_over_detectors_and_replicates(found):
    paper = found["cells"][PAPER_CELL.name]
    assert paper["false_alarms"] == pytest.approx({"mean": 0.7, "low": 0.7, "high": 0.7})
    assert paper["gap_closed"] == pytest.approx((0.9 - 0.7) / (0.9 - 0.1)) and paper["seeds"] == list(SEEDS)
    assert found["cells"][WITHOUT_NETWORK.name]["gap_closed"] == pytest.approx(1.0)
    assert found["cells"]["coarse"]["gap_closed"] == 0 and found["cells"]["real"]["gap_closed"] == 1
    assert (found["num_cells"], found["of_cells"]) == (32 * 6, 32 * 6) and found["num_windows"] == 1_000


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
    assert [findings.contribution(worth, factor) for factor in "abc"] == pytest.approx([0.5, 0.5, 0.0])


def test_contributions_add_up_and_agree_with_the_orders():
    rng = np.random.default_rng(0)
    worth = {frozenset(each): rng.standard_normal() for size in range(5) for each in itertools.combinations(LEVELS, size)}
    for factor in LEVELS:  # the definition: the mean change over all orders of switching
        changes = []
        for order in itertools.permutations(LEVELS):
            before = frozenset(order[: order.index(factor)])
            changes.append(worth[before | {factor}] - worth[before])
        assert findings.contribution(worth, factor) == pytest.approx(np.mean(changes))
    total = sum(findings.contribution(worth, factor) for factor in LEVELS)
    assert total == pytest.approx(worth[frozenset(LEVELS)] - worth[frozenset()])


def test_corners_switch_the_named_factors():
    assert findings.corner([], WHOLE_WINDOWS) == PAPER_CELL.name and findings.corner(LEVELS, WHOLE_WINDOWS) == WITHOUT_NETWORK.name
    assert findings.corner(["extraction"], WHOLE_WINDOWS) == "few / residual / network / paper's GAN"


def test_a_comparison_uses_the_seeds_that_have_all_of_its_cells():
    one = "many / residual / ridge / convolutional GAN"
    some = findings.summarise(table(without={("shot", 2, one)}))
    assert some["shares"]["convolutional GAN"]["seeds"] == [1, 3] and some["shares"][WHOLE_WINDOWS]["seeds"] == [1, 2, 3]
    assert some["cells"][one]["seeds"] == [1, 3] and some["num_cells"] == 32 * 6 - 1
    assert some["contrasts"]["convolutional GAN, whole windows"]["seeds"] == [1, 3]
    none = findings.summarise(table(without={("shot", seed, one) for seed in SEEDS}))
    assert "convolutional GAN" not in none["shares"] and one not in none["cells"]
    with pytest.raises(InputError, match="coarse and real in all environments"):
        findings.summarise(table(without={("white", seed, "real") for seed in SEEDS}))


def test_contrasts_are_the_first_arm_minus_the_second(found):
    assert found["contrasts"]["no network, real"]["false_alarms"]["mean"] == pytest.approx(0.0)
    assert found["contrasts"]["no network, paper"]["false_alarms"]["mean"] == pytest.approx(-0.6)
    assert found["contrasts"]["network, ridge"]["by_environment"]["shot"]["false_alarms"]["mean"] == pytest.approx(0.15)


def test_the_criterion_of_c8_is_counted_in_pairs(found):
    assert (found["cells"]["real"]["kept"], found["cells"]["real"]["pairs"]) == (4, 4)
    assert found["cells"][PAPER_CELL.name]["kept"] == 0
    assert found["cells"]["many / residual / network / whole windows"]["kept"] == 0  # 25 % against at most 21 %
    assert found["cells"]["few / residual / ridge / whole windows"]["kept"] == 4  # 15 %


def test_findings_are_plain_json(found):
    assert json.loads(json.dumps(found, allow_nan=False)) == found


def test_tables_say_what_the_findings_hold(found):
    text = factorial_text.contributions(found)
    assert "| extraction: moving average to residual | 12.5 (12.5 to 12.5) |" in text and "| seeds | 3 | 3 | 3 |" in text
    assert factorial_text.ranking(found).startswith(
        "If all four factors are switched, with whole windows in place of the paper's GAN (3 seeds), the share"
    )
    assert "the generator accounts for 37.5 (37.5 to 37.5) points, or 50 %; the enhancer for" in factorial_text.ranking(found)
    assert factorial_text.paper_cell(found) == "25 %, with 2 detectors and 3 seeds,"
    assert "| generator | 37.5 | 37.5 | 50 % |" in factorial_text.by_environment(found)
    assert f"| {WITHOUT_NETWORK.name} (no network) | 10.0 % (10.0 to 10.0) |" in factorial_text.short_table(found)
    assert len(factorial_text.cells_table(found).splitlines()) == 2 + 34
    assert f"| {WITHOUT_NETWORK.name} | real | 0.0 (0.0 to 0.0) | 0.0 (0.0 to 0.0) | 3 |" in factorial_text.contrasts_table(found)
    assert factorial_text.coverage(found) == "192 of 192 runs (a cell, an environment and a seed; 3 seeds, 1 to 3, in 2 environments)"


def test_sentences_follow_the_numbers(found):
    robustness = json.loads((KEPT.parent / "robustness" / "findings.json").read_text(encoding="utf-8"))
    said = practice.answers(robustness, found)
    assert "suffice** on every noise here" in said["a linear map and resampled residuals"].sentence
    network = said["a network"].evidence
    assert "On nominal telemetry the network raises false alarms: with" in network and "by 15.0 (15.0 to 15.0) points (3 seeds)" in network
    assert (
        "the convolutional GAN does not change false alarms by more than 0.5 points on average over 2 kinds of noise (0.0 (0.0 to 0.0) points)"
        in said["generated noise"].sentence
    )
    gan = "many / residual / ridge / convolutional GAN"
    few = practice.answers(robustness, findings.summarise(table(without={("shot", 1, gan)})))["generated noise"]
    assert "the convolutional GAN has no settled effect on false alarms yet" in few.sentence and "same residuals (2 seeds)" in few.evidence
    worse = table()
    worse.loc[(worse["cell"] == WITHOUT_NETWORK.name) & (worse["environment"] == "shot"), "alarms"] = 600
    linear = practice.answers(robustness, findings.summarise(worse))["a linear map and resampled residuals"]
    assert "suffice** on white noise here" in linear.sentence
    assert "On shot noise the difference is 50.0 (50.0 to 50.0) points." in linear.evidence
    unknown = practice.short(practice.answers(robustness))
    assert "not measured yet" in unknown and len(unknown.splitlines()) == 5
    assert len(objections.objections(robustness, found)) == 9


def _curve(pays):
    rates = {
        name: {"rate": {"5": rate}, "low": {"5": rate / 2}, "high": {"5": 2 * rate}, "recall_at_real_rate": {"5": 0.7}}
        for name, rate in {practice.FITTED: 0.04, practice.RESAMPLED: 0.06, "real": 0.12}.items()
    }
    rates["simulator + Gaussian"] = rates["CORAL"] = rates["real"]
    line = {practice.ONE_LINE: {"rate": {"5": 0.2}, "recall_at_real_rate": {"5": 0.75}}}
    others = {"CORAL": {"pays": [5]}, practice.ONE_LINE: {"pays": []}}
    return {"numbers": [5, 100], "seeds": [1, 2], "environments": {"white": {"pays": pays, "others_pay": others, "arms": rates | line}}}


def test_generated_noise_pays_where_the_fitted_autoregression_does():
    robustness = json.loads((KEPT.parent / "robustness" / "findings.json").read_text(encoding="utf-8"))
    said = practice.answers(robustness, curve=_curve({practice.FITTED: [5, 100]}))["generated noise"]
    assert (
        "with 5 real windows of white noise, detectors flag 4.0 % (2.0 to 8.0) of nominal windows, against 12.0 % (6.0 to 24.0) after training on these 5"
        in said.sentence
    )
    assert (
        "pays with 5 and 100 windows on white noise (2 seeds; in brackets" in said.evidence
        and "residual windows give 6.0 % (3.0 to 12.0)" in said.evidence
    )
    assert (
        "By the same rule, these pay there, too: CORAL (12.0 %). A score of one line (moving deviation) finds 75 % at the matched rate"
        in said.evidence
    )
    assert "but flags 20.0 % at a threshold set on so few windows" in said.evidence
    both = practice.answers(robustness, curve=_curve({practice.FITTED: [5], "simulator + Gaussian": [5]}))["generated noise"]
    assert "these pay there, too: simulator + Gaussian (12.0 %) and CORAL (12.0 %)" in both.evidence
    assert "**Generated noise** was not shown to pay" in practice.answers(robustness, curve=_curve({}))["generated noise"].sentence


def test_a_clean_simulator_suffices_where_the_noise_is_small():
    robustness = json.loads((KEPT.parent / "robustness" / "findings.json").read_text(encoding="utf-8"))
    rates = {"fine without noise": 0.02, "enhanced": 0.03, "enhanced + residuals drawn again": 0.01, "real, 120 orbits": 0.04}
    arms = {
        arm: {name: {"false_alarms": {"mean": rate * times}, "recall_at_real_rate": 10 * rate} for name, times in (("a", 1), ("b", 3))}
        for arm, rate in rates.items()
    }
    arms["real, 120 orbits"]["c"] = {"false_alarms": {"mean": 1.0}, "recall_at_real_rate": 1.0}  # not in all arms: left out
    said = practice.answers(robustness, battery={"regimes": {"gentle": {"detectors": arms}, "hard": {"detectors": arms}}})[
        "a clean simulator"
    ]
    assert (
        "suffices** where the noise is small, as on a battery (trained on a simulator without noise, detectors flag 4.0 % and 4.0 %"
        in said.sentence
    )
    assert (
        "(2 detectors)" in said.evidence
        and "2.0 % and 2.0 % with its residuals added, and 8.0 % and 8.0 % on 120 real orbits" in said.evidence
    )
    assert "Recall at the real rate is 10.0 % and 10.0 % with added residuals and 30.0 % and 30.0 % without them." in said.evidence
    without = practice.answers(robustness)["a clean simulator"]
    assert (
        "suffices** only with thresholds set on real windows" in without.sentence
        and "Telemetry with little noise was not tested." in without.evidence
    )
    # the named detectors alone, over the four environments
    truth = robustness["arms"]["truth"]["by_environment"].values()
    named = ("PCA residual", "limit check", "nearest neighbours")
    share = sum(about["detectors"][name] for about in truth for name in named) / 12
    assert f"with their own thresholds, these flag {100 * share:.1f} % and" in without.sentence


def test_generated_noise_pays_nowhere_if_no_noise_model_was_fitted_to_few_windows():
    robustness = json.loads((KEPT.parent / "robustness" / "findings.json").read_text(encoding="utf-8"))
    said = practice.answers(robustness)
    assert "**Generated noise** was not shown to pay; with many windows" in said["generated noise"].sentence
    assert practice.evidence(said).startswith("- *A clean simulator.* (")


def test_the_objections_say_which_experiments_are_missing(found):
    robustness = json.loads((KEPT.parent / "robustness" / "findings.json").read_text(encoding="utf-8"))
    outcome = objections.objections(robustness, found)[-1]["outcome"]
    assert "(4) The factorial: done, 192 of 192 runs" in outcome and "(7) Several channels with correlated noise: open." in outcome
    less = findings.summarise(table(without={("shot", 1, "many / residual / ridge / convolutional GAN")}))
    assert "(4) The factorial: in part, 191 of 192 runs" in objections.objections(robustness, less)[-1]["outcome"]
    assert objections.objections(robustness)[3]["outcome"].endswith("for which no design was chosen; it has not been run.")


def test_committed_findings_come_from_the_committed_table(near):
    if not (KEPT / TABLE).is_file():
        pytest.skip("the experiment has not been run: no figures/factorial")
    kept = json.loads((KEPT / "findings.json").read_text(encoding="utf-8"))
    again = findings.summarise(read_cells(KEPT / TABLE))
    assert json.loads(json.dumps(again)) == near({key: kept[key] for key in again})
    assert (KEPT / TABLE).stat().st_size < 400_000
    root = KEPT.parents[1]
    assert factorial_text.page_part(kept) in (root / "docs" / "what_holds.md").read_text(encoding="utf-8")
    robustness, labelled, curve, battery = (
        report.findings_of(root, name) for name in ("robustness", "labelled", "learning_curve", "battery")
    )
    assert practice.short(practice.answers(robustness, kept, labelled, curve, battery)) in (root / "README.md").read_text(encoding="utf-8")
