"""Anomalies in a user's own telemetry: of one channel, of several, and the files that hold them."""

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.coarse_simulator.recording import Recording, Run
from enhsim_tf.datasets.inject import inject_channel, inject_joint, join_injected
from enhsim_tf.datasets.inject_options import JOINT_KINDS, InjectOptions
from enhsim_tf.datasets.label_columns import LABELS, series_table, write_table
from enhsim_tf.telemetry.cleaning.clean import clean
from enhsim_tf.telemetry.series import Telemetry


def parts(times=True, gap=True, name="volts"):
    rng, places = np.random.default_rng(0), np.arange(3_000)
    values = 20 + 3 * np.sin(2 * np.pi * places / 80) + 0.2 * rng.standard_normal(3_000)
    index = pd.date_range("2024-01-01", periods=3_000, freq="10s", tz="UTC") if times else None
    series = pd.Series(values, index=index, name=name)
    return clean(series.drop(series.index[1_000:1_200]) if gap else series).parts


def test_labels_of_samples_by_hand():
    mask = np.array([0, 1, 0, 1, 0, 0, 1, 1], bool)[:, None]
    frame = series_table(np.zeros((8, 1)), mask, ["volts"], [("spike", 4.0, 1, 4), ("ramp", 2.0, 6, 8)], pd.RangeIndex(8))
    assert tuple(frame) == ("value", *LABELS)
    assert frame["scenario"].tolist() == ["nominal", "spike", "nominal", "spike", "nominal", "nominal", "ramp", "ramp"]
    assert frame["severity"].tolist() == [0, 4, 0, 4, 0, 0, 2, 2]
    assert frame["onset"].tolist() == [pd.NA, 1, pd.NA, 1, pd.NA, pd.NA, 6, 6]
    assert frame["end"].tolist() == [pd.NA, 4, pd.NA, 4, pd.NA, pd.NA, 8, 8]


def test_marked_samples_are_the_changed_ones_and_events_have_their_labels():
    given = parts()
    frame = inject_channel(given, InjectOptions(("level_shift", "stuck"), (2, 8), ("50", "20min"), 6, noise_sd=0.2, seed=5))
    nominal = np.concatenate([part.values for part in given])
    assert list(frame) == ["value", *LABELS] and frame.index.name == "time" and len(frame) == 2_800
    np.testing.assert_array_equal(frame["mask"], frame["value"].to_numpy() != nominal)
    np.testing.assert_array_equal(frame["mask"], frame["scenario"] != "nominal")
    events = frame[frame["mask"]].groupby(["onset", "end", "scenario"], observed=True)["severity"].nunique()
    assert len(events) == 6 and (events == 1).all()
    for onset, end, _ in events.index:
        assert 1 <= end - onset <= 120 and frame["mask"].iloc[onset] and frame["mask"].iloc[end - 1]
    assert frame["severity"][frame["mask"]].between(2, 8).all() and frame.attrs["noise_sd"] == 0.2


def test_the_noise_is_estimated_and_sets_the_severity():
    frame = inject_channel(parts(), InjectOptions(at=["level_shift:5@200/100"]))
    assert frame.attrs["noise_sd"] == pytest.approx(0.2, rel=0.05)
    change = np.abs(frame["value"].to_numpy() - np.concatenate([part.values for part in parts()]))
    assert change[200:300] == pytest.approx(5 * frame.attrs["noise_sd"], rel=1e-4) and change[:200].max() == change[300:].max() == 0


def test_channels_draw_independently_and_the_same_seed_gives_the_same_table():
    options = InjectOptions(("spike",), number=3, seed=1)
    first, again, amps = (inject_channel(parts(name=name), options) for name in ("volts", "volts", "amps"))
    pd.testing.assert_frame_equal(first, again)
    assert (amps["mask"].to_numpy() != first["mask"].to_numpy()).any()


@pytest.mark.parametrize("times", [True, False])
def test_timeeval_files_have_times_first_and_labels_last(times, tmp_path, refused):
    volts, amps = (inject_channel(parts(times, False, name), InjectOptions(("level_shift",), number=2)) for name in ("volts", "amps"))
    write_table(tmp_path / "x.csv", join_injected({"volts": volts, "amps": amps}), ["volts", "amps"])
    read = pd.read_csv(tmp_path / "x.csv")
    assert list(read) == ["timestamp", "volts", "amps", "is_anomaly"] and read["is_anomaly"].isin([0, 1]).all()
    np.testing.assert_array_equal(read["is_anomaly"], volts["mask"].to_numpy() | amps["mask"].to_numpy())
    np.testing.assert_array_equal(read["volts"].astype(np.float32), volts["value"])
    assert read["timestamp"].iloc[1] == ("2024-01-01 00:00:10" if times else 1)
    with refused("same times", "'amps' with 2,999"):
        join_injected({"volts": volts, "amps": amps.iloc[1:]})
    with refused("'is_anomaly'"):
        write_table(tmp_path / "y.csv", volts, ["is_anomaly"])
    assert not (tmp_path / "y.csv").exists()


