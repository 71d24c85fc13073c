"""The study of few windows: training data have the properties that they are named for, and the rules are those of the text."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.common.stages import Stages
from enhsim_tf.telemetry.series import Telemetry
from studies.common.settings import make_settings
from studies.few_windows import summary
from studies.few_windows.cells import QUICK, Cell, World
from studies.few_windows.record import (
    ADVERSARIAL,
    BOTH,
    CLASSIFIER,
    CLASSIFIER_ON_REAL,
    CORAL,
    NOISE_MODELS,
    ONE_LINE,
    REAL,
    SIMULATOR,
    THRESHOLD_ON_REAL,
    CoralAlignment,
    Record,
)

PUBLISHED = Path(summary.__file__).parent / "results"
WAVES = SquareWaveSimulator([SquareWave(40.0, low=-1.0, high=1.0)])


def record(num_windows=12, noise=0.2, seed=0):
    values = np.sin(2 * np.pi * np.arange(num_windows * 50) / 40) + noise * np.random.default_rng(seed).standard_normal(num_windows * 50)
    return Record(Telemetry(values.astype(np.float32)), WAVES, 50, 300, seed)


def test_the_simulator_of_a_record_generates_its_signal_and_its_noise():
    chosen = record(60)
    noise, clean = chosen.residuals
    assert noise.std() == pytest.approx(0.2, rel=0.1)
    np.testing.assert_allclose(noise + clean, chosen.windows, atol=1e-6)
    generated = chosen.generate("gaussian", 400, 1)
    assert generated.std() == pytest.approx(np.hypot(np.sqrt(0.5), 0.2), rel=0.03)
    np.testing.assert_array_equal(generated, record(60).generate("gaussian", 400, 1))
    assert not np.array_equal(generated, chosen.generate("gaussian", 400, 2))


def test_aligned_windows_have_the_mean_and_the_covariance_of_the_target():
    rng = np.random.default_rng(0)
    mixing = rng.standard_normal((6, 6))
    source, target = rng.standard_normal((20_000, 6)), rng.standard_normal((20_000, 6)) @ mixing + 3
    aligned = CoralAlignment.fit(source, target).apply(source)
    np.testing.assert_allclose(aligned.mean(axis=0), target.mean(axis=0), atol=0.05)
    np.testing.assert_allclose(np.cov(aligned.T), np.cov(target.T), atol=0.02 * np.abs(np.cov(target.T)).max())


def test_the_gradient_of_the_domain_is_reversed():
    from enhsim_tf.common.backend import tf
    from studies.few_windows.domain_adversarial import reverse_gradient

    values = tf.constant([1.0, -2.0, 3.0])
    with tf.GradientTape() as tape:
        tape.watch(values)
        unchanged = reverse_gradient(values, 0.3)
        loss = tf.reduce_sum(unchanged**2)
    np.testing.assert_allclose(unchanged, values, rtol=1e-6)
    np.testing.assert_allclose(tape.gradient(loss, values), [-0.6, 1.2, -1.8], rtol=1e-6)  # -0.3 times twice the value


@pytest.mark.slow
@pytest.mark.parametrize("adaptation", [0.0, 0.1])
def test_a_classifier_finds_what_it_was_taught(adaptation):
    from studies.few_windows.domain_adversarial import AnomalyClassifier

    rng = np.random.default_rng(0)
    nominal, real = (rng.standard_normal((300, 48)) for _ in range(2))
    step = np.where((np.arange(48) > 20) & (np.arange(48) < 30), 2.5, 0.0)
    first, second = (AnomalyClassifier(48, adaptation, seed=1).fit(nominal, nominal + step, real, 150) for _ in range(2))
    fresh = rng.standard_normal((200, 48))
    scores = first.score(fresh), first.score(fresh + step)
    assert np.mean(scores[1] > np.quantile(scores[0], 0.95)) > 0.9
    np.testing.assert_array_equal(first.score(fresh), second.score(fresh))


@pytest.mark.slow
def test_a_cell_has_all_training_data_and_is_read_from_the_cache(tmp_path):
    counts = {"num_real": (6,), "first_seed": 3, "num_windows": 30, "num_judged": 20, "num_anomalous": 6}
    changed = {f"few_windows__{name}": value for name, value in counts.items()}
    changed |= {"classifiers__num_real": (6,), "classifiers__num_steps": 3}
    settings = make_settings("smoke", paper__window=48, **changed).of("shot", 3)
    first, again = (Cell(World(settings), 6).rows(Stages(tmp_path)) for _ in range(2))
    pd.testing.assert_frame_equal(first, again)
    simulated = [SIMULATOR + name for name in NOISE_MODELS]
    assert set(first["arm"]) == {REAL, BOTH, THRESHOLD_ON_REAL, CORAL, CLASSIFIER, ADVERSARIAL, CLASSIFIER_ON_REAL, ONE_LINE, *simulated}
    for arm in (REAL, BOTH, THRESHOLD_ON_REAL, CORAL, *simulated):
        assert tuple(first[first["arm"] == arm]["detector"]) == QUICK
    assert (first["windows"] == 20).all() and (first["num_real"] == 6).all() and (first["environment"] == "shot").all()


def test_the_record_ends_before_the_judged_windows():
    world = World(make_settings("smoke", paper__seed=3, few_windows__num_real=(5, 20), few_windows__num_judged=8))
    few, many = world.record(5), world.record(20)
    np.testing.assert_array_equal(few.telemetry.values, many.telemetry.values[-5 * world.window :])
    assert few.telemetry.offset_s == 15 * world.window
    first = world.judged["nominal"][0]
    np.testing.assert_array_equal(first, world.values[21 * world.window : 22 * world.window])  # a gap of one window


def table(rates, recall=0.6, seed=1):
    """A table with one detector: rates by training data and number of real windows; `recall` is that of the simulator."""
    made = []
    for arm, by_number in rates.items():
        for number, rate in by_number.items():
            row = {"arm": arm, "detector": "a", "alarms": round(1_000 * rate), "windows": 1_000, "recall": 0.5, "num_real": number}
            matched = {"recall_at_real_rate": 0.6 if arm == REAL else recall}
            made.append(row | matched | {"seed": seed, "environment": "white", "set_for": 0.01})
    return pd.DataFrame(made)


RATES = {REAL: {5: 0.11, 20: 0.03, 100: 0.012}, SIMULATOR + "gaussian": {5: 0.06, 20: 0.021, 100: 0.01}}


@pytest.mark.parametrize(("recall", "pays"), [(0.6, [5]), (0.58, [5]), (0.56, [])])
def test_a_simulator_pays_where_it_halves_the_excess_without_losing_recall(recall, pays):
    found = summary.summarise({"rows": table(RATES, recall)})["environments"]["white"]
    assert found["pays"] == {SIMULATOR + "gaussian": pays}  # five points of ten; 1.1 of 2; and from 100 on the real windows suffice
    assert found["real_suffices_from"] == 100


def test_training_data_with_fewer_seeds_are_compared_with_the_real_windows_of_their_own_seeds(near):
    second = table({REAL: {5: 0.01, 20: 0.01, 100: 0.01}}, seed=2)
    found = summary.summarise({"rows": pd.concat([table(RATES), second], ignore_index=True)})["environments"]["white"]
    assert found["pays"] == {SIMULATOR + "gaussian": [5]}
    assert found["arms"][REAL]["rate"] == near({"5": 0.06, "20": 0.02, "100": 0.011})


def test_beside_classifiers_stands_the_detector_that_finds_most(near):
    second = table({REAL: {5: 0.01, 20: 0.01}}).assign(detector="b", recall_at_real_rate=0.7)
    rows = pd.concat([table(RATES), second, table({CLASSIFIER: {20: 0.01}, CLASSIFIER_ON_REAL: {20: 0.01}})], ignore_index=True)
    found = summary.summarise({"rows": rows})["environments"]["white"]
    assert found["best_detector"] == {"20": {"name": "b", "recall_at_real_rate": near(0.7)}}


def test_the_published_findings_come_from_the_published_table(near):
    kept = json.loads((PUBLISHED / "findings.json").read_text(encoding="utf-8"))
    again = summary.summarise(summary.KEPT.read(PUBLISHED))
    assert json.loads(json.dumps(again)) == near({key: kept[key] for key in again}) and kept["budget"] == "full"
