"""The study of few windows: training data have the properties that they are named for, and the
rules are those of the text.
"""

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.coarse.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.telemetry.series import Telemetry
from studies.common.settings import make_settings
from studies.few_windows import summary
from studies.few_windows.cells import World
from studies.few_windows.record import REAL, SIMULATOR, Record, coral_alignment


def test_the_simulator_of_a_record_generates_its_signal_and_its_noise():
    noise = 0.2 * np.random.default_rng(0).standard_normal(3_000)
    values = np.sin(2 * np.pi * np.arange(3_000) / 40) + noise
    coarse = SquareWaveSimulator([SquareWave(40.0, low=-1.0, high=1.0)])
    record, again = (
        Record(Telemetry.of(values.astype(np.float32)), coarse, 50, 300, 0) for _ in range(2)
    )
    noise, clean = record.residuals
    assert noise.std() == pytest.approx(0.2, rel=0.1)
    np.testing.assert_allclose(noise + clean, record.windows, atol=1e-6)
    generated = record.generate("gaussian", 400, 1)
    assert generated.std() == pytest.approx(np.hypot(np.sqrt(0.5), 0.2), rel=0.03)
    np.testing.assert_array_equal(generated, again.generate("gaussian", 400, 1))
    assert not np.array_equal(generated, record.generate("gaussian", 400, 2))


def test_aligned_windows_have_the_mean_and_the_covariance_of_the_target():
    rng = np.random.default_rng(0)
    mixing = rng.standard_normal((6, 6))
    source, target = rng.standard_normal((20_000, 6)), rng.standard_normal((20_000, 6)) @ mixing + 3
    aligned = coral_alignment(source, target)(source)
    np.testing.assert_allclose(aligned.mean(axis=0), target.mean(axis=0), atol=0.05)
    np.testing.assert_allclose(
        np.cov(aligned.T), np.cov(target.T), atol=0.02 * np.abs(np.cov(target.T)).max()
    )


def test_the_record_ends_before_the_judged_windows():
    counts = {"few_windows__num_real": (5, 20), "few_windows__num_judged": 8}
    world = World(make_settings("smoke", paper__seed=3, **counts))
    few, many = world.record(5), world.record(20)
    np.testing.assert_array_equal(few.telemetry.values, many.telemetry.values[-5 * world.window :])
    assert few.telemetry.offset_s == 15 * world.window
    first = world.judged["nominal"][0]
    # a gap of one window
    np.testing.assert_array_equal(first, world.values[21 * world.window : 22 * world.window])


@pytest.mark.parametrize(("recall", "pays"), [(0.6, [5]), (0.58, [5]), (0.56, [])])
def test_a_simulator_pays_where_it_halves_the_excess_without_losing_recall(recall, pays):
    rates = {
        REAL: {5: 0.11, 20: 0.03, 100: 0.012},
        SIMULATOR + "gaussian": {5: 0.06, 20: 0.021, 100: 0.01},
    }
    about = {"environment": "white", "seed": 0, "detector": "a", "windows": 1_000, "recall": 0.5}
    rows = [
        about
        | {
            "arm": arm,
            "num_real": number,
            "alarms": round(1_000 * rate),
            "recall_at_real_rate": 0.6 if arm == REAL else recall,
        }
        for arm, by_number in rates.items()
        for number, rate in by_number.items()
    ]
    found = summary.summarise({"rows": pd.DataFrame(rows)})["environments"]["white"]
    # five points of ten; 1.1 of 2; and from 100 on the real windows suffice
    assert found["pays"] == {SIMULATOR + "gaussian": pays}
    assert found["real_suffices_from"] == 100
