import copy
import dataclasses

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.coarse.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.common.errors import InputError
from enhsim_tf.scoring.events import Event
from enhsim_tf.scoring.options import ScoreOptions
from enhsim_tf.scoring.score import (
    ScoredTelemetry,
    events_table,
    score,
    scorer_of,
    write_scores,
)
from enhsim_tf.telemetry.series import Clock, Part
from tests.fitted_simulators import coarse_run, joint, recorded, series
from tests.known_simulators import of_waves

TELEMETRY = series(seed=5)


def on_clock(recording, interval_s, start):
    return dataclasses.replace(recording, clock=Clock.of(interval_s, start))


def changed(begin, end, by, channel=0, recording=TELEMETRY):
    """A recording, by default of one channel, with other values from one sample to another."""
    values = recording.values.copy()
    values[begin:end, channel] += by
    return recorded(values, recording.columns)


def after_gap(recording, end, offset_s, begin=None):
    """A recording whose samples from one on come later; those before it, after the end of the first
    part, are left out.
    """
    values = recording.values
    parts = Part(values[:end]), Part(values[begin or end :], offset_s)
    return dataclasses.replace(recording, parts=parts)


def test_a_fault_is_one_event_with_its_onset_its_views_and_nominal_time_is_not_flagged(single):
    scored = score(single[0], changed(1_000, 1_300, 4.0))
    frame = scored.table
    (event,) = scored.events
    window = scored.window
    assert window == 64 and len(frame) == 3_000 and frame["flag"].sum() == event.num_flagged
    assert abs(event.begin - 1_000) <= 8 and 1_300 <= event.end <= 1_364
    assert event.begin <= event.detected <= 1_000 + window and event.begin <= event.peak < event.end
    assert "level" in event.views and event.channels == ("volts",) and event.against == "learnt"
    assert not frame["flag"].iloc[:930].any() and frame["score"].iloc[1_100:1_250].min() > 1
    assert scored.departure == "" and scored.not_judged == ()


def test_the_past_alone_raises_the_alarm_with_the_sample_that_is_said(single):
    """With all telemetry until then the first sample is flagged, with a stride less it is not."""
    faulty = changed(1_000, 1_300, 4.0)
    scored = score(single[0], faulty)
    (event,) = scored.events
    flagged = int(np.argmax(scored.table["flag"]))
    known = scorer_of(single[0]).score(faulty.values[: event.detected + 1]).samples
    assert event.detected == flagged + 63 and known[flagged] > 1
    assert (known[:flagged] <= 1).all()


def test_scores_of_a_run_are_of_the_difference_from_it(of_run):
    given = changed(1_000, 1_200, 0.5)
    frame = score(of_run[0], given, coarse_run()).table
    assert {"value", "enhanced", "score", "flag", "out_of_range"} <= set(frame.columns)
    assert frame["score"].iloc[1_020:1_180].min() > 1 and frame["flag"].iloc[:900].mean() < 0.05
    np.testing.assert_array_equal(frame["value"], given.values[:, 0])
    assert np.std(frame["value"] - frame["enhanced"]) < 0.25


def test_an_event_ends_where_the_run_has_a_gap(of_run):
    run = after_gap(coarse_run(), 1_500, 16_000.0, 1_600)
    scored = score(of_run[0], changed(1_300, 3_000, 0.5), run)
    before = next(event for event in scored.events if abs(event.begin - 1_300) <= 8)
    after = scored.events[scored.events.index(before) + 1]
    assert before.end == 1_500 and after.begin == 1_600
    assert np.flatnonzero(scored.table["score"].isna()).tolist() == [*range(1_500, 1_600)]
    ends = events_table(scored)["end"] - scored.table.index[0]
    assert ends[scored.events.index(before)] == pd.Timedelta(seconds=15_000)


