"""Labelled training data: labels agree with the generated data, and files are written atomically."""

import hashlib

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from enhsim_tf.coarse_simulator.degraded import MODES, Degraded, ScheduledMode
from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.datasets.label_columns import LABELS
from enhsim_tf.datasets.labelled_windows import (
    Share,
    divide_windows,
    parse_length,
    parse_num_samples,
    parse_scenario,
    parse_start,
    series_labelled,
    write_series_labelled,
    write_windows_labelled,
)
from enhsim_tf.datasets.mix import make_mix
from tests.known_simulators import of_waves

WINDOW = 60
COARSE = SquareWaveSimulator([SquareWave(48, low=-0.5, high=0.5)])


def known(noise_sd=0.1, interval_s=2.0, channels=("volts",)):
    """A simulator of known processes: the coarse signal plus white noise."""
    return of_waves([COARSE] * len(channels), WINDOW, noise_sd, interval_s, channels=channels)


# options


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("stuck:0.5", Degraded("stuck", 0.5)),
        ("drift:1:0", Degraded("drift", 1.0, 0.0)),
        ("period_change:0:0.99", Degraded("period_change", 0.0, 0.99)),
        ("dropout:1e-2", Degraded("dropout", 0.01)),
        ("bus=2=stuck:0.5:0.1", Degraded("stuck", 0.5, 0.1, "bus=2")),
    ],
)
def test_scenarios_are_parsed(text, expected):
    assert parse_scenario(text) == expected


@pytest.mark.parametrize(
    "text",
    [
        "",
        "stuck",
        "stuck:",
        "stuck:half",
        "stuck:0.5:",
        "stuck:2",
        "stuck:-0.1",
        "stuck:nan",
        "stuck:0.5:1",
        "stuck:0.5:0.1:7",
        "nominal:0.5",
    ],
)
def test_invalid_scenarios_are_refused(refused, text):
    with refused():
        parse_scenario(text)


@pytest.mark.parametrize(
    ("text", "interval_s", "expected"),
    [
        ("5000", 17.0, 5_000),
        ("1d", 1.0, 86_400),
        ("1d", 60.0, 1_440),
        ("6h", 0.5, 43_200),
        ("90min", 10.0, 540),
        ("1ms", 0.001, 1),
        ("365d", 60.0, 525_600),
        ("100 s", 8.0, 12),
        ("0.5D", 86.4, 500),
        ("2.5 min", 10.0, 15),
    ],
)
def test_lengths_are_converted_to_samples(text, interval_s, expected):
    assert parse_num_samples(text, interval_s) == expected


@pytest.mark.parametrize(
    "text",
    ["", "0", "-5", "0s", "-1d", "nan", "NaT", "inf", "long", "1 fortnight", "5000.5", "1e3", "²", "1m", "1d 6h", "1.d", "d", "9" * 5_000],
)
def test_invalid_lengths_are_refused(refused, text):
    with refused("1d, 6h", "5000"):
        parse_length(text)


@pytest.mark.parametrize(("text", "interval_s"), [("1s", 10.0), ("1000d", 1.0), ("20000001", 1.0)])
def test_lengths_out_of_range_for_the_interval_are_refused(refused, text, interval_s):
    assert parse_length(text)
    with refused(f"one every {interval_s:g} s", repr(text)):
        parse_num_samples(text, interval_s)


def test_start_times_are_converted_to_utc():
    assert parse_start("2024-01-01") == pd.Timestamp("2024-01-01", tz="UTC")
    assert parse_start("2024-06-01T12:00+02:00") == pd.Timestamp("2024-06-01T10:00", tz="UTC")
    assert parse_start(pd.Timestamp("2024-06-01T12:00", tz="Europe/Berlin")) == pd.Timestamp("2024-06-01T10:00", tz="UTC")


@pytest.mark.parametrize("text", ["", "soon", "01.02.2024", "1066-10-14", "9999-01-01", "2024-13-01"])
def test_invalid_start_times_are_refused(refused, text):
    with refused("2024-01-01"):
        parse_start(text)


# division of windows


@pytest.mark.parametrize(
    ("num_scenarios", "num_windows", "nominal_share", "expected"),
    [
        (0, 100, 0.5, [100]),
        (1, 100, 0.5, [50, 50]),
        (2, 101, 0.5, [50, 26, 25]),
        (3, 100, 0.1, [10, 30, 30, 30]),
        (2, 7, 0.0, [4, 3]),
        (1, 7, 1.0, [7]),
    ],
)
def test_windows_are_divided_between_scenarios(num_scenarios, num_windows, nominal_share, expected):
    scenarios = [Degraded(mode) for mode in list(MODES)[:num_scenarios]]
    mix = make_mix(scenarios, nominal_share)
    shares = divide_windows(mix, num_windows, seed=3)
    assert [share.num_windows for share in shares] == expected and sum(expected) == num_windows
    present = ([None] if nominal_share or not scenarios else []) + (scenarios if nominal_share < 1 else [])
    assert [share.scenario for share in shares] == present
    assert len({share.seed for share in shares}) == len(shares)
    assert shares == divide_windows(mix, num_windows, seed=3) != divide_windows(mix, num_windows, seed=4)


