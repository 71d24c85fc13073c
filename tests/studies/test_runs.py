"""The whole path of studies at smoke budget: one kind of noise, one seed, narrow networks and two
detectors.
"""

import argparse
import importlib
import json

import numpy as np
import pytest

from enhsim_tf.coarse.degraded import MODES
from studies.common.detectors import CONTROLS, DETECTORS
from studies.common.settings import make_settings
from studies.few_windows.cells import QUICK
from studies.noise_models import cells
from studies.noise_models.real_floor import MEASURES
from studies.robustness import replicate
from studies.robustness.degraded_modes import METHODS, SEVERITIES

SMALL = {
    "paper__window": 64,
    "paper__num_windows": 40,
    "paper__iterations": 2,
    "paper__record_every": 1,
    "paper__hidden_units": 64,
}
SMALL |= {"robustness__num_windows": 60, "robustness__num_seeds": 1, "modes__num_learnt": 90}
# controls on real windows only
JUDGED, MODELS = 2 * len(replicate.ARMS) + len(CONTROLS), len(cells.MODELS)
ROWS = {
    "robustness": {
        "alarms": 10 * JUDGED,
        "recall": 8 * 5 * JUDGED,
        "degraded": len(METHODS) * (1 + len(MODES) * len(SEVERITIES)),
    },
    "noise_models": {"detectors": 2 * (1 + MODELS), "realism": len(MEASURES) * (1 + MODELS)},
    # numbers of windows, kinds of training data, detectors
    "few_windows": {"rows": 2 * 5 * len(QUICK)},
}


@pytest.mark.slow
@pytest.mark.usefixtures("narrow_enhancer")
@pytest.mark.parametrize("study", ROWS)
def test_every_table_has_every_row_and_a_second_run_trains_nothing(
    study, tmp_path, monkeypatch, capsys
):
    for module in (replicate, cells):
        monkeypatch.setattr(
            module, "DETECTORS", {name: DETECTORS[name] for name in ("limit check", "PCA residual")}
        )
    run = importlib.import_module(f"studies.{study}.__main__").command.run
    kept = importlib.import_module(f"studies.{study}.summary").KEPT
    options = argparse.Namespace(cache=tmp_path / "cache", environments=("shot",), fresh=False)
    settings = make_settings("smoke", **SMALL)
    first = run(options, settings, tmp_path)
    assert {name: len(table) for name, table in kept.read(tmp_path).items()} == ROWS[study]
    assert first["budget"] == "smoke"
    assert json.loads((tmp_path / "findings.json").read_text(encoding="utf-8")) == first
    for figure in tmp_path.glob("*.svg"):
        assert 'id="watermark"' in figure.read_text(encoding="utf-8")
    # of two sines of amplitudes a the square waves miss sqrt(1.5 - 4 / pi) a each; the signal is a
    # / sqrt(2)
    if study == "robustness":
        errors = first["modes"]["nrmse"]["coarse"]
        assert errors["nominal"] == pytest.approx(np.sqrt(3 - 8 / np.pi), rel=0.1)
    capsys.readouterr()
    assert run(options, settings, tmp_path) == first
    assert " ...\n" not in capsys.readouterr().out
