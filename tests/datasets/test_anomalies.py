"""Injected anomalies compared with arrays computed by hand, and equal positions for all kinds and
severities.
"""

import numpy as np
import pytest

from enhsim_tf.datasets.anomalies import INJECTIONS, estimate_noise_sd
from studies.common.injections import inject

RAMP = np.arange(10, dtype=np.float32)
BOTH_WAYS = "level_shift", "ramp", "spike"


def injected(window, kind, severity, duration, seed=0, noise_sd=0.5):
    """Injects an anomaly into one window, and returns the window and the anomalous positions."""
    values, mask = inject(
        np.asarray(window)[None], kind, severity, duration, noise_sd, np.random.default_rng(seed)
    )
    assert values.dtype == np.float32 and mask.dtype == bool
    assert values.shape == mask.shape == (1, len(window))
    return values[0], np.flatnonzero(mask[0])


def waves(number=6):
    rng = np.random.default_rng(0)
    phases = rng.uniform(0, 2 * np.pi, (number, 1))
    signal = 5 + np.sin(2 * np.pi * np.arange(300) / 120 + phases)
    return (signal + 0.1 * rng.standard_normal(signal.shape)).astype(np.float32)


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
        # twice a noise of 0.5: off by 1
        values, places = injected(np.full(10, 3.0), kind, 2, 4, seed)
        change = values[places] - 3
        side = -1 if kind in BOTH_WAYS and change[-1] < 0 else 1
        sides.add(side)
        assert change == pytest.approx(side * np.array(changes), abs=1e-6)
        assert (places == places[0] + np.arange(len(changes))).all()
    assert sides == ({-1, 1} if kind in BOTH_WAYS else {1})


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
    assert np.diff(places).tolist() == [25, 25, 25]
    assert set(values[places]) in ({1}, {-1}) and np.count_nonzero(values) == 4


def test_the_deviation_of_added_noise_is_the_severity():
    windows = waves(200)
    values, mask = inject(windows, "variance_change", 2, 100, 0.1, np.random.default_rng(0))
    assert np.std((values - windows)[mask]) == pytest.approx(0.2, rel=5 / np.sqrt(2 * mask.sum()))


def test_one_seed_gives_every_kind_and_severity_the_same_places():
    firsts = {
        tuple(inject(waves(), kind, severity, 25, 0.1, np.random.default_rng(7))[1].argmax(axis=1))
        for kind in INJECTIONS
        for severity in (0.5, 8)
    }
    assert len(firsts) == 1


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


# their unit of severity


@pytest.mark.parametrize("sd", [0.05, 1.0])
def test_the_noise_of_a_smooth_signal_with_jumps_is_recovered(sd):
    rng, places = np.random.default_rng(1), np.arange(20_000)
    signal = 5 * np.sin(2 * np.pi * places / 300) + 10 * (places // 1_000 % 2)  # 19 jumps of 10
    assert estimate_noise_sd([signal + sd * rng.standard_normal(20_000)]) == pytest.approx(
        sd, rel=0.03
    )


def test_the_noise_of_few_levels_is_the_root_mean_square_of_second_differences():
    values = np.zeros(100)
    values[50] = 3.0  # second differences 3, -6, 3 among 98: (9 + 36 + 9) / 98 / 6
    assert estimate_noise_sd([values]) == pytest.approx(np.sqrt(54 / 98 / 6))
    for values in (np.ones(100), np.arange(100.0), np.ones(2)):
        assert estimate_noise_sd([values]) == 0
