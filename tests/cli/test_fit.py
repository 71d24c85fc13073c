import argparse

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.cli import fit
from enhsim_tf.cli.shared import tell_failed
from enhsim_tf.common.atomic_files import sha256
from enhsim_tf.common.parallel.local import ProcessesDiedError
from enhsim_tf.fitting import fit as fitting
from enhsim_tf.fitting.fit import fit as fit_telemetry
from enhsim_tf.fitting.options import FitOptions
from enhsim_tf.simulator.model_folder import channels_of, models_of, name_of_channels
from enhsim_tf.telemetry.cleaning.clean import Cleaning
from tests.fitted_simulators import joint, series

OPTIONS = FitOptions(window=64, num_windows=100, enhancer="ridge", noise="residual windows")


def table(**more):
    times = pd.date_range("2024-01-01", periods=1_500, freq="10s", tz="UTC")
    values = joint(1_500).parts[0].values
    columns = {"volts": values[:, 0], "watts": values[:, 1], **more}
    return {name: pd.Series(each, times, name=name) for name, each in columns.items()}


def options_of(tmp_path, **more):
    given = {
        "out": tmp_path / "models",
        "chosen": OPTIONS,
        "cleaning": Cleaning(),
        "engine": "local",
        "json": True,
        "coarse": None,
    }
    return argparse.Namespace(**given | more)


def fitted(tmp_path, columns, separately=False, workers=None):
    lines = []
    options = options_of(tmp_path, separately=separately, workers=workers)
    return (*fit.fit_channels(columns, options, lines.append), lines)


def test_all_channels_become_one_simulator_and_one_that_cannot_is_left_out(tmp_path):
    reports, failed, lines = fitted(tmp_path, table(huge=np.arange(1_500) * 1e37))
    assert list(failed) == ["huge"] and "float32" in str(failed["huge"])
    ((name, folder),) = models_of(tmp_path / "models").items()
    assert name_of_channels([f"channel {number}" for number in range(30)]) == "channel 0~29 more"
    assert list(reports) == [name] == ["volts~watts"] and channels_of(folder) == ("volts", "watts")
    files = {"arrays.npz", "settings.json", "manifest.json", "report.json", "report.png"}
    assert {path.name for path in folder.iterdir()} == files
    assert any("cross-correlation" in line for line in lines)


def test_separate_simulators_have_the_same_bytes_in_this_process_and_in_another(tmp_path):
    sums, models = [], tmp_path / "models"
    for workers in (0, 1):
        reports, failed, lines = fitted(tmp_path, table(), separately=True, workers=workers)
        assert sorted(reports) == ["volts", "watts"] and not failed
        assert sum("in place of the one that was there" in line for line in lines) == 2 * workers
        sums.append([sha256(models / name / "arrays.npz") for name in ("volts", "watts")])
    assert sums[0] == sums[1]


@pytest.mark.parametrize("quiet", [True, False])
def test_a_worker_tells_its_progress_unless_it_is_to_be_quiet(tmp_path, capsys, quiet):
    options = options_of(tmp_path, json=False, quiet=quiet)
    (tmp_path / "models").mkdir()
    group = {"volts": table()["volts"]}
    fit.fit_or_say(group, tmp_path / "models", options)
    assert bool(capsys.readouterr().out) != quiet


def test_channels_of_other_rates_become_simulators_of_their_own(tmp_path):
    fast = pd.Series(
        series(6_000).values[:, 0], pd.date_range("2024-01-01", periods=6_000, freq="1s", tz="UTC")
    )
    reports, failed, lines = fitted(tmp_path, table() | {"fast": fast})
    assert sorted(reports) == ["fast", "volts~watts"] and not failed
    assert any("get a simulator of their own: volts, watts; fast" in line for line in lines)


def test_a_defect_that_one_channel_meets_stops_no_other_and_is_raised_in_the_end(
    tmp_path, monkeypatch, capsys
):
    def fit_or_break(telemetry, *others):
        if telemetry.columns == ("bad",):
            raise ZeroDivisionError("a defect")
        return fit_telemetry(telemetry, *others)

    monkeypatch.setattr(fitting, "fit", fit_or_break)
    few = np.where(np.arange(1_500) < 100, 1.0, np.nan)
    columns = table(bad=np.arange(1_500) % 40, short=few)
    reports, failed, _ = fitted(tmp_path, columns, separately=True, workers=0)
    assert list(reports) == ["volts", "watts"] and list(failed) == ["bad", "short"]
    with pytest.raises(ZeroDivisionError, match="a defect") as raised:
        tell_failed(failed)
    assert "in fit_or_break" in raised.value.__notes__[0]
    assert capsys.readouterr().err.startswith("error: short: Expected at least 256 samples")


def test_a_channel_that_kills_its_workers_is_reported_and_stops_no_other(tmp_path, monkeypatch):
    tried = []

    def run(engine, work, groups, workers):
        names = [name for (name,) in groups]
        tried.append(names)
        for name in names:
            if name == "bad":
                raise ProcessesDiedError([{name: None}])
            yield fit.Outcome(name, lines=[name])

    monkeypatch.setattr(fit.engines, "run", run)
    _, failed, lines = fitted(
        tmp_path, dict.fromkeys(["a", "bad", "c", "d"]), separately=True, workers=4
    )
    assert list(failed) == ["bad"] and "Memory" in str(failed["bad"]) and lines == ["a", "c", "d"]
    assert tried == [["a", "bad", "c", "d"], ["c", "d"]]
