"""The frame that studies share."""

import json

import pandas as pd
import pytest

from studies.common.replicates import collect, seed_by_seed, write_results
from studies.common.tables import KeptTables


def test_tables_of_replicates_are_joined_in_their_order_and_one_may_be_left_out(tmp_path):
    def replicate(number):
        def tables(stages):
            assert stages.cache == tmp_path
            return {"rows": pd.DataFrame({"number": [number]})} if number != 2 else {}

        return tables

    told = []
    found = collect("replicate", [(f"the {number}.", replicate(number)) for number in (3, 2, 1)], tmp_path, False, told.append)
    assert list(found) == ["rows"] and list(found["rows"]["number"]) == [3, 1] and list(found["rows"].index) == [0, 1]
    assert [line for line in told if "replicate" in line][0] == "replicate 1 of 3: the 3."


def test_all_names_with_one_seed_come_before_the_next_seed():
    replicates = seed_by_seed(lambda name, seed, stages: {"rows": (name, seed, stages)}, ("a", "b"), range(3, 5))
    assert [name for name, _ in replicates] == ["a, seed 3", "b, seed 3", "a, seed 4", "b, seed 4"]
    assert replicates[1][1]("stages") == {"rows": ("b", 3, "stages")}


def test_findings_are_computed_from_the_written_tables_and_name_the_versions(tmp_path):
    kept = KeptTables(names=("rows",), labels=(), digits=1, kind="study", command="x")
    tables = {"rows": pd.DataFrame({"value": [0.123]})}

    def summarise(read):
        return {"seeds": [1], "value": float(read["rows"]["value"].iloc[0])}

    found = write_results(tables, kept, summarise, {}, tmp_path, {"budget": "smoke", "versions": {"other": "1"}})
    assert found["value"] == pytest.approx(0.1)  # rounded as it is stored
    assert found["budget"] == "smoke" and found["versions"]["other"] == "1" and "tensorflow" in found["versions"]
    assert json.loads((tmp_path / "findings.json").read_text()) == found
