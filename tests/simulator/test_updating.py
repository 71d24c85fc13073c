import dataclasses

import numpy as np
import pytest

from enhsim_tf.coarse_simulator.recording import Run
from enhsim_tf.common.errors import InputError
from enhsim_tf.simulator.joint import join_channels
from enhsim_tf.simulator.updating import update
from tests.simulator.conftest import coarse_run, series


@pytest.fixture(scope="module")
def newer():
    (telemetry,) = join_channels({"volts": series(seed=9)})
    return dataclasses.replace(telemetry, parts=(Run(3 * telemetry.parts[0].values + 10),))


def test_the_new_level_gain_and_noise_are_reported(single, newer):
    updated, report = update(single[0], newer)
    before, after = report.before, report.after  # the wave from 3 to 7 becomes one from 19 to 31
    assert before["level"]["volts"] == pytest.approx(5, rel=0.02) and after["level"][
        "volts"
    ] == pytest.approx(25, rel=0.02)
    assert after["gain"]["volts"] / before["gain"]["volts"] == pytest.approx(3, rel=0.05)
    assert report.after["noise_sd"]["volts"] == pytest.approx(0.3, rel=0.2) and single[
        0
    ].noise_sd == pytest.approx(0.1, rel=0.2)
    assert (
        report.before["alarms"] > 0.9 > 0.1 > report.after["alarms"]
        and updated.trained["updates"][0]["num_samples"] == 3_000
    )
    assert "flagged samples" in report.lines()[-1] and report.to_dict()["channels"] == ["volts"]


def test_a_simulator_of_runs_is_updated_with_the_run_of_the_new_time(of_run, newer):
    with pytest.raises(InputError, match="--coarse"):
        update(of_run[0], newer)
    updated, report = update(of_run[0], newer, coarse_run())
    assert report.after["nrmse"]["volts"] < 0.1 < report.before["nrmse"]["volts"]
    enhanced = updated.enhance_run(coarse_run(400).parts[0].values)
    assert enhanced.mean() == pytest.approx(25, rel=0.02) and np.std(enhanced) > 4
