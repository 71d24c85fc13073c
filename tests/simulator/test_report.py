import dataclasses
import json

import numpy as np
import pytest

from enhsim_tf.simulator.figures import report_figure, score_figure
from enhsim_tf.simulator.report import correlation_of
from enhsim_tf.simulator.scoring import score
from tests.simulator.conftest import joint


@pytest.mark.parametrize("kind", ["single", "both", "of_run"])
def test_reports_are_plain_json_and_a_broken_promise_comes_first(kind, request):
    report = request.getfixturevalue(kind)[1]
    assert json.loads(json.dumps(report.to_dict(), allow_nan=False)) == report.to_dict()
    assert "WARNING" in dataclasses.replace(report, keeps_promise=False).lines()[0] and "WARNING" not in report.lines()[0]


def test_correlations_by_hand():
    windows = np.array([[[1.0, 2.0, 5.0], [2.0, 4.0, 5.0], [3.0, 6.0, 5.0]]])
    np.testing.assert_allclose(correlation_of(windows), [[1, 1, 0], [1, 1, 0], [0, 0, 0]], atol=1e-12)


def test_figures_show_every_channel(both):
    drawn = report_figure(both[1])
    assert len(drawn.axes) == 6  # two of each channel, and two of the detectors
    np.testing.assert_array_equal(drawn.axes[0].lines[0].get_ydata(), both[1].examples["real"][:, 0])
    scores = score_figure(score(both[0], joint(seed=3)), both[0], "pair")
    assert len(scores.axes) == 3 and len(scores.axes[0].lines[0].get_xdata()) == 3_000
