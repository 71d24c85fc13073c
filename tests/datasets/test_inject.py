"""Anomalies in a user's own telemetry: of one channel, of several, and the files that hold them."""

import itertools

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.coarse_simulator.recording import Recording, Run
from enhsim_tf.datasets.inject import inject
from enhsim_tf.datasets.label_columns import LABELS, series_table, write_table
from enhsim_tf.datasets.places import JOINT_KINDS, InjectOptions
from enhsim_tf.detection.anomalies import INJECTIONS
from enhsim_tf.simulator.joint import join_channels
from enhsim_tf.telemetry.cleaning.clean import clean
from enhsim_tf.telemetry.placing import draw_begin
from enhsim_tf.telemetry.series import Telemetry


def parts(times=True, gap=True, name="volts"):
    rng, places = np.random.default_rng(0), np.arange(3_000)
    values = 20 + 3 * np.sin(2 * np.pi * places / 80) + 0.2 * rng.standard_normal(3_000)
    index = pd.date_range("2024-01-01", periods=3_000, freq="10s", tz="UTC") if times else None
    series = pd.Series(values, index=index, name=name)
    return clean(series.drop(series.index[1_000:1_200]) if gap else series).parts


def test_labels_of_samples_by_hand():
    mask = np.array([0, 1, 0, 1, 0, 0, 1, 1], bool)[:, None]
    frame = series_table(
        np.zeros((8, 1)),
        mask,
        ["volts"],
        [("spike", 4.0, 1, 4), ("ramp", 2.0, 6, 8)],
        pd.RangeIndex(8),
    )
    assert tuple(frame) == ("value", *LABELS)
    assert frame["scenario"].tolist() == [
        "nominal",
        "spike",
        "nominal",
        "spike",
        "nominal",
        "nominal",
        "ramp",
        "ramp",
    ]
    assert frame["severity"].tolist() == [0, 4, 0, 4, 0, 0, 2, 2]
    assert frame["onset"].tolist() == [pd.NA, 1, pd.NA, 1, pd.NA, pd.NA, 6, 6]
    assert frame["end"].tolist() == [pd.NA, 4, pd.NA, 4, pd.NA, pd.NA, 8, 8]


@pytest.mark.parametrize("seed", range(5))
def test_marked_samples_are_the_changed_ones_and_anomalies_keep_within_parts_and_apart(seed):
    given = parts()
    options = InjectOptions(
        tuple(INJECTIONS), (2, 8), ("10", "20min"), 9, ["ramp:5@1100/100"], noise_sd=0.2, seed=seed
    )
    frame, nominal = inject(given, options), np.concatenate([part.values for part in given])
    assert list(frame) == ["value", *LABELS] and frame.index.name == "time" and len(frame) == 2_800
    np.testing.assert_array_equal(frame["mask"], frame["value"].to_numpy() != nominal)
    np.testing.assert_array_equal(frame["mask"], frame["scenario"] != "nominal")
    found, labelled = frame.attrs["anomalies"], frame[frame["mask"]]
    columns = [labelled[name].drop_duplicates().tolist() for name in ("onset", "end", "severity")]
    assert columns == [
        [each.begin for each in found],
        [each.end for each in found],
        [np.float32(each.severity) for each in found],
    ]
    assert sorted(each.kind for each in found) == sorted([*INJECTIONS, "spike", "ramp"])
    assert all(
        2 <= each.severity <= 8 and each.length <= 120 and each.channel == "volts" for each in found
    )
    assert all(before.end + 50 < after.begin for before, after in itertools.pairwise(found))
    assert all(each.end <= 1_000 or each.begin >= 1_000 for each in found)  # the gap
    assert (
        frame["mask"].iloc[[place for each in found for place in (each.begin, each.end - 1)]].all()
    )


def test_given_anomalies_by_hand():
    at = ["level_shift:4@100/50", "spike:8@1200/60", "dropout:2@150/10"]
    frame, nominal = (
        inject(parts(), InjectOptions(at=at, noise_sd=0.2)),
        np.concatenate([part.values for part in parts()]),
    )
    change = frame["value"].to_numpy() - nominal
    np.testing.assert_allclose(np.abs(change[100:150]), 0.8, rtol=1e-4)  # 4 sd of 0.2, up or down
    np.testing.assert_allclose(frame["value"][150:160], nominal[150] - 0.4, rtol=1e-6)
    assert np.flatnonzero(change).tolist() == [*range(100, 160), 1_200, 1_225, 1_250]
    assert [(each.kind, each.begin, each.end) for each in frame.attrs["anomalies"]] == [
        ("level_shift", 100, 150),
        ("dropout", 150, 160),
        ("spike", 1_200, 1_251),
    ]


