"""Each measure sees what it is there to see, is blind to what it cannot see, and lets real noise pass.

The controls are noises whose fault is known, of a process with memory (AR(1), 0.7), heavy tails (innovations of Student's t
with 5 degrees of freedom) and a scale that differs from window to window. No control is accepted by all measures.
"""

import numpy as np
import pytest
from scipy.signal import lfilter

from enhsim_tf.common import measures as fidelity
from studies.common.noise_processes import first_order
from studies.noise_models import real_floor
from studies.noise_models.real_floor import MEASURES, RealFloor

NUM_WINDOWS, SAMPLES = 200, 500
NAMES = [measure.name for measure in MEASURES]


def process(seed, num_windows=NUM_WINDOWS, samples=SAMPLES):
    rng = np.random.default_rng(seed)
    values = lfilter([1.0], [1.0, -0.7], rng.standard_t(5, (num_windows, samples + 100)), axis=1)[:, 100:]
    return (np.exp(0.3 * rng.standard_normal((num_windows, 1))) * values).astype(np.float32)


def gaussian(real, rng):
    return rng.normal(0, np.std(real), real.shape)


def autoregression(real, rng):
    memory = float(fidelity.autocorrelation(real, 1)[1])
    return np.std(real) * np.stack([first_order(real.shape[1], memory, rng) for _ in real])


def phases_randomised(real, rng):
    transformed = np.fft.rfft(real, axis=1)
    return np.fft.irfft(transformed * np.exp(2j * np.pi * rng.random(transformed.shape)), real.shape[1], axis=1)


def louder(real, rng):
    return 1.5 * real


def memorised(real, rng):
    return real[rng.integers(0, 20, len(real))]


def sixteen_dimensions(real, rng):
    _, energy, directions = np.linalg.svd(real - real.mean(axis=0), full_matrices=False)
    latent = rng.standard_normal((len(real), 16)) * energy[:16] / np.sqrt(len(real))
    return real.mean(axis=0) + latent @ directions[:16]


CLASSIFIERS = {"classifier AUC, boosted trees", "classifier AUC, convolutions"}
SPECTRUM, WITH_SCALE = {"geodesic distance"}, {"log spectral distance", "scale difference", "log scale distance", "marginal distance"}
TAILS = {"kurtosis difference", "tail ratio"}
CONTROLS = {  # what sees each control, and what is blind to it
    gaussian: (set(NAMES) - {"scale difference"}, {"scale difference"}),
    autoregression: (
        {*TAILS, *CLASSIFIERS, "marginal distance", "log scale distance", "coverage", "MMD squared"},
        {"geodesic distance", "autocorrelation distance", "scale difference", "density"},
    ),
    phases_randomised: (
        {*TAILS, *CLASSIFIERS, "coverage", "MMD squared"},
        {"geodesic distance", "log spectral distance", "autocorrelation distance", "effective rank ratio", "density"},
    ),
    louder: (
        {*WITH_SCALE, *CLASSIFIERS, "tail ratio", "coverage", "MMD squared"},
        {"geodesic distance", "autocorrelation distance", "kurtosis difference", "effective rank ratio"},
    ),
    memorised: ({*SPECTRUM, *CLASSIFIERS, "coverage", "MMD squared", "effective rank ratio"}, {"density"}),
    sixteen_dimensions: (set(NAMES), set()),
}


@pytest.fixture(scope="module")
def floor():
    return RealFloor(process(1), process(2), num_resplits=100)


@pytest.fixture(scope="module")
def rows(floor):
    """`rows[control]` holds the rows by measure for windows that the floor has not seen."""
    return {make: {row.measure: row for row in floor.evaluate(make(process(3), np.random.default_rng(4)))} for make in CONTROLS}


@pytest.mark.slow
@pytest.mark.parametrize("control", CONTROLS)
def test_a_control_is_seen_by_those_that_can_and_by_no_other(rows, control):
    seen, blind = CONTROLS[control]
    ratios = {measure: row.ratio for measure, row in rows[control].items()}
    assert {measure: ratios[measure] for measure in seen if ratios[measure] < 2} == {}
    assert {measure: ratios[measure] for measure in blind if ratios[measure] > 2} == {}


@pytest.mark.slow
def test_real_noise_is_as_near_as_its_floor(floor):
    found = floor.evaluate(process(3))
    assert [row.measure for row in found] == NAMES and max(row.ratio for row in found) < 3


def test_floors_are_real_against_real(monkeypatch):
    monkeypatch.setattr(real_floor, "_BLOCK", 1)  # the mean of a re-split's difference is that of two halves drawn at random
    real, again = process(1, 40, 100), process(2, 40, 100)
    (measure,) = [measure for measure in MEASURES if measure.name == "scale difference"]
    found = RealFloor(real, again, 200, measures=[measure])
    owner, by_hand = np.random.default_rng(9), []
    for _ in range(200):
        order = owner.permutation(80)
        by_hand.append(fidelity.scale_difference(*(np.concatenate([real, again])[half] for half in (order[:40], order[40:]))))
    mean = np.mean(np.abs(by_hand))
    assert found.departures == {"scale difference": pytest.approx(mean, abs=5 * np.std(by_hand) * np.sqrt(2 / 200))}
    assert found.evaluate(real) == [("scale difference", 0, 0)]
    (louder_row,) = found.evaluate(1.5 * real)
    assert louder_row.ratio == pytest.approx(np.log(1.5) / found.departures["scale difference"], rel=1e-3)


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
        RealFloor(*(unit * part + offset for part in (real, again)), 3, measures=quick).evaluate(unit * generated + offset)
        for unit, offset in ((1.0, 0.0), (1e-3, 0.02))
    )
    assert [row.value for row in other] == pytest.approx([row.value for row in one], rel=1e-3, abs=1e-5)


def test_windows_that_cannot_be_compared_are_refused(refused):
    real, again = process(1, 30, 60), process(2, 30, 60)
    floor = RealFloor(real, again, 2, measures=MEASURES[:1])
    with refused("at least 20 real windows"):
        RealFloor(real[:19], again, 2)
    with refused("at least 30 generated windows of 60 samples"):
        floor.evaluate(real[:29])
    with refused("finite"):
        floor.evaluate(np.where(real > 2, np.nan, real))
    with refused("vary"):
        RealFloor(np.ones((30, 60)), again, 2)
