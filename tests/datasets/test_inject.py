"""Anomalies in a user's own telemetry: of one channel, of several, and the files that hold them."""

import itertools

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.datasets.anomalies import INJECTIONS
from enhsim_tf.datasets.inject import inject
from enhsim_tf.datasets.label_columns import LABELS, series_table, write_table
from enhsim_tf.datasets.options import JOINT_KINDS, InjectOptions
from enhsim_tf.telemetry.cleaning.clean import clean
from enhsim_tf.telemetry.joining import join_channels
from enhsim_tf.telemetry.placing import FreeStretches, PlacedEvent
from enhsim_tf.telemetry.series import Part, Telemetry
from tests.fitted_simulators import recorded
from tests.known_simulators import parts_of


def parts(times=True, gap=True, name="volts"):
    rng, places = np.random.default_rng(0), np.arange(3_000)
    values = 20 + 3 * np.sin(2 * np.pi * places / 80) + 0.2 * rng.standard_normal(3_000)
    index = pd.date_range("2024-01-01", periods=3_000, freq="10s", tz="UTC") if times else None
    series = pd.Series(values, index=index, name=name)
    return clean(series.drop(series.index[1_000:1_200]) if gap else series).parts


PARTS = parts()
VOLTS = np.concatenate([part.values[:, 0] for part in PARTS])


def change_of(injected):
    """By how much each sample of `PARTS` was changed."""
    return injected.table["value"].to_numpy() - VOLTS


def test_labels_of_samples_by_hand():
    mask = np.array([0, 1, 0, 1, 0, 0, 1, 1], bool)[:, None]
    labels = [PlacedEvent("spike", 4.0, 1, 3), PlacedEvent("ramp", 2.0, 6, 2)]
    frame = series_table(np.zeros((8, 1)), mask, ["volts"], labels, pd.RangeIndex(8))
    assert tuple(frame) == ("value", *LABELS)
    names = "nominal spike nominal spike nominal nominal ramp ramp"
    assert frame["scenario"].tolist() == names.split()
    assert frame["severity"].tolist() == [0, 4, 0, 4, 0, 0, 2, 2]
    assert frame["onset"].tolist() == [pd.NA, 1, pd.NA, 1, pd.NA, pd.NA, 6, 6]
    assert frame["end"].tolist() == [pd.NA, 4, pd.NA, 4, pd.NA, pd.NA, 8, 8]


@pytest.mark.parametrize("seed", range(2))
def test_marked_samples_are_the_changed_ones_and_anomalies_keep_within_parts_and_apart(seed):
    options = InjectOptions(
        tuple(INJECTIONS), (2, 8), ("10", "20min"), 9, ["ramp:5@1100/100"], noise_sd=0.2, seed=seed
    )
    injected = inject(PARTS, options)
    frame = injected.table
    assert list(frame) == ["value", *LABELS] and frame.index.name == "time" and len(frame) == 2_800
    np.testing.assert_array_equal(frame["mask"], change_of(injected) != 0)
    np.testing.assert_array_equal(frame["mask"], frame["scenario"] != "nominal")
    anomalies, labelled = injected.anomalies, frame[frame["mask"]]
    columns = [labelled[name].drop_duplicates().tolist() for name in ("onset", "end", "severity")]
    assert list(zip(*columns, strict=True)) == [
        (anomaly.begin, anomaly.end, np.float32(anomaly.severity)) for anomaly in anomalies
    ]
    assert sorted(anomaly.kind for anomaly in anomalies) == sorted([*INJECTIONS, "spike", "ramp"])
    for anomaly in anomalies:
        assert 2 <= anomaly.severity <= 8 and anomaly.length <= 120 and anomaly.channel == "volts"
        assert anomaly.end <= 1_000 or anomaly.begin >= 1_000  # the gap
        assert frame["mask"].iloc[[anomaly.begin, anomaly.end - 1]].all()
    assert all(before.end + 50 < after.begin for before, after in itertools.pairwise(anomalies))


