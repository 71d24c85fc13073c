"""The figures of the study of real telemetry, drawn from its findings."""

from collections.abc import Mapping
from typing import Any

import matplotlib.figure
import numpy as np

from enhsim_tf.common.number_words import in_words
from enhsim_tf.common.plot_style import AVERAGE, COARSE, DOUBLE, ENHANCED, GENERATED, QUIET, REAL, SINGLE, new_sheet, panels
from enhsim_tf.detection.registry import DETECTORS
from enhsim_tf.reproduce.figure import Figure
from enhsim_tf.reproduce.spacecraft.study import ARMS, GENERATED_ARM

Findings = Mapping[str, Any]
_MOST = 12  # channels that a figure names


def _colour(arm: str) -> str:
    colours = {"real": REAL, "coarse": COARSE, GENERATED_ARM: ENHANCED, "real + generated": ENHANCED}
    return colours.get(arm, GENERATED)


def errors(found: Findings) -> matplotlib.figure.Figure:
    """Error of the coarse signal, ridge regression and the enhanced signal on nominal test windows, one row per channel."""
    channels = dict(list(found["channels"].items())[:_MOST])
    all_errors = [about["nrmse"] for about in found["channels"].values()]
    nearest = [min(each, key=each.get) for each in all_errors]
    figure, down = new_sheet(
        SINGLE,
        2.3 + 0.2 * len(channels),
        f"The enhanced signal has the smallest error on {nearest.count('enhanced')} of {len(nearest)} channels; ridge regression with the enhancer's clock "
        f"on {nearest.count('ridge, same clock')}",
        "Median error over nominal test windows, in standard deviations of each window, after phase, offset and gain are aligned to that window. "
        "Hollow: ridge regression aligned with the phase that the enhanced signal finds.",
    )
    axes = panels(figure, down + 0.4, 1, 1)[0, 0]
    place = axes.get_position()
    axes.set_position([0.16, place.y0 + 0.03, 0.8, place.height - 0.03])
    marks = (
        ("coarse", "s", COARSE, COARSE, 0.0),
        ("enhanced", "o", ENHANCED, ENHANCED, 0.0),
        ("ridge", "^", AVERAGE, AVERAGE, 0.3),  # offset from the row, so that no other mark covers it
        ("ridge, same clock", "^", AVERAGE, "none", -0.3),
    )
    for method, marker, colour, inside, beside in marks:
        values = [about["nrmse"][method] for about in channels.values()]
        axes.plot(values, beside - np.arange(len(values)), marker, color=colour, markerfacecolor=inside, markersize=5, label=method)
    axes.set_yticks(-np.arange(len(channels)), list(channels))
    axes.set_xlim(0, 1.08 * max(max(each.values()) for each in all_errors))
    axes.set_xlabel("NRMSE")
    axes.legend(frameon=False, ncols=2, loc="lower left", bbox_to_anchor=(-0.05, 1.0), handletextpad=0.2, columnspacing=1.0)
    return figure


def alarms_and_finds(found: Findings) -> matplotlib.figure.Figure:
    """False alarms on nominal test windows and labelled sequences found, for each training arm."""
    arms = found["arms"]
    generated, real = arms[GENERATED_ARM], arms["real"]
    number = len(found["channels"])
    figure, down = new_sheet(
        DOUBLE,
        3.6,
        f"On a real spacecraft, detectors trained on generated telemetry raise false alarms on {100 * generated['false_alarms']['mean']:.0f} % of nominal windows "
        f"and find {100 * generated['found']['mean']:.0f} % of the labelled anomalies; trained on the channel's own past, on {100 * real['false_alarms']['mean']:.0f} % "
        f"and {100 * real['found']['mean']:.0f} %",
        f"Vertical line: the rate that thresholds are set for, 1 %. Dot and bar: mean over {in_words(len(DETECTORS))} detectors and {number} "
        f"channels, with its 95 % interval over channels; small marks: single detectors. {found['num_sequences']} labelled sequences.",
    )
    grid = panels(figure, down + 0.12, 1, 2, gap=(0.3, 0.12), sharey=True)
    left, width = 1.75 / DOUBLE, (1 - 1.9 / DOUBLE) / 2
    words = (("false_alarms", "false alarms on nominal test windows (%)"), ("found", "labelled sequences found (%)"))
    for number, (axes, (key, label)) in enumerate(zip(grid[0], words, strict=True)):
        place = axes.get_position()
        axes.set_position([left + number * width, place.y0 + 0.02, width - 0.03, place.height - 0.02])
        for height, arm in enumerate(ARMS):
            about, colour = arms[arm], _colour(arm)
            each = [100 * rates[key] for rates in about["by_detector"].values()]
            axes.plot(each, np.full(len(each), -height), "|", color=colour, markersize=6)
            axes.plot([100 * about[key]["low"], 100 * about[key]["high"]], [-height] * 2, color=colour, linewidth=2.2, alpha=0.45)
            axes.plot(100 * about[key]["mean"], -height, "o", color=colour, markersize=4)
        axes.set_xlim(-3, 103)
        axes.set_xlabel(label)
    grid[0, 0].axvline(1, color=QUIET, linewidth=0.6, zorder=0)
    grid[0, 0].set_yticks(-np.arange(len(ARMS)), list(ARMS))
    grid[0, 1].tick_params(labelleft=False)
    return figure


FIGURES = {
    "errors": Figure(
        15,
        "Enhancement of real telemetry",
        "A row for each channel with four marks: the median error of the coarse signal, of ridge regression aligned in two ways and of the enhanced signal on "
        "nominal test windows. The title counts the channels on which the enhanced signal has the smallest error.",
        errors,
    ),
    "alarms_and_finds": Figure(
        16,
        "Detectors on real telemetry",
        "Two panels with a row for each training arm. Left: the false alarms on nominal test windows. Right: the share of "
        "labelled anomalies found; means with intervals over channels, and a mark for each detector. The title gives the two means for "
        "generated and for real training.",
        alarms_and_finds,
    ),
}
