"""Tests the page that compares the earlier and the present verdicts."""

import json
import shutil
from pathlib import Path

import pytest

from enhsim_tf.common.atomic_files import write_json
from enhsim_tf.common.errors import InputError
from enhsim_tf.reproduce.paper.claims import CLAIMS
from enhsim_tf.reproduce.publish import verdicts

ROOT = Path(__file__).parents[2]
PAGE = "# Verdicts\n" + "".join(f"<!-- {name}: generated -->\n<!-- end of {name} -->\n" for name in ("verdicts", "rules", "seeds"))
DETAILS = {
    "C1": {"ridge_nrmse": [0.03, 0.031], "nearest_nrmse": [0.05, 0.05], "nrmse": [0.09, 0.1]},
    "C2": {"cost_ratio": [10.0, 14.0]},
    "C4": {"sd_ratio": [0.75, 1.01], "sd_ratio_at_end": [0.7, 1.0]},
    "C5": {"early_accuracy": [0.9, 0.95], "late_accuracy": [0.489, 0.503]},
    "C8": {"cases met": [0.0, 1.0]},
    "C9": {"cases met": [1.0, 1.0]},
}
BEFORE = {"C1": {"ridge_nrmse": [0.1081, 0.1084]}, "C2": {"cost_ratio": [13.9, 14.7]}}


@pytest.fixture
def folder(tmp_path):
    """A folder with the results of seed 0, the verdicts of three seeds and the earlier ones of two."""
    claims, spread, earlier = [], {}, {}
    for claim in CLAIMS:
        verdicts_of = ["partly", "not reproduced", "not reproduced"] if claim.tested_by_paper else ["not tested by the paper"] * 3
        holds = [None] * 3 if claim.tested_by_paper else ["does not hold", "holds in part", "does not hold"]
        claims.append({"id": claim.id, "statistic": claim.statistic, "tolerance": claim.tolerance, "value": 0.5, "verdict": verdicts_of[0]})
        claims[-1]["holds"] = holds[0]
        about = {"range": [0.1, 0.5], "values": [0.5, 0.1, None], "verdicts": verdicts_of, "holds": holds}
        spread[claim.id] = about | {"details": DETAILS.get(claim.id, {})}
        was = {
            "statistic": claim.statistic,
            "tolerance": claim.tolerance if claim.id != "C2" else "at least 1",
            "details": BEFORE.get(claim.id, {}),
        }
        earlier[claim.id] = was | {"verdicts": ["reproduced"] * 2} | ({"holds": ["holds in part"]} if not claim.tested_by_paper else {})
        if not claim.tested_by_paper:
            earlier[claim.id]["verdicts"] = ["not tested by the paper"] * 2
    write_json(tmp_path / "results.json", {"seed": 0, "budget": "full", "claims": claims})
    write_json(tmp_path / "spread.json", {"budget": "full", "seeds": [0, 1, 2], "claims": spread})
    write_json(tmp_path / "before.json", {"seeds": [0, 1], "claims": earlier})
    (tmp_path / "verdicts.md").write_text(PAGE)
    return tmp_path


def test_the_tables_by_hand(folder):
    verdicts.fill_verdicts(folder / "verdicts.md", folder / "before.json", folder)
    lines = (folder / "verdicts.md").read_text().splitlines()
    first = next(line for line in lines if line.startswith("| C1 |") and "0.108" in line)
    assert first.startswith("| C1 | reproduced | **not reproduced** (2 not reproduced, 1 partly) | ")
    assert (
        "error is 0.03 to 0.031 (before: 0.108), that of the mean of the nearest training windows 0.05 and that of the network 0.09 to 0.1."
        in first
    )
    assert any(line.startswith("| C9 | holds in part | **does not hold** (2 does not hold, 1 holds in part) | ") for line in lines)
    assert any("90.0% to 95.0% of the rows" in line for line in lines)
    assert any(line.startswith("| C2 | seconds of telemetry generated per second of computation (at least 1) | ") for line in lines)
    assert not any(line.startswith("| C3 | ") and "detectors (" in line for line in lines), "a rule that did not change"
    assert any(line.startswith("| 2 | –, not reproduced | ") and line.endswith("–, does not hold |") for line in lines)
    assert any("each judged alone, 2 give [¬Re], 1 gives [Re, in part]." in line for line in lines)


def test_nothing_is_written_without_further_seeds_or_without_the_page(folder):
    (folder / "spread.json").unlink()
    verdicts.fill_verdicts(folder / "verdicts.md", folder / "before.json", folder)
    assert (folder / "verdicts.md").read_text() == PAGE
    (folder / "verdicts.md").unlink()
    verdicts.fill_verdicts(folder / "verdicts.md", folder / "before.json", folder)
    assert not (folder / "verdicts.md").exists()


def test_a_page_without_its_markers_is_refused(folder):
    (folder / "verdicts.md").write_text("no markers")
    with pytest.raises(InputError, match="Expected the markers of 'verdicts' once in verdicts.md"):
        verdicts.fill_verdicts(folder / "verdicts.md", folder / "before.json", folder)


def test_the_repositorys_page_is_up_to_date(tmp_path):
    page = tmp_path / "verdicts.md"
    shutil.copy(ROOT / verdicts.PATH, page)
    verdicts.fill_verdicts(page, ROOT / verdicts.BEFORE, ROOT / "figures")
    assert page.read_text(encoding="utf-8") == (ROOT / verdicts.PATH).read_text(encoding="utf-8")
    seeds = json.loads((ROOT / "figures" / "spread.json").read_text(encoding="utf-8"))["seeds"]
    assert len(seeds) >= 10
