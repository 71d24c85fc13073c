"""The frame that studies share."""

import argparse
import json
import types

import pandas as pd
import pytest

from studies.common import replicates
from studies.common.settings import make_settings
from studies.common.tables import KeptTables


def test_a_study_joins_the_tables_of_its_replicates_and_computes_findings_from_what_it_wrote(tmp_path, monkeypatch, capsys):
    kept = KeptTables(names=("rows",), labels=(), digits=1, command="x")

    def summarise(read):
        return {"values": read["rows"]["value"].tolist()}

    def tables_of(name, seed, stages):
        assert stages.cache == tmp_path / "cache"
        return {"rows": pd.DataFrame({"value": [seed + {"a": 0.123, "b": 0.5}[name]]})} if (name, seed) != ("b", 3_000) else {}

    made = types.SimpleNamespace(KEPT=kept, summarise=summarise, FIGURES={})
    monkeypatch.setattr(replicates, "importlib", types.SimpleNamespace(import_module=lambda name: made))
    options = argparse.Namespace(cache=tmp_path / "cache", fresh=False)
    about = {"versions": {"other": "1"}}
    settings = make_settings("smoke", battery__num_seeds=2)
    found = replicates.run_study("battery", tables_of, ("a", "b"), options, settings, tmp_path, about)
    assert found["values"] == pytest.approx([3_000.1, 3_001.1, 3_001.5])  # rounded as they are stored; one replicate is left out
    assert found["budget"] == "smoke" and found["versions"]["other"] == "1" and "tensorflow" in found["versions"]
    assert json.loads((tmp_path / "findings.json").read_text()) == found
    told = [line for line in capsys.readouterr().out.splitlines() if line.startswith("replicate")]
    names = ("a, seed 3000", "b, seed 3000", "a, seed 3001", "b, seed 3001")
    assert told == [f"replicate {number} of 4: {name}" for number, name in enumerate(names, 1)]