@pytest.mark.parametrize(
    "wrong",
    [
        {},
        {"kinds": ["rust"]},
        {"kinds": ["ramp"], "severity": (4, 2)},
        {"kinds": ["ramp"], "severity": (np.inf, np.inf)},
        {"kinds": ["stuck"], "severity": (1, np.inf)},
        {"kinds": ["ramp"], "length": ("long", "long")},
        {"kinds": ["ramp"], "number": 0},
        {"at": ["ramp@1/5"], "number": 3},
        {"kinds": ["ramp"], "noise_sd": 0},
        {"at": ["ramp"]},
        {"at": ["rust:4@5/5"]},
        {"kinds": ["delay", "spike"]},
        {"kinds": ["delay"], "at": ["ramp@1/5"]},
        {"kinds": ["delay"], "noise_sd": 1.0},
    ],
)
def test_wrong_options_are_refused(wrong, refused):
    with refused():
        InjectOptions(**wrong)


@pytest.mark.parametrize(
    ("given", "options", "word"),
    [
        (parts(), {"at": ["ramp@2024-01-01T03:00/5"]}, "not in a gap"),
        (parts(), {"at": ["ramp@2025-01-01/5"]}, "not in a gap"),
        (parts(times=False, gap=False), {"at": ["ramp@2024-01-01/5"]}, "sample number"),
        (parts(), {"kinds": ["ramp"], "length": ("20min", "50")}, "20min:50"),
        ([Telemetry(np.arange(200, dtype=np.float32))], {"kinds": ["ramp"]}, "--noise-sd"),
    ],
)
def test_what_does_not_fit_the_telemetry_is_refused(given, options, word, refused):
    with refused(word):
        inject_channel(given, InjectOptions(**options))


# several channels


def together(channels=3):
    rng = np.random.default_rng(0)
    common = np.cumsum(rng.standard_normal(1_000))
    values = np.stack([common * (1 + channel) + rng.standard_normal(1_000) for channel in range(channels)], axis=1).astype(np.float32)
    return Recording((Run(values[:600]), Run(values[600:], 700.0)), tuple("abc"[:channels]), name="abc")


NOMINAL = np.concatenate([part.values for part in together().parts])


@pytest.mark.parametrize("kind", JOINT_KINDS)
def test_samples_that_are_not_marked_keep_their_values(kind):
    frame = inject_joint(together(), InjectOptions([kind], length=("40", "40"), number=3, seed=1))
    mask = frame[[f"mask {name}" for name in "abc"]].to_numpy()
    np.testing.assert_array_equal(mask, frame[list("abc")].to_numpy() != NOMINAL)
    np.testing.assert_array_equal(frame["mask"], mask.any(axis=1))
    changed = {"a", "b", "c"} if kind == "common_shift" else {each[4] for each in frame.attrs["anomalies"]}
    assert len(frame.attrs["anomalies"]) == 3 and mask.any(axis=0).sum() == len(changed)


def changed_by(kind, seed):
    """The changed samples of one anomaly: their first one, the number of the channel, and all channels."""
    frame = inject_joint(together(), InjectOptions([kind], length=("40", "40"), seed=seed))
    ((_, _, begin, end, name),) = frame.attrs["anomalies"]
    return begin, "abc".find(name), frame[list("abc")].to_numpy()[begin:end]


def test_a_channel_of_another_time_has_the_values_of_that_time():
    begin, channel, piece = changed_by("another_time", 2)
    firsts = [first for first in range(961) if np.array_equal(piece[:, channel], NOMINAL[first : first + 40, channel])]
    assert firsts and all(abs(first - begin) >= 40 for first in firsts)


def test_a_late_channel_is_that_of_a_quarter_before():
    begin, channel, piece = changed_by("delay", 3)
    np.testing.assert_array_equal(piece[:, channel], NOMINAL[begin - 10 : begin + 30, channel])


def test_a_common_shift_has_the_severity_in_each_channel():
    begin, _, piece = changed_by("common_shift", 4)
    shift = piece - NOMINAL[begin : begin + 40]
    assert np.ptp(shift, axis=0).max() < 1e-3 and (shift[0] > 3).all()


def test_one_channel_is_refused(refused):
    with refused("several channels"):
        inject_joint(together(1), InjectOptions(["delay"]))


def test_a_joint_anomaly_that_changes_nothing_is_drawn_again_or_refused(refused):
    values = NOMINAL[:, :2].copy()
    values[:, 1] = 7  # a constant channel that is late is as before
    for seed in range(5):
        frame = inject_joint(Recording((Run(values),), ("a", "b"), name="ab"), InjectOptions(["delay"], number=3, seed=seed))
        assert {each[4] for each in frame.attrs["anomalies"]} == {"a"}
    with refused("changes nothing at 100 drawn places"):
        inject_joint(Recording((Run(np.ones((900, 2), np.float32)),), ("a", "b"), name="ab"), InjectOptions(["delay"]))
