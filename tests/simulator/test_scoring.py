import dataclasses

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.coarse_simulator.recording import Recording, Run
from enhsim_tf.coarse_simulator.square_waves import SquareWave, SquareWaveSimulator
from enhsim_tf.common.errors import InputError
from enhsim_tf.detection.registry import DETECTORS
from enhsim_tf.simulator.joint import join_channels
from enhsim_tf.simulator.operating_point import Departure
from enhsim_tf.simulator.options import ScoreOptions
from enhsim_tf.simulator.scoring import (
    Scorer,
    check_fits,
    event_rows,
    events_table,
    score,
    write_scores,
)
from tests.known_simulators import of_waves
from tests.simulator.conftest import coarse_run, joint, series


def changed(recording, begin, end, by, channel=0):
    values = recording.parts[0].values.copy()
    values[begin:end, channel] += by
    return dataclasses.replace(recording, parts=(Run(values),))


@pytest.fixture(scope="module")
def telemetry():
    return join_channels({"volts": series(seed=5)})[0]


@pytest.mark.parametrize(
    "name", ["residual", "PCA residual", "innovation", "largest step", "limit check"]
)
def test_a_fault_is_flagged_and_nominal_time_is_not(single, telemetry, name):
    frame = score(single[0], changed(telemetry, 1_000, 1_100, 1.5), options=ScoreOptions(name))
    assert frame["flag"].iloc[1_000:1_100].mean() > (
        0.05 if name in ("limit check", "largest step") else 0.9
    )
    assert frame["flag"].iloc[:900].mean() < 0.05 and frame["flag"].iloc[1_200:].mean() < 0.05
    assert frame.attrs["detector"] == name and len(frame) == 3_000


def test_scores_of_a_run_are_of_the_difference_from_it(of_run, telemetry):
    frame = score(of_run[0], changed(telemetry, 1_000, 1_200, 0.5), coarse_run())
    assert {"value", "enhanced", "score", "flag", "out_of_range"} <= set(frame.columns)
    assert frame["flag"].iloc[1_020:1_180].mean() > 0.9 and frame["flag"].iloc[:900].mean() < 0.05
    clean = changed(telemetry, 1_000, 1_200, 0.5).parts[0].values[:, 0] - frame["value"]
    assert not clean.any() and np.std(frame["value"] - frame["enhanced"]) < 0.25


def test_samples_without_a_run_get_no_score(of_run, telemetry):
    frame = score(of_run[0], telemetry, coarse_run(2_000))
    assert frame["score"].isna().sum() == 1_000 and not frame["flag"].iloc[2_000:].any()
    late = dataclasses.replace(telemetry, parts=(Run(telemetry.parts[0].values[500:], 5_000.0),))
    frame = score(of_run[0], late, coarse_run(2_000))
    assert (
        frame["score"].isna().tolist() == [False] * 1_500 + [True] * 1_000
        and frame["flag"].mean() < 0.05
    )


def test_events_join_flags_within_a_window_and_count_them_by_hand():
    scores = np.full(1_100, 0.5)
    scores[1_010:1_013], scores[1_020], scores[1_060:1_062], scores[1_090] = (
        (2.0, 3.0, 2.0),
        1.5,
        4.0,
        1.0,
    )  # the threshold is no alarm
    rows = event_rows(scores, [0, 1_000, 1_100], np.full(400, 0.9), 10, 2.0)
    assert [
        (row["begin"], row["end"], row["peak"], row["num_flagged"], row["duration_s"])
        for row in rows
    ] == [
        (1_010, 1_021, 1_011, 4, 22.0),
        (1_060, 1_062, 1_060, 2, 4.0),
    ]
    assert rows[0]["score"] == 3.0 and rows[0]["confidence"] == pytest.approx(
        1 - 1 / 41
    )  # forty blocks, and the event itself


