"""The enhanced simulator: windows as a sum of known parts, continuous series, training, saving and loading."""

import copy
import json
import sys

import keras
import numpy as np
import pytest

from enhsim_tf.coarse_simulator.degraded import MODES, Degraded
from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.common.atomic_files import sha256
from enhsim_tf.common.errors import InputError
from enhsim_tf.enhanced_simulator import saving
from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
from enhsim_tf.enhancer.network import build_enhancer
from enhsim_tf.enhancer.training_pairs import cut_pairs
from enhsim_tf.noise.surrogates import GaussianNoise
from enhsim_tf.noise.window_bootstrap import WindowBootstrap
from enhsim_tf.telemetry.quantisation import Levels
from enhsim_tf.telemetry.series import Telemetry
from enhsim_tf.telemetry.windows import evenly_spaced_starts

pytestmark = pytest.mark.usefixtures("narrow_enhancer")
COARSE = SquareWaveSimulator([SquareWave(480, low=-0.5, high=0.5), SquareWave(120, phase=0.21, duty=0.3, low=-0.25, high=0.25)])
FILES = ["arrays.npz", "manifest.json", "settings.json"]


def identity(window):
    """An enhancer that returns its input unchanged."""
    model = keras.Sequential([keras.Input((window,)), keras.layers.Dense(window)])
    model.layers[0].set_weights([np.eye(window), np.zeros(window)])
    return model


def known(noise_sd=0.0, window=500, **arguments):
    """A simulator of known processes: the coarse signal plus white noise."""
    return EnhancedSimulator(COARSE, identity(window), GaussianNoise(noise_sd, window), **arguments)


def small(window=60, seed=0):
    """A simulator with a narrow, untrained network."""
    noise = WindowBootstrap(0.3 * np.random.default_rng(seed).standard_normal((30, window)).astype(np.float32))
    return EnhancedSimulator(
        COARSE, build_enhancer(window, 16, seed=seed), noise, interval_s=2.0, offset=0.1, scale=0.7, trained={"seed": seed}
    )


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """A simulator and the read-only folder to which it was saved."""
    simulator, folder = small(), tmp_path_factory.mktemp("saved") / "model"
    simulator.save(folder)
    return simulator, folder


@pytest.fixture
def copied(saved, tmp_path):
    """A copy of the saved folder that a test may damage."""
    for file in saved[1].iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    return tmp_path


def vouch_for(folder):
    """Updates the manifest to match the files, as an attacker would."""
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["sha256"] = {name: sha256(folder / name) for name in manifest["sha256"]}
    (folder / "manifest.json").write_text(json.dumps(manifest, indent=2) + "\n")


# windows


def test_coarse_windows_begin_at_random_samples_of_the_coarse_simulator():
    windows = known(interval_s=2.0).generate_coarse(300, seed=0)
    assert windows.shape == (300, 500) and windows.dtype == np.float32
    begins = {COARSE.simulate(begin + 2.0 * np.arange(500)[None]).tobytes(): begin for begin in range(0, 480, 2)}
    phases = [begins[window.tobytes()] for window in windows]  # every window is one of the 240 possible ones
    assert len(set(phases)) > 0.6 * 240 and np.mean(phases) == pytest.approx(239, abs=5 * 480 / np.sqrt(12 * 300))


def test_enhanced_windows_are_in_the_telemetry_s_unit():
    coarse = COARSE.simulate(np.arange(60.0)[None])
    same = known(window=60, offset=0.25, scale=4.0).enhance(coarse)
    np.testing.assert_allclose(same, coarse, atol=1e-6)
    constant = identity(60)
    constant.layers[0].set_weights([np.zeros((60, 60)), np.ones(60)])  # always returns offset + scale
    enhanced = EnhancedSimulator(COARSE, constant, GaussianNoise(0, 60), offset=0.25, scale=4.0).enhance(coarse)
    assert (enhanced == 4.25).all() and enhanced.dtype == np.float32
    doubled = identity(60)
    doubled.layers[0].set_weights([2 * np.eye(60), np.zeros(60)])
    enhanced = EnhancedSimulator(COARSE, doubled, GaussianNoise(0, 60), offset=0.25, scale=4.0).enhance(coarse)
    np.testing.assert_allclose(enhanced - 0.25, 2 * (coarse - 0.25), atol=1e-5)


