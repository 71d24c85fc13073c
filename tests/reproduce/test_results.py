"""Tests that the table, results.json and the generated parts of the README agree with the records."""

import json
import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest

from enhsim_tf.common.atomic_files import write_json
from enhsim_tf.reproduce.publish import practice, results
from enhsim_tf.reproduce.settings import deviations, make_settings

ROOT = Path(__file__).parents[2]
RECORDS = [
    {
        "id": "C1",
        "sentence": "It learns.",
        "section": "2.2",
        "figure": "fig04_enhanced_simulation",
        "statistic": "the error",
        "tolerance": "at most 0.15",
        "expected": "reproduced",
        "value": 0.12345,
        "verdict": "reproduced",
        "finding": r"found \1 and \g<name> as they stand",
        "details": {"nrmse": 0.12345},
    },
    {
        "id": "C2",
        "sentence": "It is fast.",
        "section": "2.2",
        "figure": "fig04_enhanced_simulation",
        "statistic": "the rate",
        "tolerance": "at least 10,000",
        "expected": "reproduced",
        "value": 1234567.8,
        "verdict": "partly",
        "finding": "word " * 60,
        "details": {},
    },
    {
        "id": "C9",
        "sentence": "It degrades.",
        "section": "3",
        "figure": "fig04_enhanced_simulation",
        "statistic": "the ratio",
        "tolerance": "at most 2",
        "expected": "not tested by the paper",
        "value": None,
        "verdict": "not measured",
        "finding": "nobody knows",
        "details": {},
    },
]
TEXTS = {
    "README.md": "# Training detectors\n\nBefore.\n\n<!-- claims in short: generated -->\nold\n<!-- end of claims in short -->\n\nAfter.\n",
    "docs/what_holds.md": "# Page\n\n<!-- claims: generated -->\nold\nolder\n<!-- end of claims -->\n\nWith a `<!--` of its own.\n",
    "docs/spacecraft.md": "<!-- channels: generated -->\n<!-- end of channels -->\nLast.\n",
    "docs/decisions.md": "<!-- deviations: generated -->\n<!-- end of deviations -->\n",
    "docs/speed.md": "<!-- timings: generated -->\nold\n<!-- end of timings -->\n",
}
"""The pages with generated parts, before they are filled."""
MARKERS = {"claims in short": "README.md", "claims": "docs/what_holds.md", "deviations": "docs/decisions.md", "timings": "docs/speed.md"}


@pytest.fixture
def found():
    stages = SimpleNamespace(seconds={"telemetry": 1.234, "enhancer": 60.5}, cached={"telemetry": True, "enhancer": False})
    experiment = SimpleNamespace(stages=stages, settings=make_settings("smoke", 7), is_paper=True)
    return results.results(experiment, RECORDS, drawn_s=3.004, total_s=99.999)


def test_results_hold_what_was_found(found):
    assert set(found) >= {"budget", "seed", "versions", "claims", "timings"}
    assert (found["budget"], found["seed"], found["claims"]) == ("smoke", 7, RECORDS)
    assert found["timings"] == {"telemetry": 1.23, "enhancer": 60.5, "figures": 3.0} and found["this_run_s"] == 100
    assert found["from_cache"] == ["telemetry"] and found["verdict"] == "[Re, in part]"
    assert {"python", "tensorflow", "keras", "numpy"} <= set(found["versions"])
    assert found["source"] == "the paper's example"


def test_results_name_a_real_channel():
    stages = SimpleNamespace(seconds={}, cached={})
    source = SimpleNamespace(path=Path("somewhere") / "T-1.npy")
    experiment = SimpleNamespace(stages=stages, settings=make_settings(), is_paper=False, source=source)
    assert results.results(experiment, RECORDS, 0, 0)["source"] == "T-1.npy", "its name, not where it lies on this machine"


def test_numbers_in_short():
    expected = {0.12345: "0.123", -2.0: "-2", 999.4: "999", 999.6: "1,000", 1234567.8: "1,234,568", None: "–", float("inf"): "–"}
    assert {number: results.short(number) for number in expected} == expected


