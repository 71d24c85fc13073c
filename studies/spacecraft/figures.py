"""The figures of the study of real telemetry, drawn from its findings."""

from collections.abc import Mapping
from typing import Any

import matplotlib.figure
import numpy as np
from matplotlib.lines import Line2D

from enhsim_tf.common.figure import Figure
from enhsim_tf.common.number_words import in_words
from enhsim_tf.common.plot_style import AVERAGE, COARSE, DOUBLE, ENHANCED, GENERATED, QUIET, REAL, SINGLE, new_sheet, panels
from enhsim_tf.detection.registry import DETECTORS
from studies.spacecraft.rates import PRIMARY
from studies.spacecraft.study import ARMS, GENERATED_ARM, RIDGE_ARM

Findings = Mapping[str, Any]
_MOST = 12  # channels that a figure names
_NO_DIFFERENCE = 0.01  # of two errors; smaller differences are not worth a sentence


def _colour(arm: str) -> str:
    colours = {"real": REAL, "coarse": COARSE, GENERATED_ARM: ENHANCED, RIDGE_ARM: AVERAGE}
    return colours.get(arm, GENERATED)


def errors(found: Findings) -> matplotlib.figure.Figure:
    """Error of the coarse signal, ridge regression and the enhanced signal on nominal test windows, one row per channel."""
    channels = dict(list(found["channels"].items())[:_MOST])
    compared = ("coarse", "ridge", "ridge, own clock", "enhanced")
    all_errors = [{method: about["nrmse"][method] for method in compared} for about in found["channels"].values()]
    close = sum(abs(each["enhanced"] - min(each["ridge"], each["ridge, own clock"])) < _NO_DIFFERENCE for each in all_errors)
    better = sum(max(each["enhanced"], each["ridge"]) < each["coarse"] for each in all_errors)
    figure, down = new_sheet(
        SINGLE,
        2.5 + 0.2 * len(channels),
        f"The errors of the enhanced signal and of ridge regression differ by less than {_NO_DIFFERENCE:g} on {close} of {len(all_errors)} "
        f"channels; both are below that of the coarse signal on {better}",
        "Median error over nominal test windows, in standard deviations of each window, after phase, offset and gain are aligned to that window. "
        "Hollow: ridge regression aligned by its own waveform, as the enhanced signal is; full: by the edges of the square wave.",
    )
    axes = panels(figure, down + 0.4, 1, 1)[0, 0]
    place = axes.get_position()
    axes.set_position([0.16, place.y0 + 0.03, 0.8, place.height - 0.03])
    marks = (
        ("coarse", "s", COARSE, COARSE, 0.0),
        ("enhanced", "o", ENHANCED, ENHANCED, 0.0),
        ("ridge", "^", AVERAGE, AVERAGE, 0.3),  # offset from the row, so that no other mark covers it
        ("ridge, own clock", "^", AVERAGE, "none", -0.3),
    )
    for method, marker, colour, inside, beside in marks:
        values = [about["nrmse"][method] for about in channels.values()]
        axes.plot(values, beside - np.arange(len(values)), marker, color=colour, markerfacecolor=inside, markersize=5, label=method)
    axes.set_yticks(-np.arange(len(channels)), list(channels))
    axes.set_xlim(0, 1.08 * max(max(each.values()) for each in all_errors))
    axes.set_xlabel("NRMSE")
    axes.legend(frameon=False, ncols=2, loc="lower left", bbox_to_anchor=(-0.05, 1.0), handletextpad=0.2, columnspacing=1.0)
    return figure


def _simple(number: int) -> str:
    return "the best score of one line finds" if number == 1 else f"the best {in_words(number)} scores of one line find"


def _not_established(found: Findings, level: float = 0.05) -> str:
    """Says that no declared difference of finds is established, where that is so."""
    p_values = [each["found_p_value"] for each in found["contrasts"]]
    return f". With {found['num_sequences']} sequences no difference is established" if p_values and min(p_values) > level else ""


