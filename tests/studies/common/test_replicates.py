"""The frame that studies share."""

import argparse
import json
import types

import pandas as pd
import pytest

from studies.common import replicates
from studies.common.settings import make_settings
from studies.common.tables import KeptTables


def test_a_study_joins_the_tables_of_its_replicates_and_computes_findings_from_what_it_wrote(
    tmp_path, monkeypatch
):
    def tables_of(name, seed, stages):
        assert stages.cache == tmp_path / "cache"
        value = seed + {"a": 0.123, "b": 0.5}[name]
        return {"rows": pd.DataFrame({"value": [value]})} if (name, seed) != ("b", 3_000) else {}

    kept = KeptTables(names=("rows",), labels=(), digits=1, command="x")
    made = types.SimpleNamespace(
        KEPT=kept, summarise=lambda read: {"values": read["rows"]["value"].tolist()}, FIGURES={}
    )
    modules = types.SimpleNamespace(import_module=lambda name: made)
    monkeypatch.setattr(replicates, "importlib", modules)
    options = argparse.Namespace(cache=tmp_path / "cache", fresh=False)
    settings, about = make_settings("smoke", battery__num_seeds=2), {"versions": {"other": "1"}}
    found = replicates.run_study(
        "battery", tables_of, ("a", "b"), options, settings, tmp_path, about
    )
    # rounded as they are stored; one replicate is left out
    assert found["values"] == pytest.approx([3_000.1, 3_001.1, 3_001.5])
    assert found["budget"] == "smoke" and found["versions"].keys() >= {"other", "tensorflow"}
    assert json.loads((tmp_path / "findings.json").read_text()) == found
