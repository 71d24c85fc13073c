"""The figure of the study, drawn from its findings."""

from collections.abc import Mapping
from typing import Any

import matplotlib.figure
import numpy as np

from enhsim_tf.common.figure import Figure
from enhsim_tf.common.plot_style import (
    DOUBLE,
    ENHANCED,
    GENERATED,
    QUIET,
    REAL,
    new_sheet,
    panels,
)
from studies.common.figures import legend
from studies.reference_or_source.summary import COARSE, FITTED_AND_ENHANCED
from studies.reference_or_source.uses import COMMANDS, NO_SIMULATOR

SHOWN: dict[str, tuple[str, dict[str, Any]]] = {
    FITTED_AND_ENHANCED: (
        "fitted and enhanced simulator",
        {"color": ENHANCED, "linestyle": "-", "marker": "s"},
    ),
    COMMANDS: (
        "commands and their sums",
        {"color": GENERATED, "linestyle": "--", "marker": "o"},
    ),
    COARSE: ("simulator as it is", {"color": QUIET, "linestyle": ":", "marker": "D"}),
    NO_SIMULATOR: ("telemetry alone", {"color": REAL, "linestyle": "-.", "marker": "^"}),
}
_AXES = {
    "battery": ("simulated battery", "severity (share of the largest)", 1.0),
    "aircraft": ("simulated aircraft", "severity (share of the largest)", 1.0),
    "cells": ("real cells that age", "lost capacity (%)", 100.0),
}
_LEAST_CELLS = 6  # a step of loss that fewer cells reached is not drawn


def found(findings: Mapping[str, Any]) -> matplotlib.figure.Figure:
    """Share of windows found over severity, a system a panel, a use a curve."""
    systems = [name for name in _AXES if name in findings["uses"]]
    figure, down = new_sheet(
        DOUBLE,
        3.0,
        _TITLE,
        "Share of windows that are flagged, at equal false alarms (1 % in the simulated systems, "
        "5 % for the cells); means over kinds of faults and seeds, or over cells.",
    )
    grid = panels(figure, down + 0.4, 1, len(systems), gap=(0.2, 0.2), sharey=True)
    for axes, name in zip(grid[0], systems, strict=True):
        title, label, unit = _AXES[name]
        for use, (words, style) in SHOWN.items():
            course = findings["uses"][name][use]["course"]
            is_drawn = np.array(course["number"]) >= (_LEAST_CELLS if name == "cells" else 1)
            severity = unit * np.array(course["severity"])[is_drawn]
            share = 100 * np.array(course["found"])[is_drawn]
            axes.plot(
                severity, share, clip_on=False, linewidth=1.3, markersize=3.5, label=words, **style
            )
        axes.axhline(50, color=QUIET, linewidth=0.5)
        axes.set_title(title, fontsize=8)
        axes.set_xlabel(label)
        axes.set_ylim(-4, 104)
        axes.margins(x=0.06)
    grid[0, 0].set_ylabel("windows found (%)")
    legend(
        figure,
        grid[0, 0],
        (0.5, down),
        ncols=4,
        loc="upper center",
        handlelength=2.4,
        columnspacing=1.2,
        fontsize=7,
    )
    return figure


_TITLE = "A simulator beats its commands on a battery; cells leave it open"

FIGURES = {
    "found": Figure(
        32,
        "What a simulator is worth, and for what",
        "A panel for each system: the share of windows found over the severity of a fault or the "
        "loss of capacity, with a curve each for the fitted and enhanced simulator, for the "
        "commands and their sums, for the simulator as it is, and for the telemetry alone.",
        found,
    ),
}
