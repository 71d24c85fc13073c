"""The whole path of studies at smoke budget: one kind of noise, one seed, narrow networks and two detectors."""

import argparse
import importlib
import json

import numpy as np
import pytest

from enhsim_tf.coarse_simulator.degraded import MODES
from studies.common.controls import CONTROLS
from studies.common.detectors import DETECTORS
from studies.common.settings import make_settings
from studies.few_windows.cells import QUICK
from studies.noise_models import cells
from studies.noise_models.real_floor import MEASURES
from studies.robustness import replicate
from studies.robustness.degraded_modes import METHODS, SEVERITIES

SMALL = {
    "paper__window": 64,
    "paper__num_windows": 40,
    "paper__iterations": 1,
    "paper__record_every": 1,
    "paper__hidden_units": 64,
}
SMALL |= {"robustness__num_windows": 60, "robustness__num_seeds": 1, "modes__num_learnt": 90}
JUDGED, MODELS = (
    2 * len(replicate.ARMS) + len(CONTROLS),
    len(cells.MODELS),
)  # controls on real windows only
ROWS = {
    "robustness": {
        "alarms": 10 * JUDGED,
        "recall": 8 * 5 * JUDGED,
        "degraded": len(METHODS) * (1 + len(MODES) * len(SEVERITIES)),
    },
    "noise_models": {"detectors": 2 * (1 + MODELS), "realism": len(MEASURES) * (1 + MODELS)},
    "few_windows": {
        "rows": 2 * 5 * len(QUICK)
    },  # numbers of windows, kinds of training data, detectors
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
    run, kept = (
        importlib.import_module(f"studies.{study}.__main__").run,
        importlib.import_module(f"studies.{study}.summary").KEPT,
    )
    options, settings = (
        argparse.Namespace(cache=tmp_path / "cache", environment="shot", fresh=False),
        make_settings("smoke", **SMALL),
    )
    first = run(options, settings, tmp_path)
    assert {name: len(table) for name, table in kept.read(tmp_path).items()} == ROWS[study]
    assert (
        first["budget"] == "smoke"
        and json.loads((tmp_path / "findings.json").read_text(encoding="utf-8")) == first
    )
    assert all(
        'id="watermark"' in figure.read_text(encoding="utf-8") for figure in tmp_path.glob("*.svg")
    )
    if (
        study == "robustness"
    ):  # of two sines of amplitudes a the square waves miss sqrt(1.5 - 4 / pi) a each; the signal is a / sqrt(2)
        assert first["modes"]["nrmse"]["coarse"]["nominal"] == pytest.approx(
            np.sqrt(3 - 8 / np.pi), rel=0.1
        )
    capsys.readouterr()
    assert run(options, settings, tmp_path) == first
    assert " ...\n" not in capsys.readouterr().out