def test_alarms_within_a_departure_are_events_of_their_own_scores():
    scores, after = np.repeat([0.5, 2.0], [100, 200]), np.full(300, 0.5)
    scores[10], scores[250], after[105], after[190:192], after[194], after[197:210] = (
        3.0,
        5.0,
        9.0,
        1.5,
        4.0,
        2.0,
    )
    departure = Departure(
        100, ("level",), after, 120
    )  # an alarm before sample 120 still sees samples from before
    rows = event_rows(scores, [0, 196, 300], np.full(400, 0.9), 5, 2.0, departure)
    assert [
        (row["begin"], row["end"], row["peak"], row["num_flagged"], row["score"], row["against"])
        for row in rows
    ] == [
        (10, 11, 10, 1, 3.0, "learnt"),
        (100, 300, 250, 200, 5.0, "learnt"),
        (190, 195, 194, 3, 4.0, "new operating point"),
        (197, 210, 197, 13, 2.0, "new operating point"),  # of another part
    ]
    assert (
        event_rows(
            scores, [0, 196, 300], np.full(400, 0.9), 5, 2.0, departure._replace(settled=None)
        )
        == rows[:2]
    )


def test_a_pure_shift_of_the_level_keeps_the_promise_of_the_threshold(single):
    """Of 30,000 generated samples 1 % may be flagged, here in 375 windows; in three standard deviations of so many, at most 2.5 %."""
    simulator, _ = single
    generated = simulator.generate_series(40_000, seed=9)
    generated[8_000:] += 3 * simulator.scale
    shifted = Recording(
        (Run(generated),),
        simulator.channels,
        simulator.interval_s,
        "2024-01-01T00:00:00+00:00",
        "volts",
    )
    frame = score(simulator, shifted)
    later = frame["score_after"].iloc[10_000:] > 1
    assert frame["flag"].iloc[8_100:].all() and later.mean() < 0.025
    events = [row for row in frame.attrs["events"] if row["against"] == "new operating point"]
    assert sum(row["num_flagged"] for row in events if row["begin"] >= 10_000) == later.sum()


def test_an_event_across_a_gap_ends_one_interval_after_its_last_sample():
    seconds = np.array([0, 10, 20, 500, 510])
    frame = pd.DataFrame(index=pd.to_datetime(seconds, unit="s", utc=True))
    (row,) = event_rows(
        np.array([0.5, 2.0, 2.0, 2.0, 2.0]),
        [0, 3, 5],
        np.full(40, 0.9),
        1,
        10.0,
        Departure(1, ("level",), None, None),
    )
    frame.attrs = {"counts": False, "events": [row]}
    table = events_table(frame)
    assert (table["end"][0], table["begin"][0]) == (
        pd.Timestamp(520, unit="s", tz="UTC"),
        pd.Timestamp(10, unit="s", tz="UTC"),
    )


def test_times_of_a_clock_from_zero_are_written_as_seconds(single, telemetry, tmp_path):
    values = changed(telemetry, 1_500, 3_000, 6.0)
    frame = score(single[0], dataclasses.replace(values, start="1970-01-01T00:00:00+00:00"))
    write_scores(tmp_path / "scores.csv", frame)
    written, events = (
        pd.read_csv(tmp_path / "scores.csv"),
        pd.read_csv(tmp_path / "scores.events.csv"),
    )
    assert written["time"].tolist() == [10.0 * number for number in range(3_000)]
    (event,) = [
        row for row in frame.attrs["events"] if row["end"] == 3_000 and row["against"] == "learnt"
    ]
    assert [10 * event["begin"], 30_000] in events[["begin", "end"]].to_numpy().tolist() and len(
        events
    ) == len(events_table(frame))
    assert f"since {10 * event['begin']} s" in frame.attrs["departure"]


