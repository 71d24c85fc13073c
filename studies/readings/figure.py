"""The figure of the study: claims by readings, with the share of runs that has each verdict."""

import matplotlib.figure
import pandas as pd

from enhsim_tf.common.figure import Figure
from enhsim_tf.common.plot_style import DOUBLE, LINE, QUIET, REAL, new_sheet, panels
from enhsim_tf.paper.claims import CLAIMS, NOT_REPRODUCED, PARTLY, REPRODUCED
from studies.readings.run import READINGS

COLORS = {REPRODUCED: "#0b5a38", PARTLY: "#e0a93a", NOT_REPRODUCED: "#f3c9c3"}
"""From dark to light, so that they stay apart in grey."""


def draw(data: dict) -> matplotlib.figure.Figure:
    """Draws the shares that `summary.shares` returns, under `shares`."""
    shares: pd.DataFrame = data["shares"]
    figure, down = new_sheet(
        DOUBLE,
        3.6,
        "C6 fails in nearly all runs; C4 and C5 turn",
        "Share of runs; empty where a reading changes nothing.",
    )
    axes = panels(figure, down + 0.35, 1, 1, right=0.1)[0, 0]
    box = axes.get_position()
    axes.set_position((0.27, box.y0 - 0.06, 0.71, box.height + 0.06))
    readings = list(READINGS)
    for row in shares.itertuples(index=False):
        part = shares[(shares["reading"] == row.reading) & (shares["claim"] == row.claim)]
        before = sum(
            part.loc[part["verdict"] == verdict, "share"].sum()
            for verdict in list(COLORS)[: list(COLORS).index(row.verdict)]
        )
        left = int(row.claim[1]) - 1 + 0.86 * before
        axes.barh(
            readings.index(row.reading),
            0.86 * row.share,
            left=left,
            height=0.7,
            color=COLORS[row.verdict],
            edgecolor=LINE,
            linewidth=0.3,
        )
    axes.set_yticks(range(len(readings)), readings)
    axes.set_xticks(
        [number + 0.43 for number in range(len(CLAIMS))], [claim.id for claim in CLAIMS]
    )
    axes.set(xlim=(-0.05, len(CLAIMS)), ylim=(len(readings) - 0.4, -0.6))
    axes.tick_params(length=0, labelcolor=REAL)
    axes.spines[["left", "bottom"]].set_visible(False)
    for number, (verdict, color) in enumerate(COLORS.items()):
        axes.scatter(
            1 + 2.5 * number,
            -1.05,
            s=36,
            marker="s",
            color=color,
            edgecolor=LINE,
            linewidth=0.3,
            clip_on=False,
        )
        axes.text(1.2 + 2.5 * number, -1.05, verdict, va="center", color=QUIET)
    return figure


FIGURES = {
    "verdicts": Figure(
        1,
        "Verdicts on each claim by reading of the paper",
        "Grid of claims by readings; each cell shows the shares of runs in which the claim is reproduced, partly, and not.",
        draw,
    )
}
