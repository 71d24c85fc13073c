import numpy as np
import pytest
from scipy.signal import lfilter

from enhsim_tf.coarse.alignment import Drawn
from enhsim_tf.coarse.degraded import Degraded
from enhsim_tf.coarse.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.common.errors import InputError
from enhsim_tf.fitting.fit import fit
from enhsim_tf.simulator import simulator as module
from enhsim_tf.simulator.changes import put_changes
from enhsim_tf.simulator.simulator import EnhancedSimulator
from enhsim_tf.telemetry.placing import PlacedEvent
from tests.fitted_simulators import WINDOW, coarse_run, recorded, smooth_wave
from tests.known_simulators import of_waves


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
    # the steepest flank, and six standard deviations of two noises
    assert steps.max() < 2 * 2 / 9 + 6 * np.sqrt(2) * 0.1


SCHEDULE = [PlacedEvent("drift", 1.0, 300, 200), PlacedEvent("gain_loss", 1.0, 900, 100)]


def test_events_of_a_series_are_where_the_mask_is(single):
    values, mask, events = single[0].generate_labelled_series(1_500, seed=0, schedule=SCHEDULE)
    nominal, fade = single[0].generate_series(1_500, seed=0), WINDOW // 16
    np.testing.assert_array_equal(values[~mask], nominal[~mask])
    for event, changed in zip(SCHEDULE, events, strict=True):
        assert (changed.kind, changed.severity) == (event.kind, 1.0)
        assert event.begin - fade <= changed.begin < changed.end <= event.end + fade
    assert not mask[550:850].any()


def test_a_neighbour_does_not_change_the_end_of_an_event():
    nominal = np.zeros((1, 400, 1), np.float32)
    coarse = nominal.copy()
    coarse[0, [*range(100, 200), *range(201, 300)]] = 1
    drawn = Drawn(coarse, nominal, np.arange(400)[None, :, None])
    spans = [(100, 200), (201, 300)]
    runs, _ = put_changes(nominal, nominal + 1, drawn, spans, 496, np.zeros(1))
    assert (runs[coarse == 1] == 1).all()
    assert runs[0, 200, 0] == pytest.approx(0.5 + 0.5 * np.cos(np.pi / 32))  # first of the fade


def test_an_event_of_one_channel_changes_that_channel_alone(both):
    event = PlacedEvent("drift", 1.0, 300, 200, "watts")
    _, mask, events = both[0].generate_labelled_series(1_000, schedule=[event])
    assert mask.any(axis=0).tolist() == [False, True]
    assert [(each.kind, each.channel) for each in events] == [("drift", "watts")]


def test_a_stuck_channel_stands_still_but_for_its_noise(single):
    values, mask, _ = single[0].generate_labelled_series(1_000, Degraded("stuck", 1.0, 0.5), seed=0)
    assert np.std(values[520:, 0]) == pytest.approx(single[0].noise_sd[0], rel=0.1)
    assert not mask[:490].any()


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
    np.testing.assert_array_equal(loaded.noise_sd, simulator.noise_sd)
    np.testing.assert_array_equal(loaded.scale, simulator.scale)


def test_copies_of_a_run_differ_by_their_noise_alone(of_run):
    simulator = of_run[0]
    run = coarse_run(200)
    first, second = (copy[0] for copy in simulator.generate_copies(run, 2, seed=0))
    clean = simulator.enhance_run(run.values)
    assert np.std(first - clean) == pytest.approx(0.1, rel=0.25)
    assert (first != second).any()
    assert np.sqrt(np.mean((clean[:, 0] - (5 + 2 * smooth_wave(200))) ** 2)) < 0.05
    (again,) = next(simulator.generate_copies(run, 1, seed=0))
    np.testing.assert_array_equal(first, again)


@pytest.mark.parametrize(
    ("words", "use"),
    [
        (r"\(windows, 80, 1\)", lambda simulator: simulator.enhance(np.zeros((3, 81, 1)))),
        ("whole number", lambda simulator: simulator.generate(-1)),
        ("whole number", lambda simulator: simulator.generate_series(2.5)),
        ("seed=None", lambda simulator: simulator.generate(2, seed=None)),
        ("seed=-1", lambda simulator: simulator.generate_series(90, seed=-1)),
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


def test_generated_channels_follow_each_other_as_the_real_ones_do():
    """The second channel follows a process of the first one fifteen samples later."""
    rng = np.random.default_rng(0)
    common = lfilter([0.6], [1.0, -0.8], rng.standard_normal(6_115))[100:]
    values = 0.4 * np.stack([common[15:], common[:-15]], axis=1)
    values += 0.15 * rng.standard_normal(values.shape)
    waves = np.sin(2 * np.pi * np.arange(6_000)[:, None] / 90 + [0.0, 1.0])
    simulator, _ = fit(recorded(waves + values, ("a", "b")))
    clean = simulator.generate(1_000, seed=1, with_noise=False)
    noise = simulator.draw_noise(clean, np.random.default_rng(4))
    first, second = noise[:, :-15, 0].ravel(), noise[:, 15:, 1].ravel()
    # of the variance 0.16 + 0.0225 of each the process has 0.16
    assert np.corrcoef(first, second)[0, 1] == pytest.approx(0.16 / 0.1825, abs=0.05)