def test_a_lasting_change_is_one_event_since_its_time_and_names_update(single, telemetry):
    values = changed(telemetry, 1_500, 3_000, 6.0).parts[0].values
    parts = Run(values[:1_200]), Run(values[1_200:], 13_000.0)  # after a gap of a hundred samples
    frame = score(single[0], dataclasses.replace(telemetry, parts=parts))
    (event,) = [
        row for row in frame.attrs["events"] if row["end"] == 3_000 and row["against"] == "learnt"
    ]
    begin = frame.index[event["begin"]]
    assert 1_400 <= event["begin"] <= 1_500 and all(
        words in frame.attrs["departure"] for words in (f"since {begin}", "level", "`update`")
    )
    assert begin == pd.Timestamp("2024-01-01T00:00:00Z") + pd.Timedelta(
        seconds=13_000 + 10 * (event["begin"] - 1_200)
    )
    np.testing.assert_array_equal(frame["score_after"].iloc[:1_200], frame["score"].iloc[:1_200])
    assert (
        frame["flag"].iloc[1_600:].mean() > 0.9
        and (frame["score_after"].iloc[1_700:] > 1).mean() < 0.05
    )  # against the new level


def test_a_departure_from_a_run_begins_where_the_telemetry_leaves_it(of_run, telemetry):
    run = dataclasses.replace(
        coarse_run(), parts=(Run(coarse_run().parts[0].values[500:], 5_000.0),)
    )  # begins 500 samples later
    frame = score(of_run[0], changed(telemetry, 1_500, 3_000, 6.0), run)
    (event,) = [
        row for row in frame.attrs["events"] if row["end"] == 3_000 and row["against"] == "learnt"
    ]
    assert "level" in frame.attrs["departure"] and 1_400 <= event["begin"] <= 1_500
    assert (
        frame["score_after"].iloc[:500].isna().all()
        and (frame["score_after"].iloc[1_700:] > 1).mean() < 0.05
    )
    np.testing.assert_array_equal(frame["score_after"].iloc[:1_400], frame["score"].iloc[:1_400])


def test_telemetry_that_does_not_fit_is_refused(single, both, of_run, telemetry):
    check_fits(
        single[0], dataclasses.replace(telemetry, interval_s=10.005), None
    )  # within a thousandth
    short = dataclasses.replace(telemetry, parts=(Run(telemetry.parts[0].values[:79]),))
    for words, (simulator, _), given in (
        ("sample every 10 s", single, dataclasses.replace(telemetry, interval_s=1.0)),
        ("at least one window of 80", single, short),
        ("channels volts, watts", both, dataclasses.replace(joint(), columns=("volts", "amps"))),
        ("--coarse", of_run, telemetry),
    ):
        with pytest.raises(InputError, match=words):
            score(simulator, given)
    with pytest.raises(InputError, match="one of: residual"):
        ScoreOptions("crystal ball")


class Largest:
    """A detector whose scores are easily computed: the largest sample of a window."""

    def fit(self, windows):
        return self

    def score(self, windows):
        return windows.reshape(len(windows), -1).max(axis=1)


@pytest.fixture
def largest(monkeypatch):
    """The name of that detector, which is added to the others."""
    monkeypatch.setitem(DETECTORS, "largest sample", lambda seed: Largest())
    return "largest sample"