@pytest.mark.parametrize("share", [-0.1, 1.1, float("nan")])
def test_a_share_out_of_range_is_refused(refused, share):
    with refused("from 0 to 1"):
        make_mix([Degraded("stuck")], share)


def test_no_scenario_is_dropped_silently(refused):
    with refused("each of 3 scenarios", "4 windows"):
        divide_windows(make_mix([Degraded("stuck"), Degraded("drift"), Degraded("dropout")], 0.5), 4, 0)


# windows


@pytest.fixture
def written(tmp_path):
    """A training set, its shares and the simulator that generated it."""
    scenarios = [Degraded("stuck", 0.5, 0.4), Degraded("drift", 0.8, 0.29), Degraded("gain_loss", 0.0)]
    shares, path = divide_windows(make_mix(scenarios, 0.25), 80, seed=7), tmp_path / "deep" / "training.parquet"
    write_windows_labelled(path, known(), shares)
    return path, shares


def test_labels_agree_with_the_generated_windows(written):
    path, shares = written
    frame, first = pd.read_parquet(path), 0
    assert list(frame.columns) == ["window", *LABELS] and len(frame) == 80
    for share in shares:
        rows = frame.iloc[first : first + share.num_windows]
        expected = known().generate(share.num_windows, share.scenario, share.seed)[:, :, 0]
        np.testing.assert_array_equal(np.stack(rows["window"]), expected)
        mask = expected != known().generate(share.num_windows, None, share.seed)[:, :, 0]
        np.testing.assert_array_equal(np.stack(rows["mask"]), mask)
        changed = mask.any(axis=1)
        active = share.scenario if share.scenario and share.scenario.severity else None
        assert (rows["scenario"] == np.where(changed, active.mode if active else "", "nominal")).all()
        assert (rows["severity"] == np.where(changed, np.float32(active.severity if active else 0), 0)).all()
        assert rows["onset"].isna().tolist() == rows["end"].isna().tolist() == (~changed).tolist()
        for row, marks in zip(rows[changed].itertuples(), mask[changed], strict=True):
            assert marks[int(row.onset)] and marks[int(row.end) - 1] and marks.sum() == marks[int(row.onset) : int(row.end)].sum()
        first += share.num_windows
    assert set(frame["scenario"]) == {"nominal", "stuck", "drift"} and (frame["scenario"] == "drift").sum() == 20  # severity 0 is nominal


def test_windows_that_a_scenario_does_not_change_are_labelled_nominal_and_counted(tmp_path):
    stuck = Degraded("stuck", 0.25, 0.5)  # the period is 48 s, so the mechanism often stands still for 15 s anyway
    unchanged = write_windows_labelled(tmp_path / "x.parquet", known(), [Share(None, 10, 1), Share(stuck, 200, 2)])
    frame = pd.read_parquet(tmp_path / "x.parquet")[10:]
    same = (known().generate(200, stuck, 2) == known().generate(200, None, 2)).all(axis=(1, 2))
    assert unchanged == {stuck: same.sum()} and 20 < same.sum() < 180
    assert ((frame["scenario"] == "nominal").to_numpy() == same).all()


@pytest.mark.parametrize("onset", [0.0, 0.25, 0.29, 0.4, 0.99])
def test_the_onset_is_the_first_affected_sample(tmp_path, onset):
    # a drift begins at zero, so the first difference is one sample after the onset
    scenario = Degraded("drift", 1.0, onset)
    write_windows_labelled(tmp_path / "x.parquet", known(noise_sd=0), [Share(None, 5, 1), Share(scenario, 5, 1)])
    frame = pd.read_parquet(tmp_path / "x.parquet")
    nominal, drifting = np.stack(frame["window"][:5]), np.stack(frame["window"][5:])
    begin = int(round(onset * WINDOW, 6)) + 1
    np.testing.assert_array_equal(drifting[:, :begin], nominal[:, :begin])
    if begin == WINDOW:
        assert frame["onset"].isna().all() and set(frame["scenario"]) == {"nominal"}
    else:
        assert set(frame["onset"][5:]) == {begin} and set(frame["end"][5:]) == {WINDOW}
        assert (drifting[:, begin:] != nominal[:, begin:]).all()


