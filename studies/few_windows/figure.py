"""The figure of the study of few windows, drawn from its findings."""

from collections.abc import Mapping
from typing import Any

import matplotlib.figure
import matplotlib.ticker
from matplotlib.axes import Axes

from enhsim_tf.common.figure import Figure
from enhsim_tf.common.plot_style import (
    AVERAGE,
    DOUBLE,
    FOOT,
    QUIET,
    REAL,
    RESIDUALS,
    new_sheet,
    panels,
)
from studies.common.figures import legend
from studies.few_windows import record

_CURVES = {  # label, marker, line style and colour of each curve that is drawn
    record.REAL: ("the real windows alone", "|", "-", REAL),
    record.SIMULATOR + "autoregression": ("simulator + autoregression", "^", "--", AVERAGE),
    record.SIMULATOR + "residual windows": ("simulator + residual windows", "D", "-", RESIDUALS),
    record.CORAL: ("CORAL", "s", ":", QUIET),
}


def curves(found: Mapping[str, Any]) -> matplotlib.figure.Figure:
    """False alarms and recall over the number of real windows, a column for each environment."""
    environments = found["environments"]
    numbers = found["numbers"]
    figure, down = new_sheet(
        DOUBLE,
        4.6,
        "With at most 20 windows, a simulator pays if its noise fits",
        "Detectors trained on k real windows, or on a simulator fitted to the same k windows. Mean "
        "over four detectors and the seeds. Above: "
        "nominal windows that are flagged; the line is the target of 1 %; the scale is linear "
        "below it. Below: anomalies of 4 standard deviations "
        "found at 1 % false alarms.",
    )
    grid = panels(
        figure, down + 0.45, 2, len(environments), gap=(0.3, 0.2), sharex=True, sharey="row"
    )
    for (name, about), (upper, lower) in zip(environments.items(), grid.T, strict=True):
        for arm, (label, marker, line, colour) in _CURVES.items():
            curve = about["arms"][arm]
            at = [number for number in numbers if str(number) in curve["rate"]]
            style = {
                "marker": marker,
                "linestyle": line,
                "color": colour,
                "markersize": 3.5,
                "linewidth": 1.0,
                "markerfacecolor": "none",
            }
            upper.plot(
                at, [100 * curve["rate"][str(number)] for number in at], label=label, **style
            )
            lower.plot(
                at, [100 * curve["recall_at_real_rate"][str(number)] for number in at], **style
            )
        _finish(upper, lower, numbers, name)
    grid[0, 0].set_ylabel("false alarms (%)")
    grid[1, 0].set_ylabel("recall (%)")
    legend(figure, grid[0, 0], (0.07, down - 0.02), ncols=4, loc="upper left")
    figure.text(
        0.53,
        (FOOT + 0.02) / figure.get_size_inches()[1],
        "number of real windows k (disjoint; logarithmic)",
        ha="center",
    )
    return figure


def _finish(upper: Axes, lower: Axes, numbers: list[int], name: str) -> None:
    upper.axhline(1, color=QUIET, linewidth=0.6, zorder=0)
    upper.set_title(name, loc="left")
    upper.set_yscale("symlog", linthresh=1)
    upper.set_ylim(0, 110)
    ticks = [0, 0.5, 1, 2, 5, 10, 20, 50, 100]
    upper.set_yticks(ticks, map(str, ticks))
    upper.yaxis.set_minor_locator(matplotlib.ticker.NullLocator())
    lower.set_ylim(0, 100)
    lower.set_xscale("log")
    lower.set_xlim(numbers[0] / 1.25, numbers[-1] * 1.25)
    shown = [number for number in numbers if number in (10, 100, 1_000, 10_000)] or numbers
    lower.set_xticks(shown, [f"{number:,}" for number in shown], fontsize=7)
    lower.xaxis.set_minor_locator(matplotlib.ticker.NullLocator())


FIGURES = {
    "learning_curve": Figure(
        18,
        "How few real windows suffice",
        "False alarms and recall over the number of real windows, a column for each kind of noise "
        "and a line for each kind of training data.",
        curves,
    ),
}
