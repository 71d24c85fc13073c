"""The figures of the study of the battery, drawn from its findings."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.figure
import numpy as np
from matplotlib.axes import Axes

from enhsim_tf.common.figure import Figure
from enhsim_tf.common.plot_style import AVERAGE, COARSE, DOUBLE, ENHANCED, GENERATED, QUIET, REAL, new_sheet, panels
from studies.battery.detectors import ARMS, REAL_120, RESAMPLED, RESIDUALS
from studies.battery.detectors import COARSE as COARSE_ARM
from studies.battery.detectors import ENHANCED as CLEAN_ARM
from studies.battery.errors import ENHANCERS, FLOOR
from studies.common.figures import in_seeds

Findings = Mapping[str, Any]
_LABELLED_ARM = f"{RESAMPLED}, faults in training"
_RESIDUAL = next(iter(RESIDUALS))
_SHORT = {RESAMPLED: "enhanced + residuals", "enhanced + convolutional GAN": "enhanced + conv. GAN"}


def _enhancers(about: Mapping[str, Any]) -> list[str]:
    """Names of the enhancers, the largest nominal error first, and the floor."""
    return [*sorted(ENHANCERS, key=lambda name: -about["nominal"][name]["mean"]), FLOOR]


def _reached(nominal: Mapping[str, Any]) -> str:
    """Errors on nominal orbits in per cent of the coarse simulator's error."""
    names = {
        "the paper's network": "paper's network",
        "ridge regression": "ridge, all columns",
        "ridge and a network": "ridge and network",
    }
    whole = nominal["coarse itself"]["mean"]
    return ", ".join(f"{words} {100 * nominal[name]['mean'] / whole:.0f} %" for words, name in names.items())


def errors(found: Findings) -> matplotlib.figure.Figure:
    """Error of each enhancer on nominal orbits and on each fault, a regime a panel."""
    regimes = found["regimes"]
    said = "; ".join(f"{regime}: {_reached(about['nominal'])}" for regime, about in regimes.items())
    first = next(iter(regimes.values()))
    figure, down = new_sheet(
        DOUBLE,
        3.7,
        f"Error left by enhancers of a coarse battery simulator, as a share of its own error ({said})",
        "Error of the voltage (NRMSE) on orbits that no enhancer has learnt from. Dot and bar: nominal orbits, mean and standard error over "
        f"{in_seeds(found['seeds'])}. Crosses: mean over five severities of each of the five faults. Last row: the sensor's noise alone.",
    )
    grid = panels(figure, down + 0.2, 1, len(regimes), gap=(0.3, 0.12), sharey=True, sharex=True)
    left = 1.75 / DOUBLE
    width = (1 - left - 0.03) / len(regimes)
    order = _enhancers(first)
    for number, (axes, (regime, about)) in enumerate(zip(grid[0], regimes.items(), strict=True)):
        place = axes.get_position()
        axes.set_position([left + number * width, place.y0 + 0.02, width - 0.03, place.height - 0.02])
        for height, name in enumerate(order):
            nominal = about["nominal"][name]
            colour = COARSE if name == "coarse itself" else REAL if name == FLOOR else GENERATED if name == "paper's network" else ENHANCED
            faults = [float(np.mean(each[name])) for each in about["faults"].values()]
            axes.plot(faults, np.full(len(faults), -height), "x", color=colour, markersize=4, alpha=0.8)
            spread = nominal["mean"] + np.array([-1, 1]) * nominal["standard_error"]
            axes.plot(spread, [-height] * 2, color=colour, linewidth=2.2, alpha=0.45)
            axes.plot(nominal["mean"], -height, "o", color=colour, markersize=5)
        axes.set_xscale("log")
        axes.margins(x=0.06)
        axes.set_title(f"{regime} regime", weight="bold")
        axes.set_xlabel("NRMSE")
        axes.set_yticks(-np.arange(len(order)), order)
        axes.grid(axis="x", which="major", color="#dddddd", linewidth=0.5)
    return figure


_SHOWN: dict[str, dict[str, Any]] = {
    COARSE_ARM: {"color": COARSE, "linestyle": ":", "marker": "s"},
    CLEAN_ARM: {"color": AVERAGE, "linestyle": "--", "marker": "^"},
    RESAMPLED: {"color": ENHANCED, "linestyle": "-", "marker": "o"},
    REAL_120: {"color": REAL, "linestyle": "-", "marker": None},
}
_MORE: dict[str, tuple[str, str, dict[str, Any]]] = {
    "faults in training": (_LABELLED_ARM, "boosted trees", {"color": GENERATED, "linestyle": "-.", "marker": "D"}),
    "residual of the enhanced run": (_RESIDUAL, "residual", {"color": GENERATED, "linestyle": "-", "marker": "v"}),
}


def _recalls(about: Mapping[str, Any], kind: str) -> dict[str, tuple[Sequence[float], dict[str, Any]]]:
    """Curves of a panel: mean recall over detectors for each arm, and the two ways that need the simulator itself."""
    found = {}
    for arm, style in _SHOWN.items():
        each = [detector["by_fault"][kind] for detector in about["detectors"][arm].values()]
        found[_SHORT.get(arm, arm)] = (np.mean(each, axis=0), style)
    for label, (arm, detector, style) in _MORE.items():
        found[label] = (about["detectors"][arm][detector]["by_fault"][kind], style)
    return found


