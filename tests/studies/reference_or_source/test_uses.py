import numpy as np
import pytest

from enhsim_tf.common.stages import load_arrays
from studies.reference_or_source.detectors import MAIN, conformal_threshold
from studies.reference_or_source.judging import NOMINAL, RATE, judged
from studies.reference_or_source.recordings import FITTED, record
from studies.reference_or_source.uses import (
    COMMANDS,
    NO_SIMULATOR,
    ONE_STEP,
    REFERENCE,
    SOURCE,
    Comparison,
    Scores,
)
from studies.reference_or_source.windows import Judged, Windows, unit_starts, windows_of
from tests.studies.reference_or_source.toy import Toy


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("toy")
    record(Toy(), {"fit": 12, "test": 12, "source": 6, "parameters": 2, "fault": 2}, 0, folder)
    return load_arrays(folder, "runs")


@pytest.fixture(scope="module")
def windows(runs):
    return windows_of(Toy(), runs, "wrong physics", 0)


def test_windows_lie_within_one_unit_each():
    starts, units = unit_starts(Toy(), 2, 60, first=50)
    assert starts.tolist() == [50, 110, 170, 250, 310, 370]
    assert units.tolist() == [0, 0, 0, 1, 1, 1]


def test_the_fitted_simulator_differs_from_the_real_system_by_the_noise_alone(runs):
    assert runs[f"test/{FITTED}"][:, 0] == pytest.approx(runs["test/real"][:, 0], abs=0.02)


def test_an_enhancer_leaves_the_noise_as_residual(windows):
    residuals = Comparison(windows, 0).residuals * windows.scale
    assert residuals.std(axis=(0, 1)) == pytest.approx([Toy.sd, Toy.sd], rel=0.1)


@pytest.fixture(scope="module")
def found(windows):
    """Share of windows of the large offset, and of nominal ones, that each use flags."""
    large, shares = windows.faults.index(("offset", 1.0)), {}
    uses = (REFERENCE, NO_SIMULATOR, SOURCE, COMMANDS, ONE_STEP)
    for scores in Comparison(windows, 0).scores(uses):
        if scores.detector == MAIN:
            alarms = scores.tested > conformal_threshold(scores.known, RATE)
            shares[scores.use] = (
                alarms[windows.labels == large].mean(),
                alarms[windows.labels < 0].mean(),
            )
    return shares


@pytest.mark.parametrize("use", [REFERENCE, COMMANDS])
def test_what_is_expected_from_commands_shows_an_offset_that_telemetry_alone_does_not(found, use):
    assert found[use][0] == 1.0 and found[use][1] < 0.1
    assert found[NO_SIMULATOR][0] < 0.3 and found[SOURCE][0] < 0.3


def test_shares_at_the_set_threshold_and_at_equal_false_alarms():
    labels = np.array([-1] * 100 + [0] * 4 + [1] * 4)
    tested = np.concatenate([np.arange(100.0), [97.0, 98.5, 99.5, 10.0], [99.5, 0, 0, 0]])
    empty = np.zeros((1, 20, 2))
    one = Windows(empty, empty, empty, labels, labels)
    windows = Judged(one, one, labels, (("a", 1.0), ("b", 1.0)), empty, np.ones(2))
    # the largest of few known scores is the threshold
    rows = judged(windows, Scores("source", MAIN, np.full(9, 89.5), tested))
    assert [(row["kind"], row["found"]) for row in rows] == [
        (NOMINAL, 0.1),
        ("a", 0.75),
        ("b", 0.25),
    ]
    # 98.01 flags one of the hundred nominal windows
    assert [row["found_alike"] for row in rows] == [0.01, 0.5, 0.25]
