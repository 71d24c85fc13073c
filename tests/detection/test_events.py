"""Tests of events: hand-worked cases, an independent implementation of the event-wise measures, and known Poisson rates."""

import math

import numpy as np
import pytest

from enhsim_tf.detection.events import Event, confidences, event_scores, events_of, false_alarms_per_day, runs_of, timing_quality


def marks(text):
    return np.array([letter == "x" for letter in text])


def test_runs_and_events_by_hand():
    flags = marks("xx..x....xx")
    assert runs_of(flags) == [(0, 2), (4, 5), (9, 11)] and runs_of(marks("")) == runs_of(marks("...")) == []
    scores = np.array([2, 3, 0, 0, 9, 0, 0, 0, 0, 4, 4.0])
    assert events_of(flags, scores) == [Event(0, 2, 1), Event(4, 5, 4), Event(9, 11, 9)]
    assert events_of(flags, scores, gap=2) == [Event(0, 5, 4), Event(9, 11, 9)]
    assert events_of(flags, gap=4) == [Event(0, 11, 0)] and events_of(flags, gap=3) == [Event(0, 5, 0), Event(9, 11, 9)]


def test_measures_by_hand():
    labelled = marks("....xxxx........xxxx....xxxx....")
    flags___ = marks("..xxx.xx..xx.....xx.............")
    found = event_scores(labelled, events_of(flags___))
    # the first event has two alarms, the second one, the third none; one alarm is false. Of 20 nominal samples, 2 + 2 are covered
    assert (found.num_found, found.num_missed, found.num_false, found.num_redundant) == (2, 1, 1, 1)
    assert found.nominal_rate == pytest.approx(16 / 20)
    assert (
        found.precision == pytest.approx(2 / 3)
        and found.recall == pytest.approx(2 / 3)
        and found.alarming_precision == pytest.approx(2 / 3)
    )
    precision = 2 / 3 * 0.8
    assert found.corrected_precision == pytest.approx(precision)
    assert found.f_score() == pytest.approx(1.25 * precision * (2 / 3) / (0.25 * precision + 2 / 3))
    # the first alarm is 2 of 4 samples early: (1/2)^e; the second 1 of 4 samples late: 1 / (1 + (1/3)^e)
    assert found.timing == pytest.approx((0.5**math.e + 1 / (1 + (1 / 3) ** math.e)) / 2) and found.after_rate == 0.5


def test_one_alarm_over_everything_is_worth_nothing_and_exact_alarms_are_perfect():
    labelled = marks("..xx....xx..")
    everything = event_scores(labelled, [(0, 12)])
    assert everything.precision == everything.recall == 1 and everything.corrected_precision == everything.f_score() == 0
    exact = event_scores(labelled, runs_of(labelled))
    assert exact.f_score() == exact.timing == exact.after_rate == exact.alarming_precision == exact.nominal_rate == 1
    nothing = event_scores(labelled, [])
    assert nothing.f_score() == nothing.precision == nothing.recall == 0 and math.isnan(nothing.timing) and nothing.num_missed == 2


def test_events_with_nominal_samples_inside_are_given_as_ranges():
    found = event_scores([(2, 9)], [(5, 6)], num_samples=12)  # between two spikes at 2 and 8
    assert found.num_found == 1 and found.num_false == 0 and found.nominal_rate == 1


def test_timing_quality_has_its_limits():
    assert timing_quality(0, 10, 20) == 1 and timing_quality(-10, 10, 20) == timing_quality(20, 10, 20) == timing_quality(-11, 10, 20) == 0
    assert timing_quality(10, 10, 20) == 0.5  # half-way through the anomaly
    assert timing_quality(-5, 10, 20) == pytest.approx(0.5**math.e)
    late = [timing_quality(each, 10, 20) for each in range(21)]
    assert np.all(np.diff(late) < 0)