def test_given_anomalies_by_hand():
    at = ["level_shift:4@100/50", "spike:8@1200/60", "dropout:2@150/10"]
    injected = inject(PARTS, InjectOptions(at=at, noise_sd=0.2))
    change = change_of(injected)
    np.testing.assert_allclose(np.abs(change[100:150]), 0.8, rtol=1e-4)  # 4 sd of 0.2, up or down
    np.testing.assert_allclose(injected.table["value"][150:160], VOLTS[150] - 0.4, rtol=1e-6)
    assert np.flatnonzero(change).tolist() == [*range(100, 160), 1_200, 1_225, 1_250]
    assert [(each.kind, each.begin, each.end) for each in injected.anomalies] == [
        ("level_shift", 100, 150),
        ("dropout", 150, 160),
        ("spike", 1_200, 1_251),
    ]


def test_places_are_uniform_over_what_is_free():
    rng, free = np.random.default_rng(0), FreeStretches([(0, 100)], gap=10)
    free.take(0, 40)
    begins = [free.draw(10, rng) for _ in range(3_000)]
    counts, expected = np.bincount(begins, minlength=100), 3_000 / 41
    # the free places are the 41 samples from 50 to 90
    assert counts[:50].sum() == 0 and counts[91:].sum() == 0
    # chi-squared with 40 degrees of freedom: above 80 at p = 0.0002
    assert np.sum((counts[50:91] - expected) ** 2 / expected) < 80


def test_a_place_where_nothing_changes_is_drawn_again():
    values = np.full(2_000, 7, np.float32)
    # `stuck` changes nothing in the constant stretch before
    values[1_500:] = VOLTS[:500]
    options = InjectOptions(["stuck"], (np.inf, np.inf), ("20", "20"), 4, noise_sd=0.2)
    injected = inject([Telemetry.of(values)], options)
    for anomaly in injected.anomalies:
        assert anomaly.begin > 1_450
        assert injected.table["mask"].iloc[[anomaly.begin, anomaly.end - 1]].all()


def test_the_noise_is_estimated_and_sets_the_severity():
    injected = inject(PARTS, InjectOptions(at=["level_shift:5@200/100"]))
    (noise_sd,) = injected.noise_sd
    assert noise_sd == pytest.approx(0.2, rel=0.05)
    np.testing.assert_allclose(np.abs(change_of(injected)[200:300]), 5 * noise_sd, rtol=1e-4)


def test_channels_draw_independently_and_the_same_seed_gives_the_same_table():
    options = InjectOptions(("spike",), number=3, seed=1)
    first, again, amps = (inject(given, options).table for given in (PARTS, PARTS, parts(name="a")))
    pd.testing.assert_frame_equal(first, again)
    assert (amps["mask"].to_numpy() != first["mask"].to_numpy()).any()


@pytest.mark.parametrize("times", [True, False])
def test_timeeval_files_have_times_first_and_labels_last(times, tmp_path):
    (both,) = join_channels({name: parts(times, False, name) for name in ("volts", "amps")})
    frame = inject(both, InjectOptions(("level_shift",), number=4)).table
    write_table(tmp_path / "x.csv", frame, ["volts", "amps"])
    read = pd.read_csv(tmp_path / "x.csv")
    assert list(read) == ["timestamp", "volts", "amps", "is_anomaly"]
    assert read["is_anomaly"].isin([0, 1]).all()
    np.testing.assert_array_equal(read["is_anomaly"], frame["mask volts"] | frame["mask amps"])
    np.testing.assert_array_equal(read["volts"].astype(np.float32), frame["volts"])
    assert read["timestamp"].iloc[1] == ("2024-01-01 00:00:10" if times else 1)


def test_a_channel_called_is_anomaly_keeps_its_values(tmp_path):
    frame = inject(parts(name="is_anomaly"), InjectOptions(("spike",))).table
    write_table(tmp_path / "y.csv", frame, ["is_anomaly"])
    read = pd.read_csv(tmp_path / "y.csv")
    assert list(read) == ["timestamp", "is_anomaly (channel)", "is_anomaly"]
    np.testing.assert_array_equal(read["is_anomaly (channel)"].astype(np.float32), frame["value"])
    np.testing.assert_array_equal(read["is_anomaly"], frame["mask"])


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


WHOLE, WITHOUT_TIMES = parts(gap=False), parts(times=False, gap=False)
WITHOUT_NOISE = np.arange(200, dtype=np.float32)
CONSTANT = Telemetry.of(np.ones(900, np.float32))


