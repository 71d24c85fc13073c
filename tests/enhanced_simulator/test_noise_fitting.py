"""The choice of the noise model: known noise gets the simplest model that has its properties, and what is chosen is saved and reported."""

import numpy as np
import pytest

from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.enhanced_simulator import noise_fitting
from enhsim_tf.enhanced_simulator.noise_fitting import HeldOutJudge, NoiseWindows, choose_noise, compare, pieces_of
from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
from enhsim_tf.noise.names import CANDIDATES
from enhsim_tf.noise.surrogates import GaussianAutoregression, GaussianNoise
from enhsim_tf.noise.window_bootstrap import MatchedWindowBootstrap, WindowBootstrap
from enhsim_tf.telemetry.quantisation import Levels
from enhsim_tf.telemetry.series import Telemetry

pytestmark = pytest.mark.usefixtures("narrow_enhancer")
WAVES = SquareWaveSimulator([SquareWave(40.0, low=-1.0, high=1.0)])


def series(coefficient, num_samples=24_000, seed=0, step=0.0):
    """A sine with autoregressive noise of order 1 and unit variance, scaled to a fifth."""
    from scipy.signal import lfilter

    drawn = np.random.default_rng(seed).standard_normal(num_samples)
    noise = lfilter([np.sqrt(1 - coefficient**2)], [1, -coefficient], drawn)
    values = np.sin(2 * np.pi * np.arange(num_samples) / 40) + 0.2 * noise
    return Telemetry((step * np.rint(values / step) if step else values).astype(np.float32), name="volts")


def fit(telemetry, **noise):
    """Without a noise model, held-out telemetry chooses one."""
    counts = {"num_windows": 600, "window": 64, "epochs": 1}
    return EnhancedSimulator.fit(telemetry, WAVES, 0, **counts, **noise, enhancer="ridge", verbose=0)


@pytest.mark.parametrize(("coefficient", "expected"), [(0.0, GaussianNoise), (0.8, GaussianAutoregression)])
def test_known_noise_gets_the_simplest_model_that_has_its_properties(coefficient, expected, tmp_path):
    simulator = fit(series(coefficient))
    assert type(simulator.noise) is expected
    rows = simulator.trained["noise_candidates"]
    assert [each["name"] for each in rows] == list(CANDIDATES)
    (chosen,) = [each for each in rows if each["is_chosen"]]
    assert chosen["passes"] and chosen["auc"] - max(chosen["real_auc"], 0.5) <= 0.05
    assert not any(each["passes"] for each in rows[: rows.index(chosen)])
    simulator.save(tmp_path / "model")
    assert sorted(path.name for path in (tmp_path / "model").iterdir()) == ["arrays.npz", "manifest.json", "settings.json"]
    np.testing.assert_array_equal(EnhancedSimulator.load(tmp_path / "model").generate(3, seed=1), simulator.generate(3, seed=1))


def test_the_same_seed_chooses_the_same(tmp_path):
    first, second = (fit(series(0.8, 9_000)) for _ in range(2))
    assert first.trained == second.trained
    np.testing.assert_array_equal(first.generate(4, seed=2), second.generate(4, seed=2))


def test_every_candidate_can_be_asked_for_and_is_saved(tmp_path):
    telemetry = series(0.5, 3_000)
    for noise in CANDIDATES:
        simulator = fit(telemetry, noise=noise)
        simulator.save(tmp_path / "model")
        loaded = EnhancedSimulator.load(tmp_path / "model")
        np.testing.assert_array_equal(loaded.generate(3, seed=1), simulator.generate(3, seed=1))
        assert "noise_candidates" not in loaded.trained and loaded.trained["noise"] == noise


def test_a_quantised_channel_is_judged_with_its_levels():
    simulator = fit(series(0.0, step=0.25))
    assert simulator.quantisation == Levels(0.25, simulator.quantisation.origin, simulator.quantisation.count)
    values = simulator.generate(20, seed=1)
    np.testing.assert_allclose(values / 0.25, np.rint(values / 0.25), atol=1e-5)


def test_a_classifier_sees_disjoint_windows_and_pieces_of_them():
    rows = np.arange(9)[:, None] * 30 + np.arange(90.0)  # windows of 90 samples that begin every 30 samples
    windows = NoiseWindows(rows, rows, 30 * np.arange(9))
    np.testing.assert_array_equal(windows.disjoint.noise, rows[[0, 3, 6]])
    np.testing.assert_array_equal(NoiseWindows(rows[::-1], rows, 30 * np.arange(9)[::-1]).disjoint.noise, rows[[0, 3, 6]])
    generated, learnt, judged = pieces_of(NoiseWindows(-rows, rows), windows, windows)
    assert generated.noise.shape == learnt.noise.shape == (15, 18)  # five pieces each: shorter ones would have fewer than 16 samples
    np.testing.assert_array_equal(np.sort(learnt.noise.ravel()), np.arange(270.0))
    np.testing.assert_array_equal(learnt.noise, judged.noise)
    np.testing.assert_array_equal(generated.noise, -generated.clean)
    assert [each.shape for each in compare(windows, windows, windows)] == [(15, 24)] * 3  # in 18 samples, there are six frequency bands


