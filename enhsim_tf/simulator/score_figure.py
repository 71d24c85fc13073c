"""The figure of scores: the series of up to three channels, the scores with their threshold, and the events."""

from typing import TYPE_CHECKING

import matplotlib.dates
import matplotlib.figure
import matplotlib.style
import numpy as np

from enhsim_tf.common.plot_style import DOUBLE, EDGE, ENHANCED, GENERATED, QUIET, REAL, STYLE, new_sheet, title_words
from enhsim_tf.simulator.report_figure import drawable
from enhsim_tf.simulator.scoring import events_table

if TYPE_CHECKING:
    import pandas as pd

    from enhsim_tf.simulator.simulator import EnhancedSimulator

_MOST_CHANNELS = 3
_MOST_POINTS = 4_000  # of a curve; beyond, the smallest and the largest value of each stretch are drawn
_ROW, _GAP = 0.95, 0.2  # inches


def score_figure(frame: "pd.DataFrame", simulator: "EnhancedSimulator", name: str) -> matplotlib.figure.Figure:
    """Draws scored telemetry: series, enhanced run if there is one, scores and events.

    Args:
        frame: Scores, as returned by `scoring.score`.
        simulator: The simulator.
        name: Name of the source.
    """
    single = len(simulator.channels) == 1
    channels = ["value"] if single else list(simulator.channels[:_MOST_CHANNELS])
    events = events_table(frame)
    title = (
        f"{drawable(name, 30)}: {len(events):,} {'event' if len(events) == 1 else 'events'}, {frame['flag'].mean():.1%} of samples flagged"
    )
    subtitle = f"Detector: {frame.attrs['detector']}. Shaded: events. Dashed: threshold."
    rows = len(channels) + 1
    height = 1.0 + rows * (_ROW + _GAP)
    times = frame.index.tz_convert(None) if hasattr(frame.index, "tz") and frame.index.tz is not None else frame.index
    with matplotlib.style.context(STYLE):
        figure, down = new_sheet(DOUBLE, height, title, subtitle)
        axes = []
        for row in range(rows):
            top = height - down - 0.2 - row * (_ROW + _GAP)
            axes.append(
                figure.add_axes(
                    (0.7 / DOUBLE, (top - _ROW) / height, (DOUBLE - 0.85) / DOUBLE, _ROW / height), sharex=axes[0] if axes else None
                )
            )
        for row, channel in enumerate(channels):
            _curve(axes[row], times, frame[channel].to_numpy(), REAL, 0.6)
            enhanced = "enhanced" if single else f"enhanced {channel}"
            if enhanced in frame:
                _curve(axes[row], times, frame[enhanced].to_numpy(), ENHANCED, 1.0)
                title_words(axes[row], [("telemetry", REAL), ("enhanced run", ENHANCED)] if row == 0 else [])
            axes[row].set_ylabel(drawable(simulator.channels[0] if single else channel, 14))
            axes[row].tick_params(labelbottom=False)
        _curve(axes[-1], times, frame["score"].to_numpy(), REAL, 0.7)
        axes[-1].axhline(1, color=QUIET, linewidth=0.8, linestyle=(0, (4, 2)))
        axes[-1].set_ylabel("score")
        if np.nanmax(frame["score"].to_numpy(), initial=0.0) > 20:
            axes[-1].set_yscale("log")
        for event in frame.attrs["events"]:
            begin, end = times[event["begin"]], times[min(event["end"], len(times) - 1)]
            for each in axes:
                each.axvspan(begin, end, color=GENERATED, alpha=0.3, linewidth=0)
        if hasattr(frame.index, "tz"):
            locator = matplotlib.dates.AutoDateLocator(minticks=3, maxticks=7)
            axes[-1].xaxis.set_major_locator(locator)
            axes[-1].xaxis.set_major_formatter(matplotlib.dates.ConciseDateFormatter(locator))
            axes[-1].set_xlabel("time (UTC)")
        else:
            axes[-1].set_xlabel("sample")
        figure.text(EDGE / DOUBLE, 0.08 / height, f"enhsim-tf score · {len(frame):,} samples", size=7, color=QUIET)
    return figure


def _curve(axes, times, values: np.ndarray, color: str, width: float) -> None:  # noqa: ANN001
    """Draws a series; of a long one the envelope, so that no spike is lost."""
    if len(values) <= _MOST_POINTS:
        axes.plot(times, values, color=color, linewidth=width)
        return
    edges = np.linspace(0, len(values), _MOST_POINTS // 2 + 1).astype(int)[:-1]
    low, high = np.fmin.reduceat(values, edges), np.fmax.reduceat(values, edges)
    axes.plot(np.repeat(np.asarray(times)[edges], 2), np.stack([low, high], axis=1).ravel(), color=color, linewidth=width)
