"""The figures of the study, drawn from its findings."""

from collections.abc import Mapping
from typing import Any

import matplotlib.figure
import numpy as np

from enhsim_tf.common.figure import Figure
from enhsim_tf.common.plot_style import (
    COARSE,
    DOUBLE,
    ENHANCED,
    GENERATED,
    QUIET,
    REAL,
    RIDGE,
    SINGLE,
    new_sheet,
    panels,
)

Findings = Mapping[str, Any]
GROUPS = {"references": (ENHANCED, "s"), "controls": (QUIET, "D"), "sources": (GENERATED, "o")}
"""Groups of rows of the leading figure, with their colour and mark."""


def reference_or_source(found: Findings) -> matplotlib.figure.Figure:
    """Area under the precision-recall curve and false alarms of references, of controls and of detectors by training data."""
    names = [(group, name) for group in GROUPS for name in found[group]]
    figure, down = new_sheet(
        DOUBLE,
        1.5 + 0.19 * len(names),
        "References rank anomalies best, with wide intervals",
        "Six spacecraft channels. Mean and 95 % interval over channels and seeds. Squares: residual of the aligned simulator. Diamonds: no simulator. "
        "Circles: mean of seven detectors, by their training data (black: real telemetry).",
    )
    grid = panels(figure, down + 0.1, 1, 2, sharey=True)
    left, width = 1.95 / DOUBLE, (1 - 2.1 / DOUBLE) / 2
    values = (
        ("auc_pr", 1, "AUC-PR of labelled samples"),
        ("false_alarms", 100, "false alarms at own threshold (%)"),
    )
    for number, (axes, (key, unit, label)) in enumerate(zip(grid[0], values, strict=True)):
        place = axes.get_position()
        axes.set_position([left + number * width, place.y0, width - 0.03, place.height])
        for height, (group, name) in enumerate(names):
            colour, mark = GROUPS[group]
            colour = REAL if name == "real" else colour
            each = {end: unit * value for end, value in found[group][name][key].items()}
            axes.plot(
                [each["low"], each["high"]], [-height] * 2, color=colour, linewidth=2.2, alpha=0.45
            )
            axes.plot(each["mean"], -height, mark, color=colour, markersize=4.5)
        axes.set_xlabel(label)
        axes.set_xlim(-0.03 * unit, 1.03 * unit)
    grid[0, 1].axvline(
        1, color=QUIET, linewidth=0.6, zorder=0
    )  # the rate that thresholds are set for
    grid[0, 0].set_yticks(-np.arange(len(names)), [name for _, name in names])
    grid[0, 1].tick_params(labelleft=False)
    return figure


def errors(found: Findings) -> matplotlib.figure.Figure:
    """Error of the coarse signal, ridge regression and the enhanced signal on nominal test windows, one row per channel."""
    channels = found["channels"]
    figure, down = new_sheet(
        SINGLE,
        1.9 + 0.2 * len(channels),
        "Both enhancers beat the square wave",
        "Spacecraft channels: median error of nominal test windows, aligned in phase, offset and gain.",
    )
    axes = panels(figure, down + 0.3, 1, 1)[0, 0]
    marks = (
        ("coarse", "s", COARSE, 0.0),
        ("enhanced", "o", ENHANCED, 0.12),
        ("ridge", "^", RIDGE, -0.12),
    )
    for method, mark, colour, beside in marks:
        values = [about["nrmse"][method] for about in channels.values()]
        axes.plot(
            values, beside - np.arange(len(values)), mark, color=colour, markersize=5, label=method
        )
    axes.set_yticks(-np.arange(len(channels)), list(channels))
    axes.set_xlim(0, 1.08 * max(max(about["nrmse"].values()) for about in channels.values()))
    axes.set_xlabel("NRMSE (in standard deviations of the window)")
    axes.legend(
        frameon=False,
        ncols=3,
        loc="lower left",
        bbox_to_anchor=(-0.05, 1.0),
        handletextpad=0.2,
        columnspacing=1.0,
    )
    return figure


FIGURES = {
    "reference_or_source": Figure(
        15,
        "Detectors on real telemetry",
        "Two panels with a row for each reference, each detector without a simulator and each kind of training data. Left: the area under the "
        "precision-recall curve, with its interval. Right: the false alarms on nominal test windows at the detector's own threshold.",
        reference_or_source,
    ),
    "errors": Figure(
        16,
        "Enhancement of real telemetry",
        "A row for each channel with three marks: the median error of the coarse signal, of ridge regression and of the enhanced signal on "
        "nominal test windows.",
        errors,
    ),
}
