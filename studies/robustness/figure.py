"""The figures of the study of robustness, drawn from its findings alone."""

from collections.abc import Mapping
from typing import Any

import matplotlib.figure
import numpy as np
from matplotlib.axes import Axes

from enhsim_tf.common.figure import Figure
from enhsim_tf.common.plot_style import (
    COARSE,
    DOUBLE,
    ENHANCED,
    GENERATED,
    GREY_TINT,
    QUIET,
    REAL,
    RESIDUALS,
    RIDGE,
    new_sheet,
    panels,
)
from studies.common.figures import leave_room
from studies.robustness.degraded_modes import LARGEST_TRAINED

Findings = Mapping[str, Any]
_ROWS = {  # colour and marker of each arm
    "coarse": (COARSE, "s"),
    "truth": (COARSE, "s"),
    "enhanced": (ENHANCED, "D"),
    "enhanced + GAN": (GENERATED, "D"),
    "ridge + residual windows": (RESIDUALS, "o"),
    "real": (REAL, "o"),
}
_LEAST = 2e-4  # smaller rates are drawn here, because the axis is logarithmic


def false_alarms(found: Findings) -> matplotlib.figure.Figure:
    """False alarms by training data, a kind of noise a panel."""
    environments = found["environments"]
    columns = min(2, len(environments))
    rows = -(-len(environments) // columns)
    figure, down = new_sheet(
        DOUBLE,
        1.3 + 1.7 * rows,
        "Of simulated training data, only residual windows keep false alarms low",
        "False alarms on real nominal windows. Signals without noise (grey, blue), with the "
        "paper's GAN (orange), with residual windows (green), "
        "real telemetry (black). Large mark, bar: mean of seven detectors, 95 % interval. Small "
        "marks: each detector.",
    )
    grid = panels(figure, down + 0.22, rows, columns, gap=(0.42, 0.16), sharey=True, sharex=True)
    leave_room(grid, 1.95, 1 - 1.95 / DOUBLE - 0.04)
    for axes, name in zip(grid.ravel(), environments, strict=False):
        for height, (arm, (colour, marker)) in enumerate(_ROWS.items()):
            _row(axes, -height, found["arms"][arm]["by_environment"][name], colour, marker)
        axes.axvline(0.01, color=QUIET, linewidth=0.6, zorder=0)
        axes.set_xscale("log")
        axes.set_xlim(_LEAST * 0.8, 1.2)
        axes.set_xticks([0.001, 0.01, 0.1, 1.0], ["0.1", "1", "10", "100"])
        axes.minorticks_off()
        axes.set_title(f"{name} noise")
        axes.set_yticks(-np.arange(len(_ROWS)), list(_ROWS))
    for axes in grid[-1]:
        axes.set_xlabel("false alarms (%)")
    return figure


def _row(axes: Axes, height: float, about: Mapping[str, Any], colour: str, marker: str) -> None:
    rates = about["false_alarms"]
    each = np.maximum(list(about["detectors"].values()), _LEAST)
    axes.plot(each, np.full(len(each), height), "|", color=colour, markersize=5, alpha=0.75)
    if rates["low"] is not None:  # one seed has no interval
        interval = np.maximum([rates["low"], rates["high"]], _LEAST)
        axes.plot(interval, [height] * 2, color=colour, linewidth=2.2, alpha=0.45)
    axes.plot(max(rates["mean"], _LEAST), height, marker, color=colour, markersize=4)


_METHODS = {
    "coarse": (COARSE, "-.", "coarse"),
    "paper": (GENERATED, "--", "paper's network"),
    "ridge, faults": (RIDGE, ":", "ridge on faults"),
    "random features, faults": (ENHANCED, "-", "features on faults"),
}


def degraded_modes(found: Findings) -> matplotlib.figure.Figure:
    """Error against severity, a degraded mode a panel."""
    figure, down = new_sheet(
        DOUBLE,
        3.9,
        "Except with friction, both enhancers trained on faults beat the paper's network",
        "Root-mean-square error with respect to the true degraded signal, in standard deviations "
        "of the nominal signal; means over seeds. "
        "“On faults”: trained on random configurations of all modes, with severities in the grey "
        "area.",
    )
    curves = found["modes"]["by_mode"]
    modes = [mode for mode in curves["paper"] if mode != "nominal"]
    grid = panels(figure, down + 0.22, 2, 3, right=1.45, gap=(0.42, 0.2), sharex=True, sharey=True)
    for axes, mode in zip(grid.ravel(), modes, strict=True):
        axes.axvspan(0, LARGEST_TRAINED, color=GREY_TINT, zorder=0)
        for method, (colour, style, label) in _METHODS.items():
            errors = np.transpose(curves[method]["nominal"] + curves[method][mode])
            axes.plot(*errors, style, color=colour, label=label)
        axes.set_title(mode.replace("_", " "))
        axes.set_ylim(0, None)
        axes.set_xticks([0, 0.5, 1], ["0", "0.5", "1"])
    grid[0, -1].legend(frameon=False, loc="upper left", bbox_to_anchor=(1, 1.05))
    for axes in grid[-1]:
        axes.set_xlabel("severity")
    for axes in grid[:, 0]:
        axes.set_ylabel("error (sd)")
    return figure


FIGURES: dict[str, Figure] = {
    "false_alarms": Figure(
        1,
        "False alarms by training data",
        "A panel for each kind of noise. Six kinds of training data from top to bottom, the "
        "false-alarm rate on a logarithmic "
        "axis: a mark with an interval for the mean over detectors, a small mark for each "
        "detector, and a line at one per cent.",
        false_alarms,
    ),
    "degraded_modes": Figure(
        2,
        "Error in degraded modes",
        "Six panels, one for each degraded mode: error against severity for the coarse signal, the "
        "paper's enhancer, and ridge regression "
        "without and with random features, trained on faults; the severities of training are "
        "shaded.",
        degraded_modes,
    ),
}
"""The study's figures by name; `Figure.draw` takes the findings."""