def independent(labelled, flags):
    """The measures from sets of samples, without ranges."""

    def groups(marked):
        found, current = [], set()
        for place in range(len(marked) + 1):
            if place < len(marked) and marked[place]:
                current.add(place)
            elif current:
                found.append(current)
                current = set()
        return found

    truth, alarms = groups(labelled), groups(flags)
    found = [anomaly for anomaly in truth if any(anomaly & alarm for alarm in alarms)]
    false = [alarm for alarm in alarms if not any(anomaly & alarm for anomaly in truth)]
    redundant = sum(len([alarm for alarm in alarms if anomaly & alarm]) - 1 for anomaly in found)
    nominal = [place for place in range(len(labelled)) if not labelled[place]]
    quiet = sum(not flags[place] for place in nominal) / len(nominal)
    precision = len(found) / (len(found) + len(false)) * quiet if found else 0.0
    recall = len(found) / len(truth)
    qualities = []
    for number, anomaly in enumerate(truth):
        hits = [alarm for alarm in alarms if anomaly & alarm]
        if not hits:
            continue
        x, beta = min(map(min, hits)) - min(anomaly), len(anomaly)
        alpha = min(beta, min(anomaly) - min(truth[number - 1])) if number else beta
        early = ((x + alpha) / alpha) ** math.e if -alpha < x <= 0 else 0.0
        qualities.append(early if x <= 0 else 1 / (1 + (x / (beta - x)) ** math.e) if x < beta else 0.0)
    f_score = 1.25 * precision * recall / (0.25 * precision + recall) if precision else 0.0
    return f_score, redundant, np.mean(qualities) if qualities else math.nan


def test_measures_agree_with_an_independent_implementation():
    rng = np.random.default_rng(0)
    for _ in range(300):
        labelled, flags = (np.repeat(rng.random(30) < share, rng.integers(1, 5, 30)) for share in (0.3, 0.4))
        labelled = labelled[: min(len(labelled), len(flags))]
        flags = flags[: len(labelled)]
        if labelled.all() or not labelled.any():
            continue
        found = event_scores(labelled, events_of(flags))
        f_score, redundant, timing = independent(labelled, flags)
        assert found.f_score() == pytest.approx(f_score) and found.num_redundant == redundant
        assert found.timing == pytest.approx(timing, nan_ok=True)


def test_confidence_is_one_minus_the_conformal_p_value():
    nominal = np.array([0, 1, 0, 3, 2, 0, 0, 0.5])  # highest scores of blocks of two: 1, 3, 2, 0.5
    assert confidences([4, 3, 2.5, 1, 0.1], nominal, 2).tolist() == pytest.approx([4 / 5, 3 / 5, 3 / 5, 1 / 5, 0])
    assert confidences([], nominal, 2).shape == (0,)


def test_the_confidence_of_false_alarms_is_uniform():
    rng = np.random.default_rng(1)
    found = confidences(rng.standard_normal((4_000, 5)).max(axis=1), rng.standard_normal(5 * 2_000), 5)
    assert np.quantile(found, [0.1, 0.5, 0.9]) == pytest.approx([0.1, 0.5, 0.9], abs=0.04)


def test_false_alarms_per_day_have_the_exact_poisson_interval():
    assert false_alarms_per_day(10, 2 * 86_400) == pytest.approx((5, 4.795389 / 2, 18.390356 / 2), rel=1e-6)  # Garwood's table for 10
    assert false_alarms_per_day(0, 86_400) == pytest.approx((0, 0, -math.log(0.025)))
    rng, covered = np.random.default_rng(2), 0
    for count in rng.poisson(6, 2_000):
        _, low, high = false_alarms_per_day(int(count), 3 * 86_400)
        covered += low <= 2 <= high
    assert covered / 2_000 >= 0.94  # an exact interval covers at least 95 % of the time


def test_wrong_arguments_are_refused(refused):
    with refused("one shape"):
        events_of(np.ones(3, bool), np.ones(4))
    with refused("gap"):
        events_of(np.ones(3, bool), gap=-1)
    with refused("labelled event"):
        event_scores(np.zeros(5, bool), [])
    with refused("within the series"):
        event_scores([(2, 9)], [], num_samples=8)
    with refused("duration"):
        false_alarms_per_day(1, 0)
