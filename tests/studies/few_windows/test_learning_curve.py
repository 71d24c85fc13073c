"""The experiment on the number of real windows: its arms have the properties that they are named for, and its rules are those of the text."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.common.stages import Stages
from enhsim_tf.reproduce import __main__ as command
from enhsim_tf.reproduce.settings import make_settings
from enhsim_tf.telemetry.series import Telemetry
from studies.few_windows import figures, findings
from studies.few_windows.arms import (
    ADVERSARIAL,
    BOTH,
    CHEAP_RUNGS,
    CLASSIFIER,
    CLASSIFIER_ON_REAL,
    CORAL,
    NETWORK_RUNGS,
    ONE_LINE,
    REAL,
    SIMULATOR,
    THRESHOLD_ON_REAL,
    CoralAlignment,
    Record,
)
from studies.few_windows.cells import QUICK, Cell, World
from studies.noise_models import page

WAVES = SquareWaveSimulator([SquareWave(40.0, low=-1.0, high=1.0)])


def record(num_windows=12, noise=0.2, seed=0):
    values = np.sin(2 * np.pi * np.arange(num_windows * 50) / 40) + noise * np.random.default_rng(seed).standard_normal(num_windows * 50)
    return Record(Telemetry(values.astype(np.float32)), WAVES, 50, 300, seed, 2, 2)


def test_the_rungs_are_those_of_the_ladder():
    untried = {"matched residual windows"}  # in no environment of the curve does the noise depend on the signal
    assert {*CHEAP_RUNGS, *NETWORK_RUNGS} | untried == set(command.RUNG_NAMES)


def test_the_simulator_of_a_record_generates_its_signal_and_its_noise():
    chosen = record(60)
    noise, clean = chosen.residuals
    assert noise.std() == pytest.approx(0.2, rel=0.1)
    np.testing.assert_allclose(noise + clean, chosen.windows, atol=1e-6)
    generated = chosen.generate("Gaussian", 400, 1)
    assert generated.std() == pytest.approx(np.hypot(np.sqrt(0.5), 0.2), rel=0.03)
    np.testing.assert_array_equal(generated, record(60).generate("Gaussian", 400, 1))
    assert not np.array_equal(generated, chosen.generate("Gaussian", 400, 2))


def test_aligned_windows_have_the_mean_and_the_covariance_of_the_target():
    rng = np.random.default_rng(0)
    mixing = rng.standard_normal((6, 6))
    source, target = rng.standard_normal((20_000, 6)), rng.standard_normal((20_000, 6)) @ mixing + 3
    aligned = CoralAlignment.fit(source, target).apply(source)
    np.testing.assert_allclose(aligned.mean(axis=0), target.mean(axis=0), atol=0.05)
    np.testing.assert_allclose(np.cov(aligned.T), np.cov(target.T), atol=0.02 * np.abs(np.cov(target.T)).max())


def test_the_gradient_of_the_domain_is_reversed():
    from enhsim_tf.keras_tools.backend import tf
    from studies.few_windows.domain_adversarial import reverse_gradient

    values = tf.constant([1.0, -2.0, 3.0])
    with tf.GradientTape() as tape:
        tape.watch(values)
        unchanged = reverse_gradient(values, 0.3)
        loss = tf.reduce_sum(unchanged**2)
    np.testing.assert_allclose(unchanged, values, rtol=1e-6)
    np.testing.assert_allclose(tape.gradient(loss, values), [-0.6, 1.2, -1.8], rtol=1e-6)  # -0.3 times twice the value


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


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    """The rows of one tiny cell, and of the same cell from the cache."""
    counts = {"num_real": (6,), "first_seed": 3, "num_windows": 30, "num_judged": 20, "num_anomalous": 6}
    networks = {"num_real": (6,), "num_real_classifiers": (6,), "num_real_gans": (), "num_steps": 3, "num_iterations": 2}
    changed = {f"curve__{name}": value for name, value in counts.items()}
    changed |= {f"curve_networks__{name}": value for name, value in networks.items()}
    settings = make_settings("smoke", 3, telemetry__window=48, telemetry__noise="shot", **changed)
    cache, told = tmp_path_factory.mktemp("cache"), []
    return [Cell(World(settings), 6).rows(("autoregressive network",), Stages(cache, tell=told.append)) for _ in range(2)]


def test_a_cell_has_all_arms_and_is_read_from_the_cache(rows):
    first, again = rows
    pd.testing.assert_frame_equal(first, again)
    simulated = [SIMULATOR + rung for rung in (*CHEAP_RUNGS, "autoregressive network")]
    assert set(first["arm"]) == {REAL, BOTH, THRESHOLD_ON_REAL, CORAL, CLASSIFIER, ADVERSARIAL, CLASSIFIER_ON_REAL, ONE_LINE, *simulated}
    for arm in (REAL, BOTH, THRESHOLD_ON_REAL, CORAL, *simulated):
        assert tuple(first[first["arm"] == arm]["detector"]) == QUICK
    assert (first["windows"] == 20).all() and (first["num_real"] == 6).all() and (first["environment"] == "shot").all()


def test_the_record_ends_before_the_judged_windows():
    world = World(make_settings("smoke", 3, curve__num_real=(5, 20), curve__num_judged=8))
    few, many = world.record(5), world.record(20)
    np.testing.assert_array_equal(few.telemetry.values, many.telemetry.values[-5 * world.window :])
    assert few.telemetry.offset_s == 15 * world.window
    first = world.judged["nominal"][0]
    np.testing.assert_array_equal(first, world.values[21 * world.window : 22 * world.window])  # a gap of one window


def table(real, simulated, recall=0.6):
    """A table with one detector and one seed: rates of the real windows and of the simulator by number of windows."""
    made = []
    for arm, rates, share in ((REAL, real, 0.6), (SIMULATOR + "Gaussian", simulated, recall)):
        for number, rate in rates.items():
            row = {
                "arm": arm,
                "detector": "a",
                "alarms": round(1_000 * rate),
                "windows": 1_000,
                "recall": 0.5,
                "recall_at_real_rate": share,
            }
            made.append(row | {"num_real": number, "seed": 1, "environment": "white", "set_for": 0.01})
    return {"rows": pd.DataFrame(made)}


def test_a_simulator_pays_where_it_halves_the_excess_without_losing_recall():
    real, simulated = {5: 0.11, 20: 0.03, 100: 0.012}, {5: 0.06, 20: 0.021, 100: 0.01}
    found = findings.summarise(table(real, simulated))["environments"]["white"]
    assert found["pays"] == {SIMULATOR + "Gaussian": [5]}  # five points of ten; 1.1 of 2; and from 100 on the real windows suffice
    assert found["real_suffices_from"] == 100
    assert found["bar"] == {
        "num_real": 20,
        "best": SIMULATOR + "Gaussian",
        "excess": pytest.approx(0.011),
        "real_excess": pytest.approx(0.02),
        "is_kept": False,
    }
    assert findings.summarise(table(real, simulated, recall=0.56))["environments"]["white"]["pays"] == {SIMULATOR + "Gaussian": []}
    assert findings.summarise(table(real, simulated, recall=0.58))["environments"]["white"]["pays"] == {SIMULATOR + "Gaussian": [5]}


def _with_another_seed(tables, arm):
    """The tables with a second seed, in which the real windows have no excess and an arm has no rows."""
    rows = tables["rows"]
    second = rows[rows["arm"] != arm].assign(seed=2)
    second.loc[second["arm"] == REAL, "alarms"] = 10
    return {"rows": pd.concat([rows, second], ignore_index=True)}


def test_an_arm_with_fewer_seeds_decides_nothing_and_is_compared_on_its_own_seeds(near):
    tables = table({5: 0.11, 20: 0.03}, {5: 0.06, 20: 0.021})
    network = tables["rows"][tables["rows"]["arm"] != REAL].assign(arm=SIMULATOR + "autoregressive network", alarms=10)
    both = _with_another_seed({"rows": pd.concat([tables["rows"], network], ignore_index=True)}, SIMULATOR + "autoregressive network")
    found = findings.summarise(both)
    white = found["environments"]["white"]
    assert list(white["pays"]) == [SIMULATOR + "Gaussian"] and white["bar"]["best"] == SIMULATOR + "Gaussian"
    other = white["others_pay"][SIMULATOR + "autoregressive network"]
    assert (other["pays"], other["tried"], other["seeds"]) == (
        [5, 20],
        [5, 20],
        1,
    )  # on seed 1 the real windows have excesses of 10 and 2 points
    assert other["cannot"] == []
    (few,) = white["few_seeds"]
    assert few["names"] == [SIMULATOR + "autoregressive network"]
    assert few["seeds"] == [1] and list(few["arms"]) == [REAL, SIMULATOR + "Gaussian", SIMULATOR + "autoregressive network"]
    assert few["arms"][REAL]["rate"] == {"5": 0.11, "20": 0.03} and white["arms"][REAL]["rate"] == near({"5": 0.06, "20": 0.02})
    assert few["best_detector"]["20"] == {"name": "a", "recall_at_real_rate": 0.6}
    text = page.learning_curve(found)
    assert "simulator + autoregressive network (1 seed). They pay only here:" in text
    assert "| white | real | 6.0 / 60 | 2.0 / 60 |" in text and "| white | real | 11.0 / 60 | 3.0 / 60 |" in text
    assert text.count("| white | simulator + autoregressive network |") == 1 and "The single detector that finds most" not in text
    assert "1 seed (1): simulator + autoregressive network. The same table for this seed alone:" in text
    assert "With 20 windows and its own thresholds it finds 50 % of the anomalies; training on the real windows alone finds 50 %." in text


def test_beside_classifiers_stands_the_detector_that_finds_most(near):
    tables = table({5: 0.11, 20: 0.03}, {5: 0.06, 20: 0.021})
    classifier = tables["rows"][tables["rows"]["arm"] != REAL].assign(arm=CLASSIFIER)
    both = _with_another_seed({"rows": pd.concat([tables["rows"], classifier], ignore_index=True)}, CLASSIFIER)
    assert "- white: 5 windows: a 60 %; 20 windows: a 60 %." in page.learning_curve(findings.summarise(both))


def test_arms_with_different_seeds_are_compared_with_the_real_windows_of_their_own_seeds(near):
    rows = table({5: 0.11, 20: 0.03}, {5: 0.06, 20: 0.021})["rows"]
    parts = []
    for seed, alarms in ((1, 110), (2, 50), (3, 20)):  # of the real windows, with 5 and with 20 windows
        own = rows.assign(seed=seed)
        own.loc[own["arm"] == REAL, "alarms"] = alarms
        other = own[own["arm"] != REAL]
        parts.append(own)
        if seed <= 2:
            parts.append(other.assign(arm=SIMULATOR + "autoregressive network", alarms=10))
        if seed == 1:
            parts.append(other[other["num_real"] == 20].assign(arm=CLASSIFIER, alarms=10))
    found = findings.summarise({"rows": pd.concat(parts, ignore_index=True)})
    network, classifier = found["environments"]["white"]["few_seeds"]
    assert (network["names"], network["seeds"]) == ([SIMULATOR + "autoregressive network"], [1, 2])
    assert (classifier["names"], classifier["seeds"]) == ([CLASSIFIER], [1])
    assert network["arms"][REAL]["rate"] == near({"5": 0.08, "20": 0.08})  # the mean of seeds 1 and 2
    assert classifier["arms"][REAL]["rate"] == near({"20": 0.11})  # seed 1, and only where there is a classifier
    text = page.learning_curve(found)
    assert "2 seeds (1 and 2): simulator + autoregressive network. The same table for these seeds alone:" in text
    assert "1 seed (1): classifier. The same table for this seed alone:" in text
    assert "| white | real | 8.0 / 60 | 8.0 / 60 |" in text and "| white | real | 11.0 / 60 |" in text
    assert text.count("The single detector that finds most") == 1 and "- white: 20 windows: a 60 %." in text


def test_where_real_windows_suffice_on_the_seeds_of_a_network_the_page_says_that_it_cannot_pay():
    tables = table({5: 0.11, 20: 0.012}, {5: 0.06, 20: 0.01})
    network = tables["rows"][tables["rows"]["arm"] != REAL].assign(arm=SIMULATOR + "autoregressive network", alarms=10)
    both = _with_another_seed({"rows": pd.concat([tables["rows"], network], ignore_index=True)}, SIMULATOR + "autoregressive network")
    found = findings.summarise(both)
    assert found["environments"]["white"]["others_pay"][SIMULATOR + "autoregressive network"]["cannot"] == [20]
    said = "Noise networks cannot pay where real windows suffice: on seed 1, the real windows alone suffice on white noise (20 windows)."
    assert said in page.learning_curve(found)


def test_methods_without_a_simulator_are_held_to_the_same_rule():
    tables = table({5: 0.11, 20: 0.03}, {5: 0.06, 20: 0.021})
    coral = tables["rows"][tables["rows"]["arm"] != REAL].assign(arm=CORAL, alarms=90)
    found = findings.summarise({"rows": pd.concat([tables["rows"], coral], ignore_index=True)})
    assert found["environments"]["white"]["others_pay"] == {CORAL: {"pays": [], "tried": [5, 20], "cannot": [], "seeds": 1, "recall": {}}}
    assert "none of the other methods pays: CORAL (1 seed)." in page.learning_curve(found)


def test_options_that_do_not_fit_are_refused_in_one_line(capsys):
    assert command.main(["--experiment", "learning-curve", "--rungs", "pink"]) == 2
    assert "Expected --rungs of none, Gaussian" in capsys.readouterr().err
    assert dataclasses.asdict(make_settings("smoke").curve)["num_real"] == (5, 20)


def test_the_page_and_the_figure_say_where_the_simulator_pays():
    found = findings.summarise(table({5: 0.11, 20: 0.03, 100: 0.012}, {5: 0.06, 20: 0.021, 100: 0.01}))
    text = page.learning_curve(found)
    assert (
        "**white**: a simulator with noise of a simple model pays with these numbers of real windows: Gaussian: 5. Real windows alone suffice"
        in text
    )
    assert (
        "from 100 on. With 20 windows, the excess is 2.0 points for the real windows alone and 1.1 for the best simulator (Gaussian): more"
        in text
    )
    assert "| white | real | 11.0 / 60 | 3.0 / 60 | 1.2 / 60 |" in text
    assert figures._message(found) == "A fitted simulator with a simple noise model pays with 5 real windows on white noise"
    found["environments"] |= {"shot": {"pays": {"a": []}}, "other": {"pays": {"a": [5], "b": [20]}}}
    assert figures._message(found) == (
        "A fitted simulator with a simple noise model pays with 5 real windows on white noise, with up to 20 real windows on other noise, and nowhere on shot noise"
    )


def test_the_published_findings_and_the_page_come_from_the_published_table(near):
    root = Path(__file__).parents[3]
    kept = json.loads((root / "figures" / "learning_curve" / "findings.json").read_text(encoding="utf-8"))
    again = findings.summarise(findings.KEPT.read(root / "figures" / "learning_curve"))
    assert json.loads(json.dumps(again)) == near({key: kept[key] for key in again}) and kept["budget"] == "full"
    assert page.learning_curve(kept) in (root / "docs" / "noise.md").read_text(encoding="utf-8")
