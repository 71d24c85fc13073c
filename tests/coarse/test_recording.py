"""Recorded runs: what was recorded is returned, files are cleaned like telemetry, and labels stay
with their samples.
"""

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.coarse.pairing import pair_recordings
from enhsim_tf.coarse.recording_files import read_recording
from enhsim_tf.telemetry.series import Part, Telemetry
from tests.known_simulators import parts_of


def recording():
    parts = (
        Part(np.array([[0.0, 10], [1, 20], [4, 30]], np.float32)),
        Part(np.array([[7.0, 0], [9, 2]], np.float32), offset_s=50.0),
    )
    return parts_of(parts, ("a", "b"), 10.0, name="run.csv")


ROWS = np.arange(60)
HALVES = 0.5 * ROWS
SCENARIO = ["nominal"] * 20 + ["leak"] * 40
MASK = [0] * 20 + [1] * 20 + [2] * 20
TABLE = pd.DataFrame(
    {
        "time": pd.date_range("2024-01-01", periods=60, freq="10s"),
        "volts": HALVES,
        "amps": 7.0 - ROWS,
        "scenario": SCENARIO,
        "mask": MASK,
    }
)
BOTH = ["volts", "amps"]


# in memory


def test_times_between_samples_are_interpolated_and_gaps_are_nan():
    values = recording().at(np.array([0.0, 5.0, 20.0, 25.0, 50.0, 55.0, 60.0, 61.0]))
    np.testing.assert_array_equal(values[:, 0], [0, 0.5, 4, np.nan, 7, 8, 9, np.nan])
    np.testing.assert_array_equal(values[:, 1], [10, 15, 30, np.nan, 0, 1, 2, np.nan])


def test_a_recording_refuses_what_it_does_not_hold(refused):
    with refused("from 0 s to 60 s", "30 s"):
        recording().run(np.array([20.0, 30.0]))
    with refused("Record a run of it"):
        recording().run(np.array([0.0]), scenario="leak")
    with refused("without 'c'"):
        recording().select(["a", "c"])


# from files


def test_a_table_is_read_with_its_labels(written):
    found = read_recording(written(TABLE[["time", "amps", "volts", "scenario", "mask"]]), BOTH)
    (part,) = found.parts
    assert (found.columns, found.interval_s) == (("volts", "amps"), 10.0)
    assert found.start == "2024-01-01T00:00:00+00:00"
    np.testing.assert_array_equal(part.values, TABLE[BOTH])
    assert list(part.carried["scenario"]) == SCENARIO and list(part.carried["mask"]) == MASK
    assert "mask" in " ".join(found.notes)


def test_columns_without_numbers_are_no_inputs_and_named(written):
    notes = read_recording(written(TABLE.assign(pump="true"))).notes
    assert any("columns without numbers: scenario, pump" in note for note in notes)


def test_labels_follow_the_repairs_of_the_rows(written):
    # unsorted, with a short gap, and one row twice
    frame = TABLE.iloc[[*range(30, 60), *range(5), *range(7, 30), 3]]
    found = read_recording(written(frame), BOTH)
    (part,) = found.parts
    np.testing.assert_allclose(part.values[:, 0], HALVES)
    assert list(part.carried["scenario"]) == SCENARIO
    assert len(found.notes) >= 2 and all("a.csv" in note for note in found.notes)


def test_labels_are_those_of_the_series_that_is_read(written):
    """Two hosts at the same times, one after the other: that of b has drifted where that of a is
    nominal.
    """
    hosts = TABLE.iloc[[*range(6), *range(6)]].assign(
        host=[*"aaaaaabbbbbb"], scenario=[*"nnnnnnnnnddd"]
    )
    (part,) = read_recording(written(hosts[["time", "host", "volts", "scenario"]]), ["b"]).parts
    assert list(part.carried["scenario"]) == [*"nnnddd"] and set(part.carried["host"]) == {"b"}


def test_a_run_in_several_files_keeps_its_labels(written, tmp_path):
    paths = [written(TABLE.iloc[:30], "1.csv"), written(TABLE.iloc[30:], "2.csv")]
    for source in (tmp_path, paths):
        (part,) = read_recording(source, ["volts"]).parts
        assert list(part.carried["scenario"]) == SCENARIO


def test_another_rate_is_brought_to_the_wanted_one(written):
    path = written(TABLE)
    averaged, finer = (read_recording(path, ["volts"], interval_s=step) for step in (30, 5))
    # means of three rows around each grid point
    np.testing.assert_allclose(averaged.parts[0].values[1:-1, 0], 3 * HALVES[1:20])
    assert "averaged to one every 30 s" in averaged.notes[-1]
    np.testing.assert_allclose(finer.parts[0].values[:, 0], 0.25 * np.arange(119))
    assert "interpolated to one every 5 s" in finer.notes[-1]
    # up to 195 s, half-way between two rows
    assert list(finer.parts[0].carried["scenario"]).count("nominal") == 40


