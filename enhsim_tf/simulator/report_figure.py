"""The figure of a report: signals and generated windows of up to three channels, and how the detectors do."""

import matplotlib.figure
import matplotlib.style
import numpy as np
from matplotlib import font_manager

from enhsim_tf.common.errors import printable
from enhsim_tf.common.plot_style import COARSE, DOUBLE, EDGE, ENHANCED, FOOT, GENERATED, LINE, QUIET, REAL, STYLE, new_sheet, title_words
from enhsim_tf.simulator.detector_choice import RATE
from enhsim_tf.simulator.report import Report

_MOST_CHANNELS = 3
_ROW, _GAP = 1.15, 0.62  # inches
_COLUMNS = ((0.68, 2.50), (3.00, 4.82), (5.95, 7.0))  # left and right edges of the columns of panels, in inches


def report_figure(report: Report) -> matplotlib.figure.Figure:
    """Draws a report: for each channel real, coarse and enhanced telemetry, and generated telemetry; false alarms and recall of the detectors.

    Args:
        report: The report.
    """
    shown = report.channels[:_MOST_CHANNELS]
    first = report.nrmse[shown[0]]
    nearer = 1 - first["enhanced"] / first["coarse"] if first["coarse"] > 0 else 0.0
    message = f"{drawable(shown[0], 30)}: " + (
        f"enhanced {nearer:.0%} nearer to the telemetry than coarse" if nearer > 0 else "enhancing brings the coarse signal no nearer"
    )
    where = "held-out telemetry" if report.is_held_out else "the telemetry of the fit"
    subtitle = f"Measured on {where}; noise: {report.noise_model}; detector that score uses: {report.detector}."
    height = 0.9 + max(2, len(shown)) * (_ROW + _GAP)
    with matplotlib.style.context(STYLE):
        figure, down = new_sheet(DOUBLE, height, message, subtitle)

        def panel(row: int, column: int, rows: int = 1):  # noqa: ANN202
            left, right = _COLUMNS[column]
            top = height - down - 0.24 - row * (_ROW + _GAP)
            tall = rows * _ROW + (rows - 1) * _GAP
            return figure.add_axes((left / DOUBLE, (top - tall) / height, (right - left) / DOUBLE, tall / height))

        for row, name in enumerate(shown):
            own = {kind: values[:, row] for kind, values in report.examples.items()}
            signal, made = panel(row, 0), panel(row, 1)
            signal.plot(own["real"], color=REAL, linewidth=0.7)
            signal.plot(own["coarse"], color=COARSE, linewidth=1.0, linestyle=(0, (4, 1.5)), zorder=3)
            signal.plot(own["enhanced"], color=ENHANCED, linewidth=1.5)
            made.plot(own["generated"], color=GENERATED, linewidth=0.7)
            if row == 0:
                title_words(signal, [("real", REAL), ("coarse (dashed)", COARSE), ("enhanced", ENHANCED)])
                title_words(made, [("generated", GENERATED)])
            for axes in (signal, made):
                axes.locator_params(axis="y", nbins=4)
                axes.ticklabel_format(axis="y", useOffset=False)
                axes.set_xlabel("sample" if row == len(shown) - 1 else "")
            signal.set_ylabel(drawable(name, 14))
        names = [each["name"] for each in report.detectors]
        places = -np.arange(len(names), dtype=float)
        alarms, recall = panel(0, 2), panel(1, 2)
        for axes, key, label in (
            (alarms, "false_alarms", f"false alarms (%),\nset for {RATE:.0%} (line)"),
            (recall, "recall", "injected anomalies\nfound (%)"),
        ):
            values = [100 * each[key] for each in report.detectors]
            axes.hlines(places, 0, values, color=QUIET, linewidth=0.8)
            for place, value, name in zip(places, values, names, strict=True):
                is_used = name == report.detector
                axes.plot(value, place, "o", color=ENHANCED if is_used else REAL, markersize=5 if is_used else 3, clip_on=False)
            axes.set_yticks(places, names, fontsize=6)
            axes.set_ylim(0.6 - len(names), 0.6)
            axes.set_xlim(0, max(2.0, *values) if key == "false_alarms" else 100)
            axes.set_xlabel(label)
        alarms.axvline(100 * RATE, color=LINE, linewidth=0.6, zorder=0)
        figure.text(EDGE / DOUBLE, (FOOT - 0.18) / height, f"enhsim-tf fit · windows of {report.window:,} samples", size=7, color=QUIET)
    return figure


def drawable(text: str, most_letters: int = 60) -> str:
    """Returns text as one line that the font can draw: unknown characters are replaced and `$` is escaped.

    Args:
        text: Any text, for example a channel's name.
        most_letters: Maximum number of characters; longer text is shortened.
    """
    letters = font_manager.get_font(font_manager.findfont("DejaVu Sans")).get_charmap()
    known = "".join(letter if ord(letter) in letters else "?" for letter in printable(text))
    return (known if len(known) <= most_letters else f"{known[: most_letters - 3]}...").replace("$", r"\$")
