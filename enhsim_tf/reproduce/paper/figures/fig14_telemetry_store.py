"""Figure 14: the beginning of the series in the telemetry store."""

import matplotlib.dates
import matplotlib.figure
import numpy as np

from enhsim_tf.common.plot_style import DOUBLE, REAL, name_axes, new_sheet, panels
from enhsim_tf.reproduce.paper.figures.paper_figure import Arrays, PaperFigure
from enhsim_tf.reproduce.paper.figures.window_arrays import value_unit
from enhsim_tf.reproduce.paper.pipeline import Experiment

STRETCH = 3_600  # samples: an hour of the paper's example


def arrays(experiment: Experiment) -> Arrays:
    """The beginning of the series as the store holds it, with its timestamps where the source has them."""
    series = experiment.store.read(experiment.store.names()[0])
    stretch = series.part(0, min(STRETCH, len(series)))
    time = stretch.time_s
    if series.has_time:
        start = np.datetime64(series.start.removesuffix("+00:00"), "ms")
        time = start + np.round(1e3 * stretch.time_s).astype("timedelta64[ms]")
    about = {"name": series.name, "num_samples": len(series), "interval_s": series.interval_s, "unit": value_unit(experiment, series)}
    return {"time": time, "values": stretch.values} | {key: np.array(value) for key, value in about.items()}


def draw(data: Arrays) -> matplotlib.figure.Figure:
    """Draws Figure 14."""
    number, interval = int(data["num_samples"]), float(data["interval_s"])
    has_time = data["time"].dtype.kind == "M"
    figure, down = new_sheet(
        DOUBLE,
        2.5,
        f"The telemetry store holds {number:,} samples of “{data['name']}”",
        f"One sample every {interval:g} s. Shown: the first {len(data['values']):,}, as read back from the store."
        if has_time
        else f"Shown: the first {len(data['values']):,}, as read back from the store; the source gives no times.",
    )
    panel = panels(figure, down + 0.1, 1, 1)[0, 0]
    panel.plot(data["time"], data["values"], color=REAL, linewidth=0.4)
    if has_time:
        locator = matplotlib.dates.AutoDateLocator()
        panel.xaxis.set_major_locator(locator)
        panel.xaxis.set_major_formatter(matplotlib.dates.ConciseDateFormatter(locator, show_offset=False))
    name_axes(np.array([[panel]]), data | {"time_unit": f"UTC, from {str(data['time'][0])[:10]}" if has_time else "samples"})
    return figure


FIGURE = PaperFigure(
    number=14,
    title="Example telemetry signals in the store",
    alt=("The beginning of the stored telemetry series over its timestamps."),
    drawn_by=draw,
    arrays=arrays,
    stages=("telemetry",),
)
