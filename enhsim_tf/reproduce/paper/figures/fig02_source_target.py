"""Figure 2: pairs of training windows."""

import matplotlib.figure
import numpy as np

from enhsim_tf.common.number_words import in_words
from enhsim_tf.common.plot_style import COARSE, DOUBLE, QUIET, REAL, name_axes, new_sheet, panels
from enhsim_tf.reproduce.paper.figures.paper_figure import Arrays, PaperFigure
from enhsim_tf.reproduce.paper.figures.window_arrays import spread_windows, time_axis
from enhsim_tf.reproduce.paper.pipeline import Experiment


def arrays(experiment: Experiment) -> Arrays:
    """Pairs of training windows, coarse source and recorded target, and where in the series they begin."""
    pairs = spread_windows(experiment, "train", 3, "figure 2")
    telemetry = experiment.data.channels[0].telemetry
    begin = experiment.data.channels[0].train.time_s[pairs["offset"]]
    return {"source": pairs["coarse"], "target": pairs["target"], "begin": begin, "begin_unit": np.array(telemetry.time_unit)} | time_axis(
        experiment
    )


def draw(data: Arrays) -> matplotlib.figure.Figure:
    """Draws Figure 2."""
    figure, down = new_sheet(
        DOUBLE,
        3.1,
        "The enhancer is trained on pairs: the coarse simulation, and telemetry of the same time",
        f"{in_words(len(data['source'])).capitalize()} of the training pairs. Training windows begin at random times of the series and have the same length.",
    )
    axes = panels(figure, down + 0.2, 2, len(data["source"]), sharex=True, sharey=True)
    for column, begin in enumerate(data["begin"]):
        axes[0, column].set_title(start_of_window(float(begin), str(data["begin_unit"])), loc="right", color=QUIET, size=7)
        axes[0, column].plot(data["time"], data["source"][column], color=COARSE, linewidth=1.2)
        axes[1, column].plot(data["time"], data["target"][column], color=REAL, linewidth=0.6)
    for row, name in enumerate(("Source", "Target")):
        axes[row, 0].set_title(name, weight="bold")
    name_axes(axes, data)
    return figure


def start_of_window(begin: float, unit: str) -> str:
    """The time at which a window begins, as text."""
    if unit != "s":
        return f"begins at sample {begin:,.0f}"
    days, rest = divmod(round(begin), 86_400)
    return f"begins at {days} d {rest // 3_600:02d}:{rest // 60 % 60:02d}:{rest % 60:02d}"


FIGURE = PaperFigure(
    number=2,
    title="Training source and target time series",
    alt=("Training windows in two rows: above, the coarse simulation, a sum of square waves; below, the telemetry of the same time."),
    drawn_by=draw,
    arrays=arrays,
    stages=("telemetry",),
)