def test_windows_of_two_parts_are_disjoint():
    simulator = fit(series(0.0, 3_000), noise="gaussian")
    values = series(0.0, 320).values
    parts = [Telemetry(values[begin : begin + 64], name="volts", offset_s=200 + begin) for begin in range(0, 320, 64)]
    windows = simulator.noise_windows(parts, np.arange(5))  # each part is one window, so that the starts are the numbers of the parts
    assert len(windows.disjoint) == 5
    assert len(np.unique(WindowBootstrap.fit(windows.noise, windows.starts).generate(5, np.random.default_rng(1)), axis=0)) == 5


def test_a_classifier_seldom_sees_a_residual_twice(monkeypatch):
    """Whole windows of a short record: as many are generated as there are disjoint ones, and most of them share no sample."""
    halves = [np.lib.stride_tricks.sliding_window_view(half, 40) for half in np.arange(2_400.0).reshape(2, -1)]  # values are places
    learnt, judged = (NoiseWindows(each, np.zeros_like(each), np.arange(len(each))) for each in halves)
    judge = HeldOutJudge(learnt, judged, 0)
    seen = []
    monkeypatch.setattr(noise_fitting, "compare", lambda *groups: seen.append(groups[0].noise) or compare(*groups))
    judge.judge("residual windows", WindowBootstrap.fit(learnt.noise, learnt.starts), np.random.default_rng(1))
    (drawn,) = seen
    assert drawn.shape == (30, 40) and len(np.unique(drawn)) > 0.75 * drawn.size  # with replacement: 63 %


def test_noise_that_follows_the_signal_gets_windows_that_match_it():
    clean = np.sin(2 * np.pi * np.arange(24_000) / 40)
    noise = 0.2 * (1.1 + clean) * np.random.default_rng(0).standard_normal(24_000)
    simulator = fit(Telemetry((clean + noise).astype(np.float32), name="volts"))
    assert type(simulator.noise) is MatchedWindowBootstrap
    rows = {each["name"]: each for each in simulator.trained["noise_candidates"]}
    assert rows["residual windows"]["auc"] > 0.8 > 0.65 > rows["matched residual windows"]["auc"]
    windows = simulator.generate_clean(2_000, seed=1)
    drawn = simulator.draw_noise(windows, np.random.default_rng(1))
    for level in (-0.9, 0.0, 0.9):  # the scale is that of the process at each level of the signal
        there = np.abs(windows - level) < 0.1
        assert drawn[there].std() == pytest.approx(0.2 * (1.1 + level), rel=0.15, abs=0.03)


def test_the_classifier_sees_the_same_in_any_unit():
    rng = np.random.default_rng(0)
    clean = np.sin(np.arange(64) / 5) * np.ones((40, 1))
    groups = [NoiseWindows(noise, clean, 64 * np.arange(40)) for noise in rng.standard_normal((3, 40, 64))]
    small = [NoiseWindows(1e-9 * each.noise, 1e-9 * each.clean, each.starts) for each in groups]
    np.testing.assert_allclose(compare(*small), compare(*groups), rtol=1e-6, atol=1e-9)


def test_detectors_are_judged_on_the_whole_of_the_held_out_time(monkeypatch):
    monkeypatch.setattr(noise_fitting, "MOST_JUDGED", 400)
    rng = np.random.default_rng(0)
    quiet = NoiseWindows(rng.standard_normal((400, 64)), np.zeros((400, 64)), 64 * np.arange(400))
    loud = np.repeat([1.0, 9.0], 400)[:, None] * rng.standard_normal((800, 64))  # the second half is louder
    later = NoiseWindows(loud, np.zeros((800, 64)), 64 * np.arange(800))
    judge = HeldOutJudge(quiet, later, 0)
    assert 0.45 < judge._judge.real_alarms < 0.55


def test_noise_is_told_from_none_where_a_few_windows_overlap():
    few = fit(series(0.0, 900))  # fourteen windows, of which three are judged
    assert [each["name"] for each in few.trained["noise_candidates"] if each["is_chosen"]] != ["none"]
    assert few.noise_sd == pytest.approx(0.2, rel=0.2)


def test_too_little_telemetry_gets_residual_windows_and_a_note():
    windows = NoiseWindows(*np.random.default_rng(0).standard_normal((2, 19, 40)).astype(np.float32), 40 * np.arange(19))
    notes = []
    model, rows = choose_noise(windows, windows, windows, 0, notes)
    assert isinstance(model, WindowBootstrap) and rows == [] and "too little telemetry" in notes[0]
