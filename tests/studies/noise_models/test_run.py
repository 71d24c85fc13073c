"""The whole path of the study at smoke budget: one family, one seed and two detectors."""

import argparse

import pytest

from studies.common.detectors import DETECTORS
from studies.common.settings import make_settings
from studies.noise_models import cells
from studies.noise_models.__main__ import run
from studies.noise_models.summary import KEPT, REAL

pytestmark = pytest.mark.slow


def test_every_model_is_tried_and_a_second_run_trains_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(cells, "DETECTORS", {name: DETECTORS[name] for name in ("limit check", "PCA residual")})
    settings = make_settings("smoke", paper__window=64, robustness__num_windows=60)
    options = argparse.Namespace(cache=tmp_path / "cache", environment="shot", fresh=False)
    first = run(options, settings, tmp_path)
    tables = KEPT.read(tmp_path)
    assert tuple(dict.fromkeys(tables["detectors"]["model"])) == (REAL, *cells.MODELS)
    assert tuple(tables["choice"]["model"]) == cells.MODELS and len(tables["detectors"]) == 2 * (1 + len(cells.MODELS))
    capsys.readouterr()
    assert run(options, settings, tmp_path) == first
    assert " ...\n" not in capsys.readouterr().out
