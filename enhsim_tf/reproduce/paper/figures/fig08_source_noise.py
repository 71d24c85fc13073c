"""Figure 8: the noise that a moving average leaves."""

import matplotlib.figure
import numpy as np

from enhsim_tf.common.plot_style import AVERAGE, DASHED, DOUBLE, REAL, label_ends, name_axes, new_sheet, panels
from enhsim_tf.noise.extraction import extract_noise
from enhsim_tf.reproduce.paper.figures.paper_figure import Arrays, PaperFigure
from enhsim_tf.reproduce.paper.figures.window_arrays import spread_windows, time_axis, window_noise
from enhsim_tf.reproduce.paper.pipeline import Experiment


def arrays(experiment: Experiment) -> Arrays:
    """Training telemetry with its moving average, the noise that is left, and its sd over the training part."""
    window = spread_windows(experiment, "train", 1, "figure 8")
    noise, average = window_noise(experiment, window["offset"][0], "train")
    width = experiment.settings.noise.moving_average
    deviation = np.std(extract_noise(experiment.data.channels[0].train.values, width)[0])
    shown = {"telemetry": window["target"][0], "average": average, "noise": noise}
    return shown | {"standard_deviation": deviation, "width": np.array(width)} | time_axis(experiment)


def draw(data: Arrays) -> matplotlib.figure.Figure:
    """Draws Figure 8."""
    width, deviation = int(data["width"]), float(data["standard_deviation"])
    figure, down = new_sheet(
        DOUBLE,
        3.4,
        f"Subtracting a moving average of {width} samples leaves noise with a standard deviation of {deviation:.3g}",
        "The average is centred. The standard deviation is that of the whole training part, of which one window is shown. The "
        f"subtraction lowers the standard deviation of white noise by {100 * (1 - np.sqrt(1 - 1 / width)):.1f} %.",
    )
    above, below = panels(figure, down + 0.1, 2, 1, right=0.95, height_ratios=(3, 2), sharex=True)[:, 0]
    above.plot(data["time"], data["telemetry"], color=REAL, linewidth=0.5)
    above.plot(data["time"], data["average"], color=AVERAGE, linewidth=1.8)
    label_ends(
        above, {"telemetry": (np.mean(data["telemetry"][-20:]), REAL), "moving\naverage": (np.nanmean(data["average"][-20:]), AVERAGE)}
    )
    below.plot(data["time"], data["noise"], color=REAL, linewidth=0.5)
    for side in (-deviation, deviation):
        below.axhline(side, color=AVERAGE, linewidth=1.2, linestyle=DASHED)
    label_ends(below, {"+ 1 sd": (deviation, AVERAGE), "noise": (0.0, REAL), "− 1 sd": (-deviation, AVERAGE)})
    name_axes(np.array([[above], [below]]), data)
    return figure


FIGURE = PaperFigure(
    number=8,
    title="Extracted source noise",
    alt=(
        "Above, a window of telemetry with its centred moving average; below, the difference of the two, which is the noise, with "
        "lines at one standard deviation. The title gives the standard deviation."
    ),
    drawn_by=draw,
    arrays=arrays,
    stages=("telemetry",),
)
