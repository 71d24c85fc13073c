"""Scores of telemetry: the given rate on simulated telemetry, flags at anomalies, and no score in short parts."""

import keras
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.detection.registry import DETECTORS
from enhsim_tf.enhanced_simulator import scoring
from enhsim_tf.enhanced_simulator.scoring import ScoreOptions, score_channel, write_scores
from enhsim_tf.enhanced_simulator.simulator import EnhancedSimulator
from enhsim_tf.noise.surrogates import GaussianNoise
from enhsim_tf.telemetry.pandas_series import to_series
from enhsim_tf.telemetry.series import Telemetry

WINDOW = 60
COARSE = SquareWaveSimulator([SquareWave(48, low=-0.5, high=0.5)])


@pytest.fixture(scope="module")
def known():
    """A simulator of known processes: the coarse signal plus white noise."""
    enhancer = keras.Sequential([keras.Input((WINDOW,)), keras.layers.Dense(WINDOW)])
    enhancer.layers[0].set_weights([np.eye(WINDOW), np.zeros(WINDOW)])
    return EnhancedSimulator(COARSE, enhancer, GaussianNoise(0.1, WINDOW), interval_s=2.0)


@pytest.fixture
def short(monkeypatch):
    """Uses a short series for the threshold."""
    monkeypatch.setattr(scoring, "_THRESHOLD_WINDOWS", 100)


def telemetry(known, num_samples=3_000, seed=99, **fields):
    values = known.generate_series(num_samples, seed=seed)
    return Telemetry(values, **{"interval_s": 2.0, "start": "2024-01-01T00:00:00+00:00", "name": "volts"} | fields)


@pytest.mark.parametrize("detector", ["PCA residual", "nearest neighbours"])
def test_simulated_telemetry_is_flagged_at_the_given_rate(known, short, detector):
    # scores within two windows are correlated, so a series of 100 windows has about 50 independent scores. At a rate of 0.1
    # the flags have sd = sqrt(0.09 / 50), and the threshold adds the same variance; both are averaged over the seeds
    num_seeds, rate = 12, 0.1
    shares = []
    for seed in range(num_seeds):
        options = ScoreOptions(detector, num_windows=150, false_alarm_rate=rate, seed=seed)
        shares.append(score_channel(known, [telemetry(known, 100 * WINDOW, 1_000 + seed)], options)["flag"].mean())
    sd = np.sqrt(2 * rate * (1 - rate) / 50 / num_seeds)
    assert abs(np.mean(shares) - rate) < 4 * sd
    assert 4 * sd < rate  # otherwise the test would show nothing


@pytest.mark.parametrize("detector", [name for name in DETECTORS if "autoencoder" not in name])
def test_a_large_anomaly_is_flagged_at_its_position(known, short, detector):
    series = telemetry(known)
    series.values[1_500:1_520] += 4.0  # 40 standard deviations of the noise
    frame = score_channel(known, [series], ScoreOptions(detector, num_windows=300, seed=1))
    assert frame["flag"].iloc[1_500:1_520].all()
    assert frame["flag"].iloc[: 1_500 - WINDOW].mean() < 0.1 and frame["flag"].iloc[1_520 + WINDOW :].mean() < 0.1
    assert 1_500 - WINDOW < int(np.argmax(frame["score"])) < 1_520 + WINDOW


def test_a_stuck_sensor_is_flagged(known, short):
    series = telemetry(known)
    series.values[900:1_300] = series.values[900]
    frame = score_channel(known, [series], ScoreOptions("nearest neighbours", num_windows=300))
    assert frame["flag"].iloc[960:1_240].all()


def test_samples_with_a_score_above_one_are_flagged(known, short):
    frame = score_channel(known, [telemetry(known)], ScoreOptions(num_windows=100, false_alarm_rate=0.2))
    np.testing.assert_array_equal(frame["flag"], frame["score"] > 1)
    assert 0 < frame["flag"].mean() < 1 and frame["flag"].dtype == bool
    assert frame.attrs["expected_false_alarm_rate"] == 0.2


