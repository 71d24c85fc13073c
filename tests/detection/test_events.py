"""Tests of events: hand-worked cases and known Poisson rates."""

import math

import numpy as np
import pytest

from enhsim_tf.detection.events import Event, confidences, events_of, false_alarms_per_day
from enhsim_tf.telemetry.windows import runs_of


def marks(text):
    return np.array([letter == "x" for letter in text])


def test_runs_and_events_by_hand():
    flags = marks("xx..x....xx")
    assert (
        runs_of(flags) == [(0, 2), (4, 5), (9, 11)]
        and runs_of(marks("")) == runs_of(marks("...")) == []
    )
    scores = np.array([2, 3, 0, 0, 9, 0, 0, 0, 0, 4, 4.0])
    assert events_of(flags, scores) == [Event(0, 2, 1), Event(4, 5, 4), Event(9, 11, 9)]
    assert events_of(flags, scores, gap=2) == [Event(0, 5, 4), Event(9, 11, 9)]
    assert events_of(flags, gap=4) == [Event(0, 11, 0)] and events_of(flags, gap=3) == [
        Event(0, 5, 0),
        Event(9, 11, 9),
    ]


def test_confidence_is_one_minus_the_conformal_p_value():
    nominal = np.array([0, 1, 0, 3, 2, 0, 0, 0.5])  # highest scores of blocks of two: 1, 3, 2, 0.5
    assert confidences([4, 3, 2.5, 1, 0.1], nominal, 2).tolist() == pytest.approx(
        [4 / 5, 3 / 5, 3 / 5, 1 / 5, 0]
    )
    assert confidences([], nominal, 2).shape == (0,)


def test_false_alarms_per_day_have_the_exact_poisson_interval():
    assert false_alarms_per_day(10, 2 * 86_400) == pytest.approx(
        (5, 4.795389 / 2, 18.390356 / 2), rel=1e-6
    )  # Garwood's table for 10
    assert false_alarms_per_day(0, 86_400) == pytest.approx((0, 0, -math.log(0.025)))
