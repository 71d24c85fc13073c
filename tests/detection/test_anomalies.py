"""Injected anomalies compared with arrays computed by hand, and equal positions for all kinds and severities."""

import itertools

import numpy as np
import pytest

from enhsim_tf.detection.anomalies import INJECTIONS, estimate_noise_sd, inject, inject_anomalies
from enhsim_tf.telemetry.placing import PlacedEvent

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


def test_the_deviation_of_added_noise_is_the_severity():
    windows = waves(200)
    values, mask = inject(windows, "variance_change", 2, 100, 0.1, np.random.default_rng(0))
    assert np.std((values - windows)[mask]) == pytest.approx(0.2, rel=5 / np.sqrt(2 * mask.sum()))


def test_one_seed_gives_every_kind_and_severity_the_same_places():
    firsts = {
        (kind, severity): inject(waves(), kind, severity, 25, 0.1, np.random.default_rng(7))[1].argmax(axis=1).tolist()
        for kind in INJECTIONS
        for severity in (0.5, 8)
    }
    assert len(set(map(tuple, firsts.values()))) == 1


def test_a_range_may_begin_at_every_place_where_it_fits():
    _, mask = inject(np.zeros((4_000, 30)), "level_shift", 1, 21, 1, np.random.default_rng(0))
    assert np.bincount(mask.argmax(axis=1)) == pytest.approx(np.full(10, 400), abs=5 * np.sqrt(400))


def test_what_is_refused(refused):
    rng = np.random.default_rng(0)
    with refused("'bump'", "spike"):
        inject(waves(), "bump", 1, 25, 0.1, rng)
    for duration in (0, 301):
        with refused(f"duration={duration}"):
            inject(waves(), "spike", 1, duration, 0.1, rng)
    for severity in (-1, np.nan, np.inf):
        with refused(f"ramp at {severity}"):
            inject(waves(), "ramp", severity, 25, 0.1, rng)


# at places in a series


def series(num_samples=4_000, seed=0):
    rng = np.random.default_rng(seed)
    return (20 + 3 * np.sin(2 * np.pi * np.arange(num_samples) / 80) + 0.2 * rng.standard_normal(num_samples)).astype(np.float32)