@pytest.mark.parametrize("columns", [10, 80, 500])
def test_the_table_says_it_for_a_terminal(monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    text = results.table(RECORDS)
    for record, value in zip(RECORDS, ("0.123", "1,234,568", "–"), strict=True):
        (line,) = (line for line in text.splitlines() if line.startswith(record["id"]))
        assert record["verdict"] in line and f"{record['statistic']}: {value} ({record['tolerance']})" in line
        assert " ".join(record["finding"].split()) in " ".join(text.split())
    assert all(len(line) <= max(60, min(columns, 140)) for line in text.splitlines() if line.startswith("    "))


# -- the README ------------------------------------------------------------------------------------------------------------


@pytest.fixture
def filled(tmp_path, found):
    """Fills the pages and returns their texts, one after the other."""

    def fill(texts=TEXTS, spread=None):
        (tmp_path / "docs").mkdir(exist_ok=True)
        for name, text in texts.items():
            (tmp_path / name).write_text(text, encoding="utf-8")
        write_json(tmp_path / "results.json", found)
        if spread is not None:
            write_json(tmp_path / "spread.json", spread)
        results.fill_results(tmp_path, tmp_path)
        return "".join((tmp_path / name).read_text(encoding="utf-8") for name in texts)

    return fill


def _between(text, name):
    return re.search(f"<!-- {name}: generated -->\n(.*)<!-- end of {name} -->", text, re.DOTALL)[1]


def test_the_pages_are_filled_between_their_markers_only(filled):
    text = filled()
    assert text.startswith("# [Re, in part] Training detectors\n\nBefore.\n") and "\n\nAfter.\n" in text
    for name in (*MARKERS, "channels"):
        text = text.replace(_between(text, name), "")
    before = "".join(TEXTS.values()).replace("old\nolder\n", "").replace("old\n", "")
    assert text == before.replace("# Training", "# [Re, in part] Training")


def test_the_readme_has_a_short_row_for_each_claim(filled):
    rows = [line for line in _between(filled(), "claims in short").splitlines() if line.startswith("| C")]
    for row, record, value in zip(rows, RECORDS, ("0.123", "1,234,568", "–"), strict=True):
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        needed = results.NEEDED[record["id"]]
        assert cells == [record["id"], record["sentence"], f"**{record['verdict']}**", f"{record['statistic']}: {value}", needed]


def test_what_is_needed_in_short_has_the_numbers_of_the_tolerances():
    from enhsim_tf.reproduce.paper.claims import CLAIMS

    assert list(results.NEEDED) == [claim.id for claim in CLAIMS]
    for claim in CLAIMS:
        numbers = set(re.findall(r"\d[\d.,]*\d|\d", results.NEEDED[claim.id]))
        assert numbers and numbers <= set(re.findall(r"\d[\d.,]*\d|\d", claim.tolerance)), claim.id


def test_the_readme_holds_the_claims(filled):
    rows = [line for line in _between(filled(), "claims").splitlines() if line.startswith("| C")]
    assert len(rows) == len(RECORDS)
    for row, record, value in zip(rows, RECORDS, ("0.123", "1,234,568", "–"), strict=True):
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        assert cells[0] == record["id"] and cells[1] == f"{record['sentence']} ({record['section']})"
        assert cells[2:5] == [f"{record['statistic']} ({record['tolerance']})", value, f"**{record['verdict']}**"]
        assert cells[5] == record["finding"].strip()


def test_the_readme_says_seed_and_budget_and_what_each_stage_took(filled):
    text = filled()
    assert "Seed 7, smoke budget" in _between(text, "claims")
    assert "| telemetry | 1.2 |" in text and "| enhancer | 60.5 |" in text and "| **sum** | **65** |" in text


def _spread(value, budget="smoke", seeds=(7, 8, 9)):
    claims = {
        "C1": {"range": [0.1, 0.2], "values": [value, 0.1, 0.2], "verdicts": ["reproduced"] * 3},
        "C2": {"range": [1, 2e6], "values": [1, 2e6, 3], "verdicts": ["partly", "not reproduced", "partly"]},
        "C9": {"range": None, "values": [None] * 3, "verdicts": ["not measured"] * 3},
    }
    return {"budget": budget, "seeds": seeds, "claims": claims}


def test_the_readme_gives_the_range_over_seeds_where_it_is_known(filled):
    text = filled(spread=_spread(0.12345))
    assert "0.123 (0.1 to 0.2)" in text and "the range over 3 seeds, 7 to 9, and the verdict of most of them" in text
    assert (
        "Of 3 seeds, each judged alone, 2 give [Re, in part], 1 gives [¬Re]. With the verdict of most seeds for each claim, the title is [Re, in part]."
        in text
    )
    assert "| 1,234,568 | **partly**" in text, "a speed has no range over seeds"
    assert "**partly** (over seeds: 2 partly, 1 not reproduced)" in text and text.count("over seeds:") == 1
    for other in (_spread(0.12345, budget="full"), _spread(0.12345, seeds=(0, 1))):
        assert "over seeds" not in filled(spread=other), "ranges of another run"
    older = _spread(0.12345)
    del older["claims"]["C9"]
    assert "over seeds" not in filled(spread=older), "ranges of another ledger"


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([0.15, 0.1, 0.2], "0.123 (0.1 to 0.2)"),  # another processor: the value of the seed was .15 and is .12345
        ([0.15, 0.13, 0.16], "0.123 (0.123 to 0.16)"),  # .0066 outside, and half the width is .015
        ([0.15, 0.14, 0.16], None),  # .0166 outside, and half the width is .01
        ([0.1, 0.09, 0.11], None),  # .0135 outside
        ([0.123, 0.123, 0.123], "0.123 (0.123 to 0.123)"),  # no width: equal in three digits
        ([0.124, 0.124, 0.124], None),
    ],
)
def test_ranges_of_another_processor_are_kept_and_those_of_other_code_are_not(filled, values, expected):
    spread = _spread(0.12345)
    spread["claims"]["C1"]["values"] = values
    text = filled(spread=spread)
    assert ("over 3 seeds" in text) == (expected is not None) and (expected or "| 0.123 |") in text


