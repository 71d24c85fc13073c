"""The table of faults matches the record, every listed fault was tried, and no data was lost."""

import json
from pathlib import Path

import pytest

from tests.faults import __main__ as faults

ROOT = Path(__file__).parents[2]
RECORD = json.loads((ROOT / "docs" / "faults.json").read_text(encoding="utf-8"))


def test_the_page_shows_the_record():
    assert f"<!-- faults: generated -->\n{faults.as_markdown(RECORD)}\n<!-- end of faults -->" in (ROOT / "docs" / "faults.md").read_text(
        encoding="utf-8"
    )


@pytest.mark.parametrize(("of", "listed"), [(of, listed) for of, (_, listed) in faults.BENCHES.items()])
def test_every_fault_was_tried_and_nothing_was_lost(of, listed):
    rows = {row["fault"]: row for row in RECORD if row["of"] == of}
    assert list(rows) == list(listed)
    for fault, row in rows.items():
        assert sum(row["outcomes"].values()) == row["tries"] >= 2, fault
        assert all("same" in outcome and "NOT" not in outcome for outcome in row["outcomes"]), fault
    for fault in set(rows) & {"driver killed (SIGKILL)", "worker killed (SIGKILL)", "run killed (SIGKILL)"}:
        assert rows[fault]["tries"] == 20


def test_a_table_of_several_outcomes_counts_them():
    table = [{"of": "fleet", "fault": "f", "tries": 3, "outcomes": {"well": 2, "better": 1}, "seed": 0}]
    assert "| f | `generate --workers` | 3 | 2 × well; 1 × better |" in faults.as_markdown(table)
