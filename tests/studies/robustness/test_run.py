"""The whole path of the study at smoke budget: one kind of noise, one seed, narrow networks and two detectors."""

import argparse
import json

import pytest

from enhsim_tf.coarse_simulator.degraded import MODES
from studies.common.controls import CONTROLS
from studies.common.detectors import DETECTORS
from studies.common.settings import make_settings
from studies.robustness import replicate
from studies.robustness.__main__ import run
from studies.robustness.degraded_modes import METHODS, SEVERITIES
from studies.robustness.replicate import ARMS
from studies.robustness.summary import KEPT

pytestmark = pytest.mark.slow

SMALL = {"paper__num_windows": 40, "modes__num_learnt": 90, "robustness__num_windows": 120}
SMALL |= {"robustness__num_seeds": 1, "paper__iterations": 1, "paper__record_every": 1, "paper__hidden_units": 64}


@pytest.mark.usefixtures("narrow_networks")
def test_every_table_has_every_row_and_a_second_run_trains_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(replicate, "DETECTORS", {name: DETECTORS[name] for name in ("limit check", "PCA residual")})
    options = argparse.Namespace(cache=tmp_path / "cache", environment="shot", fresh=False)
    first = run(options, make_settings("smoke", **SMALL), tmp_path)
    tables = KEPT.read(tmp_path)
    detectors = 2 * len(ARMS) + len(CONTROLS)  # controls on real windows only
    assert len(tables["alarms"]) == detectors * 10 and len(tables["recall"]) == detectors * 8 * 5
    assert (tables["alarms"].groupby(["arm", "detector"])["windows"].sum() == 59).all()  # disjoint windows of a quarter of 120,000 samples
    assert len(tables["degraded"]) == len(METHODS) * (1 + len(MODES) * len(SEVERITIES))
    assert first["budget"] == "smoke" and json.loads((tmp_path / "findings.json").read_text(encoding="utf-8")) == first
    assert 'id="watermark"' in (tmp_path / "false_alarms.svg").read_text(encoding="utf-8")
    capsys.readouterr()
    assert run(options, make_settings("smoke", **SMALL), tmp_path) == first
    assert " ...\n" not in capsys.readouterr().out