def recall(found: Findings) -> matplotlib.figure.Figure:
    """Recall by fault and severity for each training of the detectors, a regime a row and a fault a column."""
    regimes = found["regimes"]
    kinds = list(next(iter(regimes.values()))["faults"])
    mean = {
        regime: (
            np.mean([each["recall"] for each in about["detectors"][RESAMPLED].values()]),
            about["detectors"][_RESIDUAL]["residual"]["recall"],
        )
        for regime, about in regimes.items()
    }
    said = "; ".join(f"{regime}: {100 * whole:.0f} % and {100 * residual:.0f} %" for regime, (whole, residual) in mean.items())
    figure, down = new_sheet(
        DOUBLE,
        4.6,
        f"Fault windows that are found by detectors trained on enhanced telemetry, and by the difference between telemetry and the enhanced run ({said})",
        "Share of windows with an alarm under each fault, at thresholds that are set for 1 % false alarms on each training's own windows: high recall "
        "is worth nothing where false alarms are high, see the other figure. Means over detectors and seeds; severity 1 is the largest.",
    )
    grid = panels(figure, down + 0.55, len(regimes), len(kinds), gap=(0.2, 0.12), sharex=True, sharey=True)
    for row, (regime, about) in zip(grid, regimes.items(), strict=True):
        for axes, kind in zip(row, kinds, strict=True):
            for label, (values, style) in _recalls(about, kind).items():
                axes.plot(about["faults"][kind]["severities"], 100 * np.asarray(values), markersize=3, linewidth=1.2, label=label, **style)
            axes.set_ylim(-4, 104)
            axes.set_xlim(0.12, 1.08)
            axes.set_xticks((0.2, 0.6, 1.0))
        row[0].set_ylabel(f"{regime}: recall (%)")
    for axes, kind in zip(grid[0], kinds, strict=True):
        axes.set_title(kind, weight="bold", fontsize=7.5)
    for axes in grid[-1]:
        axes.set_xlabel("severity")
    _legend_above(figure, grid[0, 0], down)
    return figure


def _legend_above(figure: matplotlib.figure.Figure, axes: Axes, down: float) -> None:
    height = figure.get_size_inches()[1]
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, frameon=False, ncols=3, loc="upper center", bbox_to_anchor=(0.5, 1 - down / height), handlelength=2.6)


def alarms(found: Findings) -> matplotlib.figure.Figure:
    """False alarms of the detectors for each training, a regime a panel."""
    regimes = found["regimes"]
    rates = {regime: {arm: _rates(about, arm) for arm in _arms(about)} for regime, about in regimes.items()}
    said = "; ".join(
        f"{regime}: {100 * np.mean(each[RESAMPLED]):.1f} %, and {100 * np.mean(each[REAL_120]):.1f} % from as many real orbits"
        for regime, each in rates.items()
    )
    fewer = any("dense autoencoder" in each for about in regimes.values() for each in about["detectors"].values())
    figure, down = new_sheet(
        DOUBLE,
        3.9,
        f"False alarms of detectors trained on the enhanced simulator with its residuals drawn again ({said})",
        "Vertical line: the rate that thresholds are set for, 1 %. Dot: mean over detectors and seeds; small marks: single detectors; rates below 0.1 % are "
        "drawn at 0.1 %."
        + (" The autoencoders and the GAN ran for fewer seeds, and the autoencoders for three of the trainings." if fewer else ""),
    )
    grid = panels(figure, down + 0.2, 1, len(regimes), gap=(0.3, 0.12), sharey=True, sharex=True)
    left = 1.95 / DOUBLE
    width = (1 - left - 0.03) / len(regimes)
    names = list(dict.fromkeys(arm for each in rates.values() for arm in each))
    for number, (axes, (regime, each)) in enumerate(zip(grid[0], rates.items(), strict=True)):
        place = axes.get_position()
        axes.set_position([left + number * width, place.y0 + 0.02, width - 0.03, place.height - 0.02])
        for height, arm in enumerate(names):
            if arm not in each:
                continue
            colour = REAL if arm.startswith("real") else COARSE if arm == COARSE_ARM else GENERATED if arm == _RESIDUAL else ENHANCED
            values = np.maximum(each[arm], 1e-3)
            axes.plot(values, np.full(len(values), -height), "|", color=colour, markersize=6)
            axes.plot(max(np.mean(each[arm]), 1e-3), -height, "o", color=colour, markersize=4)
        axes.axvline(0.01, color=QUIET, linewidth=0.6, zorder=0)
        axes.set_xscale("log")
        axes.set_xlim(0.0008, 1.4)
        axes.set_xticks((0.001, 0.01, 0.1, 1.0), ("0.1", "1", "10", "100"))
        axes.minorticks_off()
        axes.set_title(f"{regime} regime", weight="bold")
        axes.set_xlabel("false alarms on nominal orbits (%)")
        axes.set_yticks(-np.arange(len(names)), [_SHORT.get(arm, arm) for arm in names])
    return figure


def _arms(about: Mapping[str, Any]) -> list[str]:
    return [arm for arm in (*ARMS, _RESIDUAL) if arm in about["detectors"]]


def _rates(about: Mapping[str, Any], arm: str) -> list[float]:
    return [each["false_alarms"]["mean"] for each in about["detectors"][arm].values()]


FIGURES = {
    "errors": Figure(
        31,
        "Enhancing a coarse battery simulator",
        "A panel for each regime with a row for each enhancer: the error on nominal orbits as a dot, and on each of five faults as a cross, on a logarithmic axis. "
        "The title gives the errors of the coarse simulator, of ridge regression and of ridge regression with a network.",
        errors,
    ),
    "alarms": Figure(
        32,
        "False alarms of detectors on the fine battery simulator",
        "A panel for each regime with a row for each training: a mark for each detector and a dot for their mean, on a logarithmic axis with a line at 1 %.",
        alarms,
    ),
    "recall": Figure(
        33,
        "Faults of the battery that detectors find",
        "A row of panels for each regime and a column for each fault: the share of windows with an alarm over the severity, a curve for each training.",
        recall,
    ),
}
