"""The recorded pair in `examples/battery`: two commands' worth of Python on a battery's coarse and fine simulator."""

from pathlib import Path

import numpy as np
import pytest

from enhsim_tf.coarse_simulator.recording_files import read_recording
from enhsim_tf.enhanced_simulator.runs import fitting
from enhsim_tf.enhanced_simulator.runs.fitting import fit_run_model
from enhsim_tf.enhanced_simulator.runs.options import RunOptions
from enhsim_tf.enhancer.ladder import COARSE, LEVEL_AND_GAIN, RIDGE
from enhsim_tf.telemetry.cleaning.clean import clean
from enhsim_tf.telemetry.sources import read_source

PAIR = Path(__file__).parents[3] / "examples" / "battery"


@pytest.fixture(scope="module")
def fitted():
    parts = clean(read_source(PAIR / "telemetry.csv")["volts"]).parts
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fitting, "RUNGS", (COARSE, LEVEL_AND_GAIN, RIDGE))
        return fit_run_model(
            parts, read_recording(PAIR / "simulator.csv"), RunOptions(window=100, num_windows=600, noise="residual windows")
        )


def test_the_enhanced_run_has_less_than_half_the_error_of_the_coarse_one(fitted):
    _, report = fitted
    assert report.is_held_out and report.nrmse["enhanced"] < 0.5 * report.nrmse["coarse"]


def test_a_fault_run_keeps_its_labels_and_is_said_to_be_outside_the_range(fitted):
    model, report = fitted
    fault = read_recording(PAIR / "simulator_fault.csv", model.columns, interval_s=model.interval_s)
    (part,) = model.usable(fault).parts
    labels = np.asarray(part.carried["mask"]) > 0
    outside = model.coverage.score(part.values) > 1
    assert outside[labels].mean() > outside[~labels].mean() and report.outside < outside[labels].mean()
    (copy,) = next(model.generate_copies(fault, 1, seed=0))
    measured = read_source(PAIR / "telemetry_fault.csv")["volts"].to_numpy()
    coarse = part.values[:, model.columns.index("volts")]
    assert len(copy) == len(measured) == len(part.carried["scenario"])
    assert np.sqrt(np.mean((copy - measured) ** 2)) < np.sqrt(np.mean((coarse - measured) ** 2))