def test_no_event_has_its_peak_before_it_begins(of_run):
    events = score(of_run[0], TELEMETRY, coarse_run(), ScoreOptions(0.2)).events
    assert events and all(one.begin <= one.peak < one.end for one in events)


def test_samples_without_a_run_get_no_score(of_run):
    frame = score(of_run[0], TELEMETRY, coarse_run(2_000)).table
    assert frame["score"].isna().sum() == 1_000 and not frame["flag"].iloc[2_000:].any()
    frame = score(of_run[0], TELEMETRY.part(500, 3_000), coarse_run(2_000)).table
    assert frame["score"].isna().tolist() == [False] * 1_500 + [True] * 1_000
    assert frame["flag"].mean() < 0.05


def row_of_event(clock, times, *places):
    """The row of an event in samples at these times."""
    event = Event(*places, 2.0, 0.9, "learnt", ("step", "level"), ("volts",))
    scored = ScoredTelemetry(pd.DataFrame(index=times), {}, (event,), 16, clock)
    return events_table(scored).iloc[0]


def test_an_event_across_a_gap_ends_one_interval_after_its_last_sample():
    times = pd.to_datetime([0, 10, 20, 500, 510], unit="s", utc=True)
    row = row_of_event(Clock.of(10.0, "2024-01-01"), times, 1, 5, 2, 3, 4)
    found = [row[name].timestamp() for name in ("begin", "end", "detected", "peak")]
    assert found == [10, 520, 20, 500]
    assert (row["views"], row["channels"]) == ("step, level", "volts")


def test_an_event_of_a_fast_clock_ends_one_interval_after_its_last_sample():
    clock = Clock.of(2e-7, "2024-01-01")
    times = clock.index(2e-7 * np.arange(5))
    assert row_of_event(clock, times, 1, 3, 2, 2, 2)["end"] == times[3]


def test_times_of_a_clock_from_zero_are_written_as_seconds(single, tmp_path):
    given = on_clock(changed(1_500, 3_000, 6.0), 10.0, "1970-01-01")
    scored = score(single[0], given)
    write_scores(tmp_path / "scores.CSV", scored)
    written = pd.read_csv(tmp_path / "scores.CSV")
    assert written["time"].tolist() == [10.0 * number for number in range(3_000)]
    events = pd.read_csv(tmp_path / "scores.events.csv")[["begin", "end"]].to_numpy().tolist()
    begin_s = 10 * scored.events[-1].begin
    assert [begin_s, 30_000] in events and len(events) == len(scored.events)
    assert f"since {begin_s} s" in scored.departure


def test_a_lasting_change_is_one_event_since_its_time_and_names_update(single):
    # after a gap of a hundred samples
    given = after_gap(changed(1_500, 3_000, 6.0), 1_200, 13_000.0)
    scored = score(single[0], given)
    frame = scored.table
    (event,) = scored.events
    assert abs(event.begin - 1_500) <= 8 and event.end == 3_000
    begin = frame.index[event.begin]
    assert begin == pd.Timestamp("2024-01-01T00:00:00Z") + pd.Timedelta(
        seconds=13_000 + 10 * (event.begin - 1_200)
    )
    for words in (f"since {begin}", "level", "`update`"):
        assert words in scored.departure
    # flagged when it leaves, and no more although it stays
    assert frame["flag"].iloc[1_440:1_520].any() and frame["score"].iloc[1_600:].min() > 1
    assert frame["flag"].iloc[1_700:].mean() < 0.02


def test_a_fault_within_a_departure_is_an_event_against_the_new_operating_point(single):
    given = changed(2_200, 2_400, 9.0, recording=changed(1_000, 3_000, 6.0))
    departure, later = score(single[0], given).events
    assert abs(departure.begin - 1_000) <= 8 and departure.end == 3_000
    assert later.against == "new operating point" and abs(later.begin - 2_200) <= 8


