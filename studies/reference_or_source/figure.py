"""The figure of the study, drawn from its findings."""

from collections.abc import Mapping
from typing import Any

import matplotlib.axes
import matplotlib.figure
import numpy as np

from enhsim_tf.common.figure import Figure
from enhsim_tf.common.plot_style import DOUBLE, ENHANCED, GENERATED, QUIET, REAL, new_sheet, panels
from studies.reference_or_source.cells import MAIN
from studies.reference_or_source.recordings import CRUDE, FITTED
from studies.reference_or_source.uses import COARSE_REFERENCE, NO_SIMULATOR, REFERENCE, SOURCE

SHOWN: dict[str, tuple[str, dict[str, Any]]] = {
    REFERENCE: ("enhanced run as reference", {"color": ENHANCED, "linestyle": "-", "marker": "s"}),
    COARSE_REFERENCE: (
        "coarse run as reference",
        {"color": QUIET, "linestyle": ":", "marker": "D"},
    ),
    SOURCE: ("source of training data", {"color": GENERATED, "linestyle": "--", "marker": "o"}),
    NO_SIMULATOR: ("no simulator", {"color": REAL, "linestyle": "-", "marker": "^"}),
}
_COMMANDS = {
    "": "known",
    "delayed, aligned": "late,\naligned",
    "delayed, ignored": "late,\nignored",
    "unknown": "unknown",
}
_SIMULATORS = {
    "own": "same\nmodel",
    "off 10 %": "10 %\noff",
    "off 30 %": "30 %\noff",
    FITTED: "fitted\nphysics",
    CRUDE: "wrong\nphysics",
    "missing state": "missing\nstate",
}
_BROKEN = 0.03
"""Above this share of false alarms, a threshold that was set for 1 % is said not to keep its promise."""


def reference_or_source(found: Mapping[str, Any]) -> matplotlib.figure.Figure:
    """Recall of four uses over known telemetry, over simulators, and over what is known of the commands, a system a row."""
    systems = found["systems"]
    figure, down = new_sheet(
        DOUBLE,
        2.35 * len(systems) + 0.6,
        "A reference finds more faults than a source, if physics is near",
        "Fault windows found, at thresholds set for 1 % false alarms on the known telemetry. Open marks: more than 3 % false alarms. "
        "Bars: 95 % intervals over seeds and faults, at one point.",
    )
    grid = panels(figure, down + 0.45, len(systems), 3, gap=(0.62, 0.12), sharey=True)
    for row, (name, about) in zip(
        np.reshape(grid, (len(systems), 3)), systems.items(), strict=True
    ):
        points = about["points"]
        main = [point for point in points if point["axis"] == MAIN]
        middle = next(point["units"] for point in points if point["axis"] != MAIN)
        crude = sorted(
            (point for point in main if point["simulator"] == CRUDE), key=lambda each: each["units"]
        )
        by_simulator = [
            point
            for each in _SIMULATORS
            for point in main
            if point["units"] == middle and point["simulator"] == each
        ]
        here = [point for point in crude if point["units"] == middle]
        commands = sorted(
            [*here, *(point for point in points if point["axis"] == "commands")],
            key=lambda each: list(_COMMANDS).index(each["level"]),
        )
        for use, (label, style) in SHOWN.items():
            _curve(row[0], np.array([point["units"] for point in crude]), crude, use, label, style)
            for axes, there in ((row[1], by_simulator), (row[2], commands)):
                _curve(
                    axes,
                    np.arange(len(there)),
                    here * len(there) if use == NO_SIMULATOR else there,
                    use,
                    label,
                    style,
                )
        for place, (use, (_, style)) in enumerate(SHOWN.items()):
            recall = here[0]["uses"][use]["recall"]
            at = middle * 1.1 ** (place - 1.5)
            row[0].plot(
                [at, at],
                [100 * recall["low"], 100 * recall["high"]],
                color=style["color"],
                linewidth=1.2,
                alpha=0.6,
            )
        row[0].set_xscale("log")
        windows = 5 if name == "battery" else 10  # of an orbit, of a flight
        row[0].set_xticks(
            [point["units"] for point in crude],
            [f"{windows * point['units']:,}" for point in crude],
        )
        row[0].minorticks_off()
        row[1].set_xticks(
            np.arange(len(by_simulator)),
            [_SIMULATORS[point["simulator"]] for point in by_simulator],
            fontsize=6,
        )
        row[2].set_xticks(
            np.arange(len(commands)), [_COMMANDS[point["level"]] for point in commands], fontsize=6
        )
        for axes, there in ((row[1], by_simulator), (row[2], commands)):
            axes.set_xlim(-0.45, len(there) - 0.55)
        row[0].set_xlim(crude[0]["units"] / 1.4, crude[-1]["units"] * 1.4)
        row[0].set_ylabel(f"{name}: found (%)")
        row[0].set_ylim(-4, 104)
        for axes, label in zip(row, ("known windows", "simulator", "commands"), strict=True):
            axes.set_xlabel(label)
    handles, labels = np.ravel(grid)[0].get_legend_handles_labels()
    above = 1 - down / figure.get_size_inches()[1]
    figure.legend(
        handles,
        labels,
        frameon=False,
        ncols=4,
        loc="upper center",
        bbox_to_anchor=(0.5, above),
        handlelength=2.4,
    )
    return figure


def _curve(
    axes: matplotlib.axes.Axes,
    at: np.ndarray,
    points: list,
    use: str,
    label: str,
    style: Mapping[str, Any],
) -> None:
    """Draws the recall of a use, with open marks where false alarms are too many."""
    uses = [point["uses"][use] for point in points]
    found = np.array([100 * each["recall"]["mean"] for each in uses])
    is_broken = np.array([each["false_alarms"]["mean"] > _BROKEN for each in uses])
    axes.plot(at, found, linewidth=1.2, markersize=3.5, label=label, **style)
    axes.plot(
        at[is_broken],
        found[is_broken],
        style["marker"],
        color=style["color"],
        markerfacecolor="white",
        markersize=3.5,
        zorder=3,
    )


FIGURES = {
    "map": Figure(
        32,
        "What a simulator is worth, and for what",
        "A row of panels for each system: the share of fault windows found over the known telemetry, over simulators from exact to crude, and over what "
        "is known of the commands, with a curve each for the enhanced and the coarse run as reference, for generated training data and for no simulator.",
        reference_or_source,
    ),
}
