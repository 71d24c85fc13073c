"""The figure of a channel's report: signals and generated windows, false-alarm rates and recall of detectors."""

import matplotlib.figure
import matplotlib.style
import numpy as np
from matplotlib import font_manager
from matplotlib.axes import Axes

from enhsim_tf.common.errors import printable
from enhsim_tf.common.plot_style import COARSE, DOUBLE, EDGE, ENHANCED, FOOT, GENERATED, LINE, QUIET, REAL, STYLE, new_sheet, title_words
from enhsim_tf.enhanced_simulator.report import RATE, SEVERITY, ChannelReport

_HEIGHT = 4.3  # inches
_LEFT, _MIDDLE = (0.68, 3.36), (4.66, 7.0)  # left and right edges of the two columns of panels, in inches
_BETWEEN = 0.62  # vertical gap between two panels, in inches; holds an axis label and a title


def channel_figure(report: ChannelReport) -> matplotlib.figure.Figure:
    """Draws the report of one channel.

    Args:
        report: The report.
    """
    with matplotlib.style.context(STYLE):
        name, unit = drawable(report.channel), drawable(report.unit, 10)
        where = "held-out telemetry" if report.is_held_out else "the telemetry it learnt from"
        errors = {key: "not measurable" if np.isnan(error) else f"{error:.2f}" for key, error in report.nrmse.items()}
        subtitle = (
            f"Error on {where} (NRMSE, median window): {errors['coarse']} coarse, {errors['ridge']} ridge regression, "
            f"{errors['nearest']} nearest training windows, {errors['enhanced']} enhanced. Left, above: the window with the median error; below: a generated window, with noise."
        )
        figure, down = new_sheet(DOUBLE, _HEIGHT, f"{name}: {_message(report)}", subtitle)
        (signal, alarms), (made, found) = _grid(figure, down + 0.24)

        signal.plot(report.examples["real"], color=REAL, linewidth=0.7)
        signal.plot(report.examples["coarse"], color=COARSE, linewidth=1.0, linestyle=(0, (4, 1.5)), zorder=3)
        signal.plot(report.examples["enhanced"], color=ENHANCED, linewidth=1.5)
        title_words(signal, [("telemetry", REAL), ("coarse (dashed)", COARSE), ("enhanced (thick)", ENHANCED)])
        made.plot(report.examples["generated"], color=GENERATED, linewidth=0.7)
        title_words(made, [("generated", GENERATED)])
        for axes in (signal, made):
            axes.set_xlabel("sample")
            _name_values(axes, "" if unit == "1" else unit)

        _dots(alarms, report.false_alarms["generated"], report.false_alarms["real"])
        alarms.axvline(100 * RATE, color=LINE, linewidth=0.6, zorder=0)
        title_words(alarms, [("trained on generated (dots)", ENHANCED), ("real (rings)", REAL)])
        alarms.set_xlabel(f"false alarms (%), set for {RATE:.0%} (line)")
        kinds = {kind.replace("_", " "): share for kind, (_, share) in report.found.items()}
        _dots(found, kinds)
        title_words(found, [("trained on generated, best detector", ENHANCED)])
        found.set_xlabel(f"found (%) of anomalies of {SEVERITY:g} sd of the noise")
        if not kinds:
            found.text(
                0.5, 0.5, "no detector can be used:\neach has too many false alarms", ha="center", va="center", transform=found.transAxes
            )
        windows = f"{report.num_windows:,} windows" if report.num_windows != 1 else "1 window"
        alone = "" if report.num_disjoint >= report.num_windows else f", of which {report.num_disjoint:,} share no sample"
        foot = f"python -m enhsim_tf fit · windows of {report.window:,} samples · rates on {windows}{alone}"
        figure.text(EDGE / DOUBLE, 0.08 / _HEIGHT, foot, size=7, color=QUIET)
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


def _message(report: ChannelReport) -> str:
    enhanced, coarse = report.nrmse["enhanced"], report.nrmse["coarse"]
    if np.isnan(enhanced) or np.isnan(coarse):
        return "no window moves, so nothing can be said of the enhanced signal"
    if enhanced >= coarse:
        return "the enhanced signal is no nearer to the telemetry than the coarse one"
    others = {"ridge regression": report.nrmse["ridge"], "the nearest training windows": report.nrmse["nearest"]}
    best = min(others, key=others.get)
    but = "" if enhanced < others[best] else f", but no nearer than {best}"
    return f"the enhanced signal is {1 - enhanced / coarse:.0%} nearer to the telemetry than the coarse one{but}"


def _grid(figure: matplotlib.figure.Figure, down: float) -> list[list[Axes]]:
    """Adds two rows of two panels: curves on the left, rates with their labels on the right."""
    bottom = FOOT + 0.36
    height = (_HEIGHT - down - bottom - _BETWEEN) / 2
    return [
        [figure.add_axes((left / DOUBLE, foot / _HEIGHT, (right - left) / DOUBLE, height / _HEIGHT)) for left, right in (_LEFT, _MIDDLE)]
        for foot in (bottom + height + _BETWEEN, bottom)
    ]


def _name_values(axes: Axes, unit: str) -> None:
    """Labels the value axis with the unit and with the factor or offset of its tick labels."""
    axes.locator_params(axis="y", nbins=5)
    axes.ticklabel_format(axis="y", scilimits=(-3, 4))
    axes.figure.draw_without_rendering()
    left_out = axes.yaxis.get_offset_text()
    left_out.set_visible(False)  # it would overlap the title
    about = ", ".join(word for word in (unit, left_out.get_text()) if word)
    axes.set_ylabel(f"value ({about})" if about else "value")
    axes.yaxis.set_label_coords(-0.5 / (_LEFT[1] - _LEFT[0]), 0.5)


def _dots(axes: Axes, shares: dict[str, float], others: dict[str, float] | None = None) -> None:
    """Draws a dot for each share, and a ring for the share it is compared with, in rows from top to bottom."""
    heights = -np.arange(len(shares), dtype=float)
    axes.hlines(heights, 0, [100 * share for share in shares.values()], color=ENHANCED, linewidth=0.8)
    axes.plot([100 * share for share in shares.values()], heights, "o", color=ENHANCED, markersize=4, clip_on=False)
    if others is not None:
        ring = {"markersize": 7, "markerfacecolor": "none", "markeredgewidth": 0.8, "clip_on": False}
        axes.plot([100 * others[name] for name in shares], heights, "o", color=REAL, **ring)
    axes.set_yticks(heights, list(shares))
    axes.set_ylim(0.6 - max(1, len(shares)), 0.6)
    axes.set_xlim(-2, 102)