def test_an_onset_after_the_last_sample_is_refused(tmp_path, refused):
    late = Degraded("friction", 0.5, 1 - 1e-9)
    with refused("onset within 60 samples"):
        write_windows_labelled(tmp_path / "x.parquet", known(), [Share(late, 5, 1)])
    with refused("onset within 30 samples"):
        write_series_labelled(tmp_path / "y.parquet", known(), 30, late, 0)
    assert not list(tmp_path.iterdir())


def test_other_programs_can_read_the_file(written):
    path, _ = written
    schema = pq.read_schema(path)
    assert str(schema.field("window").type) == "fixed_size_list<element: float>[60]" or schema.field("window").type.list_size == WINDOW
    assert [str(schema.field(name).type) for name in ("scenario", "severity", "onset", "end")] == ["string", "float", "int32", "int32"]
    assert schema.field("mask").type.list_size == WINDOW
    assert schema.metadata[b"interval_s"] == b"2.0" and schema.metadata[b"channel"] == b"volts"
    assert 0 < pq.read_table(path, filters=[("scenario", "==", "stuck")]).num_rows <= 20


def test_same_seed_same_bytes(tmp_path):
    scenarios = [Degraded("friction", 0.5), Degraded("dropout", 0.9)]

    def sums(seed):
        write_windows_labelled(tmp_path / "windows.parquet", known(), divide_windows(make_mix(scenarios, 0.5), 50, seed))
        write_series_labelled(tmp_path / "series.parquet", known(), 700, scenarios[1], seed)
        return [hashlib.sha256((tmp_path / name).read_bytes()).hexdigest() for name in ("windows.parquet", "series.parquet")]

    once = sums(5)
    assert once == sums(5) and all(one != other for one, other in zip(once, sums(6), strict=True))


def test_several_channels_have_columns_of_their_own(tmp_path, refused):
    both, drift = known(channels=("volts", "amps")), Degraded("drift", 1.0, 0.5, "amps")
    assert write_windows_labelled(tmp_path / "x.parquet", both, [Share(None, 3, 1), Share(drift, 5, 2)]) == {drift: 0}
    frame = pd.read_parquet(tmp_path / "x.parquet")
    assert list(frame) == ["window volts", "window amps", *LABELS, "mask volts", "mask amps"]
    expected = np.concatenate([both.generate(3, None, 1), both.generate(5, drift, 2)])
    for number, name in enumerate(both.channels):
        np.testing.assert_array_equal(np.stack(frame[f"window {name}"]), expected[:, :, number])
    changed = np.stack(frame["mask amps"])
    assert not np.stack(frame["mask volts"]).any() and changed[3:, 31:].all() and not changed[:3].any()
    np.testing.assert_array_equal(np.stack(frame["mask"]), changed)
    series = series_labelled(both, 300, drift, 4)
    assert list(series) == ["volts", "amps", *LABELS, "mask volts", "mask amps"]
    nominal = both.generate_series(300, None, 4)
    np.testing.assert_array_equal(series["volts"], nominal[:, 0])
    np.testing.assert_array_equal(series["mask"], series["amps"] != nominal[:, 1])
    assert write_series_labelled(tmp_path / "x.csv", both, 300, drift, 4, is_timeeval=True) == series["mask"].sum() > 0
    assert list(pd.read_csv(tmp_path / "x.csv")) == ["timestamp", "volts", "amps", "is_anomaly"]
    with refused("volts, amps", "'watts'"):
        series_labelled(both, 300, Degraded("drift", 1.0, 0.5, "watts"))


# series


@pytest.mark.parametrize("scenario", [None, Degraded("dropout", 0.7, 0.3), Degraded("stuck", 0.0)], ids=str)
def test_a_series_equals_that_of_the_simulator(tmp_path, scenario):
    write_series_labelled(tmp_path / "x.parquet", known(), 1_234, scenario, 9)
    frame = pd.read_parquet(tmp_path / "x.parquet")
    assert list(frame.columns) == ["time_s", "value", *LABELS]
    np.testing.assert_array_equal(frame["value"], known().generate_series(1_234, scenario, 9)[:, 0])
    np.testing.assert_array_equal(frame["time_s"], 2.0 * np.arange(1_234))
    mask = (known().generate_series(1_234, scenario, 9) != known().generate_series(1_234, None, 9))[:, 0]
    assert mask.any() == bool(scenario and scenario.severity) and not mask[:370].any()  # 0.3 * 1234 = 370.2
    np.testing.assert_array_equal(frame["mask"], mask)
    np.testing.assert_array_equal(frame["scenario"] == "dropout", mask)
    np.testing.assert_array_equal(frame["scenario"] == "nominal", ~mask)
    np.testing.assert_allclose(frame["severity"], np.where(mask, 0.7, 0), rtol=1e-6)
    for name, value in (("onset", mask.argmax()), ("end", 1_234 - mask[::-1].argmax())):
        assert frame[name].isna().tolist() == (~mask).tolist() and (frame[name][mask] == value).all()


