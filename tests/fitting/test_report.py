import dataclasses
import json

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.datasets.figure import inject_figure
from enhsim_tf.datasets.inject import Injected
from enhsim_tf.fitting.figure import report_figure
from enhsim_tf.fitting.fit import fit
from enhsim_tf.fitting.report import alarms_of, correlation_of
from enhsim_tf.scoring import figure as figures
from enhsim_tf.scoring.events import Event
from enhsim_tf.scoring.figure import score_figure
from enhsim_tf.scoring.score import ScoredTelemetry, score
from enhsim_tf.scoring.scorer import Scorer
from enhsim_tf.scoring.views import VIEWS
from enhsim_tf.telemetry.placing import PlacedEvent
from enhsim_tf.telemetry.series import Clock
from tests.fitted_simulators import QUICK, coarse_run, joint, recorded, series


@pytest.mark.parametrize("kind", ["single", "both", "of_run"])
def test_reports_are_plain_json_and_many_false_alarms_come_first(kind, request):
    report = request.getfixturevalue(kind)[1]
    assert json.loads(json.dumps(report.to_dict(), allow_nan=False)) == report.to_dict()
    assert "WARNING" in dataclasses.replace(report, false_alarms=0.11).lines()[0]
    assert "WARNING" not in report.lines()[0]


def test_alarms_are_counted_on_held_out_time_by_views_that_have_not_learnt_it():
    rng = np.random.default_rng(0)
    learnt, same = rng.standard_normal((2, 6_400, 1)).astype(np.float32)
    scorer = Scorer([learnt])
    share, views = alarms_of(scorer, [same])
    assert share < 0.05 and list(views) == list(VIEWS) and max(views.values()) < 0.05
    # a quarter of the time has another level
    higher = same + 3 * (np.arange(6_400) >= 4_800)[:, None].astype(np.float32)
    share, views = alarms_of(scorer, [higher])
    assert share == pytest.approx(0.25, abs=0.03) and views["level"] > 0.2 > 0.05 > views["shape"]
    share, views = alarms_of(scorer)
    assert share <= 0.01 and not views


def test_an_end_without_a_window_of_the_views_is_not_said_to_be_held_out():
    short = dataclasses.replace(QUICK, window=32, held_out=0.02)
    assert not fit(series(), options=short)[1].is_held_out  # 60 samples; views have 64
    assert fit(series(), options=dataclasses.replace(short, held_out=0.03))[1].is_held_out


def test_the_shown_window_does_not_depend_on_the_unit_of_a_channel():
    quick = dataclasses.replace(QUICK, num_windows=100)
    shown = []
    for unit in (1, 2**-20):
        telemetry = recorded(joint(1_500).values * (1, unit), ("a", "b"))
        shown.append(fit(telemetry, options=quick)[1].examples["real"][:, 0])
    np.testing.assert_array_equal(*shown)


def test_the_report_says_the_rate_that_a_short_series_allows():
    simulator, report = fit(series(1_000), options=QUICK)
    rate = score(simulator, series(1_000)).false_alarm_rate
    assert report.set_for == rate > 0.02
    assert any(f"set for {100 * rate:.2g}%" in line for line in report.lines())


def test_the_enhanced_signal_is_drawn_whatever_the_channels_are_called():
    telemetry = recorded(joint(seed=1).values, ("value", "enhanced"))
    simulator, _ = fit(telemetry, coarse_run(), options=QUICK)
    *channels, _ = score_figure(score(simulator, telemetry, coarse_run()), "pair").axes
    assert [len(axes.lines) for axes in channels] == [2, 2]


def test_correlations_by_hand():
    windows = np.array([[[1.0, 2.0, 5.0], [2.0, 4.0, 5.0], [3.0, 6.0, 5.0]]])
    np.testing.assert_allclose(
        correlation_of(windows), [[1, 1, 0], [1, 1, 0], [0, 0, 0]], atol=1e-12
    )


def test_figures_show_every_channel(both):
    drawn = report_figure(both[1])
    assert len(drawn.axes) == 4  # two of each channel
    np.testing.assert_array_equal(
        drawn.axes[0].lines[0].get_ydata(), both[1].examples["real"][:, 0]
    )
    scores = score_figure(score(both[0], joint(seed=3)), "pair")
    assert len(scores.axes) == 3 and len(scores.axes[0].lines[0].get_xdata()) == 3_000


@pytest.mark.parametrize(
    ("most", "drawn"),
    [
        (4_000, [*range(6), np.nan, *range(6, 10)]),
        # lowest and highest value of the samples 0 to 4, 5, and 6 to 9
        (4, [0, 4, 5, 5, np.nan, 6, 9]),
    ],
)
def test_a_figure_of_scores_breaks_at_gaps_and_shows_the_channels_that_depart_most(
    monkeypatch, most, drawn
):
    monkeypatch.setattr(figures, "_MOST_POINTS", most)
    names, flag = ["a", "b", "c", "d"], np.arange(10) < 4
    times = pd.Timestamp("2024-01-01", tz="UTC") + pd.to_timedelta(
        [*range(0, 60, 10), *range(160, 200, 10)], unit="s"
    )
    values = np.arange(10.0)[:, None] * np.ones(4)
    frame = pd.DataFrame(values, times, names)
    frame = frame.assign(score=np.where(np.arange(10) < 8, 2.0 * flag, np.nan), flag=flag)
    event = Event(0, 4, 3, 0, 4, 2.0, 0.9, "learnt", ("level", "step"), ("d", "b"))
    columns = {name: name for name in names}
    scored = ScoredTelemetry(frame, columns, (event,), 16, Clock.of(10.0, "2024-01-01"))
    sheet = score_figure(scored, "four")
    assert [axes.get_ylabel() for axes in sheet.axes] == ["a", "b", "d", "score"]
    np.testing.assert_array_equal(sheet.axes[0].lines[0].get_ydata(), drawn)


def test_a_figure_of_anomalies_shades_and_names_them_in_the_channels_that_they_change():
    frame = pd.DataFrame(np.ones((6, 3)), [0, 1, 2, 10, 11, 12], ["a", "b", "c"]).assign(mask=True)
    anomalies = PlacedEvent("delay", 1, 0, 1, "a"), PlacedEvent("another_time", 1, 2, 1, "c")
    injected = Injected(frame, anomalies, (1.0, 1.0, 1.0), Clock())
    sheet = inject_figure(injected, ["a", "b", "c"])
    drawn = {
        axes.get_ylabel(): [(patch.get_x(), patch.get_width()) for patch in axes.patches]
        for axes in sheet.axes
    }
    assert drawn == {"a": [(0, 1)], "c": [(2, 1)]}  # not up to 10, which comes after the gap
    assert [axes.texts[0].get_text() for axes in sheet.axes] == ["delay", "another_time"]
