"""The figure of the study, drawn from its findings."""

from collections.abc import Mapping
from typing import Any

import matplotlib.figure

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
from studies.common.figures import leave_room
from studies.public_benchmarks.arms import CHOSEN, DIFFERENCE, TELEMETRY
from studies.public_benchmarks.arms import GENERATED as GENERATED_VIEWS
from studies.public_benchmarks.peers import PEERS, RANDOM

ROWS = {
    TELEMETRY: (REAL, "s"),
    DIFFERENCE: (ENHANCED, "s"),
    GENERATED_VIEWS: (GENERATED, "s"),
    CHOSEN: (REAL, "D"),
    **dict.fromkeys((*PEERS, RANDOM), (QUIET, "D")),
}
"""Methods from top to bottom, with their colours and marks."""


def areas(found: Mapping[str, Any]) -> matplotlib.figure.Figure:
    """AUC-PR of all methods with intervals, a panel for each group of series."""
    groups = found["groups"]
    figure, down = new_sheet(
        DOUBLE,
        1.5 + 0.19 * len(ROWS),
        "A fitted simulator adds nothing; views lead or tie with the best peer",
        "Area under the precision-recall curve (AUC-PR) of labelled samples: mean and 95 % "
        "interval over series. Squares: the same views in three uses. Diamonds: views and other "
        "detectors, with settings chosen on other series. Line: these views.",
    )
    grid = panels(figure, down + 0.25, 1, len(groups), sharey=True)
    leave_room(grid, 1.95, 1 - 2.1 / DOUBLE)
    names = [name for name in ROWS if name in next(iter(groups.values()))["methods"]]
    for axes, (title, group) in zip(grid[0], groups.items(), strict=True):
        for height, name in enumerate(names):
            colour, mark = ROWS[name]
            area = group["methods"][name]["auc_pr"]
            if area["low"] is not None:
                axes.plot(
                    [area["low"], area["high"]],
                    [-height] * 2,
                    color=colour,
                    linewidth=2.2,
                    alpha=0.45,
                )
            axes.plot(area["mean"], -height, mark, color=colour, markersize=4.5)
        best = group["methods"][CHOSEN]["auc_pr"]["mean"]
        axes.axvline(best, color=QUIET, linewidth=0.6, zorder=0)
        axes.set_title(f"{title} ({group['series']} series)", loc="left", fontsize=8)
        axes.set_xlabel("AUC-PR")
        axes.set_xlim(-0.03, 1.03)
        axes.tick_params(labelleft=axes is grid[0, 0])
    grid[0, 0].set_yticks([-height for height in range(len(names))], names)
    return figure


FIGURES = {
    "areas": Figure(
        21,
        "Views and peers on public telemetry",
        "A panel for each group of series, with a row for the views in each of three uses, for "
        "each "
        "peer and for random scores: a mark at the mean area under the precision-recall curve, and "
        "a line for its interval.",
        areas,
    ),
}