def test_a_value_stands_beside_the_number_that_decides(filled, found):
    found["claims"] = [RECORDS[0] | {"details": {"ridge_nrmse": 0.03, "nearest_nrmse": 0.05}}, *RECORDS[1:]]
    assert "; ridge regression 0.030, nearest windows 0.050 |" in filled()
    found["claims"] = [RECORDS[0], RECORDS[1] | {"details": {"cost_ratio": 11.94}}, *RECORDS[2:]]
    assert ", in 11.9 times the time of the coarse simulator |" in filled()


def test_a_range_says_how_many_seeds_have_a_value(filled):
    spread = _spread(0.12345)
    spread["claims"]["C1"]["values"] = [0.12345, 0.1, None]
    assert "0.123 (0.1 to 0.123 in 2 seeds, none in 1)" in filled(spread=spread)


def test_a_value_lies_in_its_range_and_a_verdict_is_counted_whatever_the_seed_had_before(filled, found):
    spread = _spread(0.12345)
    spread["claims"]["C9"] |= {"range": [1, 2], "values": [1.5, 1, 2], "verdicts": ["partly"] * 3}
    found["claims"] = [*RECORDS[:2], RECORDS[2] | {"value": 3.5, "verdict": "reproduced"}]
    text = filled(spread=spread)
    assert "| 3.5 (1 to 3.5) | **partly** (over seeds: 2 partly, 1 reproduced)" in text


def test_a_tie_is_said(filled):
    spread = _spread(0.12345)
    assert "divided equally" not in filled(spread=spread)
    spread["claims"]["C2"]["verdicts"] = ["partly", "not reproduced", "reproduced"]
    assert "On C2 the seeds are divided equally, and the worse verdict counts." in filled(spread=spread)


def test_of_a_claim_that_the_paper_does_not_test_what_holds_is_counted(filled, found):
    spread = _spread(0.12345)
    spread["claims"]["C9"] |= {"verdicts": ["not tested by the paper"] * 3, "holds": [None, "holds", "does not hold"]}
    found["claims"] = [*RECORDS[:2], RECORDS[2] | {"verdict": "not tested by the paper", "holds": "does not hold"}]
    assert "**not tested by the paper** (over seeds: 2 does not hold, 1 holds)" in filled(spread=spread)


def test_the_title_carries_the_verdict_of_most_seeds(filled):
    spread = _spread(0.12345)
    spread["claims"]["C2"]["verdicts"][1:] = ["not reproduced"] * 2
    assert filled().startswith("# [Re, in part] ") and filled(spread=spread).startswith("# [¬Re] ")