def test_a_departure_from_a_run_begins_where_the_telemetry_leaves_it(of_run):
    run = coarse_run().part(500, 3_000)
    scored = score(of_run[0], changed(1_500, 3_000, 6.0), run)
    event = scored.events[-1]
    assert "level" in scored.departure and abs(event.begin - 1_500) <= 8
    assert event.end == 3_000 and scored.table["score"].iloc[:500].isna().all()


def test_a_channel_that_is_missing_leaves_the_others_judged(both):
    watts = changed(1_000, 1_200, -60.0, 1, joint(seed=1)).select(["watts"])
    scored = score(both[0], watts)
    (event,) = scored.events
    assert scored.not_judged == ("volts",) and event.channels == ("watts",)
    assert list(scored.table) == ["watts", "score", "flag"] and abs(event.begin - 1_000) <= 8
    alone = scorer_of(both[0], channels=("watts",)).score(watts.values).samples
    np.testing.assert_array_equal(scored.table["score"], alone)


@pytest.mark.parametrize(("channel", "by"), [(0, 4.0), (1, -60.0)])
def test_the_channel_that_fails_is_named(both, channel, by):
    (event,) = score(both[0], changed(1_000, 1_200, by, channel, joint(seed=1))).events
    assert event.channels[0] == ("volts", "watts")[channel]


def test_telemetry_that_does_not_fit_is_refused(single, both, of_run):
    # within a thousandth
    single[0].pair(on_clock(TELEMETRY, 10.005, TELEMETRY.start))
    for words, (simulator, _), given in (
        ("sample every 10 s", single, on_clock(TELEMETRY, 1.0, TELEMETRY.start)),
        ("at least one window of 80", single, TELEMETRY.part(0, 63)),
        ("channels volts, watts", both, recorded(joint().values, ("volts", "amps"))),
        ("--coarse", of_run, TELEMETRY),
    ):
        with pytest.raises(InputError, match=words):
            score(simulator, given)
    with pytest.raises(InputError, match="false_alarm_rate"):
        ScoreOptions(0.7)


def test_a_simulator_without_nominal_telemetry_is_refused():
    with pytest.raises(InputError, match="Make it with `fit`"):
        scorer_of(of_waves([SquareWaveSimulator([SquareWave(20)])], 24))


def test_more_false_alarms_lower_the_threshold(single):
    rare, often = (scorer_of(single[0], ScoreOptions(rate)) for rate in (0.01, 0.2))
    assert often.threshold < rare.threshold and often.rate == 0.2


def test_an_event_at_the_beginning_of_a_part_is_not_detected_before_it_begins(single):
    (event,) = score(single[0], changed(104, 400, 4.0)).events
    assert abs(event.begin - 104) <= 8 and 104 <= event.detected <= 104 + 64


def test_a_fault_that_goes_on_after_a_gap_is_an_event_of_both_parts(single):
    given = after_gap(changed(1_000, 2_000, 6.0), 1_200, 20_000.0)
    before, after, *_ = score(single[0], given).events
    assert abs(before.begin - 1_000) <= 8 and before.end == after.begin == 1_200


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_values_that_are_not_finite_are_refused(single, refused, value):
    with refused("finite"):
        score(single[0], changed(1_000, 1_001, value))


def test_channels_keep_their_values_whatever_their_names(both):
    names = ("score", "enhanced score")
    renamed = copy.copy(both[0])
    renamed.channels = names
    scored = score(renamed, recorded(joint(seed=1).values, names))
    values = scored.table[[scored.columns[name] for name in names]]
    np.testing.assert_array_equal(values, joint(seed=1).values)
    assert list(scored.table)[2:] == ["score", "flag"]


def test_the_enhanced_run_is_told_beside_an_outlier(of_run):
    calm, spoilt = (
        score(of_run[0], changed(500, 501, by), coarse_run()).table["enhanced"]
        for by in (0.0, 1e12)
    )
    np.testing.assert_array_equal(spoilt, calm)