def test_places_are_uniform_over_what_is_free():
    rng = np.random.default_rng(0)
    begins = [draw_begin([(0, 100)], [(0, 40)], 10, 10, rng) for _ in range(3_000)]
    counts, expected = np.bincount(begins, minlength=100), 3_000 / 41
    assert (
        counts[:50].sum() == 0 and counts[91:].sum() == 0
    )  # the free places are the 41 samples from 50 to 90
    assert (
        np.sum((counts[50:91] - expected) ** 2 / expected) < 80
    )  # chi-squared with 40 degrees of freedom: above 80 at p = 0.0002


def test_a_place_where_nothing_changes_is_drawn_again():
    values = np.full(2_000, 7, np.float32)
    values[1_500:] = parts()[0].values[
        :500
    ]  # `stuck` changes nothing in the constant stretch before
    for seed in range(10):
        frame = inject(
            [Telemetry(values)],
            InjectOptions(["stuck"], (np.inf, np.inf), ("50", "50"), noise_sd=0.2, seed=seed),
        )
        ((onset, end),) = {(each.begin, each.end) for each in frame.attrs["anomalies"]}
        assert onset > 1_450 and frame["mask"].iloc[[onset, end - 1]].all()


def test_the_noise_is_estimated_and_sets_the_severity():
    frame = inject(parts(), InjectOptions(at=["level_shift:5@200/100"]))
    assert frame.attrs["noise_sd"] == pytest.approx(0.2, rel=0.05)
    change = np.abs(frame["value"].to_numpy() - np.concatenate([part.values for part in parts()]))
    assert (
        change[200:300] == pytest.approx(5 * frame.attrs["noise_sd"], rel=1e-4)
        and change[:200].max() == change[300:].max() == 0
    )


def test_channels_draw_independently_and_the_same_seed_gives_the_same_table():
    options = InjectOptions(("spike",), number=3, seed=1)
    first, again, amps = (inject(parts(name=name), options) for name in ("volts", "volts", "amps"))
    pd.testing.assert_frame_equal(first, again)
    assert (amps["mask"].to_numpy() != first["mask"].to_numpy()).any()


@pytest.mark.parametrize("times", [True, False])
def test_timeeval_files_have_times_first_and_labels_last(times, tmp_path, refused):
    (both,) = join_channels({name: parts(times, False, name) for name in ("volts", "amps")})
    frame = inject(both, InjectOptions(("level_shift",), number=4))
    write_table(tmp_path / "x.csv", frame, ["volts", "amps"])
    read = pd.read_csv(tmp_path / "x.csv")
    assert (
        list(read) == ["timestamp", "volts", "amps", "is_anomaly"]
        and read["is_anomaly"].isin([0, 1]).all()
    )
    np.testing.assert_array_equal(read["is_anomaly"], frame["mask volts"] | frame["mask amps"])
    np.testing.assert_array_equal(read["volts"].astype(np.float32), frame["volts"])
    assert read["timestamp"].iloc[1] == ("2024-01-01 00:00:10" if times else 1)
    with refused("'is_anomaly'"):
        write_table(tmp_path / "y.csv", frame, ["is_anomaly"])
    assert not (tmp_path / "y.csv").exists()


