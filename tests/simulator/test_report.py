import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from enhsim_tf.simulator import figures
from enhsim_tf.simulator.figures import inject_figure, report_figure, score_figure
from enhsim_tf.simulator.report import correlation_of
from enhsim_tf.simulator.scoring import score
from enhsim_tf.telemetry.placing import PlacedEvent
from tests.simulator.conftest import joint


@pytest.mark.parametrize("kind", ["single", "both", "of_run"])
def test_reports_are_plain_json_and_a_broken_promise_comes_first(kind, request):
    report = request.getfixturevalue(kind)[1]
    assert json.loads(json.dumps(report.to_dict(), allow_nan=False)) == report.to_dict()
    assert (
        "WARNING" in dataclasses.replace(report, keeps_promise=False).lines()[0]
        and "WARNING" not in report.lines()[0]
    )


@pytest.mark.parametrize(("recall", "warns"), [(0.29, True), (0.3, False)])
def test_a_detector_that_finds_little_is_a_warning_and_comes_first(single, recall, warns):
    judged = [
        each | {"recall": recall if each["name"] == single[1].detector else 0.9}
        for each in single[1].detectors
    ]
    first = dataclasses.replace(single[1], detectors=judged).lines()[0]
    assert (
        f"WARNING: {single[1].detector}, the detector that score uses, finds only 29% of the injected"
        in first
    ) == warns


def test_correlations_by_hand():
    windows = np.array([[[1.0, 2.0, 5.0], [2.0, 4.0, 5.0], [3.0, 6.0, 5.0]]])
    np.testing.assert_allclose(
        correlation_of(windows), [[1, 1, 0], [1, 1, 0], [0, 0, 0]], atol=1e-12
    )


def test_figures_show_every_channel(both):
    drawn = report_figure(both[1])
    assert len(drawn.axes) == 6  # two of each channel, and two of the detectors
    np.testing.assert_array_equal(
        drawn.axes[0].lines[0].get_ydata(), both[1].examples["real"][:, 0]
    )
    scores = score_figure(score(both[0], joint(seed=3)), both[0], "pair")
    assert len(scores.axes) == 3 and len(scores.axes[0].lines[0].get_xdata()) == 3_000


@pytest.mark.parametrize(
    ("most", "drawn"),
    [
        (4_000, [*range(6), np.nan, *range(6, 10)]),
        (
            4,
            [0, 4, 5, 5, np.nan, 6, 9],
        ),  # lowest and highest value of the samples 0 to 4, 5, and 6 to 9
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
    one, two, three, four = ((-1.0) ** (np.arange(16) // each) for each in (1, 2, 4, 8))
    nominal = np.stack(
        [one, one + 0.1 * two, three, four], axis=1
    )  # "b" follows "a" to within 0.1, the others are apart
    away = np.outer(flag, [1, -1, 2, 3]) + np.outer(
        ~flag, [0, 0, 9, 9]
    )  # 1.99**2 / 0.0099, 2**2 / 0.01, 2**2 and 3**2 where it is flagged
    values = np.arange(10.0)[:, None] * np.ones(4)
    frame = pd.DataFrame(values, times, names).join(
        pd.DataFrame(values - away, times, [f"enhanced {name}" for name in names])
    )
    frame = frame.assign(score=np.where(np.arange(10) < 8, 2.0 * flag, np.nan), flag=flag)
    event = {
        "begin": 0,
        "end": 4,
        "peak": 0,
        "duration_s": 40.0,
        "num_flagged": 4,
        "score": 2.0,
        "confidence": 0.9,
    }
    frame.attrs = {"detector": "residual", "counts": False, "events": [event]}
    simulator = SimpleNamespace(
        channels=names,
        is_run_model=True,
        nominal="",
        nominal_run="",
        judged_series=lambda *given: [nominal],
    )
    sheet = score_figure(frame, simulator, "four")
    assert [axes.get_ylabel() for axes in sheet.axes] == ["a", "b", "d", "score"]
    np.testing.assert_array_equal(sheet.axes[0].lines[0].get_ydata(), drawn)
    said = " ".join(text.get_text() for text in sheet.texts)
    assert "1 event, 50.0% of scored samples flagged" in said and "the 3 of 4 channels" in said


def test_a_figure_of_anomalies_shades_and_names_them_in_the_channels_that_they_change():
    frame = pd.DataFrame(np.ones((6, 3)), [0, 1, 2, 10, 11, 12], ["a", "b", "c"]).assign(mask=True)
    frame.attrs = {
        "counts": False,
        "anomalies": [
            PlacedEvent("delay", 1, 0, 1, "a"),
            PlacedEvent("another_time", 1, 2, 1, "c"),
        ],
    }
    sheet = inject_figure(frame, ["a", "b", "c"])
    drawn = [
        (axes.get_ylabel(), *((each.get_x(), each.get_width()) for each in axes.patches))
        for axes in sheet.axes
    ]
    assert drawn == [("a", (0, 1)), ("c", (2, 1))]  # not up to 10, which comes after the gap
    assert [[each.get_text() for each in axes.texts] for axes in sheet.axes] == [
        ["delay"],
        ["another_time"],
    ]
    frame.attrs["anomalies"] = [PlacedEvent("common_shift", 4, each % 6, 1) for each in range(21)]
    sheet = inject_figure(frame, ["a", "b", "c"])
    assert [len(axes.patches) for axes in sheet.axes] == [21] * 3 and not any(
        axes.texts for axes in sheet.axes
    )
