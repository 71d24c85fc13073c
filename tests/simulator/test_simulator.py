import numpy as np
import pytest

from enhsim_tf.coarse_simulator.degraded import Degraded
from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.common.errors import InputError
from enhsim_tf.simulator import simulator as module
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.placing import PlacedEvent
from tests.known_simulators import of_waves
from tests.simulator.conftest import WINDOW, coarse_run, smooth_wave


def test_windows_have_the_shape_level_and_noise_of_the_telemetry(single):
    windows = single[0].generate(400, seed=1)
    assert windows.shape == (400, WINDOW, 1) and windows.dtype == np.float32
    assert windows.mean() == pytest.approx(5.0, abs=0.05)
    assert np.std(windows) == pytest.approx(np.hypot(2 * np.std(smooth_wave(4_000)), 0.1), rel=0.03)
    assert single[0].noise_sd == pytest.approx(0.1, rel=0.15)


@pytest.mark.parametrize(
    "mode", ["stuck", "drift", "gain_loss", "friction", "dropout", "period_change"]
)
def test_samples_that_are_not_marked_are_those_of_the_nominal_windows(both, mode):
    simulator = both[0]
    (found,) = simulator.generate_labelled_chunks([Degraded(mode, 0.8), None] * 10, seed=2)
    nominal = simulator.generate(20, seed=2)
    windows, mask = found
    np.testing.assert_array_equal(windows[~mask], nominal[~mask])
    assert mask[::2].any() and not mask[1::2].any() and (windows[mask] != nominal[mask]).all()


def test_a_series_has_no_seams(single):
    steps = np.abs(np.diff(single[0].generate_series(5_000, seed=1)[:, 0]))
    assert (
        steps.max() < 2 * 2 / 9 + 6 * np.sqrt(2) * 0.1
    )  # the steepest flank, and six standard deviations of two noises


SCHEDULE = [PlacedEvent("drift", 1.0, 300, 200), PlacedEvent("gain_loss", 1.0, 900, 100)]


def test_events_of_a_series_are_where_the_mask_is(single):
    values, mask, events = single[0].generate_labelled_series(1_500, seed=0, schedule=SCHEDULE)
    nominal, fade = single[0].generate_series(1_500, seed=0), WINDOW // 16
    np.testing.assert_array_equal(values[~mask], nominal[~mask])
    for event, (mode, severity, begin, end) in zip(SCHEDULE, events, strict=True):
        assert (mode, severity) == (
            event.kind,
            1.0,
        ) and event.begin - fade <= begin < end <= event.end + fade
    assert not mask[550:850].any()


def test_a_stuck_channel_stands_still_but_for_its_noise(single):
    values, mask, _ = single[0].generate_labelled_series(1_000, Degraded("stuck", 1.0, 0.5), seed=0)
    assert (
        np.std(values[520:, 0]) == pytest.approx(single[0].noise_sd[0], rel=0.1)
        and not mask[:490].any()
    )


@pytest.mark.parametrize("kind", ["single", "both", "of_run"])
def test_a_loaded_simulator_generates_the_same(kind, request, tmp_path):
    simulator = request.getfixturevalue(kind)[0]
    simulator.save(tmp_path / "model")
    loaded = EnhancedSimulator.load(tmp_path / "model")
    np.testing.assert_array_equal(loaded.generate(5, seed=1), simulator.generate(5, seed=1))
    np.testing.assert_array_equal(
        loaded.generate_series(300, seed=1), simulator.generate_series(300, seed=1)
    )
    assert loaded.trained == simulator.trained and loaded.channels == simulator.channels


def test_copies_of_a_run_differ_by_their_noise_alone(of_run):
    simulator = of_run[0]
    run = coarse_run(200)
    first, second = (copy[0] for copy in simulator.generate_copies(run, 2, seed=0))
    clean = simulator.enhance_run(run.parts[0].values)
    assert np.std(first - clean) == pytest.approx(0.1, rel=0.25) and not np.array_equal(
        first, second
    )
    assert np.sqrt(np.mean((clean[:, 0] - (5 + 2 * smooth_wave(200))) ** 2)) < 0.05
    (again,) = next(simulator.generate_copies(run, 1, seed=0))
    np.testing.assert_array_equal(first, again)


@pytest.mark.parametrize(
    ("words", "use"),
    [
        (r"\(windows, 80, 1\)", lambda simulator: simulator.enhance(np.zeros((3, 81, 1)))),
        ("whole number", lambda simulator: simulator.generate(-1)),
        ("whole number", lambda simulator: simulator.generate_series(2.5)),
        ("one of square waves", lambda simulator: next(simulator.generate_copies(coarse_run(), 1))),
        (
            "or a schedule",
            lambda simulator: simulator.generate_labelled_series(
                500, Degraded("drift"), schedule=[SCHEDULE[0]]
            ),
        ),
    ],
)
def test_what_is_refused(single, words, use):
    with pytest.raises(InputError, match=words):
        use(single[0])


@pytest.mark.parametrize("mode", [None, "drift", "stuck"])
def test_generated_windows_do_not_depend_on_the_chunks(mode, monkeypatch):
    waves = [
        SquareWaveSimulator([SquareWave(period_s=period, low=-0.5, high=0.5)])
        for period in (10.0, 17.0)
    ]
    simulator, scenario = of_waves(waves, 24), mode and Degraded(mode)
    whole = simulator.generate(23, scenario, seed=5)
    monkeypatch.setattr(module, "_CHUNK_VALUES", 4 * 24 * 2)
    assert [
        len(chunk) for chunk, _ in simulator.generate_labelled_chunks([scenario] * 23, seed=5)
    ] == [4] * 5 + [3]
    np.testing.assert_allclose(simulator.generate(23, scenario, seed=5), whole, atol=1e-6)
    if mode is None:
        noise = simulator.noise.generate(23, np.random.default_rng([5, 1]))
        np.testing.assert_allclose(
            whole, simulator.generate(23, seed=5, with_noise=False) + noise, atol=1e-6
        )
    assert np.abs(whole - simulator.generate(23, scenario, seed=6)).max() > 0.01