def by_hand(series, window=24):
    """The mean of the largest samples of all windows that contain a sample; one begins every eighth of a window, and one ends the series."""
    begins = [*range(0, len(series) - window, window // 8), len(series) - window]
    sums, counts = np.zeros(len(series)), np.zeros(len(series))
    for begin in begins:
        sums[begin : begin + window] += series[begin : begin + window].max()
        counts[begin : begin + window] += 1
    return sums / counts


def test_the_threshold_is_the_conformal_rank_of_a_thousand_generated_windows(largest):
    simulator = of_waves([SquareWaveSimulator([SquareWave(20)])], 24, noise_sd=0.2)
    scorer = Scorer(simulator, ScoreOptions(largest, num_windows=20, false_alarm_rate=0.05, seed=3))
    scores = np.sort(by_hand(simulator.generate_series(24_000, seed=4)[:, 0]))
    assert scorer.threshold == pytest.approx(scores[int(np.ceil(24_001 * 0.95)) - 1], rel=1e-6)
    assert (scorer.rate, scorer.nominal_threshold) == (0.05, -np.inf)
    new = simulator.generate_series(100, seed=9)
    np.testing.assert_allclose(
        scorer.score_series(new), by_hand(new[:, 0]) / scorer.threshold, rtol=1e-6
    )
    further = by_hand(simulator.generate_series(24_000, seed=5)[:, 0])
    np.testing.assert_allclose(scorer.nominal_scores, further / scorer.threshold, rtol=1e-6)


def test_nominal_telemetry_of_few_windows_bounds_the_threshold_by_its_largest_score(largest):
    simulator = of_waves([SquareWaveSimulator([SquareWave(20)])], 24, noise_sd=0.2)
    loud, short = (2 * simulator.generate_series(number, seed=7) for number in (480, 23))
    simulator.nominal = Recording(
        (Run(loud), Run(short + 50, 1_000.0)), ("volts",), 1.0, None
    )  # the second part is shorter than a window
    scorer = Scorer(simulator, ScoreOptions(largest, num_windows=20, false_alarm_rate=0.01))
    assert (
        scorer.threshold
        == scorer.nominal_threshold
        == pytest.approx(by_hand(loud[:, 0]).max(), rel=1e-6)
    )  # 20 windows, not 99
    tenth = Scorer(simulator, ScoreOptions(largest, num_windows=20, false_alarm_rate=0.1))
    assert tenth.nominal_threshold == pytest.approx(
        np.sort(by_hand(loud[:, 0]))[int(np.ceil(481 * 0.9)) - 1], rel=1e-6
    )


def test_the_held_out_end_of_nominal_telemetry_bounds_the_threshold_by_itself(largest):
    simulator = of_waves([SquareWaveSimulator([SquareWave(20)])], 24, noise_sd=0.2)
    nominal = simulator.generate_series(4_800, seed=7)
    nominal[-960:] *= 2  # 40 windows, whose largest score is above a tenth of those of all
    simulator.nominal, simulator.trained = (
        Recording((Run(nominal),), ("volts",), 1.0, None),
        {"num_samples": 3_840},
    )
    scorer = Scorer(simulator, ScoreOptions(largest, num_windows=20, false_alarm_rate=0.3))
    late = np.sort(by_hand(nominal[-960:, 0]))
    assert scorer.threshold == pytest.approx(late[int(np.ceil(961 * 0.7)) - 1], rel=1e-6)


def test_scores_with_a_threshold_below_zero_are_shifted(largest):
    waves = SquareWaveSimulator([SquareWave(20, low=-101.0, high=-99.0)])
    simulator = of_waves([waves], 8, noise_sd=0.2)  # a window begins at every sample
    scorer, new = (
        Scorer(simulator, ScoreOptions(largest, num_windows=20)),
        simulator.generate_series(100, seed=9),
    )
    assert scorer.threshold < 0
    np.testing.assert_allclose(
        scorer.score_series(new), 1 + by_hand(new[:, 0], 8) - scorer.threshold, atol=1e-4
    )


def test_a_residual_is_a_root_mean_square_and_grows_with_a_level_that_training_never_had():
    simulator = of_waves([SquareWaveSimulator([SquareWave(20)])], 24, noise_sd=0.2)
    scorer, windows = (
        Scorer(simulator, ScoreOptions("residual", num_windows=50)),
        simulator.generate(5, seed=9),
    )
    size = np.sqrt(np.mean(simulator.residuals(windows) ** 2, axis=(1, 2)))
    np.testing.assert_allclose(scorer.score_windows(windows), size, rtol=1e-5)
    levels = simulator.generate(50, seed=0).mean(axis=1)
    beyond = (
        windows.mean(axis=1)[:, 0]
        + 10
        - (levels.max() + max(np.ptp(levels), simulator.noise_sd[0]))
    )
    np.testing.assert_allclose(
        scorer.score_windows(windows + 10), np.hypot(size, beyond), rtol=1e-4
    )