def test_a_rate_that_the_series_cannot_support_is_replaced_by_the_smallest(known, short):
    # a series of 100 windows supports no rate below 1 / 101: the threshold is its largest score, whatever smaller rate is asked for
    frames = [score_channel(known, [telemetry(known)], ScoreOptions(num_windows=100, false_alarm_rate=rate)) for rate in (1e-3, 1e-6)]
    pd.testing.assert_frame_equal(*frames)
    assert all(frame.attrs["expected_false_alarm_rate"] == pytest.approx(1 / 101) for frame in frames)


def test_scores_keep_their_order_if_the_threshold_is_not_positive():
    # a limit check scores below zero inside its limits, and dividing by a negative threshold would reverse the order
    scores = np.array([-3.0, -1.0, 0.5])
    for threshold in (2.0, 0.0, -1.5):
        relative = scoring._relative(scores, threshold)
        np.testing.assert_array_equal(relative > 1, scores > threshold)
        assert (np.diff(relative) > 0).all()


@pytest.mark.parametrize("has_time", [True, False])
def test_the_index_equals_that_of_the_series(known, short, has_time):
    fields = {} if has_time else {"start": None}
    series = telemetry(known, 1_000, **fields)
    first, rest = series.part(0, 400), series.part(450, 1_000)
    frame = score_channel(known, [first, rest], ScoreOptions(num_windows=100))
    expected = pd.concat([to_series(first), to_series(rest)])
    assert frame.index.equals(expected.index) and frame.index.name == expected.index.name
    assert isinstance(frame.index, pd.DatetimeIndex) is has_time
    np.testing.assert_array_equal(frame["value"], expected)
    assert list(frame.columns) == ["value", "score", "flag"] and frame["score"].notna().all()


def test_parts_shorter_than_a_window_have_no_score(known, short):
    series = telemetry(known, 500)
    parts = [series.part(0, WINDOW - 1), series.part(100, 100 + WINDOW), series.part(200, 500)]
    frame = score_channel(known, parts, ScoreOptions(num_windows=100))
    is_short = np.arange(len(frame)) < WINDOW - 1
    np.testing.assert_array_equal(frame["score"].isna(), is_short)
    assert not frame["flag"][is_short].any()
    assert frame["score"].iloc[WINDOW - 1 : 2 * WINDOW - 1].nunique() == 1  # one window, one score


def test_same_seed_same_scores_and_another_differs(known, short):
    frames = [score_channel(known, [telemetry(known, 600)], ScoreOptions(num_windows=100, seed=seed)) for seed in (3, 3, 4)]
    pd.testing.assert_frame_equal(frames[0], frames[1])
    assert (frames[0]["score"] != frames[2]["score"]).any()


def test_telemetry_that_cannot_be_scored_is_refused(known, refused):
    with refused("every 2 s", "every 1 s"):
        score_channel(known, [telemetry(known, interval_s=1.0)])
    with refused(f"{WINDOW} samples", "Received: 59"):
        score_channel(known, [telemetry(known, 59), telemetry(known, 10)])
    with refused("Received: 0"):
        score_channel(known, [])


@pytest.mark.parametrize(
    "options",
    [
        {"detector": "a crystal ball"},
        {"false_alarm_rate": 0.0},
        {"false_alarm_rate": 0.5},
        {"false_alarm_rate": float("nan")},
        {"num_windows": 9},
    ],
)
def test_options_out_of_range_are_refused(refused, options):
    with refused():
        ScoreOptions(**options)


