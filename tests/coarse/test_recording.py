"""Recorded runs: what was recorded is returned, files are cleaned like telemetry, and labels stay
with their samples.
"""

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.coarse.pairing import pair_recordings
from enhsim_tf.coarse.recording_files import read_recording
from enhsim_tf.telemetry.series import Part
from tests.known_simulators import parts_of


def recording():
    parts = (
        Part(np.array([[0.0, 10], [1, 20], [4, 30]], np.float32)),
        Part(np.array([[7.0, 0], [9, 2]], np.float32), offset_s=50.0),
    )
    return parts_of(parts, ("a", "b"), 10.0, name="run.csv")


def table(num_samples=60, step_s=10):
    rows = np.arange(num_samples)
    stamps = pd.Timestamp("2024-01-01") + pd.to_timedelta(rows * step_s, unit="s")
    return pd.DataFrame(
        {
            "time": stamps,
            "volts": 0.5 * rows,
            "amps": 7.0 - rows,
            "scenario": np.where(rows < 20, "nominal", "leak"),
            "mask": rows // 20,
        }
    )


@pytest.fixture
def written(tmp_path):
    def write(frame, name="run.csv"):
        frame.to_csv(tmp_path / name, index=False)
        return tmp_path / name

    return write


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
    found = read_recording(
        written(table()[[*"time amps volts scenario mask".split()]]), ["volts", "amps"]
    )
    (part,) = found.parts
    assert (found.columns, found.interval_s, found.start) == (
        ("volts", "amps"),
        10.0,
        "2024-01-01T00:00:00+00:00",
    )
    np.testing.assert_array_equal(
        part.values, np.stack([0.5 * np.arange(60), 7.0 - np.arange(60)], 1).astype(np.float32)
    )
    assert list(part.carried["scenario"]) == ["nominal"] * 20 + ["leak"] * 40
    assert list(part.carried["mask"]) == [0] * 20 + [1] * 20 + [2] * 20 and "mask" in " ".join(
        found.notes
    )


def test_columns_without_numbers_are_no_inputs_and_named(written):
    assert any(
        "columns without numbers: scenario, pump" in note
        for note in read_recording(written(table().assign(pump="true"))).notes
    )


def test_labels_follow_the_repairs_of_the_rows(written):
    frame = table()
    # unsorted, with a short gap
    frame = pd.concat([frame.iloc[30:], frame.iloc[:30].drop(index=[5, 6])])
    frame = pd.concat([frame, frame.iloc[[3]]])  # one row twice
    found = read_recording(written(frame), ["volts", "amps"])
    (part,) = found.parts
    np.testing.assert_allclose(part.values[:, 0], 0.5 * np.arange(60))
    assert list(part.carried["scenario"]) == ["nominal"] * 20 + ["leak"] * 40
    assert len(found.notes) >= 2 and all("run.csv" in note for note in found.notes)


def test_labels_are_those_of_the_series_that_is_read(written):
    """Two hosts at the same times, one after the other: that of b has drifted where that of a is
    nominal.
    """
    frame = pd.concat(
        [
            table(6).assign(host="a", scenario="nominal"),
            table(6).assign(host="b", scenario=[*"nnnddd"]),
        ]
    )
    (part,) = read_recording(written(frame[["time", "host", "volts", "scenario"]]), ["b"]).parts
    assert list(part.carried["scenario"]) == [*"nnnddd"] and set(part.carried["host"]) == {"b"}


def test_a_run_in_several_files_keeps_its_labels(written, tmp_path):
    written(table().iloc[:30], "1.csv")
    written(table().iloc[30:], "2.csv")
    for source in (tmp_path, [tmp_path / "1.csv", tmp_path / "2.csv"]):
        (part,) = read_recording(source, ["volts"]).parts
        assert list(part.carried["scenario"]) == ["nominal"] * 20 + ["leak"] * 40


def test_another_rate_is_brought_to_the_wanted_one(written):
    finer, coarser = (
        read_recording(written(table(), f"{step}.csv"), ["volts"], interval_s=step)
        for step in (30, 5)
    )
    # means of three rows around each grid point
    np.testing.assert_allclose(finer.parts[0].values[1:-1, 0], 0.5 * 3 * np.arange(1, 20))
    np.testing.assert_allclose(coarser.parts[0].values[:, 0], 0.25 * np.arange(119))
    assert (
        "averaged to one every 30 s" in finer.notes[-1]
        and "interpolated to one every 5 s" in coarser.notes[-1]
    )
    # up to 195 s, half-way between two rows
    assert list(coarser.parts[0].carried["scenario"]).count("nominal") == 40


