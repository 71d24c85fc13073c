"""Injected anomalies compared with arrays computed by hand, and equal positions for all kinds and severities."""

import numpy as np
import pytest

from enhsim_tf.detection.anomalies import DURATIONS, INJECTIONS, SEVERITIES, inject, inject_into_trace

RAMP = np.arange(10, dtype=np.float32)


def injected(window, kind, severity, duration, seed=0, noise_sd=0.5):
    """Injects an anomaly into one window, and returns the window and the anomalous positions."""
    values, mask = inject(np.asarray(window)[None], kind, severity, duration, noise_sd, np.random.default_rng(seed))
    assert values.dtype == np.float32 and mask.dtype == bool and values.shape == mask.shape == (1, len(window))
    return values[0], np.flatnonzero(mask[0])


def waves(number=6, samples=300, seed=0):
    rng = np.random.default_rng(seed)
    phases = rng.uniform(0, 2 * np.pi, (number, 1))
    return (5 + np.sin(2 * np.pi * np.arange(samples) / 120 + phases) + 0.1 * rng.standard_normal((number, samples))).astype(np.float32)


def test_there_are_eight_kinds_five_severities_and_three_durations():
    assert list(INJECTIONS) == ["spike", "level_shift", "ramp", "stuck", "variance_change", "oscillation", "dropout", "gain"]
    assert (SEVERITIES, DURATIONS) == ((0.5, 1, 2, 4, 8), (25, 100, 250))


@pytest.mark.parametrize(
    ("kind", "changes"),
    [
        ("level_shift", [1, 1, 1, 1]),
        ("ramp", [0.25, 0.5, 0.75, 1]),
        ("spike", [1]),
        ("oscillation", np.sin(np.pi * np.array([0, 0.1, 0.2, 0.3]))),
        ("dropout", [-1, -1, -1, -1]),
        ("stuck", [0, 0, 0, 0]),
        ("gain", [0, 0, 0, 0]),  # on its mean
    ],
)
def test_constant_window_by_hand(kind, changes):
    sides = set()
    for seed in range(8):
        values, places = injected(np.full(10, 3.0), kind, 2, 4, seed)  # twice a noise of 0.5: off by 1
        change = values[places] - 3
        side = -1 if kind in ("level_shift", "ramp", "spike") and change[-1] < 0 else 1
        sides.add(side)
        assert change == pytest.approx(side * np.array(changes), abs=1e-6)
        assert (places == places[0] + np.arange(len(changes))).all()
    assert sides == ({-1, 1} if kind in ("level_shift", "ramp", "spike") else {1})


@pytest.mark.parametrize(
    ("kind", "severity", "expected"),
    [
        ("stuck", 2, [0, 0, 2, 2, 4]),  # held until the true value is more than 1 away
        ("stuck", 1, [0, 1, 2, 3, 4]),  # a step of 1 is more than 0.5
        ("stuck", np.inf, [0, 0, 0, 0, 0]),
        ("dropout", 3, [-1.5] * 5),
        ("dropout", 0, [0] * 5),
    ],
)
def test_ramp_window_by_hand(kind, severity, expected):
    values, places = injected(RAMP, kind, severity, 5)
    assert (values[places] - places[0]).tolist() == expected
    outside = np.setdiff1d(np.arange(10), places)
    assert (values[outside] == RAMP[outside]).all()


def test_gain_of_a_ramp_by_hand():
    values, places = injected([-2, 4, -4, 2], "gain", 1, 4)  # mean 0, mean square 10
    assert places.tolist() == [0, 1, 2, 3]
    assert values == pytest.approx(np.array([-2, 4, -4, 2]) * (1 + 0.5 / np.sqrt(10)))


def test_spikes_come_every_25_samples_of_the_range():
    values, places = injected(np.zeros(300), "spike", 2, 100, seed=1)
    assert np.diff(places).tolist() == [25, 25, 25] and set(np.abs(values[places])) == {1} and len(set(values[places])) == 1
    assert np.count_nonzero(values) == 4


@pytest.mark.parametrize("kind", ["level_shift", "variance_change", "gain"])
@pytest.mark.parametrize("severity", SEVERITIES)
def test_root_mean_square_of_a_change_is_the_severity(kind, severity):
    windows = waves(200)
    values, mask = inject(windows, kind, severity, 100, 0.1, np.random.default_rng(0))
    change = (values - windows)[mask].astype(np.float64).reshape(200, 100)
    size = np.sqrt(np.mean(change**2, axis=1))
    if kind == "variance_change":
        size = np.sqrt(np.mean(size**2))
        assert size == pytest.approx(0.1 * severity, rel=5 / np.sqrt(2 * change.size))
    else:
        assert size == pytest.approx(np.full(200, 0.1 * severity), rel=1e-4)


