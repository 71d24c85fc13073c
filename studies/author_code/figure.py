"""The figure of the study: measurements over seeds, of the author's code and of this project."""

import matplotlib.figure
import pandas as pd

from enhsim_tf.common.figure import Figure
from enhsim_tf.common.plot_style import DOUBLE, ENHANCED, GENERATED, new_sheet, panels
from studies.author_code.summary import READING_OF, words_of
from studies.common.figures import leave_room

SHOWN = {
    ("C5", "late_accuracy"): "accuracy",
    ("C6", "auc_over_floor"): "AUC − floor",
    ("C6", "scale_difference"): "log ratio of sd",
    ("C6", "lag_one_error"): "error of lag 1",
    ("C6", "rank_ratio"): "share of rank",
}
STYLES = {"his": (GENERATED, "o", -0.12), "ours": (ENHANCED, "s", 0.12)}


def draw(data: dict) -> matplotlib.figure.Figure:
    """Draws the values that `summary.pairs` returns, under `pairs`."""
    values: pd.DataFrame = data["pairs"]
    kinds = [kind for kind in READING_OF if kind in set(values["kind"])]
    figure, down = new_sheet(
        DOUBLE,
        1.7 + 0.3 * len(kinds),
        "The author's code makes noise like this project's",
        "Circles: the author's code. Squares: this project in his configuration. Each mark is a "
        "run with another seed.",
    )
    grid = panels(figure, down + 0.25, 1, len(SHOWN), sharey=True)
    leave_room(grid, 1.75, 1 - 1.75 / DOUBLE - 0.02, gap=0.025)
    for axes, ((claim, name), title) in zip(grid[0], SHOWN.items(), strict=True):
        chosen = values[(values["claim"] == claim) & (values["name"] == name)]
        for whose, (color, marker, shift) in STYLES.items():
            part = chosen[chosen["whose"] == whose]
            heights = [-kinds.index(kind) - shift for kind in part["kind"]]
            axes.scatter(part["value"], heights, s=14, color=color, marker=marker, alpha=0.8)
        axes.set_title(title, loc="left", fontsize=8)
        axes.set(xlim=(0, 1.15 * chosen["value"].max()), ylim=(0.5 - len(kinds), 0.5))
        axes.tick_params(labelleft=axes is grid[0, 0])
    grid[0, 0].set_yticks([-place for place in range(len(kinds))], map(words_of, kinds))
    return figure


FIGURES = {
    "beside": Figure(
        1,
        "The author's code beside this project in his configuration",
        "Dots of five measurements over seeds, for each kind of run, his and ours.",
        draw,
    )
}
