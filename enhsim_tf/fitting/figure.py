"""The figure of a report: series of up to three channels."""

import matplotlib.figure
import matplotlib.style

from enhsim_tf.common.plot_style import (
    COARSE,
    DASHED,
    DOUBLE,
    ENHANCED,
    GENERATED,
    REAL,
    STYLE,
    new_sheet,
    panels,
    title_words,
)
from enhsim_tf.fitting.report import Report
from enhsim_tf.scoring.figure import MOST_CHANNELS, drawable, foot


@matplotlib.style.context(STYLE)
def report_figure(report: Report) -> matplotlib.figure.Figure:
    """Draws a report: for each channel a window of real, coarse and enhanced telemetry, and one of
    generated telemetry.
    """
    shown = report.channels[:MOST_CHANNELS]
    rows = len(shown)
    where = "held-out telemetry" if report.is_held_out else "the telemetry of the fit"
    subtitle = f"Measured on {where}; noise: {report.noise_model}."
    if rows < len(report.channels):
        subtitle += f" Drawn: the first {rows} of {len(report.channels):,} channels."
    figure, down = new_sheet(DOUBLE, 1.05 + 1.45 * rows, _message(report), subtitle)
    grid = panels(figure, down + 0.24, rows, 2, gap=(0.3, 0.6), sharey="row")
    for row, name in enumerate(shown):
        curves = {kind: values[:, row] for kind, values in report.examples.items()}
        signal, made = grid[row]
        signal.plot(curves["real"], color=REAL, linewidth=0.7)
        signal.plot(curves["coarse"], color=COARSE, linewidth=1.0, linestyle=DASHED, zorder=3)
        signal.plot(curves["enhanced"], color=ENHANCED, linewidth=1.5)
        made.plot(curves["generated"], color=GENERATED, linewidth=0.7)
        for axes in (signal, made):
            axes.locator_params(axis="y", nbins=4)
            axes.ticklabel_format(axis="y", useOffset=False)
            axes.set_xlabel("sample" if row == len(shown) - 1 else "")
        signal.set_ylabel(drawable(name, 20), parse_math=False)
    title_words(grid[0, 0], [("real", REAL), ("coarse (dashed)", COARSE), ("enhanced", ENHANCED)])
    title_words(grid[0, 1], [("generated", GENERATED)])
    foot(figure, f"enhsim-tf fit · windows of {report.window:,} samples")
    return figure


def _message(report: Report) -> str:
    """What the figure shows: how much nearer the enhanced signal is, or in how many channels."""
    nearer = {
        name: 1 - error.enhanced / error.coarse
        for name, error in report.nrmse.items()
        if error.enhanced < error.coarse
    }
    if len(report.channels) > 1:
        of_all = f"{len(nearer):,} of {len(report.channels):,} channels"
        return f"Enhanced is nearer to the telemetry than coarse in {of_all}"
    (name,) = report.channels
    if nearer:
        said = f"enhanced {nearer[name]:.0%} nearer to the telemetry than coarse"
    else:
        said = "enhancing brings the coarse signal no nearer"
    return f"{drawable(name, 30)}: {said}"
