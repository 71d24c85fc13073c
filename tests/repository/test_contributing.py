"""Each how-to of CONTRIBUTING.md is followed: its file is made, its line is added, and the contract
holds.
"""

import sys
import types
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.cli.arguments import parse
from enhsim_tf.fitting.fit import fit
from enhsim_tf.noise.registry import NOISES
from enhsim_tf.scoring.scorer import Scorer
from enhsim_tf.scoring.views import VIEWS
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.reading.formats import READERS
from enhsim_tf.telemetry.sources import read_telemetry
from tests.coarse.test_interface import check_simulator
from tests.fitted_simulators import QUICK, series
from tests.scoring.test_views import check_view
from tests.simulator.test_packing import check_noise_model
from tests.telemetry.test_sources import check_reader

PAGE = (Path(__file__).parents[2] / "CONTRIBUTING.md").read_text(encoding="utf-8")


def blocks_of(title):
    """The file and the line of a how-to."""
    section = PAGE.partition(f"## {title}\n")[2].partition("\n## ")[0]
    return [part.partition("```")[0] for part in section.split("```python\n")[1:]]


@pytest.fixture
def followed(monkeypatch):
    """`followed(title, module)` makes the module of a how-to, and returns its names and the entry
    that its line adds to a registry.
    """

    def follow(title, module):
        file, line = blocks_of(title)
        made = types.ModuleType(module)
        if module in sys.modules:  # the file is there, and the block is a part of it
            vars(made).update(vars(sys.modules[module]))
        exec(file, vars(made))
        monkeypatch.setitem(sys.modules, module, made)
        ((name, entry),) = eval(f"{{{line}}}", vars(made)).items()
        return name, entry

    return follow


def test_a_reader_is_added(followed, monkeypatch, tmp_path):
    ending, reader = followed("Add a reader of telemetry", "enhsim_tf.telemetry.reading.formats")
    monkeypatch.setitem(READERS, ending, reader)
    check_reader(ending, tmp_path)
    times = pd.date_range("2024-01-01", periods=60, freq="s", tz="UTC")
    pd.DataFrame({"time": times, "volts": np.arange(60.0)}).to_feather(tmp_path / f"x{ending}")
    (telemetry,) = read_telemetry(tmp_path / f"x{ending}")
    assert (telemetry.columns, telemetry.interval_s) == (("volts",), 1.0)
    assert telemetry.start == "2024-01-01T00:00:00+00:00"
    np.testing.assert_array_equal(telemetry.values[:, 0], np.arange(60))


def test_a_coarse_simulator_is_added(followed, refused):
    _, example = followed("Add a coarse simulator", "enhsim_tf.coarse.ramp")
    check_simulator(*example(), refused)


def test_a_noise_model_is_added(followed, monkeypatch, tmp_path):
    name, entry = followed("Add a noise model", "enhsim_tf.noise.laplace_noise")
    monkeypatch.setitem(NOISES, name, entry)
    check_noise_model(name)
    parse(["fit", "x.csv", "--out", "models", "--noise", name])
    simulator, report = fit(series(), options=type(QUICK)(window=80, num_windows=200, noise=name))
    assert report.noise_model == name and simulator.noise_sd == pytest.approx(0.1, rel=0.3)
    simulator.save(tmp_path / "model")
    loaded = EnhancedSimulator.load(tmp_path / "model")
    assert (loaded.generate(3, seed=1) == simulator.generate(3, seed=1)).all()


def test_a_view_is_added(followed, monkeypatch):
    name, entry = followed("Add a view", "enhsim_tf.scoring.views")
    check_view(entry)
    monkeypatch.setitem(VIEWS, name, entry)
    assert name in Scorer([series().values]).names
