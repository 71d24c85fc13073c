"""The figure of the study, drawn from its findings."""

from collections.abc import Iterable, Mapping
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
    COARSE_REFERENCE: ("coarse run as reference", {"color": QUIET, "linestyle": ":", "marker": "D"}),
    SOURCE: ("source of training data", {"color": GENERATED, "linestyle": "--", "marker": "o"}),
    NO_SIMULATOR: ("no simulator", {"color": REAL, "linestyle": "-", "marker": "^"}),
}
_COMMANDS = {"": "known", "delayed, aligned": "late,\naligned", "delayed, ignored": "late,\nignored", "unknown": "unknown"}


def reference_or_source(found: Mapping[str, Any]) -> matplotlib.figure.Figure:
    """Recall of four uses over known telemetry, over the error of the simulator, and over what is known of the commands, a system a row."""
    systems = found["systems"]
    figure, down = new_sheet(
        DOUBLE,
        2.35 * len(systems) + 0.5,
        "A simulator finds faults as a reference, hardly as a source",
        "Share of fault windows found, at thresholds set for 1 % false alarms on the known telemetry. Bands: 95 % intervals over seeds and faults.",
    )
    grid = panels(figure, down + 0.45, len(systems), 3, gap=(0.42, 0.16), sharey=True)
    for row, (name, about) in zip(np.reshape(grid, (len(systems), 3)), systems.items(), strict=True):
        points = about["points"]
        main = [point for point in points if point["axis"] == MAIN]
        middle = next(point["units"] for point in points if point["axis"] != MAIN)
        crude = [point for point in main if point["simulator"] == CRUDE]
        by_error = sorted(
            (point for point in main if point["units"] == middle and SOURCE in point["uses"]), key=lambda each: each["coarse_error"]
        )
        by_error = [point for point in by_error if point["simulator"] != FITTED]
        here = [point for point in crude if point["units"] == middle]
        known = [*here, *(point for point in points if point["axis"] == "commands")]
        known.sort(key=lambda each: list(_COMMANDS).index(each["level"]))
        for use, (label, style) in SHOWN.items():
            _curve(row[0], [point["units"] for point in crude], crude, use, label, style)
            at = here if use == NO_SIMULATOR else by_error
            _curve(
                row[1], [point["coarse_error"] for point in at], at, use, label, style, spread=[point["coarse_error"] for point in by_error]
            )
            _curve(row[2], np.arange(len(known)), known, use, label, style, spread=np.arange(len(known)))
        row[0].set_xscale("log")
        row[1].set_xscale("symlog", linthresh=0.1)
        row[2].set_xticks(np.arange(len(known)), [_COMMANDS[point["level"]] for point in known], fontsize=6)
        row[0].set_ylabel(f"{name}: found (%)")
        row[0].set_ylim(-4, 104)
        row[0].set_xlabel("known orbits" if name == "battery" else "known flights")
        row[1].set_xlabel("error of the simulator (sd of the telemetry)")
        row[2].set_xlabel("commands")
    handles, labels = np.ravel(grid)[0].get_legend_handles_labels()
    above = 1 - down / figure.get_size_inches()[1]
    figure.legend(handles, labels, frameon=False, ncols=4, loc="upper center", bbox_to_anchor=(0.5, above), handlelength=2.4)
    return figure


def _curve(
    axes: matplotlib.axes.Axes,
    at: Iterable[float],
    points: list,
    use: str,
    label: str,
    style: Mapping[str, Any],
    spread: Iterable[float] = (),
) -> None:
    """Draws the recall of a use with its band; a use without a simulator does not depend on one and is drawn as a level line."""
    there = [(place, point["uses"][use]["recall"]) for place, point in zip(at, points, strict=False) if use in point["uses"]]
    if use == NO_SIMULATOR and len(list(spread)):
        there = [(place, there[0][1]) for place in spread]
    places = [place for place, _ in there]
    values = {name: [100 * each[name] for _, each in there] for name in ("mean", "low", "high")}
    axes.plot(places, values["mean"], markersize=3, linewidth=1.2, label=label, **style)
    axes.fill_between(places, values["low"], values["high"], color=style["color"], alpha=0.12, linewidth=0)


FIGURES = {
    "map": Figure(
        32,
        "What a simulator is worth, and for what",
        "A row of panels for each system: the share of fault windows found over the known telemetry, over the error of the simulator, and over what "
        "is known of the commands, with a curve each for the enhanced and the coarse run as reference, for generated training data and for no simulator.",
        reference_or_source,
    ),
}
