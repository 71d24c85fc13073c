import numpy as np
import pytest

from enhsim_tf.simulator.detector_choice import (
    RELATIONS,
    JudgedDetector,
    anomalous_windows,
    choose_detector,
    relation_anomalies,
)


def detector(name, false_alarms=0.01, recall=0.5, relation=None):
    return JudgedDetector(
        name, false_alarms, 0.03, recall, {} if relation is None else {RELATIONS[0]: relation}
    )


@pytest.mark.parametrize(
    ("judged", "expected"),
    [
        ([detector("a", recall=0.5), detector("b", recall=0.69)], "a"),  # within twenty points
        ([detector("a", recall=0.5), detector("b", recall=0.71)], "b"),
        ([detector("a", 0.04, 0.9), detector("b", 0.03, 0.1)], "b"),  # the first breaks its promise
        ([detector("a", 0.2), detector("b", 0.1)], "b"),  # both do
        (
            [detector("a", recall=0.5, relation=0.1), detector("b", recall=0.4, relation=0.9)],
            "b",
        ),  # only the second is near the best in both
        (
            [detector("a", recall=0.9, relation=0.1), detector("b", recall=0.5, relation=0.8)],
            "b",
        ),  # neither is: 1.0 and 1.3
    ],
)
def test_the_rule_by_hand(judged, expected):
    assert choose_detector(judged).name == expected


def test_relation_anomalies_keep_the_values_of_every_channel():
    windows = np.random.default_rng(0).standard_normal((10, 40, 3))
    for found in relation_anomalies(
        windows, np.zeros_like(windows), np.random.default_rng(1)
    ).values():
        changed = (found != windows).any(axis=1)
        assert (changed.sum(axis=1) == 1).all()
        pool = {
            tuple(np.sort(windows[row, :, channel])) for row in range(10) for channel in range(3)
        }
        assert all(
            tuple(np.sort(found[row, :, channel])) in pool for row, channel in np.argwhere(changed)
        )


def test_a_lost_relation_of_two_channels_is_found_by_the_innovation(both):
    judged = {each["name"]: each for each in both[1].detectors}
    assert (
        judged["innovation"]["by_kind"]["another time"]
        > 0.9
        > judged["largest step"]["by_kind"]["another time"] + 0.5
    )
    assert all(each["false_alarms"] <= 0.05 for each in both[1].detectors)


def test_anomalies_are_in_one_channel_and_of_the_asked_size():
    nominal = np.zeros((6, 120, 2), np.float32)
    found = anomalous_windows(nominal, np.array([1.0, 10.0]), 0, (4.0,))["level_shift", 4.0]
    size = np.abs(found).max(axis=1)
    assert ((size > 0).sum(axis=1) == 1).all() and set(size[size > 0].tolist()) == {4.0, 40.0}