@pytest.mark.parametrize(
    "wrong",
    [
        {},
        {"kinds": ["rust"]},
        {"kinds": ["common_shift"], "severity": (np.inf, np.inf)},
        {"kinds": ["ramp"], "severity": (4, 2)},
        {"kinds": ["ramp"], "severity": (np.inf, np.inf)},
        {"kinds": ["stuck"], "severity": (1, np.inf)},
        {"kinds": ["ramp"], "length": ("long", "long")},
        {"kinds": ["ramp"], "number": 0},
        {"at": ["ramp@1/5"], "number": 3},
        {"kinds": ["ramp"], "noise_sd": 0},
        {"at": ["ramp"]},
        {"at": ["rust:4@5/5"]},
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
        (
            Recording((Run(np.outer(np.arange(200), [3, -2]).astype(np.float32)),), ("a", "b")),
            {"kinds": ["delay", "ramp"]},
            "--noise-sd",
        ),
        (
            parts(),
            {"at": ["ramp@100/50", "gain@149/5"]},
            "do not overlap. Received: ramp at 4 from sample 100 to 150",
        ),
        (parts(), {"at": ["ramp@990/20"]}, "2,800 samples in 2 parts"),
        (
            parts(gap=False),
            {"kinds": ["ramp"], "length": ("1600", "1600"), "number": 2},
            "3,000 samples with 1 event, nowhere",
        ),
        (parts(), {"at": ["dropout@10/5"], "noise_sd": 1e38}, "range of float32"),
        (parts(), {"at": ["level_shift@10/5"], "noise_sd": 1e-9}, "changes no sample"),
        (
            [Telemetry(np.ones(900, np.float32))],
            {"kinds": ["stuck"], "noise_sd": 1.0},
            "changes nothing at 100 drawn places",
        ),
    ],
)
def test_what_does_not_fit_the_telemetry_is_refused(given, options, word, refused):
    with refused(word):
        inject(given, InjectOptions(**options))


# several channels


def together(channels=3):
    rng = np.random.default_rng(0)
    common = np.cumsum(rng.standard_normal(1_000))
    values = np.stack(
        [common * (1 + channel) + rng.standard_normal(1_000) for channel in range(channels)], axis=1
    ).astype(np.float32)
    return Recording(
        (Run(values[:600]), Run(values[600:], 700.0)), tuple("abc"[:channels]), name="abc"
    )


NOMINAL = np.concatenate([part.values for part in together().parts])


@pytest.mark.parametrize("kind", [*JOINT_KINDS, "spike,delay,gain"])
def test_samples_that_are_not_marked_keep_their_values(kind):
    frame = inject(
        together(), InjectOptions(kind.split(","), length=("40", "40"), number=3, seed=1)
    )
    mask = frame[[f"mask {name}" for name in "abc"]].to_numpy()
    np.testing.assert_array_equal(mask, frame[list("abc")].to_numpy() != NOMINAL)
    np.testing.assert_array_equal(frame["mask"], mask.any(axis=1))
    changed = (
        set("abc")
        if kind == "common_shift"
        else {each.channel for each in frame.attrs["anomalies"]}
    )
    assert len(frame.attrs["anomalies"]) == 3 and mask.any(axis=0).sum() == len(changed)


def changed_by(kind, seed):
    """The changed samples of one anomaly: their first one, the number of the channel, and all channels."""
    frame = inject(together(), InjectOptions([kind], length=("40", "40"), seed=seed))
    (found,) = frame.attrs["anomalies"]
    return (
        found.begin,
        "abc".find(found.channel or "abc"),
        frame[list("abc")].to_numpy()[found.begin : found.end],
    )


def test_a_channel_of_another_time_has_the_values_of_that_time():
    begin, channel, piece = changed_by("another_time", 2)
    firsts = [
        first
        for first in range(961)
        if np.array_equal(piece[:, channel], NOMINAL[first : first + 40, channel])
    ]
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
        inject(together(1), InjectOptions(["delay"]))


def test_a_joint_anomaly_that_changes_nothing_is_drawn_again():
    values = NOMINAL[:, :2].copy()
    values[:, 1] = 7  # a constant channel that is late is as before
    for seed in range(5):
        frame = inject(
            Recording((Run(values),), ("a", "b"), name="ab"),
            InjectOptions(["delay"], number=3, seed=seed),
        )
        assert {each.channel for each in frame.attrs["anomalies"]} == {"a"}


@pytest.mark.parametrize("seed", range(6))
def test_an_anomaly_of_one_of_several_channels_is_put_into_one_that_has_noise(seed):
    values = np.stack(
        [np.full(900, 5.0), 0.2 * np.random.default_rng(0).standard_normal(900)], axis=1
    ).astype(np.float32)
    frame = inject(
        Recording((Run(values),), ("level", "volts")), InjectOptions(at=["ramp@100/50"], seed=seed)
    )
    assert [each.channel for each in frame.attrs["anomalies"]] == ["volts"]
