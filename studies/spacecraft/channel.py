"""The picture of one real channel with its enhanced signal. Its telemetry is not part of the project, so a run draws it from the data."""

from collections.abc import Mapping
from typing import Any

import matplotlib.figure
import numpy as np

from enhsim_tf.common.figure import Figure
from enhsim_tf.common.plot_style import DASHED, DOUBLE, ENHANCED, GREY_TINT, REAL, new_sheet, panels
from enhsim_tf.paper.telemetry import cut_windows
from studies.spacecraft.telemanom import LabelledChannel

CHANNEL, LATER = "G-1", 7_000
"""The channel, and the first sample of a later stretch of its test part."""


def stretches(channel: LabelledChannel) -> dict[str, Any]:
    """Two windows that are learnt, two later ones, and two around the labelled anomaly, each with the aligned enhanced signal.

    Args:
        channel: The channel, with one labelled anomaly.
    """
    from enhsim_tf.simulator.fitting import fit
    from enhsim_tf.simulator.options import FitOptions

    simulator, _ = fit(
        channel.train, options=FitOptions(enhancer="ridge", noise="residual windows", held_out=0)
    )
    ((begin, end),), window = channel.sequences, simulator.window
    found: dict[str, Any] = {"anomaly": (begin, end)}
    for name, series, first in (
        ("learnt", channel.train, 2 * window),
        ("later", channel.test, LATER),
        ("labelled as anomalous", channel.test, (begin + end) // 2 - window),
    ):
        windows = cut_windows(series.values, np.array([first, first + window]), window)
        enhanced = windows - simulator.residuals(windows[:, :, None])[:, :, 0]
        found[name] = first + np.arange(2 * window), windows.ravel(), enhanced.ravel()
    return found


def draw(found: Mapping[str, Any]) -> matplotlib.figure.Figure:
    """Draws the stretches in three panels."""
    figure, down = new_sheet(
        DOUBLE,
        2.5,
        "A real channel drifts far from what was learnt, and sticks",
        f"Channel {CHANNEL} of the SMAP satellite, scaled by its publishers, and the enhanced square wave, aligned in clock, level and gain.",
    )
    grid = panels(figure, down + 0.22, 1, 3, gap=(0.2, 0.22), sharey=True)
    for axes, (name, curves) in zip(
        grid[0], [each for each in found.items() if each[0] != "anomaly"], strict=True
    ):
        samples, telemetry, enhanced = curves
        axes.plot(samples, telemetry, color=REAL, linewidth=0.7, label="telemetry")
        axes.plot(
            samples, enhanced, color=ENHANCED, linestyle=DASHED, linewidth=1.2, label="enhanced"
        )
        axes.set_title(name)
        axes.set_xlabel("time (samples)")
    grid[0, 2].axvspan(*found["anomaly"], color=GREY_TINT, zorder=0)
    grid[0, 0].set_ylabel("value (dimensionless)")
    grid[0, 1].legend(frameon=False, loc="upper left")
    return figure


PICTURE = Figure(
    17,
    "A real channel",
    "Three panels over time. Left: a channel that rises and falls, with the enhanced signal upon it. Middle: the same at a lower level and "
    "with a smaller amplitude. Right: the channel holds one value for most of a cycle, and the enhanced signal goes on.",
    draw,
)
