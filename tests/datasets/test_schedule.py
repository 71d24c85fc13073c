"""Events of a generated series: those at drawn places, and the form of scenarios, lengths, times
and places on the command line.
"""

import itertools

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.coarse.degraded import Degraded
from enhsim_tf.datasets.labelled_series import draw_schedule
from enhsim_tf.datasets.options import split_limits
from enhsim_tf.datasets.places import (
    Place,
    ScenarioRange,
    length_limits,
    parse_length,
    parse_num_samples,
    parse_place,
    parse_scenario,
    parse_start,
)
from enhsim_tf.telemetry.placing import PlacedEvent
from tests.known_simulators import of_waves
from tests.small_data_set import COARSE, INTERVAL_S

MODES = [ScenarioRange("stuck", (1.0, 1.0)), ScenarioRange("drift", (0.3, 0.6))]
SIMULATOR = of_waves([COARSE], 64, interval_s=INTERVAL_S)


@pytest.mark.parametrize("seed", range(3))
def test_drawn_events_change_the_coarse_run_and_keep_their_distance(seed):
    given = PlacedEvent("gain_loss", 1.0, 500, 100)
    rng = np.random.default_rng(seed)
    schedule = draw_schedule(SIMULATOR, 3_000, [given], MODES, 8, (10, 80), rng)
    kinds = sorted(event.kind for event in schedule)
    assert kinds == ["drift"] * 4 + ["gain_loss"] + ["stuck"] * 4 and given in schedule
    for before, after in itertools.pairwise(schedule):
        assert after.begin - before.end >= 80
    drifts = [event.severity for event in schedule if event.kind == "drift"]
    assert len(set(drifts)) == 4 and 0.3 <= min(drifts) < max(drifts) <= 0.6
    assert schedule[-1].end <= 3_000
    assert all(10 <= event.length <= 80 for event in schedule if event != given)
    drawn = SIMULATOR.alignment.draw_series(
        3_000,
        [(Degraded(each.kind, each.severity, 0.0), each.begin, each.end) for each in schedule],
        np.random.default_rng(0),
    )
    run, nominal = drawn.coarse[0, :, 0], drawn.nominal[0, :, 0]
    for event in schedule:
        places = slice(event.begin, event.end)
        assert (run[places] != nominal[places]).any()
        nominal[places] = run[places]
        assert event.kind != "stuck" or len(set(run[places])) == 1  # until the end
    np.testing.assert_array_equal(run, nominal)


def test_the_same_seed_gives_the_same_schedule_and_changes_that_fade_do_not_meet():
    first, again = (
        draw_schedule(SIMULATOR, 3_000, [], MODES, 8, (2, 2), np.random.default_rng(3))
        for _ in range(2)
    )
    assert first == again
    # a fade is four samples long
    assert min(after.begin - before.end for before, after in itertools.pairwise(first)) >= 9


def test_events_that_change_nothing_or_do_not_fit_are_refused(refused):
    rng = np.random.default_rng(0)
    with refused("changes nothing at 100 drawn places"):
        nothing = ScenarioRange("drift", (0.0, 0.0))
        draw_schedule(SIMULATOR, 3_000, [], [nothing], 1, (10, 10), rng)
    with refused("space for events"):
        draw_schedule(SIMULATOR, 300, [], MODES, 3, (100, 100), rng)


# texts


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("stuck:0.5", ScenarioRange("stuck", (0.5, 0.5), (0.25, 0.25))),
        ("drift:1:0", ScenarioRange("drift", (1.0, 1.0), (0.0, 0.0))),
        ("dropout:1e-2-1:0.1-0.99", ScenarioRange("dropout", (0.01, 1.0), (0.1, 0.99))),
        ("bus=2=stuck:.2-5e-1:0.1", ScenarioRange("stuck", (0.2, 0.5), (0.1, 0.1), "bus=2")),
    ],
)
def test_scenarios_are_parsed(text, expected):
    assert parse_scenario(text) == expected