@pytest.mark.parametrize(
    ("given", "options", "word"),
    [
        (PARTS, {"at": ["ramp@2024-01-01T03:00/5"]}, "not in a gap"),
        (PARTS, {"at": ["ramp@2025-01-01/5"]}, "not in a gap"),
        (WITHOUT_TIMES, {"at": ["ramp@2024-01-01/5"]}, "sample number"),
        (PARTS, {"kinds": ["ramp"], "length": ("20min", "50")}, "20min:50"),
        (Telemetry.of(WITHOUT_NOISE), {"kinds": ["ramp"]}, "--noise-sd"),
        (
            recorded(np.outer(WITHOUT_NOISE, [3, -2]), ("a", "b")),
            {"kinds": ["delay", "ramp"]},
            "--noise-sd",
        ),
        (
            PARTS,
            {"at": ["ramp@100/50", "gain@149/5"]},
            "do not overlap. Received: ramp at 4 from sample 100 to 150",
        ),
        (PARTS, {"at": ["ramp@990/20"]}, "2,800 samples in 2 parts"),
        (
            WHOLE,
            {"kinds": ["ramp"], "length": ("1600", "1600"), "number": 2},
            "3,000 samples with 1 event, nowhere",
        ),
        (PARTS, {"at": ["dropout@10/5"], "noise_sd": 1e38}, "range of float32"),
        (PARTS, {"at": ["level_shift@10/5"], "noise_sd": 1e-9}, "changes no sample"),
        (CONSTANT, {"kinds": ["stuck"], "noise_sd": 1.0}, "changes nothing at 100 drawn places"),
        ([], {"kinds": ["spike"]}, "at least one part"),
        (PARTS, {"kinds": ["delay"]}, "several channels"),
    ],
)
def test_what_does_not_fit_the_telemetry_is_refused(given, options, word, refused):
    with refused(word):
        inject(given, InjectOptions(**options))


# several channels


def together():
    rng = np.random.default_rng(0)
    common = np.cumsum(rng.standard_normal(1_000))[:, None]
    values = (common * [1, 2, 3] + rng.standard_normal((1_000, 3))).astype(np.float32)
    return parts_of((Part(values[:600]), Part(values[600:], 700.0)), tuple("abc"), name="abc")


NOMINAL = np.concatenate([part.values for part in together().parts])


@pytest.mark.parametrize("kind", [*JOINT_KINDS, "spike,delay,gain"])
def test_samples_that_are_not_marked_keep_their_values(kind):
    options = InjectOptions(kind.split(","), length=("40", "40"), number=3, seed=1)
    injected = inject(together(), options)
    frame = injected.table
    mask = frame[[f"mask {name}" for name in "abc"]].to_numpy()
    np.testing.assert_array_equal(mask, frame[list("abc")].to_numpy() != NOMINAL)
    np.testing.assert_array_equal(frame["mask"], mask.any(axis=1))
    channels = {anomaly.channel for anomaly in injected.anomalies}
    assert len(injected.anomalies) == 3
    assert mask.any(axis=0).sum() == (3 if kind == "common_shift" else len(channels))


def changed_by(kind, seed):
    """The changed samples of one anomaly: their first one, the number of the channel, and all
    channels.
    """
    injected = inject(together(), InjectOptions([kind], length=("40", "40"), seed=seed))
    (anomaly,) = injected.anomalies
    values = injected.table[list("abc")].to_numpy()[anomaly.begin : anomaly.end]
    return anomaly.begin, "abc".find(anomaly.channel or "abc"), values


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


def test_a_joint_anomaly_that_changes_nothing_is_drawn_again():
    values = NOMINAL[:, :2] * (1, 0)  # a constant channel that is late is as before
    options = InjectOptions(["delay"], length=("20", "20"), number=6)
    injected = inject(recorded(values, ("a", "b")), options)
    assert {anomaly.channel for anomaly in injected.anomalies} == {"a"}


def test_anomalies_of_one_of_several_channels_are_put_into_one_that_has_noise():
    noise = 0.2 * np.random.default_rng(0).standard_normal(900)
    given = recorded(np.stack([np.full(900, 5.0), noise], axis=1), ("level", "volts"))
    injected = inject(given, InjectOptions(["ramp"], length=("20", "20"), number=5))
    assert [anomaly.channel for anomaly in injected.anomalies] == ["volts"] * 5
