"""Tests of schedules: events at drawn places, and the form of places on the command line."""

import itertools

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.coarse_simulator.degraded import Degraded
from enhsim_tf.coarse_simulator.schedule import ScheduledMode
from enhsim_tf.datasets.places import Place, length_limits, num_samples, parse_place, split_limits
from enhsim_tf.datasets.schedule import draw_schedule
from tests.faults.small_data_set import COARSE, INTERVAL_S
from tests.known_simulators import of_waves

MODES = [Degraded("stuck", 1.0), Degraded("drift", 0.5)]


SIMULATOR = of_waves([COARSE], 64, interval_s=INTERVAL_S)


@pytest.mark.parametrize("seed", range(10))
def test_drawn_events_change_the_coarse_run_and_keep_their_distance(seed):
    given, rng = [ScheduledMode("gain_loss", 1.0, 500, 100)], np.random.default_rng(seed)
    schedule = draw_schedule(SIMULATOR, 3_000, given, MODES, 8, (10, 80), 30, rng)
    assert sorted(event.mode for event in schedule) == ["drift"] * 4 + ["gain_loss"] + ["stuck"] * 4 and given[0] in schedule
    for before, after in itertools.pairwise(schedule):
        assert after.begin - before.end >= 30
    assert schedule[-1].end <= 3_000 and all(10 <= event.length <= 80 for event in schedule if event not in given)
    events = [(Degraded(event.mode, event.severity, 0.0), event.begin, event.end) for event in schedule]
    drawn = SIMULATOR.alignment.draw_series(3_000, events, np.random.default_rng(0))
    run, nominal = drawn.coarse[0, :, 0], drawn.nominal[0, :, 0]
    for event in schedule:
        assert (run[event.begin : event.end] != nominal[event.begin : event.end]).any()
        nominal[event.begin : event.end] = run[event.begin : event.end]
        if event.mode == "stuck":
            assert len(set(run[event.begin : event.end])) == 1  # until the end
    np.testing.assert_array_equal(run, nominal)


def test_the_same_seed_gives_the_same_schedule_and_changes_that_fade_do_not_meet():
    first, again = (draw_schedule(SIMULATOR, 3_000, [], MODES, 8, (10, 80), 0, np.random.default_rng(3)) for _ in range(2))
    assert first == again
    assert min(after.begin - before.end for before, after in itertools.pairwise(first)) >= 9  # a fade is four samples long


def test_events_that_change_nothing_or_do_not_fit_are_refused(refused):
    with refused("changes nothing at 100 drawn places"):
        draw_schedule(SIMULATOR, 3_000, [], [Degraded("drift", 0.0)], 1, (10, 10), None, np.random.default_rng(0))
    with refused("room for events"):
        draw_schedule(SIMULATOR, 300, [], MODES, 3, (100, 100), None, np.random.default_rng(0))


def test_places_are_parsed(refused):
    assert parse_place("stuck:0.5@100/20") == Place("stuck", 0.5, "100", "20")
    assert parse_place("stuck:inf@2024-01-05T12:00+02:00/2h") == Place("stuck", np.inf, "2024-01-05T12:00+02:00", "2h")
    assert parse_place("drift@100/20").severity is None
    times = pd.date_range("2024-01-05T09:00", periods=1_000, freq="10s", tz="UTC")
    assert parse_place("stuck:1@2024-01-05T12:00+02:00/10min").samples(times, 10.0) == (360, 60)
    assert parse_place("stuck:1@7/10min").samples(pd.RangeIndex(9), 10.0) == (7, 60)
    for wrong in ("stuck", "stuck@5", "stuck:x@5/5", "@5/5", "stuck:1@5/long"):
        with refused():
            parse_place(wrong)


def test_lengths_and_limits_are_parsed(refused):
    assert num_samples("10min", 30.0) == 20 and num_samples("7", 30.0) == 7 and length_limits(("10", "10min"), 30.0) == (10, 20)
    assert split_limits("length", "5") == ("5", "5") and split_limits("length", "5:1h") == ("5", "1h")
    with refused("at least one sample"):
        num_samples("1s", 30.0)
    with refused("the least first"):
        length_limits(("20", "10"), 1.0)
    for wrong in ("", ":5", "5:", "1:2:3"):
        with refused("--length"):
            split_limits("length", wrong)