def test_a_scenario_is_drawn_between_its_limits():
    scenario, rng = parse_scenario("a=stuck:0.2-0.8:0.1-0.3"), np.random.default_rng(0)
    drawn = [scenario.draw(rng) for _ in range(2_000)]
    for name, low, high in (("severity", 0.2, 0.8), ("onset", 0.1, 0.3)):
        values = [getattr(each, name) for each in drawn]
        assert low <= min(values) and max(values) <= high
        assert np.mean(values) == pytest.approx((low + high) / 2, abs=0.1 * (high - low))
    assert {(each.mode, each.channel) for each in drawn} == {("stuck", "a")}
    assert parse_scenario("stuck:0.5").draw(np.random.default_rng(0)) == Degraded("stuck", 0.5)


def test_places_are_parsed():
    assert parse_place("stuck:0.5@100/20") == Place("stuck", 0.5, "100", "20")
    late = "2024-01-05T12:00+02:00"
    assert parse_place(f"stuck:inf@{late}/2h") == Place("stuck", np.inf, late, "2h")
    assert parse_place("drift@100/20").severity is None
    assert parse_place("drift@100/20", 1.0).severity == 1.0
    times = pd.date_range("2024-01-05T09:00", periods=1_000, freq="10s", tz="UTC")
    assert parse_place(f"stuck:1@{late}/10min").samples(times, 10.0) == (360, 60)
    assert parse_place("stuck:1@7/10min").samples(pd.RangeIndex(9), 10.0) == (7, 60)


@pytest.mark.parametrize(
    ("text", "interval_s", "expected"),
    [
        ("5000", 17.0, 5_000),
        ("1d", 60.0, 1_440),
        ("6h", 0.5, 43_200),
        ("1ms", 0.001, 1),
        ("100 s", 8.0, 12),
        ("2.5 min", 10.0, 15),
        ("5s", 10.0, 1),
    ],
)
def test_lengths_are_converted_to_samples(text, interval_s, expected):
    assert parse_num_samples(text, interval_s) == expected


@pytest.mark.parametrize(("text", "interval_s"), [("1s", 10.0), ("1000d", 1.0), ("20000001", 1.0)])
def test_lengths_out_of_range_for_the_interval_are_refused(refused, text, interval_s):
    with refused(f"one every {interval_s:g} s", repr(text)):
        parse_num_samples(text, interval_s)


def test_limits_are_parsed(refused):
    assert length_limits(("10", "10min"), 30.0) == (10, 20)
    assert split_limits("5") == ("5", "5") and split_limits("5:1h") == ("5", "1h")
    with refused("the least first"):
        length_limits(("20", "10"), 1.0)


def test_start_times_are_converted_to_utc():
    assert parse_start("2024-01-01") == pd.Timestamp("2024-01-01", tz="UTC")
    assert parse_start("2024-06-01T12:00+02:00") == pd.Timestamp("2024-06-01T10:00", tz="UTC")
    assert parse_start(pd.Timestamp("2024-06-01T12:00", tz="Europe/Berlin")) == pd.Timestamp(
        "2024-06-01T10:00", tz="UTC"
    )


WRONG = {
    parse_scenario: "|stuck|stuck:|stuck:half|stuck:0.5:|stuck:2|stuck:-0.1|stuck:nan|stuck:0.5:1|stuck:0.5:0.1:7|nominal:0.5|stuck:0.8-0.2"
    "|stuck:0.2-|stuck:0.1-0.2-0.3|stuck:0.2-2|stuck:0.5:0.5-1",
    parse_length: "|0|-5|0s|-1d|nan|NaT|inf|long|1 fortnight|5000.5|1e3|²|1m|1d 6h|1.d|d|"
    + "9" * 5_000,
    parse_start: "|soon|01.02.2024|1066-10-14|9999-01-01|2024-13-01",
    parse_place: "stuck|stuck@5|stuck:x@5/5|@5/5|stuck:1@5/long",
    split_limits: "|:5|5:|1:2:3",
}


@pytest.mark.parametrize("parse", WRONG)
def test_other_texts_are_refused(parse, refused):
    for text in WRONG[parse].split("|"):
        with refused():
            parse(text)