def test_missing_values_split_the_run_or_are_filled(written):
    frame = table()
    frame.loc[10:11, "volts"] = np.nan
    frame.loc[30:44, "amps"] = np.nan
    found = read_recording(written(frame), ["volts", "amps"])
    assert [len(part) for part in found.parts] == [30, 15]
    np.testing.assert_allclose(found.parts[0].values[:, 0], 0.5 * np.arange(30))
    assert list(found.parts[1].carried["mask"]) == [2] * 15 and any(
        "2 parts" in note for note in found.notes
    )


def test_a_run_without_times_counts_its_samples(written):
    found = read_recording(written(table().drop(columns="time")), ["volts"])
    assert found.start is None and found.interval_s == 1.0 and found.parts[0].offset_s == 0
    assert list(found.parts[0].carried["scenario"])[18:22] == ["nominal", "nominal", "leak", "leak"]


def test_unusable_runs_are_refused(refused, written):
    with refused("'watts'", "volts"):
        read_recording(written(table()), ["volts", "watts"])
    frame = table()
    frame.loc[:29, "volts"], frame.loc[30:, "amps"] = np.nan, np.nan
    with refused("share some time"):
        read_recording(written(frame), ["volts", "amps"])
    frame = table().astype({"volts": object})
    frame.loc[3, "volts"] = "offline"
    with refused("offline"):
        read_recording(written(frame), ["volts"])
    with refused("without times"):
        read_recording(written(table().drop(columns="time")), ["volts"], interval_s=10.0)


# runs of other simulators


def stepped(times):
    """A run whose columns are known functions of time."""
    return pd.DataFrame(
        {"time": times, "volts": 1.5 * np.asarray(times), "amps": 7.0 - np.asarray(times)}
    )


def test_steps_of_any_length_are_interpolated(written):
    times = np.concatenate([[0.0], np.cumsum(np.random.default_rng(0).exponential(3.0, 400))])
    found = read_recording(written(stepped(times)), interval_s=2.0)
    (part,) = found.parts
    assert found.columns == ("volts", "amps") and part.offset_s == 0
    np.testing.assert_allclose(part.values[:, 0], 3.0 * np.arange(len(part)), atol=1e-3)
    assert (
        len(part) == int(times[-1] // 2) + 1 and "interpolated to one every 2 s" in found.notes[0]
    )


@pytest.mark.parametrize(
    "events", [[20.0, 40.0], [21.3, 44.9]], ids=["at samples", "between samples"]
)
def test_an_event_has_the_value_after_it(written, events):
    steady = stepped(2.0 * np.arange(60))
    after = stepped(np.repeat(events, 2)).assign(
        volts=lambda frame: frame["volts"] + np.tile([0.0, 5.0], len(events))
    )
    frame = pd.concat([steady, after]).sort_values("time", kind="stable")
    found = read_recording(written(frame), ["volts"], interval_s=2.0)
    (part,) = found.parts
    assert len(part) == 60
    is_event = np.isin(2.0 * np.arange(60), events)
    between = np.isin(np.arange(60), np.ceil(np.array(events) / 2)) & ~is_event
    np.testing.assert_allclose(
        part.values[~between, 0], (3.0 * np.arange(60) + 5.0 * is_event)[~between], atol=1e-5
    )


def test_the_zero_of_a_run_can_be_given(written, refused):
    path = written(stepped(2.0 * np.arange(60)))
    found = read_recording(path, start="2024-03-01T02:00:00+01:00")
    assert found.start == "2024-03-01T01:00:00+00:00"
    telemetry = parts_of(
        (Part(np.zeros((50, 1), np.float32), 4.0),), ("celsius",), 2.0, "2024-03-01T01:00:00+00:00"
    )
    _, paired = pair_recordings(telemetry, found)
    np.testing.assert_allclose(paired.values[:, 0], 6.0 + 3.0 * np.arange(50))
    with refused("--coarse-start 2024-03-01T01:00:04"):
        pair_recordings(telemetry, read_recording(path))
    with refused("--coarse-start"):
        read_recording(written(table()), start="2024-03-01")


def test_a_frame_is_a_run_whose_clock_is_no_input():
    for time in (None, "none"):
        assert read_recording(stepped(2.0 * np.arange(60)), time=time).columns == ("volts", "amps")


def test_a_run_of_which_most_rows_share_their_time_is_refused(refused):
    table = pd.DataFrame({"time": np.repeat(np.arange(20.0), 3), "volts": np.arange(60.0)})
    with refused("60 rows with 20 different times"):
        read_recording(table)
    assert len(read_recording(table.iloc[::3])) == 20