@pytest.mark.parametrize("sd", [0.05, 1.0])
def test_the_noise_of_a_smooth_signal_with_jumps_is_recovered(sd):
    rng, places = np.random.default_rng(1), np.arange(20_000)
    signal = 5 * np.sin(2 * np.pi * places / 300) + 10 * (places // 1_000 % 2)  # 19 jumps of 10
    assert estimate_noise_sd([signal + sd * rng.standard_normal(20_000)]) == pytest.approx(sd, rel=0.03)


def test_the_noise_of_few_levels_is_the_root_mean_square_of_second_differences():
    values = np.zeros(100)
    values[50] = 3.0  # second differences 3, -6, 3 among 98: (9 + 36 + 9) / 98 / 6
    assert estimate_noise_sd([values]) == pytest.approx(np.sqrt(54 / 98 / 6))
    assert estimate_noise_sd([np.ones(100)]) == estimate_noise_sd([np.arange(100.0)]) == estimate_noise_sd([np.ones(2)]) == 0


def test_given_anomalies_change_exactly_the_marked_samples():
    nominal = series()
    given = [PlacedEvent("level_shift", 4, 100, 50), PlacedEvent("spike", 8, 1_000, 60), PlacedEvent("dropout", 2, 150, 10)]
    values, mask, found = inject_anomalies([nominal], given, [], 0.2, 0, np.random.default_rng(0))
    np.testing.assert_allclose(np.abs(values[100:150] - nominal[100:150]), 0.8, rtol=1e-4)  # 4 sd of 0.2, up or down
    np.testing.assert_array_equal(np.flatnonzero(mask[900:1_100]) + 900, [1_000, 1_025, 1_050])
    np.testing.assert_allclose(values[150:160], nominal[150] - 0.4, rtol=1e-6)
    np.testing.assert_array_equal(values[~mask], nominal[~mask])
    assert (values[mask] != nominal[mask]).all() and mask.sum() == 50 + 3 + 10
    assert [(each.kind, each.begin, each.end) for each in found] == [
        ("level_shift", 100, 150),
        ("dropout", 150, 160),
        ("spike", 1_000, 1_051),
    ]


@pytest.mark.parametrize("seed", range(10))
def test_drawn_anomalies_lie_within_parts_and_keep_their_distance(seed):
    parts = [series(900, 1), series(50, 2), series(1_500, 3)]
    rng = np.random.default_rng(seed)
    drawn = [(kind, 4.0, int(rng.integers(10, 120))) for kind in INJECTIONS]
    values, mask, found = inject_anomalies(parts, [PlacedEvent("ramp", 4, 1_000, 100)], drawn, 0.2, 30, rng)
    nominal = np.concatenate(parts)
    np.testing.assert_array_equal(mask, values != nominal)
    assert sorted(each.kind for each in found) == sorted([*INJECTIONS, "ramp"])
    for before, after in itertools.pairwise(found):
        assert after.begin - before.end >= 30
    assert all(any(a <= each.begin and each.end <= b for a, b in ((0, 900), (900, 950), (950, 2_450))) for each in found)
    assert not mask[[place for place in range(2_450) if not any(each.begin <= place < each.end for each in found)]].any()


def test_places_are_uniform_over_what_is_free():
    nominal, counts = series(100), np.zeros(100, int)
    for seed in range(3_000):
        _, _, (_, found) = inject_anomalies(
            [nominal], [PlacedEvent("level_shift", 4, 0, 40)], [("level_shift", 4, 10)], 0.2, 10, np.random.default_rng(seed)
        )
        counts[found.begin] += 1
    assert counts[:50].sum() == 0 and counts[91:].sum() == 0  # the free places are the 41 samples from 50 to 90
    expected = 3_000 / 41
    assert np.sum((counts[50:91] - expected) ** 2 / expected) < 80  # chi-squared with 40 degrees of freedom: above 80 at p = 0.0002


def test_a_place_where_nothing_changes_is_drawn_again_or_refused(refused):
    nominal = series(2_000)
    nominal[:1_500] = 7  # constant: `stuck` changes nothing there
    for seed in range(10):
        _, mask, (found,) = inject_anomalies([nominal], [], [("stuck", np.inf, 50)], 0.2, 50, np.random.default_rng(seed))
        assert mask.any() and found.begin > 1_450 and mask[found.begin] and mask[found.end - 1]
    with refused("changes no sample", "stuck at inf"):
        inject_anomalies([nominal], [PlacedEvent("stuck", np.inf, 100, 50)], [], 0.2, 0, np.random.default_rng(0))
    with refused("changes nothing at 100 drawn places"):
        inject_anomalies([nominal[:1_000]], [], [("stuck", 4, 50)], 0.2, 0, np.random.default_rng(0))
    with refused("changes no sample"):  # far below the resolution of float32
        inject_anomalies([nominal + np.float32(1e8)], [PlacedEvent("level_shift", 1, 100, 50)], [], 0.2, 0, np.random.default_rng(0))


def test_overlaps_and_places_outside_are_refused(refused):
    rng = np.random.default_rng(0)
    with refused("do not overlap", "ramp at 4 from sample 100 to 150"):
        inject_anomalies([series()], [PlacedEvent("ramp", 4, 100, 50), PlacedEvent("gain", 4, 149, 5)], [], 0.2, 0, rng)
    with refused("within a part", "2 parts"):
        inject_anomalies([series(100), series(100)], [PlacedEvent("ramp", 4, 90, 20)], [], 0.2, 0, rng)
    with refused("room for events", "1 events are placed"):
        inject_anomalies([series(100)], [], [("ramp", 4, 60), ("ramp", 4, 41)], 0.2, 0, rng)
    with refused("range of float32"):
        inject_anomalies([series(100)], [PlacedEvent("dropout", 1e39, 10, 5)], [], 1.0, 0, rng)
    for wrong in (("rust", 1, 0, 5), ("ramp", np.inf, 0, 5), ("ramp", 1, -1, 5), ("ramp", 1, 0, 0)):
        with refused():
            inject_anomalies([series()], [PlacedEvent(*wrong)], [], 0.2, 0, rng)