def test_generated_windows_are_the_enhanced_signal_plus_the_noise():
    simulator = known(noise_sd=0.3)
    noise = simulator.generate(200, seed=4) - simulator.generate_coarse(200, seed=4)
    assert np.std(noise) == pytest.approx(0.3, rel=5 / np.sqrt(2 * noise.size))
    assert (known().generate(20, Degraded("drift"), seed=4) == known().generate_coarse(20, Degraded("drift"), seed=4)).all()


@pytest.mark.parametrize("scenario", [None, Degraded("dropout", 0.8), Degraded("friction", 0.8)], ids=str)
def test_same_seed_same_windows_and_series(scenario):
    simulator = small()
    keras.utils.set_random_seed(1)  # must not matter
    windows, series = simulator.generate(20, scenario, seed=3), simulator.generate_series(500, scenario, seed=3)
    keras.utils.set_random_seed(2)
    assert windows.shape == (20, 60) and windows.dtype == series.dtype == np.float32
    assert (windows == simulator.generate(20, scenario, seed=3)).all()
    assert (series == simulator.generate_series(500, scenario, seed=3)).all()
    assert (windows != simulator.generate(20, scenario, seed=4)).any(axis=1).all()
    assert (series != simulator.generate_series(500, scenario, seed=4)).any()


# series


@pytest.mark.parametrize("num_samples", [1, 499, 500, 501, 12_345])
def test_series_of_any_length(num_samples):
    series = small(window=500).generate_series(num_samples, seed=1)
    assert series.shape == (num_samples,) and series.dtype == np.float32 and np.isfinite(series).all()


def test_series_of_no_length_is_refused(refused):
    for number in (0, -5):
        with refused(f"num_samples={number}"):
            known(window=60).generate_series(number)


@pytest.mark.parametrize("window", [60, 61])
@pytest.mark.parametrize("num_samples", [1, 59, 60, 61, 90, 1_234])
def test_series_of_an_identity_enhancer_is_the_coarse_series(window, num_samples):
    simulator = known(window=window, interval_s=3.0)
    for start_s in (0.0, 97.0):
        expected = COARSE.simulate(start_s + 3.0 * np.arange(num_samples)[None])[0]
        assert (simulator.generate_series(num_samples, start_s=start_s) == expected).all()


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("num_samples", [40, 60, 700, 1_234])
def test_scenario_of_a_series_is_that_of_its_own_length(mode, num_samples):
    # the last window may extend beyond the end of the series
    scenario, times = Degraded(mode, severity=0.6, onset=0.35), np.arange(float(num_samples))[None]
    series = known(window=60).generate_series(num_samples, scenario, seed=6)
    expected = COARSE.simulate(times, scenario, np.random.default_rng(6))[0]
    np.testing.assert_allclose(series, expected, atol=1e-6)


@pytest.mark.parametrize("onset", [0.1, 0.29, 0.5, 0.73])
def test_onset_of_a_series_is_at_the_given_share(onset):
    for num_samples in (300, 1_000, 1_111):
        degraded = known(window=60).generate_series(num_samples, Degraded("drift", 1.0, onset))
        changed = np.flatnonzero(degraded != known(window=60).generate_series(num_samples))
        assert changed[0] == int(round(onset * num_samples, 6)) + 1  # the ramp begins at zero


