"""The figure of the study: verdicts on each claim against the factor of all limits."""

import matplotlib.figure
import pandas as pd

from enhsim_tf.common.figure import Figure
from enhsim_tf.common.plot_style import DOUBLE, EDGE, LINE, QUIET, REAL, new_sheet, panels
from enhsim_tf.paper.claims import CLAIMS, NOT_REPRODUCED, PARTLY, REPRODUCED
from studies.readings.run import DECIDING

MESSAGE = "With limits halved or doubled, C6, C8 and C9 still fail"
COLORS = {REPRODUCED: "#0b5a38", PARTLY: "#e0a93a", NOT_REPRODUCED: "#f3c9c3"}
"""From dark to light, so that they stay apart in grey."""


def draw(data: dict) -> matplotlib.figure.Figure:
    """Draws the shares that `summary.shares` returns, under `shares`."""
    shares: pd.DataFrame = data["shares"]
    figure, down = new_sheet(
        DOUBLE,
        5.2,
        MESSAGE,
        "Shares of runs with each verdict over the factor by which the distances of all limits "
        "from "
        f"the ideal are multiplied: {data['basis']}.",
    )
    axes = panels(figure, down + 0.45, len(CLAIMS), 3, gap=(0.07, 0.2), sharex=True, sharey=True)
    for column, name in enumerate(DECIDING):
        axes[0, column].set_title(name, loc="left", weight="bold")
        for row, claim in enumerate(CLAIMS):
            panel = axes[row, column]
            chosen = (shares["column"] == name) & (shares["claim"] == claim.id)
            part = shares[chosen]
            panel.stackplot(
                part["factor"],
                *(part[verdict] for verdict in COLORS),
                colors=COLORS.values(),
                linewidth=0,
                step="mid",
            )
            for factor in (0.5, 1, 2):
                style = "-" if factor == 1 else ":"
                panel.axvline(factor, color=LINE, linewidth=0.8, linestyle=style)
            panel.set(xscale="log", xlim=(0.25, 4), ylim=(0, 1), yticks=[])
            if not column:
                panel.set_ylabel(claim.id, rotation=0, ha="right", va="center", color=REAL)
        axes[-1, column].set_xticks([0.25, 0.5, 1, 2, 4], ["¼", "½", "1", "2", "4"])
        axes[-1, column].minorticks_off()
        axes[-1, column].set_xlabel("factor of all limits")
    width, height = figure.get_size_inches()
    for number, (verdict, color) in enumerate(COLORS.items()):
        x = EDGE + 1.1 * number
        y = height - down - 0.16
        figure.text(x / width, y / height, "■", color=color, size=9)
        figure.text((x + 0.14) / width, y / height, verdict, color=QUIET, size=7.5)
    return figure


FIGURES = {
    "verdicts": Figure(
        1,
        "Verdicts on each claim against the factor of all limits",
        "For each claim and both columns, the shares of runs in which it is reproduced, "
        "partly, and "
        "not, over the factor by which the distances of all limits are multiplied.",
        draw,
    )
}
