"""Each measure sees what it is there to see, is blind to what it cannot see, and lets real noise
pass.
"""

import numpy as np
import pytest
from scipy.signal import lfilter

from enhsim_tf.common import measures as fidelity
from studies.noise_models import real_floor
from studies.noise_models.real_floor import MEASURES, RealFloor

NAMES = [measure.name for measure in MEASURES]


def process(seed, num_windows=200, samples=500):
    """Noise with memory (AR(1), 0.7), heavy tails (Student's t with 5 degrees of freedom) and a
    scale that differs between windows.
    """
    rng = np.random.default_rng(seed)
    draws = rng.standard_t(5, (num_windows, samples + 100))
    values = lfilter([1.0], [1.0, -0.7], draws, axis=1)[:, 100:]
    return (np.exp(0.3 * rng.standard_normal((num_windows, 1))) * values).astype(np.float32)


CLASSIFIERS = {"classifier AUC, boosted trees", "classifier AUC, convolutions"}
WITH_SCALE = {
    "log spectral distance",
    "scale difference",
    "log scale distance",
    "marginal distance",
    "tail ratio",
}
CONTROLS = {  # noise whose fault is known, what sees it, and what is blind to it
    "gaussian": (
        lambda real, rng: rng.normal(0, np.std(real), real.shape),
        set(NAMES) - {"scale difference"},
        {"scale difference"},
    ),
    "louder": (
        lambda real, rng: 1.5 * real,
        {*WITH_SCALE, *CLASSIFIERS, "coverage", "MMD squared"},
        {
            "geodesic distance",
            "autocorrelation distance",
            "kurtosis difference",
            "effective rank ratio",
        },
    ),
    "memorised": (
        lambda real, rng: real[rng.integers(0, 20, len(real))],
        {"coverage", "effective rank ratio"},
        {"density"},
    ),
}


@pytest.mark.slow
def test_a_control_is_seen_by_those_that_can_and_by_no_other_and_real_noise_by_none():
    floor = RealFloor(process(1), process(2), num_resplits=100)
    for name, (make, seen, blind) in CONTROLS.items():
        ratios = {
            row.measure: row.ratio
            for row in floor.evaluate(make(process(3), np.random.default_rng(4)))
        }
        assert [measure for measure in seen if ratios[measure] < 2] == [], name
        assert [measure for measure in blind if ratios[measure] > 2] == [], name
    found = floor.evaluate(process(3))
    assert [row.measure for row in found] == NAMES and max(row.ratio for row in found) < 3


def test_floors_are_real_against_real(monkeypatch):
    # the mean of a re-split's difference is that of two halves drawn at random
    monkeypatch.setattr(real_floor, "_BLOCK", 1)
    real, again = process(1, 40, 100), process(2, 40, 100)
    (measure,) = [measure for measure in MEASURES if measure.name == "scale difference"]
    found = RealFloor(real, again, 200, measures=[measure])
    owner, windows = np.random.default_rng(9), np.concatenate([real, again])
    orders = [owner.permutation(80) for _ in range(200)]
    by_hand = [
        fidelity.scale_difference(windows[order[:40]], windows[order[40:]]) for order in orders
    ]
    mean = np.mean(np.abs(by_hand))
    assert found.departures == {
        "scale difference": pytest.approx(mean, abs=5 * np.std(by_hand) * np.sqrt(2 / 200))
    }
    assert found.evaluate(real) == [("scale difference", 0, 0)]
    (louder_row,) = found.evaluate(1.5 * real)
    assert louder_row.ratio == pytest.approx(
        np.log(1.5) / found.departures["scale difference"], rel=1e-3
    )


def test_resplits_keep_blocks_together_and_use_every_window_once():
    floor, seen = RealFloor(process(1, 30, 60), process(2, 30, 60), 1, measures=[]), set()
    for first, second in floor._resplits(20, np.random.default_rng(0)):
        assert len(first) == len(second) == 30 and sorted([*first, *second]) == list(range(60))
        assert (np.diff(first) > 0).all() and (first.reshape(-1, 10) % 10 == np.arange(10)).all()
        seen.add(tuple(first))
    assert len(seen) > 10


def test_the_unit_and_the_offset_do_not_matter():
    real, again, generated = (process(seed, 60, 100) for seed in (1, 2, 3))
    quick = [measure for measure in MEASURES if measure.name not in CLASSIFIERS]
    one, other = (
        RealFloor(*(unit * part + offset for part in (real, again)), 3, measures=quick).evaluate(
            unit * generated + offset
        )
        for unit, offset in ((1.0, 0.0), (1e-3, 0.02))
    )
    assert [row.value for row in other] == pytest.approx(
        [row.value for row in one], rel=1e-3, abs=1e-5
    )