def test_a_series_has_several_events_and_is_nominal_between_them():
    schedule = [ScheduledMode("stuck", 1.0, 800, 100), ScheduledMode("drift", 0.5, 100, 60), ScheduledMode("dropout", 1.0, 400, 200)]
    frame = series_labelled(known(), 1_234, None, 9, schedule=schedule)
    nominal = known().generate_series(1_234, None, 9)[:, 0]
    np.testing.assert_array_equal(frame["mask"], frame["value"] != nominal)
    outside = np.ones(1_234, bool)
    for event in schedule:
        rows = frame.iloc[event.begin : event.end]
        rows = rows[rows["mask"]]
        assert set(rows["scenario"]) == {event.mode} and set(rows["severity"]) == {event.severity}
        assert event.begin <= rows["onset"].iloc[0] and rows["end"].iloc[0] <= event.end and rows["onset"].nunique() == 1
        outside[event.begin : event.end] = False
    assert not frame["mask"][outside].any()
    stuck = frame["value"].iloc[800:900].to_numpy() - (nominal[800:900] - COARSE.simulate(2.0 * np.arange(800, 900)[None])[0])
    np.testing.assert_allclose(stuck, stuck[0], atol=1e-6)  # without its noise, it stands still until the end


def test_wrong_schedules_are_refused(refused):
    for wrong in (
        [ScheduledMode("stuck", 1.0, 100, 100), ScheduledMode("drift", 1.0, 200, 50)],
        [ScheduledMode("stuck", 1.0, 100, 100), ScheduledMode("drift", 1.0, 150, 10)],
        [ScheduledMode("stuck", 1.0, 950, 51)],
    ):
        with refused("stuck"):
            series_labelled(known(), 1_000, schedule=wrong)
    with refused("both"):
        series_labelled(known(), 1_000, Degraded("stuck"), schedule=[ScheduledMode("stuck", 1.0, 100, 50)])
    for wrong in (("rust", 1.0, 0, 5), ("stuck", 2.0, 0, 5), ("stuck", 1.0, -1, 5), ("stuck", 1.0, 0, 0)):
        with refused():
            ScheduledMode(*wrong)


def test_a_series_with_a_start_has_times(tmp_path):
    frame = series_labelled(known(interval_s=0.1), 1_000, Degraded("stuck", 0.5, 0.5), 1, "2024-02-28T23:59:59")
    assert isinstance(frame.index, pd.DatetimeIndex) and str(frame.index.tz) == "UTC" and frame.index.name == "time"
    expected = pd.date_range("2024-02-28T23:59:59", periods=1_000, freq="100ms", tz="UTC")
    assert (frame.index == expected).all()  # to the nanosecond
    assert (frame["scenario"].iloc[:500] == "nominal").all() and (frame["scenario"].iloc[500:] == "stuck").any()
    write_series_labelled(tmp_path / "x.parquet", known(interval_s=0.1), 1_000, Degraded("stuck", 0.5, 0.5), 1, "2024-02-28T23:59:59")
    read = pd.read_parquet(tmp_path / "x.parquet")
    assert (pd.DatetimeIndex(read["time"]) == expected).all() and (read["value"].to_numpy() == frame["value"].to_numpy()).all()


# failures


@pytest.mark.parametrize("there_before", [False, True])
def test_a_failed_generation_writes_nothing(tmp_path, monkeypatch, there_before):
    broken = known()

    def chunks(*arguments):  # fails after the first windows
        yield np.zeros((3, WINDOW, 1), np.float32), np.zeros((3, WINDOW, 1), bool)
        raise KeyboardInterrupt

    monkeypatch.setattr(broken, "generate_labelled_chunks", chunks)
    monkeypatch.setattr(broken, "generate_labelled_series", lambda *arguments, **options: next(iter(())))
    for name in ("windows.parquet", "series.parquet") if there_before else ():
        (tmp_path / name).write_text("the old one")
    with pytest.raises(KeyboardInterrupt):
        write_windows_labelled(tmp_path / "windows.parquet", broken, [Share(None, 10, 0)])
    with pytest.raises(StopIteration):
        write_series_labelled(tmp_path / "series.parquet", broken, 100, None, 0)
    assert [path.read_text() for path in tmp_path.iterdir()] == ["the old one"] * (2 * there_before)
