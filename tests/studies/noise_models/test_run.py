"""The whole path of the study at smoke budget: one family, one seed and two detectors."""

import json

import pandas as pd
import pytest

from enhsim_tf.detection.registry import DETECTORS
from studies.common.settings import make_settings
from studies.noise_models import cells, run
from studies.noise_models.summary import KEPT

pytestmark = pytest.mark.slow


def test_every_model_is_tried_and_a_second_run_trains_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(cells, "DETECTORS", {name: DETECTORS[name] for name in ("limit check", "PCA residual")})
    settings = make_settings("smoke", paper__window=64, robustness__num_windows=60)
    out, told = tmp_path / "out", []
    out.mkdir()
    arguments = (settings, tmp_path / "cache", out, ["shot"], None, False)
    first = run.run(*arguments, told.append)
    tables = KEPT.read(out)
    assert tuple(dict.fromkeys(tables["detectors"]["model"])) == (cells.REAL, *cells.MODELS)
    assert tuple(tables["choice"]["model"]) == cells.MODELS and len(tables["detectors"]) == 2 * (1 + len(cells.MODELS))
    assert json.loads((out / "findings.json").read_text(encoding="utf-8")) == first
    told.clear()
    assert run.run(*arguments, told.append) == first
    assert not any(line.endswith(" ...") for line in told)
    run.run(*arguments[:4], cells.LEARNT, False, told.append)  # its rows replace themselves, and the others are kept
    for name, table in KEPT.read(out).items():
        keys = list(table.columns)
        pd.testing.assert_frame_equal(table.sort_values(keys, ignore_index=True), tables[name].sort_values(keys, ignore_index=True))