def test_a_slightly_different_sampling_interval_is_accepted(known, short):
    series = telemetry(known, 300, interval_s=2.0 * (1 + 5e-4))  # an interval estimated from times with jitter
    assert len(score_channel(known, [series], ScoreOptions(num_windows=50))) == 300


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_written_scores_can_be_read(known, short, tmp_path, suffix):
    frame = score_channel(known, [telemetry(known, 300)], ScoreOptions(num_windows=50))
    path = tmp_path / f"scores{suffix}"
    write_scores(path, frame)
    read = pd.read_parquet(path) if suffix == ".parquet" else pd.read_csv(path, index_col="time", parse_dates=["time"])
    assert (read.index == frame.index).all() and (read["flag"] == frame["flag"]).all()
    np.testing.assert_allclose(read["score"], frame["score"], rtol=1e-12)
    np.testing.assert_allclose(read["value"], frame["value"], rtol=1e-6)
    assert sorted(each.name for each in tmp_path.iterdir()) == sorted([path.name, "scores.events.csv"])


def test_the_sample_number_is_a_column_for_every_reader_of_parquet(known, short, tmp_path):
    values = known.generate_series(300, seed=1)
    frame = score_channel(known, [Telemetry(values, interval_s=2.0)], ScoreOptions(num_windows=50))
    write_scores(tmp_path / "scores.parquet", frame)
    table = pq.read_table(tmp_path / "scores.parquet")
    assert table.column("sample").to_pylist() == list(range(300))


def test_events_are_the_flags_with_their_times(known, short, tmp_path):
    series = telemetry(known)
    series.values[1_500:1_520] += 4.0
    parts = [series.part(0, 1_000), series.part(1_100, 3_000)]  # with a gap of 100 samples
    frame = score_channel(known, parts, ScoreOptions(num_windows=300, seed=1))
    table = scoring.events_table(frame)
    assert list(table) == ["begin", "end", "peak", "duration_s", "num_flagged", "score", "confidence"]
    best = table.loc[table["score"].idxmax()]
    shifted = frame.index[0] + pd.Timedelta(seconds=2 * 1_500)
    assert best["begin"] <= shifted < best["end"] and best["begin"] <= best["peak"] < best["end"] and best["confidence"] > 0.98
    assert table["num_flagged"].sum() == frame["flag"].sum() and table["confidence"].between(0, 1).all()
    for row in table.itertuples():
        inside = frame[(frame.index >= row.begin) & (frame.index < row.end)]
        assert inside["flag"].iloc[0] and inside["flag"].iloc[-1] and inside["score"].max() == row.score == frame["score"][row.peak]
        assert row.duration_s == 2 * len(inside) and (row.end - row.begin).total_seconds() == row.duration_s
    assert (table["begin"].iloc[1:].to_numpy() - table["end"].iloc[:-1].to_numpy() > np.timedelta64(2 * WINDOW, "s")).all()
    write_scores(tmp_path / "scores.parquet", frame)
    written = pd.read_csv(tmp_path / "scores.events.csv", parse_dates=["begin", "end", "peak"])
    assert written["begin"].tolist() == table["begin"].tolist() and sorted(tmp_path.iterdir())[0].name == "scores.events.csv"


def test_a_series_without_times_has_events_by_sample_and_maybe_none(known, short):
    nominal = telemetry(known, 600, start=None, interval_s=2.0)
    frame = score_channel(known, [nominal], ScoreOptions(num_windows=150, false_alarm_rate=1e-4))
    assert scoring.events_table(frame).empty and not frame["flag"].any()
    nominal.values[300:310] += 8
    (event,) = scoring.events_table(score_channel(known, [nominal], ScoreOptions(num_windows=150, false_alarm_rate=1e-4))).itertuples()
    assert event.begin <= 300 < event.end and 310 - WINDOW <= event.peak < 300 + WINDOW


def test_expected_false_alarms_are_those_of_nominal_telemetry(known, short):
    options = ScoreOptions("nearest neighbours", num_windows=150, false_alarm_rate=0.1, seed=3)
    series = telemetry(known, 400 * WINDOW, seed=500)
    frame = score_channel(known, [series], options)
    expected, low, high = frame.attrs["false_alarms_per_day"]
    found = len(frame.attrs["events"]) / (len(series) * 2.0 / 86_400)
    assert low < expected < high and low / 2 < found < 2 * high