def alarms_and_finds(found: Findings) -> matplotlib.figure.Figure:
    """False alarms at own thresholds, and labelled sequences found at matched false-alarm rates, for each training arm and control."""
    rows = {arm: (found["arms"][arm], _colour(arm)) for arm in ARMS if arm in found["arms"]}
    rows |= {f"one line: {name}": (about, QUIET) for name, about in found["controls"].items()}
    finds = {name: next(each["mean"] for each in about["matched"] if each["rate"] == PRIMARY) for name, (about, _) in rows.items()}
    simple = [finds[name] for name in rows if name.startswith("one line") and "random" not in name]
    trained = [finds[name] for name in rows if name == "real" or " + " in name]
    least, most, best = (f"{100 * each:.0f}" for each in (min(trained), max(trained), max(simple)))
    equal = sum(each == max(simple) for each in simple)
    figure, down = new_sheet(
        DOUBLE,
        4.6,
        f"At {100 * PRIMARY:.0f}\N{NO-BREAK SPACE}% false alarms, detectors find {least} to {most}\N{NO-BREAK SPACE}% of the labelled anomalies of a real spacecraft, "
        f"depending on the training windows; {_simple(equal)} {best}\N{NO-BREAK SPACE}%{_not_established(found)}",
        f"Left: thresholds set for 1 % (vertical line) on held-out windows of the arm (dot, with its 95 % interval) and on the channel's past (hollow). Right: thresholds "
        f"matched on nominal test windows; the vertical mark is what chance finds at {100 * PRIMARY:.0f} %. Means over {in_words(len(DETECTORS))} detectors (one line: one), "
        f"{len(found['channels'])} channels, {len(found['seeds'])} training seed{'s' * (len(found['seeds']) > 1)} and {found['num_sequences']} labelled sequences.",
    )
    grid = panels(figure, down + 0.3, 1, 2, gap=(0.3, 0.12), sharey=True)
    left, width = 1.85 / DOUBLE, (1 - 2.0 / DOUBLE) / 2
    for number, axes in enumerate(grid[0]):
        place = axes.get_position()
        axes.set_position([left + number * width, place.y0 + 0.01, width - 0.03, place.height - 0.01])
        axes.set_xlim(-3, 103)
    alarms, shares = grid[0]
    for height, (about, colour) in enumerate(rows.values()):
        rate = about["false_alarms"]
        alarms.plot([100 * rate["low"], 100 * rate["high"]], [-height] * 2, color=colour, linewidth=2.2, alpha=0.45)
        alarms.plot(100 * about["false_alarms_past"]["mean"], -height, "D", color=colour, markerfacecolor="white", markersize=4)
        alarms.plot(100 * rate["mean"], -height, "o", color=colour, markersize=4)
        for each, marker in zip(about["matched"], ("v", "o", "^"), strict=True):
            inside = colour if each["rate"] == PRIMARY else "white"
            shares.plot(100 * each["mean"], -height, marker, color=colour, markerfacecolor=inside, markersize=4.5)
            if each["rate"] == PRIMARY:
                shares.plot(100 * each["chance"], -height, "|", color=colour, markersize=9)
    alarms.axvline(1, color=QUIET, linewidth=0.6, zorder=0)
    alarms.set_xlabel("false alarms on nominal test windows (%)")
    shares.set_xlabel("labelled sequences found (%)")
    marks = [*zip(("v", "o", "^"), found["rates"], strict=True)]
    handles = [
        Line2D([], [], ls="", marker=m, color=REAL, mfc=REAL if r == PRIMARY else "white", ms=4.5, label=f"at {100 * r:.0f} %")
        for m, r in marks
    ]
    handles.append(Line2D([], [], ls="", marker="|", color=REAL, ms=9, label="chance"))
    shares.legend(
        handles=handles, frameon=False, ncols=4, loc="lower left", bbox_to_anchor=(-0.02, 1.0), handletextpad=0.1, columnspacing=0.9
    )
    alarms.set_yticks(-np.arange(len(rows)), list(rows))
    shares.tick_params(labelleft=False)
    return figure


FIGURES = {
    "errors": Figure(
        15,
        "Enhancement of real telemetry",
        "A row for each channel with four marks: the median error of the coarse signal, of ridge regression aligned in two ways and of the enhanced signal on "
        "nominal test windows. The title counts the channels on which the enhanced signal and ridge regression have the smallest error.",
        errors,
    ),
    "alarms_and_finds": Figure(
        16,
        "Detectors on real telemetry",
        "Two panels with a row for each training arm and each detector of one line. Left: the false alarms on nominal test windows, with thresholds set "
        "on the arm's own windows and on the channel's past. Right: the share of labelled anomalies found at matched false-alarm rates of 1, 5 and 10 %, with what "
        "chance finds. The title gives the range of the finds at 5 %.",
        alarms_and_finds,
    ),
}
