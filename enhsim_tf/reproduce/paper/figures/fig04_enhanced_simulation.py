"""Figure 4: the enhanced signal beside the coarse simulation and the true signal."""

import matplotlib.figure
import numpy as np

from enhsim_tf.common.plot_style import COARSE, DASHED, DOUBLE, ENHANCED, LINE, REAL, beside, label_ends, name_axes, new_sheet, panels
from enhsim_tf.realism.measures import nrmse
from enhsim_tf.reproduce.paper.figures.paper_figure import Arrays, PaperFigure
from enhsim_tf.reproduce.paper.figures.window_arrays import spread_windows, time_axis
from enhsim_tf.reproduce.paper.pipeline import Experiment


def arrays(experiment: Experiment) -> Arrays:
    """A held-out window, coarse and enhanced, beside the truth, and the errors over all test windows."""
    window = {key: values[0] for key, values in spread_windows(experiment, "test", 1, "figure 4").items()}
    enhanced = experiment.simulator.enhance(window["coarse"][None])[0]
    errors = {key: experiment.enhancement[key] for key in ("nrmse", "identity_nrmse", "ridge_nrmse")}
    shown = {key: window[key] for key in ("coarse", "truth")} | {"enhanced": enhanced}
    return shown | errors | time_axis(experiment) | {"truth_is_known": np.array(experiment.data.channels[0].truth is not None)}


def draw(data: Arrays) -> matplotlib.figure.Figure:
    """Draws Figure 4."""
    before, after, ridge = (float(data[key]) for key in ("identity_nrmse", "nrmse", "ridge_nrmse"))
    verb = "reduces" if after < before else "increases"
    truth = "true signal" if data["truth_is_known"] else "telemetry"
    shown = [nrmse(data[key], data["truth"]) for key in ("coarse", "enhanced")]
    figure, down = new_sheet(
        DOUBLE,
        3.6,
        f"The enhancer {verb} the error of the coarse simulation from {before:.2f} to {after:.2f}",
        f"Error: root-mean-square error over all held-out windows, divided by the standard deviation of the {truth} (NRMSE); {ridge:.2f} for ridge "
        f"regression. In the window shown: {shown[0]:.2f} coarse, {shown[1]:.2f} enhanced.",
    )
    above, below = panels(figure, down + 0.1, 2, 1, right=0.85, height_ratios=(3, 1), sharex=True)[:, 0]
    above.plot(data["time"], data["coarse"], color=COARSE, linewidth=1.2)
    above.plot(data["time"], data["enhanced"], color=ENHANCED, linewidth=1.4)
    above.plot(data["time"], data["truth"], color=REAL, linewidth=0.8, linestyle=DASHED if data["truth_is_known"] else "-")
    label_ends(above, {"coarse": (data["coarse"], COARSE), "enhanced": (data["enhanced"], ENHANCED), truth: (data["truth"], REAL)})
    below.axhline(0, color=LINE, linewidth=0.6)
    below.plot(data["time"], data["enhanced"] - data["truth"], color=ENHANCED, linewidth=0.8)
    beside(below, 0.5, f"enhanced\n− {truth}", ENHANCED)
    name_axes(np.array([[above], [below]]), data)
    return figure


FIGURE = PaperFigure(
    number=4,
    title="Enhanced simulation",
    alt=(
        "One held-out window: the stepped coarse simulation, the enhanced signal and the signal that it should match; below, the "
        "difference of the last two. The title and the line under it give the errors."
    ),
    drawn_by=draw,
    arrays=arrays,
    stages=("telemetry", "enhancer", "noise GAN", "enhancement"),
)
