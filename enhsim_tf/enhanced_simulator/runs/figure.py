"""The figure of a run model's report: telemetry with the coarse and the enhanced run, and the errors of all enhancers."""

import matplotlib.figure
import matplotlib.style
import numpy as np
from matplotlib.axes import Axes

from enhsim_tf.common.plot_style import COARSE, DOUBLE, EDGE, ENHANCED, GENERATED, LINE, QUIET, REAL, STYLE, new_sheet, title_words
from enhsim_tf.enhanced_simulator.report_figure import drawable
from enhsim_tf.enhanced_simulator.runs.report import RunReport

_HEIGHT = 3.7  # inches
_LEFT, _RIGHT = (0.68, 4.0), (5.25, 7.0)  # left and right edges of the panels, in inches


def run_figure(report: RunReport) -> matplotlib.figure.Figure:
    """Draws the report of one channel.

    Args:
        report: The report.
    """
    with matplotlib.style.context(STYLE):
        name, unit = drawable(report.channel), drawable(report.unit, 10)
        where = "held-out telemetry" if report.is_held_out else "the telemetry it learnt from"
        subtitle = (
            f"Error on {where} (NRMSE, with the telemetry's noise): {report.nrmse['coarse']:.3f} coarse, {report.nrmse['enhanced']:.3f} enhanced. "
            f"Right: each enhancer on held-out blocks of the training time, with its standard error; the filled dot is used."
        )
        figure, down = new_sheet(DOUBLE, _HEIGHT, f"{name}: {_message(report)}", subtitle)
        top, bottom, gap = 1 - (down + 0.24) / _HEIGHT, 0.62, 0.36
        height = (top * _HEIGHT - bottom - gap) / 2

        def panel(edges: tuple[float, float], foot: float, height: float) -> Axes:
            return figure.add_axes((edges[0] / DOUBLE, foot / _HEIGHT, (edges[1] - edges[0]) / DOUBLE, height / _HEIGHT))

        signal, made = panel(_LEFT, bottom + height + gap, height), panel(_LEFT, bottom, height)
        signal.plot(report.examples["real"], color=REAL, linewidth=0.6, zorder=4)
        signal.plot(report.examples["coarse"], color=COARSE, linewidth=1.0, linestyle=(0, (4, 1.5)))
        signal.plot(report.examples["enhanced"], color=ENHANCED, linewidth=1.5)
        title_words(signal, [("telemetry (thin)", REAL), ("coarse (dashed)", COARSE), ("enhanced (thick)", ENHANCED)])
        made.plot(report.examples["generated"], color=GENERATED, linewidth=0.7)
        title_words(made, [("generated: enhanced and noise", GENERATED)])
        made.set_xlabel("sample")
        signal.set_xticklabels([])
        for axes in (signal, made):
            axes.locator_params(axis="y", nbins=4)
            axes.set_ylabel("value" if unit == "1" else f"value ({unit})")
        _errors(panel(_RIGHT, bottom, 2 * height + gap), report)
        foot = f"python -m enhsim_tf fit --coarse · windows of {report.window:,} samples · {report.num_stretches} disjoint held-out windows"
        figure.text(EDGE / DOUBLE, 0.08 / _HEIGHT, foot, size=7, color=QUIET)
    return figure


def _errors(axes: Axes, report: RunReport) -> None:
    errors = np.array([each["error"] for each in report.ladder])
    spreads = np.array([each["standard_error"] for each in report.ladder])
    heights = -np.arange(len(errors), dtype=float)
    axes.errorbar(errors, heights, xerr=spreads, fmt="none", ecolor=LINE, elinewidth=1.0, capsize=2)
    for error, height, each in zip(errors, heights, report.ladder, strict=True):
        filled = each["name"] == report.chosen
        axes.plot(error, height, "o", color=ENHANCED, markersize=5, markerfacecolor=ENHANCED if filled else "white")
    axes.set_yticks(heights, [each["name"].replace(" and ", "\nand ") for each in report.ladder])
    axes.set_ylim(0.6 - len(errors), 0.6)
    axes.set_xlim(0, 1.12 * float((errors + spreads).max()) or 1.0)
    axes.set_xlabel("error (NRMSE)")


def _message(report: RunReport) -> str:
    coarse, enhanced = report.nrmse["coarse"], report.nrmse["enhanced"]
    if enhanced >= coarse:
        return "the enhanced run is no nearer to the telemetry than the coarse one"
    return f"the enhanced run ({report.chosen}) is {1 - enhanced / coarse:.0%} nearer to the telemetry than the coarse one"
