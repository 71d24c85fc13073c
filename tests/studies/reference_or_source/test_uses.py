import numpy as np
import pytest

from enhsim_tf.common.stages import load_arrays
from studies.reference_or_source.cells import NOMINAL, judged
from studies.reference_or_source.detectors import conformal_threshold
from studies.reference_or_source.recordings import COMMANDS, FITTED, record
from studies.reference_or_source.uses import NO_SIMULATOR, REFERENCE, SOURCE, Cell, Scores
from studies.reference_or_source.windows import (
    Judged,
    Windows,
    delayed,
    estimated_delays,
    unit_starts,
    windows_of,
)
from tests.studies.reference_or_source.toy import Toy


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("toy")
    record(Toy(), {"fit": 12, "test": 12, "source": 6, "parameters": 2, "fault": 2}, 0, folder)
    return load_arrays(folder, "runs")


def test_windows_lie_within_one_unit_each():
    starts, units = unit_starts(Toy(), 2, 60, first=50)
    assert starts.tolist() == [50, 110, 170, 250, 310, 370]
    assert units.tolist() == [0, 0, 0, 1, 1, 1]


def test_delays_of_units_are_found():
    run = np.random.default_rng(0).standard_normal((600, 2))
    delays = np.array([3, 0, -5])
    assert estimated_delays(run, delayed(run, 200, delays), 200, 8).tolist() == [3, 0, -5]


def test_the_fitted_simulator_differs_from_the_real_system_by_the_noise_alone(runs):
    assert runs[f"test/{FITTED}"][:, 0] == pytest.approx(runs["test/real"][:, 0], abs=0.02)


@pytest.mark.parametrize("simulator", ["wrong physics", COMMANDS])
def test_an_enhancer_leaves_the_noise_as_residual(runs, simulator):
    windows = windows_of(Toy(), runs, simulator, 12, 0)
    residuals = Cell(windows, 0).residuals * windows.scale
    assert residuals.std(axis=(0, 1)) == pytest.approx([Toy.sd, Toy.sd], rel=0.1)


def test_noise_is_drawn_for_all_channels_at_once_unless_it_is_drawn_separately(runs):
    windows = windows_of(Toy(), runs, "own", 12, 0)
    joint, separate = (
        Cell(windows, 0, draws=draws).noise(300, 1).reshape(-1, 2)
        for draws in ("joint", "separate")
    )
    assert np.corrcoef(joint.T)[0, 1] > 0.95 and abs(np.corrcoef(separate.T)[0, 1]) < 0.1


def test_a_reference_finds_an_offset_that_telemetry_alone_does_not_show(runs):
    windows = windows_of(Toy(), runs, "wrong physics", 12, 0)
    large = windows.faults.index(("offset", 1.0))
    found = {}
    for scores in Cell(windows, 0).scores((REFERENCE, NO_SIMULATOR, SOURCE)):
        alarms = scores.tested > conformal_threshold(scores.known)
        found[scores.use, scores.detector] = (
            alarms[windows.labels == large].mean(),
            alarms[windows.labels < 0].mean(),
        )
    assert found[REFERENCE, "size"][0] == 1.0
    assert found[REFERENCE, "size"][1] < 0.05
    assert found[NO_SIMULATOR, "size"][0] < 0.3
    assert found[SOURCE, "size"][0] < 0.3


def test_a_classifier_finds_the_kind_of_fault_that_it_has_learnt_in_the_difference_from_the_simulator(
    runs,
):
    windows = windows_of(Toy(), runs, "wrong physics", 12, 0)
    large = windows.faults.index(("offset", 1.0))
    assert {windows.faults[number][0] for number in windows.simulated} == {"offset"}
    for scores in Cell(windows, 0).classified(tuple(windows.simulated), ("reference, faults",)):
        assert (
            np.mean(scores.tested[windows.labels == large] > conformal_threshold(scores.known))
            > 0.9
        )


def test_a_channel_of_another_time_keeps_its_values(runs):
    windows = windows_of(Toy(), runs, "own", 12, 0, with_relations=True)
    moved = windows.labels == windows.faults.index(("channel of another time", 1.0))
    nominal = windows.tested.telemetry[windows.labels < 0]
    changed = windows.tested.telemetry[moved] != nominal
    assert (changed.any(axis=1).sum(axis=1) == 1).all()
    rows = {row.tobytes() for each in range(2) for row in np.ascontiguousarray(nominal[:, :, each])}
    assert all(
        row.tobytes() in rows
        for each in range(2)
        for row in np.ascontiguousarray(windows.tested.telemetry[moved][:, :, each])
    )


def test_unknown_commands_are_replaced_by_the_most_similar_coarse_window(runs):
    windows = windows_of(Toy(), runs, "own", 12, 0)
    found = Cell(windows, 0, is_unknown=True).planned[:5]

    def normal(values, about):
        return (values - about.mean(axis=(0, 1))) / about.std(axis=(0, 1))

    library = normal(windows.source[:, :, :2], windows.source[:, :, :2])
    for window, chosen in zip(
        normal(windows.known.telemetry[:5], windows.known.telemetry), found, strict=True
    ):
        nearest = np.argmin(((library - window) ** 2).sum(axis=(1, 2)))
        assert chosen == pytest.approx(windows.source[nearest])


def test_alarms_and_their_beginnings_are_counted():
    labels = np.array([-1] * 10 + [0, 0, 1, 1])
    tested = np.array([0, 2, 2, 0, 0, 2, 0, 0, 0, 0, 2, 0, 2, 2.0])
    empty = np.zeros((1, 20, 2))
    windows = Judged(
        Windows(empty, empty, labels, labels),
        Windows(empty, empty, labels, labels),
        labels,
        (("a", 1), ("b", 1)),
        empty,
        empty,
        {},
    )
    rows = judged(
        Toy(), windows, Scores("source", "size", np.ones(1), tested), lambda known: 1.0, True
    )
    assert [(row["kind"], row["alarms"]) for row in rows] == [
        (NOMINAL, 0.3),
        ("a", 0.5),
        ("b", 1.0),
    ]
    assert rows[0]["events"] == pytest.approx(2 / (10 * 10 / 86_400))
