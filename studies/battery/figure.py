"""The figure of the study, drawn from its findings."""

from collections.abc import Mapping
from typing import Any

import matplotlib.figure
import numpy as np

from enhsim_tf.common.figure import Figure
from enhsim_tf.common.plot_style import DOUBLE, ENHANCED, GENERATED, QUIET, REAL, new_sheet, panels
from studies.battery.detectors import COARSE_RUN, ENHANCED_RUN, REAL_120, WITH_RESIDUALS
from studies.common.faults import SEVERITIES
from studies.common.figures import legend

SHOWN: dict[str, tuple[str, dict[str, Any]]] = {
    ENHANCED_RUN: (
        "enhanced run as reference",
        {"color": ENHANCED, "linestyle": "-", "marker": "s"},
    ),
    COARSE_RUN: ("coarse run as reference", {"color": QUIET, "linestyle": ":", "marker": "D"}),
    WITH_RESIDUALS: (
        "detectors trained on enhanced windows",
        {"color": GENERATED, "linestyle": "--", "marker": "o"},
    ),
    REAL_120: (
        "detectors trained on as many real orbits",
        {"color": REAL, "linestyle": "-", "marker": None},
    ),
}
"""For each curve its name and its style."""


def reference_or_source(found: Mapping[str, Any]) -> matplotlib.figure.Figure:
    """Recall by fault and severity of references and of trained detectors, a regime a row and a
    fault a column.
    """
    regimes = found["regimes"]
    kinds = list(next(iter(regimes.values()))["uses"][ENHANCED_RUN]["by_fault"])
    figure, down = new_sheet(
        DOUBLE,
        4.5,
        "The enhanced run finds most faults, trained detectors few",
        "Share of windows with an alarm, at thresholds that are set for 1 % false alarms. Means "
        "over seeds and detectors; severity 1 is the largest.",
    )
    grid = panels(
        figure, down + 0.55, len(regimes), len(kinds), gap=(0.2, 0.12), sharex=True, sharey=True
    )
    for row, (regime, about) in zip(grid, regimes.items(), strict=True):
        for axes, kind in zip(row, kinds, strict=True):
            for use, (label, style) in SHOWN.items():
                values = 100 * np.array(about["uses"][use]["by_fault"][kind])
                axes.plot(SEVERITIES, values, markersize=3, linewidth=1.2, label=label, **style)
            axes.set_ylim(-4, 104)
            axes.set_xlim(0.12, 1.08)
            axes.set_xticks((0.2, 0.6, 1.0))
        row[0].set_ylabel(f"{regime}: found (%)")
    for axes, kind in zip(grid[0], kinds, strict=True):
        axes.set_title(kind, weight="bold", fontsize=7.5)
    for axes in grid[-1]:
        axes.set_xlabel("severity")
    legend(figure, grid[0, 0], (0.5, down), ncols=2, loc="upper center", handlelength=2.6)
    return figure


FIGURES = {
    "reference_or_source": Figure(
        31,
        "Faults of the battery that are found",
        "A row of panels for each regime and a column for each fault: the share of windows with an "
        "alarm over the severity, with a curve each "
        "for the enhanced and the coarse run as reference and for detectors trained on enhanced "
        "windows and on real orbits.",
        reference_or_source,
    ),
}
