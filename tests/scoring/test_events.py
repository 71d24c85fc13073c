"""Tests of events: hand-worked cases and known Poisson rates."""

import math

import numpy as np
import pytest

from enhsim_tf.scoring.events import (
    LEARNT,
    NEW,
    confidence_of,
    false_alarms_per_day,
    flags_of,
    onset_of,
    spans_of,
)
from enhsim_tf.telemetry.windows import runs_of


def marks(text):
    return np.array([letter == "x" for letter in text])


def test_runs_by_hand():
    assert runs_of(marks("xx..x....xx")) == [(0, 2), (4, 5), (9, 11)]
    assert runs_of(marks("")) == runs_of(marks("...")) == []


def test_a_score_is_flagged_when_it_goes_further_than_the_last_eight_windows():
    scores = np.full(200, 0.5)
    scores[20:60] = 2.0  # ten windows of four samples
    scores[60:64], scores[64:68], scores[70], scores[110], scores[112] = 2.05, 2.2, np.nan, 1.5, 1.0
    flagged = np.flatnonzero(flags_of(scores, 4))
    # for a window, in which its own beginning is not remembered; then only what is a twentieth more
    assert flagged.tolist() == [20, 21, 22, 23, 64, 65, 66, 67, 110]
    late = scores.copy()
    late[66:] = 9.0
    np.testing.assert_array_equal(flags_of(late, 4)[:66], flags_of(scores, 4)[:66])


def test_events_by_hand():
    scores = np.full(300, 0.5)
    # two runs with two windows of five samples between them, another, and one at the end
    scores[20:25], scores[35:40], scores[51:53], scores[290:] = 2.0, 1.5, 2.0, 2.0
    flags = scores > 1
    flags[35:40] = False  # remembered
    expected = [(20, 40, LEARNT), (51, 53, LEARNT), (290, 300, LEARNT)]
    assert spans_of(scores, flags, 5) == expected
    flags[20:25] = False
    assert spans_of(scores, flags, 5)[0] == (51, 53, LEARNT)


def test_what_is_flagged_after_a_lasting_departure_is_an_event_of_its_own():
    scores, flags = np.full(300, 0.5), np.zeros(300, bool)
    scores[100:], flags[100:105], flags[120:122], flags[200:204] = 2.0, True, True, True
    # forty samples are remembered
    expected = [(100, 300, LEARNT), (200, 204, NEW)]
    assert spans_of(scores, flags, 5) == expected
    scores[170:176] = 0.5  # for more than a tenth of the time before
    assert spans_of(scores, flags, 5) == expected[:1]


@pytest.mark.parametrize("onset", [180, 200, 215])
def test_an_onset_is_where_windows_that_end_later_rise(onset):
    """A window of 40 samples that ends with sample t holds t - onset + 1 anomalous ones."""
    past = 1 + 0.1 * np.random.default_rng(0).standard_normal(400)
    past += 10 * np.clip((np.arange(400) - onset + 1) / 40, 0, 1)
    assert abs(onset_of(past, 190, 40) - onset) <= 2


def test_confidence_is_one_minus_the_conformal_p_value():
    nominal = np.array([0, 1, 0, 3, 2, 0, 0, 0.5])  # highest scores of blocks of two: 1, 3, 2, 0.5
    for peak, expected in ((4, 4 / 5), (3, 3 / 5), (2.5, 3 / 5), (1, 1 / 5), (0.1, 0)):
        assert confidence_of(peak, nominal, 2) == pytest.approx(expected)


def test_false_alarms_per_day_have_the_exact_poisson_interval():
    # Garwood's table for 10
    assert false_alarms_per_day(10, 2 * 86_400) == pytest.approx(
        (5, 4.795389 / 2, 18.390356 / 2), rel=1e-6
    )
    assert false_alarms_per_day(0, 86_400) == pytest.approx((0, 0, -math.log(0.025)))
