import dataclasses

import numpy as np
import pytest

from enhsim_tf.coarse.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.common.errors import InputError
from enhsim_tf.fitting.fit import fit
from enhsim_tf.fitting.update import update
from enhsim_tf.telemetry.joining import one_series
from tests.fitted_simulators import QUICK, coarse_run, joint, recorded, series
from tests.known_simulators import of_waves

UNFITTED = of_waves([SquareWaveSimulator([SquareWave(40.0)])], 64)


@pytest.fixture(scope="module")
def newer():
    return recorded(3 * series(seed=9).values + 10)


def test_the_new_level_gain_and_noise_are_reported(single, newer):
    updated, report = update(single[0], newer)
    before, after = report.before, report.after  # the wave from 3 to 7 becomes one from 19 to 31
    levels = before.level["volts"], after.level["volts"]
    assert levels == pytest.approx((5, 25), rel=0.02)
    assert after.gain["volts"] / before.gain["volts"] == pytest.approx(3, rel=0.05)
    noise_sd = single[0].noise_sd[0], after.noise_sd["volts"]
    assert noise_sd == pytest.approx((0.1, 0.3), rel=0.2)
    assert before.alarms > 0.9 > 0.1 > after.alarms
    assert updated.trained["updates"][0]["num_samples"] == 3_000
    assert "above the threshold" in report.lines()[-1] and report.to_dict()["channels"] == ["volts"]


def test_alarms_after_an_update_are_of_views_that_have_not_learnt_the_held_out_end(single):
    values = series(seed=9).values.copy()
    values[2_400:] += 1.0  # half of the wave, ten standard deviations of the noise
    moved = recorded(values)
    report = update(single[0], moved)[1]
    assert report.after.alarms == fit(moved, options=QUICK)[1].false_alarms > 0.9
    assert report.num_held_out == 600
    assert update(single[0], moved, held_out=0.0)[1].num_held_out == 0


def test_channels_in_another_order_keep_their_names(both):
    swapped = joint(seed=9).select(["watts", "volts"])
    updated, report = update(both[0], swapped)
    assert updated.channels == ("volts", "watts")
    assert list(report.after.level.values()) == pytest.approx([5, 100], rel=0.02)
    real, _, clean = both[0].windows_and_signals(both[0].pair(swapped), 50)
    assert np.std(real - clean, axis=(0, 1)) == pytest.approx([0.2, 3.0], rel=0.1)


def test_parts_that_are_shorter_than_the_longest_windows_of_views_suffice():
    quick = dataclasses.replace(QUICK, window=32, num_windows=100)
    simulator, _ = fit(series(1_500), options=quick)
    parts = [series(1_500).part(first, first + 62) for first in range(0, 1_488, 80)]
    assert update(simulator, one_series(parts))[1].after.alarms < 0.1


@pytest.mark.parametrize(
    ("words", "use"),
    [
        ("without 'watts'", lambda model: update(model, joint().select(["volts"]))),
        (
            "without 'watts'",
            lambda model: model.windows_and_signals(model.pair(joint().select(["volts"])), 5),
        ),
        ("a Telemetry. Received: ndarray", lambda model: update(model, joint().values)),
        ("options of its fit", lambda model: update(UNFITTED, joint())),
    ],
)
def test_what_is_refused(both, words, use):
    with pytest.raises(InputError, match=words):
        use(both[0])


def test_a_simulator_of_runs_is_updated_with_the_run_of_the_new_time(of_run, newer):
    with pytest.raises(InputError, match="--coarse"):
        update(of_run[0], newer)
    updated, report = update(of_run[0], newer, coarse_run())
    assert report.after.nrmse["volts"] < 0.1 < report.before.nrmse["volts"]
    enhanced = updated.enhance_run(coarse_run(400).parts[0].values)
    assert enhanced.mean() == pytest.approx(25, rel=0.02) and np.std(enhanced) > 4
