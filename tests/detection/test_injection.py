"""Tests of anomalies at given and drawn places: labels, places without overlaps, and the estimate of the noise."""

import itertools

import numpy as np
import pytest

from enhsim_tf.detection.anomalies import INJECTIONS
from enhsim_tf.detection.injection import Anomaly, estimate_noise_sd, inject_anomalies

KINDS = list(INJECTIONS)


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
    given = [Anomaly("level_shift", 4, 100, 50), Anomaly("spike", 8, 1_000, 60), Anomaly("dropout", 2, 150, 10)]
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
    drawn = [(kind, 4.0, int(rng.integers(10, 120))) for kind in KINDS]
    values, mask, found = inject_anomalies(parts, [Anomaly("ramp", 4, 1_000, 100)], drawn, 0.2, 30, rng)
    nominal = np.concatenate(parts)
    np.testing.assert_array_equal(mask, values != nominal)
    assert sorted(each.kind for each in found) == sorted([*KINDS, "ramp"])
    for before, after in itertools.pairwise(found):
        assert after.begin - before.end >= 30
    assert all(any(a <= each.begin and each.end <= b for a, b in ((0, 900), (900, 950), (950, 2_450))) for each in found)
    assert not mask[[place for place in range(2_450) if not any(each.begin <= place < each.end for each in found)]].any()


def test_places_are_uniform_over_what_is_free():
    nominal, counts = series(100), np.zeros(100, int)
    for seed in range(3_000):
        _, _, (_, found) = inject_anomalies(
            [nominal], [Anomaly("level_shift", 4, 0, 40)], [("level_shift", 4, 10)], 0.2, 10, np.random.default_rng(seed)
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
        inject_anomalies([nominal], [Anomaly("stuck", np.inf, 100, 50)], [], 0.2, 0, np.random.default_rng(0))
    with refused("changes none at 100 drawn places"):
        inject_anomalies([nominal[:1_000]], [], [("stuck", 4, 50)], 0.2, 0, np.random.default_rng(0))
    with refused("changes no sample"):  # far below the resolution of float32
        inject_anomalies([nominal + np.float32(1e8)], [Anomaly("level_shift", 1, 100, 50)], [], 0.2, 0, np.random.default_rng(0))


def test_overlaps_and_places_outside_are_refused(refused):
    rng = np.random.default_rng(0)
    with refused("do not overlap", "another from sample 100 to 150"):
        inject_anomalies([series()], [Anomaly("ramp", 4, 100, 50), Anomaly("gain", 4, 149, 5)], [], 0.2, 0, rng)
    with refused("within a part", "2 parts"):
        inject_anomalies([series(100), series(100)], [Anomaly("ramp", 4, 90, 20)], [], 0.2, 0, rng)
    with refused("room for events", "1 events are placed"):
        inject_anomalies([series(100)], [], [("ramp", 4, 60), ("ramp", 4, 41)], 0.2, 0, rng)
    with refused("range of float32"):
        inject_anomalies([series(100)], [Anomaly("dropout", 1e39, 10, 5)], [], 1.0, 0, rng)
    for wrong in (("rust", 1, 0, 5), ("ramp", np.inf, 0, 5), ("ramp", 1, -1, 5), ("ramp", 1, 0, 0)):
        with refused():
            Anomaly(*wrong)