def test_the_readme_shows_what_real_channels_reached(tmp_path, filled, found):
    errors = {"nrmse": 0.1, "ridge_nrmse": 0.2, "identity_nrmse": 0.3}
    errors |= {"synchronised_nrmse": 0.01, "synchronised_ridge_nrmse": 0.02, "synchronised_identity_nrmse": 0.03}
    for name in ("b", "a"):
        (tmp_path / name).mkdir()
        claims = [RECORDS[0] | {"id": f"C{number}", "details": errors, "verdict": f"said {number}"} for number in range(1, 10)]
        claims[2] |= {"finding": "17 disjoint test windows and no known degraded truth: too little"}
        write_json(tmp_path / name / "results.json", found | {"source": f"{name}.npy", "claims": claims})
    head, rule, *rows = _between(filled(), "channels").splitlines()
    assert head.count("|") == rule.count("|") == 14
    judged = "said 1 | said 4 | said 5 | said 6 | said 7"
    assert rows == [f"| `{name}.npy` | 0.100 | 0.200 | 0.300 | 0.010 | 0.020 | 0.030 | 17 | {judged} |" for name in ("a", "b")]


def test_filling_twice_is_filling_once(tmp_path, filled):
    once = filled()
    texts = {name: (tmp_path / name).read_text(encoding="utf-8") for name in TEXTS}
    assert filled(texts) == once
    texts["README.md"] = texts["README.md"].replace("[Re, in part]", "[¬Re]")
    assert filled(texts) == once, "the verdict of the title is replaced, not added to"


@pytest.mark.parametrize("name", MARKERS)
@pytest.mark.parametrize("kind", ["begin", "end", "twice"])
def test_missing_markers_are_refused_and_all_pages_stay(tmp_path, filled, refused, name, kind):
    marker = f"<!-- end of {name} -->\n" if kind == "end" else f"<!-- {name}: generated -->\n"
    other = "<!-- other: generated -->\n"  # so that it is still a page with generated parts
    text = TEXTS[MARKERS[name]]
    text = text + f"<!-- {name}: generated -->\n<!-- end of {name} -->\n" if kind == "twice" else text.replace(marker, "") + other
    texts = TEXTS | {MARKERS[name]: text}
    with refused(name):
        filled(texts)
    assert {each: (tmp_path / each).read_text(encoding="utf-8") for each in texts} == texts


def test_without_pages_nothing_is_done(tmp_path, found):
    write_json(tmp_path / "results.json", found)
    results.fill_results(tmp_path, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["results.json"]


def test_deviations_table_has_a_row_a_setting():
    head, rule, *rows = results.deviations_table().splitlines()
    assert len(rows) == len(deviations()) > 40
    for row, about in zip(rows, deviations(), strict=True):
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        assert cells == [f"`{about['setting']}`", about["value"], about["paper"], about["author"], about["source"]]
    assert head.count("|") == rule.count("|") == 6


def test_the_repositorys_pages_are_up_to_date(tmp_path):
    if not (ROOT / "figures" / "results.json").is_file():
        pytest.skip("figures/results.json is not there yet: run the full budget")
    names = set(results.PAGES.values())
    (tmp_path / "docs").mkdir()
    for name in names:
        shutil.copy(ROOT / name, tmp_path / name)
    results.fill_results(tmp_path, ROOT / "figures")
    for name in names:
        assert (tmp_path / name).read_text(encoding="utf-8") == (ROOT / name).read_text(encoding="utf-8"), name
    assert json.loads((ROOT / "figures" / "results.json").read_text(encoding="utf-8"))["budget"] == "full"


def test_it_is_said_where_only_noise_of_a_network_pays():
    groups = [{"names": ["simulator + autoregressive network"], "seeds": [1, 2]}]
    pays = {"CORAL": {"pays": [5]}, "simulator + autoregressive network": {"pays": [5, 10]}}
    environments = {name: {"others_pay": pays, "few_seeds": groups} for name in ("white", "shot")}
    said = practice._learnt_pays(environments, {"white"})
    assert said == ". By the same rule, these pay there: simulator + autoregressive network with 5 and 10 windows on shot noise (2 seeds)"
    assert practice._learnt_pays(environments, {"white", "shot"}) == ""