@pytest.mark.parametrize("kind", INJECTIONS)
@pytest.mark.parametrize("duration", DURATIONS)
def test_samples_outside_the_mask_are_untouched(kind, duration):
    windows = waves()
    before = windows.copy()
    values, mask = inject(windows, kind, 4, duration, 0.1, np.random.default_rng(2))
    assert (windows == before).all()
    assert (values[~mask] == windows[~mask]).all() and (values[mask] != windows[mask]).any()
    assert (mask.sum(axis=1) == (duration // 25 if kind == "spike" else duration)).all()


@pytest.mark.parametrize("kind", sorted(set(INJECTIONS) - {"dropout"}))
def test_severity_0_changes_nothing(kind):
    values, mask = inject(waves(), kind, 0, 50, 0.1, np.random.default_rng(0))
    assert (values == waves()).all() and mask.any()


def test_one_seed_gives_every_kind_and_severity_the_same_places():
    firsts = {
        (kind, severity): inject(waves(), kind, severity, 25, 0.1, np.random.default_rng(7))[1].argmax(axis=1).tolist()
        for kind in INJECTIONS
        for severity in (0.5, 8)
    }
    assert len(set(map(tuple, firsts.values()))) == 1
    again, other = (inject(waves(), "variance_change", 1, 25, 0.1, np.random.default_rng(seed))[0] for seed in (7, 8))
    assert (again == inject(waves(), "variance_change", 1, 25, 0.1, np.random.default_rng(7))[0]).all() and (again != other).any()


def test_a_range_may_begin_at_every_place_where_it_fits():
    _, mask = inject(np.zeros((4_000, 30)), "level_shift", 1, 21, 1, np.random.default_rng(0))
    assert np.bincount(mask.argmax(axis=1)) == pytest.approx(np.full(10, 400), abs=5 * np.sqrt(400))


def test_ranges_of_a_trace():
    trace = np.full(10_000, 2.0)
    values, labels = inject_into_trace(trace, "level_shift", 3, 50, 0.1, num_ranges=20, gap=100, rng=np.random.default_rng(0))
    assert values.dtype == np.float32 and labels.dtype == bool and values.shape == labels.shape == (10_000,)
    begins, ends = np.flatnonzero(np.diff(labels, prepend=False, append=False)).reshape(-1, 2).T
    assert (ends - begins == 50).all() and len(begins) == 20
    assert (begins[1:] - ends[:-1]).min() >= 100 and begins[0] >= 100 and ends[-1] <= 9_900
    assert (values[~labels] == 2).all() and np.abs(values[labels] - 2) == pytest.approx(np.full(1_000, 0.3), abs=1e-6)
    assert len(set(np.round(values[begins] - 2, 3))) == 2  # each range draws its side


def test_every_arrangement_of_a_trace_is_as_likely():
    # two ranges of 1 sample, 1 apart at least, among 6 samples: (1, 3), (1, 4), (2, 4)
    rng, counts = np.random.default_rng(0), {}
    for _ in range(3_000):
        places = tuple(np.flatnonzero(inject_into_trace(np.zeros(6), "dropout", 1, 1, 1, 2, 1, rng)[1]).tolist())
        counts[places] = counts.get(places, 0) + 1
    assert set(counts) == {(1, 3), (1, 4), (2, 4)}
    assert list(counts.values()) == pytest.approx([1_000] * 3, abs=5 * np.sqrt(3_000 * 2 / 9))


def test_gain_in_a_trace_is_about_the_mean_of_the_trace():
    trace = np.repeat([0.0, 10.0], 50)
    values, labels = inject_into_trace(trace, "gain", 2, 10, 1, num_ranges=3, gap=5, rng=np.random.default_rng(1))
    inner = labels & (np.abs(np.arange(100) - 50) > 10)
    assert values[inner] == pytest.approx(np.where(trace > 5, 12, -2)[inner])


def test_what_is_refused(refused):
    rng = np.random.default_rng(0)
    with refused("kind='bump'", "spike"):
        inject(waves(), "bump", 1, 25, 0.1, rng)
    for duration in (0, 301):
        with refused(f"duration={duration}"):
            inject(waves(), "spike", 1, duration, 0.1, rng)
    for severity in (-1, np.nan, np.inf):
        with refused(f"severity={severity}"):
            inject(waves(), "ramp", severity, 25, 0.1, rng)
    with refused("num_ranges=4", "100 samples", "at least 110 samples"):
        inject_into_trace(np.zeros(100), "ramp", 1, 20, 0.1, num_ranges=4, gap=6, rng=rng)
    with refused("num_ranges=0"):
        inject_into_trace(np.zeros(100), "ramp", 1, 20, 0.1, num_ranges=0, gap=6, rng=rng)
