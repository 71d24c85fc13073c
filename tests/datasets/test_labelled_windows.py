"""Labelled training data: labels agree with the generated data, and files are written atomically."""

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from enhsim_tf.coarse_simulator.degraded import MODES, Degraded
from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.datasets.label_columns import LABELS
from enhsim_tf.datasets.labelled_windows import series_labelled, write_windows_labelled
from enhsim_tf.datasets.places import Share, divide_windows
from enhsim_tf.telemetry.placing import PlacedEvent
from tests.known_simulators import of_waves

WINDOW = 60
COARSE = SquareWaveSimulator([SquareWave(48, low=-0.5, high=0.5)])


def known(noise_sd=0.1, interval_s=2.0, channels=("volts",)):
    """A simulator of known processes: the coarse signal plus white noise."""
    return of_waves([COARSE] * len(channels), WINDOW, noise_sd, interval_s, channels=channels)


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
    shares = divide_windows(scenarios, nominal_share, num_windows, seed=3)
    assert [share.num_windows for share in shares] == expected and len({share.seed for share in shares}) == len(shares)
    assert [share.scenario for share in shares if share.scenario] == (scenarios if nominal_share < 1 else [])
    assert shares != divide_windows(scenarios, nominal_share, num_windows, seed=4)


def test_no_scenario_is_dropped_silently(refused):
    with refused("each of 3 scenarios", "4 windows"):
        divide_windows([Degraded("stuck"), Degraded("drift"), Degraded("dropout")], 0.5, 4, 0)


# windows


@pytest.fixture
def written(tmp_path):
    """A training set, its shares and the simulator that generated it."""
    scenarios = [Degraded("stuck", 0.5, 0.4), Degraded("drift", 0.8, 0.29), Degraded("gain_loss", 0.0)]
    shares, path = divide_windows(scenarios, 0.25, 80, seed=7), tmp_path / "deep" / "training.parquet"
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


def test_other_programs_can_read_the_file(written):
    path, _ = written
    schema = pq.read_schema(path)
    assert schema.field("window").type.list_size == WINDOW and str(schema.field("window").type.value_type) == "float"
    assert [str(schema.field(name).type) for name in ("scenario", "severity", "onset", "end")] == ["string", "float", "int32", "int32"]
    assert schema.field("mask").type.list_size == WINDOW
    assert schema.metadata[b"interval_s"] == b"2.0" and schema.metadata[b"channel"] == b"volts"
    assert 0 < pq.read_table(path, filters=[("scenario", "==", "stuck")]).num_rows <= 20


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
    series = series_labelled(both, 300, drift, 4)
    assert list(series) == ["volts", "amps", *LABELS, "mask volts", "mask amps"]
    np.testing.assert_array_equal(series["mask"], series["amps"] != both.generate_series(300, None, 4)[:, 1])
    with refused("volts, amps", "'watts'"):
        series_labelled(both, 300, Degraded("drift", 1.0, 0.5, "watts"))


# series


@pytest.mark.parametrize("scenario", [None, Degraded("dropout", 0.7, 0.3), Degraded("stuck", 0.0)], ids=str)
def test_a_series_equals_that_of_the_simulator(scenario):
    frame = series_labelled(known(), 1_234, scenario, 9)
    assert list(frame.columns) == ["value", *LABELS] and frame.index.name == "time_s"
    np.testing.assert_array_equal(frame["value"], known().generate_series(1_234, scenario, 9)[:, 0])
    np.testing.assert_array_equal(frame.index, 2.0 * np.arange(1_234))
    mask = (known().generate_series(1_234, scenario, 9) != known().generate_series(1_234, None, 9))[:, 0]
    assert mask.any() == bool(scenario and scenario.severity) and not mask[:370].any()  # 0.3 * 1234 = 370.2
    np.testing.assert_array_equal(frame["mask"], mask)
    np.testing.assert_array_equal(frame["scenario"] == "dropout", mask)
    np.testing.assert_array_equal(frame["scenario"] == "nominal", ~mask)
    np.testing.assert_allclose(frame["severity"], np.where(mask, 0.7, 0), rtol=1e-6)
    for name, value in (("onset", mask.argmax()), ("end", 1_234 - mask[::-1].argmax())):
        assert frame[name].isna().tolist() == (~mask).tolist() and (frame[name][mask] == value).all()


def test_wrong_schedules_are_refused(refused):
    for begin, length in ((200, 50), (150, 10), (950, 51)):  # touching, overlapping, beyond the end
        with refused("drift"):
            series_labelled(known(), 1_000, schedule=[PlacedEvent("stuck", 1.0, 100, 100), PlacedEvent("drift", 1.0, begin, length)])
    for wrong in (("rust", 1.0, 0, 5), ("stuck", 2.0, 0, 5), ("stuck", 1.0, -1, 5), ("stuck", 1.0, 0, 0)):
        with refused():
            series_labelled(known(), 1_000, schedule=[PlacedEvent(*wrong)])


def test_a_series_with_a_start_has_times():
    frame = series_labelled(known(interval_s=0.1), 1_000, Degraded("stuck", 0.5, 0.5), 1, "2024-02-28T23:59:59")
    assert isinstance(frame.index, pd.DatetimeIndex) and str(frame.index.tz) == "UTC" and frame.index.name == "time"
    expected = pd.date_range("2024-02-28T23:59:59", periods=1_000, freq="100ms", tz="UTC")
    assert (frame.index == expected).all()  # to the nanosecond
    assert (frame["scenario"].iloc[:500] == "nominal").all() and (frame["scenario"].iloc[500:] == "stuck").any()