def test_noise_of_a_series_has_no_visible_joins():
    window, sd = 100, 0.3
    noise = known(noise_sd=sd, window=window).generate_series(200_000, seed=2) - known(window=window).generate_series(200_000)
    by_position = noise.reshape(-1, window // 2)  # a window begins and another ends at position 0
    edges, middle = by_position[:, [0, 1, -2, -1]], by_position[:, 2:-2]
    for part in (edges, middle):
        assert np.var(part) == pytest.approx(sd**2, rel=5 * np.sqrt(2 / part.size))
    # position for position
    assert np.var(by_position, axis=0) == pytest.approx(np.full(window // 2, sd**2), rel=5 * np.sqrt(2 / len(by_position)))
    # white noise stays white, also where windows join
    assert np.mean(noise[1:] * noise[:-1]) / sd**2 == pytest.approx(0, abs=5 / np.sqrt(len(noise)))
    across = by_position[1:, 0] * by_position[:-1, -1]
    assert np.mean(across) / sd**2 == pytest.approx(0, abs=5 / np.sqrt(len(across)))


@pytest.mark.parametrize("num_samples", [1_000, 1_400])
def test_noise_of_a_series_has_full_amplitude_at_both_ends(num_samples):
    noise = known(noise_sd=0.3, window=1_000).generate_series(num_samples, seed=2) - known(window=1_000).generate_series(num_samples)
    for part in (noise, noise[:400], noise[-400:]):
        assert np.var(part) == pytest.approx(0.3**2, rel=5 * np.sqrt(2 / part.size))


def test_noise_is_drawn_independently_of_the_coarse_windows():
    # with the same seed, both would use the same random bits
    class Drawing(GaussianNoise):
        def _draw(self, shape, seed):
            drawn.append(np.random.default_rng(copy.deepcopy(seed)).integers(1_000_000))
            return super()._draw(shape, seed)

    drawn, simulator = [], EnhancedSimulator(COARSE, identity(60), Drawing(0.1, 60))
    for seed in (0, 1, 2, 1):
        simulator.generate(2, seed=seed)
        simulator.generate_series(70, seed=seed)
    assert drawn[2:4] == drawn[6:8] and len(set(drawn)) == 3
    assert not set(drawn) & {np.random.default_rng(seed).integers(1_000_000) for seed in (0, 1, 2)}


# folders


def test_the_content_of_a_saved_folder(saved):
    simulator, folder = saved
    assert sorted(file.name for file in folder.iterdir()) == FILES
    assert [file.name for file in folder.parent.iterdir()] == ["model"]
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["sha256"] == {name: sha256(folder / name) for name in FILES if name != "manifest.json"}


def test_a_loaded_simulator_generates_identical_windows(saved):
    simulator, folder = saved
    loaded = EnhancedSimulator.load(folder)
    assert loaded.coarse.waves == COARSE.waves
    assert (loaded.window, loaded.interval_s, loaded.offset, loaded.scale) == (60, 2.0, 0.1, 0.7)
    assert loaded.trained == simulator.trained == {"seed": 0}
    scenario = Degraded("friction", 0.5)
    assert loaded.generate(50, scenario, seed=3).tobytes() == simulator.generate(50, scenario, seed=3).tobytes()
    assert loaded.generate_series(500, seed=3).tobytes() == simulator.generate_series(500, seed=3).tobytes()


def test_a_simulator_replaced_during_loading_is_refused(copied, monkeypatch, refused):
    load, other = saving.load_npz, small(seed=1)

    def replaced_meanwhile(path, max_bytes):
        other.save(copied)
        return load(path, max_bytes)

    monkeypatch.setattr(saving, "load_npz", replaced_meanwhile)
    with refused("try again"):
        EnhancedSimulator.load(copied)
    monkeypatch.undo()
    assert (EnhancedSimulator.load(copied).generate(3, seed=0) == other.generate(3, seed=0)).all()


def test_saving_again_replaces_the_folder(saved, copied):
    (copied / "stray.txt").write_text("x")
    other = small(seed=1)
    other.save(copied)
    assert sorted(file.name for file in copied.iterdir()) == FILES
    assert (EnhancedSimulator.load(copied).generate(3, seed=0) == other.generate(3, seed=0)).all()


@pytest.mark.parametrize("name", FILES)
def test_a_flipped_byte_is_detected(copied, refused, name):
    content = (copied / name).read_bytes()
    every = 3 if name == "manifest.json" else len(content) // 4  # the manifest itself has no checksum
    for place in range(0, len(content), every):
        damaged = bytearray(content)
        damaged[place] ^= 1
        (copied / name).write_bytes(damaged)
        with refused(str(copied)):
            EnhancedSimulator.load(copied)
            pytest.fail(f"a change of byte {place} went unnoticed, after {content[:place][-30:]}")


@pytest.mark.parametrize("name", FILES)
def test_a_missing_file_is_detected(copied, refused, name):
    (copied / name).unlink()
    with refused(str(copied)):
        EnhancedSimulator.load(copied)


MANIFESTS = {
    "not JSON": "not JSON",
    "no text": b"\xff\xfe\x00",
    "nothing": "",
    "a list": "[]",
    "a number": "3",
    "another format": lambda manifest: {**manifest, "format": "somebody.else/7"},
    "a format of two lines": lambda manifest: {**manifest, "format": "a\nb"},
    "no format": lambda manifest: {"sha256": manifest["sha256"]},
    "no checksums": lambda manifest: {"format": manifest["format"]},
    "checksums in a list": lambda manifest: {**manifest, "sha256": list(manifest["sha256"])},
    "a file too few": lambda manifest: {**manifest, "sha256": dict(list(manifest["sha256"].items())[1:])},
    "a file too many": lambda manifest: {**manifest, "sha256": {**manifest["sha256"], "../manifest.json": "0"}},
    "another checksum": lambda manifest: {**manifest, "sha256": {**manifest["sha256"], "settings.json": "0"}},
}


@pytest.mark.parametrize("name", MANIFESTS)
def test_foreign_manifest_is_refused(copied, refused, name):
    content, path = MANIFESTS[name], copied / "manifest.json"
    if callable(content):
        content = json.dumps(content(json.loads(path.read_text())))
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with refused(str(copied)):
        EnhancedSimulator.load(copied)


def test_foreign_folders_are_refused(tmp_path, refused):
    with refused("absent"):
        EnhancedSimulator.load(tmp_path / "absent")
    with refused(str(tmp_path)):
        EnhancedSimulator.load(tmp_path)  # empty
    (tmp_path / "notes.txt").write_text("x")
    with refused(str(tmp_path)):
        EnhancedSimulator.load(tmp_path)
    with refused("notes.txt"):
        EnhancedSimulator.load(tmp_path / "notes.txt")


SETTINGS = {
    "no settings": "{}",
    "a list": "[]",
    "a wave too many words": lambda settings: {**settings, "coarse": {"waves": [{"period_s": 3, "colour": "red"}]}},
    "no waves": lambda settings: {**settings, "coarse": {"waves": []}},
    "a wave without a period": lambda settings: {**settings, "coarse": {"waves": [{}]}},
    "words for numbers": lambda settings: {**settings, "interval_s": "often"},
    "an argument nobody knows": lambda settings: {**settings, "noise": {"colour": "pink"}},
}


@pytest.mark.parametrize("name", SETTINGS)
def test_invalid_settings_with_a_correct_checksum_are_refused(copied, refused, name):
    content, path = SETTINGS[name], copied / "settings.json"
    path.write_text(json.dumps(content(json.loads(path.read_text()))) if callable(content) else content)
    vouch_for(copied)
    with refused():
        EnhancedSimulator.load(copied)


def test_a_model_of_an_earlier_format_is_refused(copied, refused):
    path = copied / "manifest.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"format": "enhsim_tf.EnhancedSimulator/1"}))
    with refused("format 2. Received: format 1", "Fit it again"):
        EnhancedSimulator.load(copied)


def test_noise_of_another_make_is_not_saved(tmp_path, refused):
    class MyNoise:
        def generate(self, number, rng, signal=None):
            return np.zeros((number, 60), np.float32)

    with refused("MyNoise"):
        EnhancedSimulator(COARSE, identity(60), MyNoise()).save(tmp_path / "model")
    assert not list(tmp_path.iterdir())


# training


def measured(number=1_500):
    """A noisy sine with a period of 50 samples and values far from 1."""
    times = 2.0 * np.arange(number)
    values = 1_000 + 50 * np.sin(2 * np.pi * times / 100) + 4 * np.random.default_rng(0).standard_normal(number)
    return Telemetry(values.astype(np.float32), interval_s=2.0)


def fitted(seed=0, **arguments):
    """Fits the network with a small budget."""
    counts = {"num_windows": 60, "epochs": 4, "window": 60, "noise": "gaussian", "decay": False, "verbose": 0}
    return EnhancedSimulator.fit(measured(), seed=seed, **{**counts, **arguments})


def test_fit_to_short_telemetry_end_to_end():
    simulator = fitted()
    assert (simulator.window, simulator.interval_s) == (60, 2.0)
    assert simulator.coarse.waves[0].period_s == pytest.approx(100, rel=0.005)
    # after training, the enhanced signal is closer to the sine than the coarse square wave
    windows = simulator.generate_coarse(40, seed=1)
    clean = simulator.enhance(windows)
    amplitude = np.sqrt(2) * np.std(clean)
    assert np.mean(clean) == pytest.approx(1_000, abs=5) and amplitude == pytest.approx(50, rel=0.15)
    assert np.mean(np.abs(np.diff(clean, axis=1))) < 0.6 * 50
    again = fitted()
    assert (simulator.generate(5, seed=2) == again.generate(5, seed=2)).all()


def test_noise_is_the_residual_of_the_enhancer():
    simulator = fitted(num_windows=300, epochs=8, decay=True, held_out=0.25)
    # the residual is white noise of 4 plus the error of the enhancer: at least 4, and far below the 35 of the sine itself
    assert 3.9 < simulator.noise.standard_deviation < 10


# telemetry that drifts


def drifting(number=4_000):
    """A sine with a period of 40 samples whose level and amplitude grow, at the end far beyond the range of the beginning."""
    places = np.arange(number)
    clean = 100 + 0.005 * places + (1 + places / 1_000) * np.sin(2 * np.pi * places / 40)
    return Telemetry((clean + 0.02 * np.random.default_rng(0).standard_normal(number)).astype(np.float32))


@pytest.fixture(scope="module")
def followers():
    """Simulators with and without `follow`, fitted to the first half of the telemetry."""
    coarse, counts = SquareWaveSimulator([SquareWave(40, low=99, high=101)]), {"window": 80, "num_windows": 300, "epochs": 6}
    settings = {"noise": "residual windows", "verbose": 0}
    learnt = drifting().part(0, 2_000)
    parts = [learnt.part(0, 1_100), learnt.part(1_150, 2_000)]
    return {follow: EnhancedSimulator.fit(parts, coarse, 0, **counts, **settings, follow=follow) for follow in (True, False)}


def test_follow_keeps_the_error_small_outside_the_range_of_training_levels(followers):
    later, errors = drifting().part(2_500, 4_000), {}
    for follow, simulator in followers.items():
        pairs = cut_pairs([later], simulator.coarse, evenly_spaced_starts([later], 80, 50), 80, follow)
        enhanced = simulator.follow(pairs)
        errors[follow] = np.median(np.sqrt(np.mean((enhanced - pairs.target) ** 2, axis=1)) / pairs.target.std(axis=1))
    assert errors[True] < 0.3 and errors[False] > 3  # in standard deviations of each window
    assert followers[False].levels is None
    levels = followers[True].levels
    assert levels.shape == (500, 2) and np.corrcoef(levels[:, 1], np.arange(500))[0, 1] > 0.95  # in the order of time: the gain grows
    middle = levels[:, 0] + 100 * levels[:, 1]  # mean level of each window
    assert middle.min() > 99.5 and middle.max() < 100.5 + 0.005 * 2_000 and np.ptp(middle) > 8


def test_generated_windows_use_levels_and_gains_of_the_training(followers):
    simulator = followers[True]
    windows = simulator.generate_coarse(400, seed=1)
    centre, amplitude = (windows.max(axis=1) + windows.min(axis=1)) / 2, np.ptp(windows, axis=1) / 2
    shift, gain = simulator.levels.T
    known_levels = np.stack([shift + 100 * gain, gain], axis=1)  # the coarse simulator itself has 100 and 1
    nearest = np.abs(known_levels[None] - np.stack([centre, amplitude], axis=1)[:, None]).max(axis=2).min(axis=1)
    assert nearest.max() < 1e-3
    assert np.ptp(centre) > 8 and len(np.unique(np.round(amplitude, 4))) > 100


def test_levels_are_saved_and_loaded(followers, tmp_path):
    for follow, simulator in followers.items():
        simulator.save(tmp_path / str(follow))
        loaded = EnhancedSimulator.load(tmp_path / str(follow))
        assert (loaded.levels is None) is (not follow) and loaded.trained["follow"] is follow
        if follow:
            assert (loaded.levels == simulator.levels).all()
        assert (loaded.generate(7, seed=4) == simulator.generate(7, seed=4)).all()
        assert (loaded.generate_series(500, seed=4) == simulator.generate_series(500, seed=4)).all()


def test_a_series_with_levels_has_no_visible_joins():
    # with a constant coarse signal, each window is constant, and the series cross-fades from one to the next
    one = SquareWaveSimulator([SquareWave(1e9, low=0.0, high=1.0)])
    levels = np.random.default_rng(2).normal(0, 1, (7, 2))
    simulator = EnhancedSimulator(one, identity(60), GaussianNoise(0.0, 60), levels=levels)
    series = simulator.generate_series(3_000, seed=5).astype(np.float64)
    constants = levels.sum(axis=1)
    largest = np.abs(np.diff(constants)).max()  # windows that follow each other have neighbouring levels
    assert np.abs(np.diff(series)).max() <= largest * np.pi / 60 + 1e-6
    assert series.min() >= constants.min() - 1e-6 and series.max() <= constants.max() + 1e-6
    assert np.ptp(series) > 0.9 * np.ptp(constants)  # the series is long enough to use every level


def test_a_fitted_series_with_levels_has_no_visible_joins(followers):
    fitted = followers[True]
    simulator = EnhancedSimulator(fitted.coarse, fitted.enhancer, GaussianNoise(0.0, 80), 1.0, fitted.offset, fitted.scale, fitted.levels)
    series = simulator.generate_series(8_000, seed=3)
    steps, inside = np.abs(np.diff(series)), np.abs(np.diff(simulator.generate(200, seed=3), axis=1))
    assert steps.max() < 1.2 * inside.max()
    seams = np.arange(40, 7_960, 40) - 1  # where a window begins or ends
    assert steps[seams].max() < 1.2 * inside.max() and np.ptp(series) > np.ptp(fitted.levels[:, 1])


def test_fit_refuses_unknown_choices(refused):
    with refused("noise='pink'"):
        fitted(noise="pink")


@pytest.mark.parametrize("number", [-1, 2.5, "3", None])
def test_an_invalid_number_of_windows_is_refused(refused, tmp_path, number):
    simulator = known(window=60)
    words = f"num_windows={number!r}"
    for made in (simulator.generate, simulator.generate_coarse, lambda count: list(simulator.generate_chunks(count))):
        with refused(words):
            made(number)
    with refused(words):
        simulator.generate_to_parquet(tmp_path / "windows.parquet", number)
    assert not list(tmp_path.iterdir())
    with refused(words):
        simulator.residual_windows(measured(), number, np.random.default_rng(0))
    assert simulator.generate(np.int64(0)).shape == (0, 60)


@pytest.mark.parametrize("shape", [(3, 59), (60,), (3, 60, 1)])
def test_windows_of_another_width_are_refused(refused, shape):
    with refused("(windows, 60)", str(shape)):
        known(window=60).enhance(np.zeros(shape, np.float32))


@pytest.mark.parametrize("count", ["num_windows", "epochs", "window"])
def test_fit_refuses_counts_below_one(refused, count):
    for number in (-1, 0):
        with refused(f"{count}={number}"):
            fitted(**{count: number})


def test_invalid_telemetry_is_refused(refused):
    values = measured().values
    for made in (lambda: EnhancedSimulator.fit(values), lambda: EnhancedSimulator.fit(values, coarse=COARSE)):
        with refused("Expected a Telemetry", "ndarray"):
            made()
    with refused("Expected a Telemetry", "list"):
        SquareWaveSimulator.fit(values.tolist())


@pytest.mark.parametrize("is_terminal", [False, True])
def test_fit_shows_progress_bars_only_on_terminals(capsys, monkeypatch, is_terminal):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: is_terminal)
    fitted(verbose="auto", epochs=1)
    out, error = capsys.readouterr()
    assert ("/step" in out) == is_terminal and bool(out) == is_terminal
    assert not error


def test_fit_refuses_less_than_eight_windows(refused):
    with refused("479", "480 samples"):
        EnhancedSimulator.fit(measured(479), window=60, verbose=0)


def test_saving_refuses_a_folder_with_a_foreign_manifest(tmp_path):
    (tmp_path / "manifest.json").write_text('{"name": "an extension"}')
    with pytest.raises(InputError, match="something else"):
        small().save(tmp_path)
    assert (tmp_path / "manifest.json").read_text() == '{"name": "an extension"}'


# quantised channels

LEVELS = Levels(0.25, 0.1, 9)


@pytest.fixture(scope="module")
def quantised():
    """A simulator of a channel whose levels are coarse compared with the noise, so that rounding removes small changes."""
    return known(0.1, 60, quantisation=LEVELS)


def is_on_levels(values):
    steps = (values.astype(np.float64) - LEVELS.origin) / LEVELS.step
    return np.abs(steps - np.rint(steps)).max() < 1e-4


def test_generated_values_keep_the_levels_of_the_channel(quantised):
    plain = known(0.1, 60)
    windows = quantised.generate(30, Degraded("drift", 0.4), seed=1)
    np.testing.assert_array_equal(windows, LEVELS.round(plain.generate(30, Degraded("drift", 0.4), seed=1)))
    assert is_on_levels(windows) and is_on_levels(quantised.generate_series(500, seed=2))
    assert not is_on_levels(quantised.generate_clean(5))


@pytest.mark.parametrize("mode", ["drift", "gain_loss", "stuck"])
def test_marked_samples_of_a_quantised_channel_are_those_that_differ(quantised, mode):
    scenario = Degraded(mode, 0.2)
    nominal = quantised.generate(40, seed=3)
    windows, mask = (np.concatenate(each) for each in zip(*quantised.generate_labelled_chunks(40, scenario, seed=3), strict=True))
    assert mask.any()
    np.testing.assert_array_equal(mask, windows != nominal)
    values, marks, events = quantised.generate_labelled_series(900, scenario, seed=3)
    np.testing.assert_array_equal(marks, values != quantised.generate_series(900, seed=3))
    assert events[0][2] == np.flatnonzero(marks)[0] and events[-1][3] == np.flatnonzero(marks)[-1] + 1


def test_levels_are_saved(quantised, tmp_path):
    quantised.save(tmp_path / "model")
    loaded = EnhancedSimulator.load(tmp_path / "model")
    assert loaded.quantisation == LEVELS
    np.testing.assert_array_equal(loaded.generate(4, seed=1), quantised.generate(4, seed=1))