def test_missing_values_split_the_run_or_are_filled(written):
    frame = TABLE.copy()
    frame.loc[10:11, "volts"] = np.nan
    frame.loc[30:44, "amps"] = np.nan
    found = read_recording(written(frame), BOTH)
    assert [len(part) for part in found.parts] == [30, 15]
    np.testing.assert_allclose(found.parts[0].values[:, 0], HALVES[:30])
    assert list(found.parts[1].carried["mask"]) == [2] * 15
    assert any("2 parts" in note for note in found.notes)


def test_a_run_without_times_counts_its_samples(written):
    found = read_recording(written(TABLE.drop(columns="time")), ["volts"])
    (part,) = found.parts
    assert (found.start, found.interval_s, part.offset_s) == (None, 1.0, 0)
    assert list(part.carried["scenario"]) == SCENARIO


def test_unusable_runs_are_refused(refused, written):
    apart, words = TABLE.copy(), TABLE.astype({"volts": object})
    apart.loc[:29, "volts"] = apart.loc[30:, "amps"] = np.nan
    words.loc[3, "volts"] = "offline"
    for said, frame, columns, options in (
        (["'watts'", "volts"], TABLE, ["volts", "watts"], {}),
        (["share some time"], apart, BOTH, {}),
        (["offline"], words, ["volts"], {}),
        (["without times"], TABLE.drop(columns="time"), ["volts"], {"interval_s": 10.0}),
    ):
        with refused(*said):
            read_recording(written(frame), columns, **options)


# runs of other simulators


EVEN = 2.0 * ROWS


def stepped(times):
    """A run whose columns are known functions of time."""
    return pd.DataFrame({"time": times, "volts": 1.5 * times, "amps": 7.0 - times})


def test_steps_of_any_length_are_interpolated(written):
    times = np.concatenate([[0.0], np.cumsum(np.random.default_rng(0).exponential(3.0, 400))])
    found = read_recording(written(stepped(times)), interval_s=2.0)
    (part,) = found.parts
    assert found.columns == ("volts", "amps") and part.offset_s == 0
    np.testing.assert_allclose(part.values[:, 0], 3.0 * np.arange(len(part)), atol=1e-3)
    assert len(part) == int(times[-1] // 2) + 1
    assert "interpolated to one every 2 s" in found.notes[0]


@pytest.mark.parametrize(
    "events", [[20.0, 40.0], [21.3, 44.9]], ids=["at samples", "between samples"]
)
def test_an_event_has_the_value_after_it(written, events):
    after = stepped(np.repeat(events, 2))
    after["volts"] += np.tile([0.0, 5.0], len(events))
    frame = pd.concat([stepped(EVEN), after]).sort_values("time", kind="stable")
    (part,) = read_recording(written(frame), ["volts"], interval_s=2.0).parts
    assert len(part) == 60
    is_event = np.isin(EVEN, events)
    between = np.isin(ROWS, np.ceil(np.array(events) / 2)) & ~is_event
    expected = 1.5 * EVEN + 5.0 * is_event
    np.testing.assert_allclose(part.values[~between, 0], expected[~between], atol=1e-5)


def test_the_zero_of_a_run_can_be_given(written, refused):
    path = written(stepped(EVEN))
    found = read_recording(path, start="2024-03-01T02:00:00+01:00")
    assert found.start == "2024-03-01T01:00:00+00:00"
    telemetry = Telemetry.of(np.zeros(50, np.float32), 2.0, 4.0, "2024-03-01T01:00")
    _, paired = pair_recordings(telemetry, found)
    np.testing.assert_allclose(paired.values[:, 0], 6.0 + 3.0 * np.arange(50))
    with refused("--coarse-start 2024-03-01T01:00:04"):
        pair_recordings(telemetry, read_recording(path))
    with refused("--coarse-start"):
        read_recording(written(TABLE), start="2024-03-01")


def test_a_frame_is_a_run_whose_clock_is_no_input():
    for time in (None, "none"):
        assert read_recording(stepped(EVEN), time=time).columns == ("volts", "amps")


def test_a_run_of_which_most_rows_share_their_time_is_refused(refused):
    frame = pd.DataFrame({"time": np.repeat(np.arange(20.0), 3), "volts": ROWS})
    with refused("60 rows with 20 different times"):
        read_recording(frame)
    assert len(read_recording(frame.iloc[::3])) == 20
