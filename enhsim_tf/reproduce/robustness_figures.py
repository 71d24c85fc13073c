"""The figures of the experiment on robustness, drawn from its findings alone."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.figure
import numpy as np
from matplotlib.axes import Axes

from enhsim_tf.reproduce.caption import in_seeds
from enhsim_tf.reproduce.degraded_modes import LARGEST_TRAINED, SCORED
from enhsim_tf.reproduce.figures import Figure
from enhsim_tf.reproduce.replicates import ARMS, MIXED, SCALED
from enhsim_tf.sheet import AVERAGE, COARSE, DOUBLE, ENHANCED, GENERATED, IN_PRINT, QUIET, REAL, label_ends, new_sheet, panels

Findings = Mapping[str, Any]
_NAMES = {
    "white": "white noise",
    "autoregressive": "coloured noise, AR(1)",
    "heteroscedastic": "heteroscedastic noise",
    "shot": "shot noise",
}
_LEAST = 2e-4  # a rate of zero is drawn here


def _colour(arm: str) -> str:
    if arm in ("real", "truth"):
        return REAL
    return COARSE if arm == "coarse" else ENHANCED if arm.startswith("ours") else GENERATED


def _per_cent(axes: Axes, ticks: Sequence[float]) -> None:
    axes.set_xticks(ticks, [f"{100 * tick:g}" for tick in ticks])
    axes.minorticks_off()


def _scope(found: Findings) -> str:
    return f"{in_seeds(found['seeds'])}, {found['num_windows']:,} real nominal windows each"


def false_alarms(found: Findings) -> matplotlib.figure.Figure:
    """False alarms by arm and detector, an environment a panel."""
    arms, paper, ours, real = (
        [found["arms"][name] for name in ARMS],
        *(found["arms"][n] for n in ("enhanced + GAN", "ours + GAN", "real")),
    )
    figure, down = new_sheet(
        DOUBLE,
        6.4,
        f"Detectors trained with the paper's generated noise alarm on {100 * paper['false_alarms']['mean']:.0f} % of real nominal telemetry, "
        f"with the second generator's on {100 * ours['false_alarms']['mean']:.1f} %; trained on real telemetry, on {100 * real['false_alarms']['mean']:.1f} %",
        f"Set for 1 % (line). Dot and bar: mean over seven detectors, with its 95 % interval over seeds; small marks: each detector. {_scope(found)}.",
    )
    environments = found["environments"]
    rows = -(-len(environments) // 2)
    grid = panels(figure, down + 0.22, rows, min(2, len(environments)), gap=(0.42, 0.16), sharey=True, sharex=True)
    left = 1.5 / DOUBLE
    for number, (axes, name) in enumerate(zip(grid.ravel(), environments, strict=False)):
        place = axes.get_position()
        width = (1 - left - 0.04) / grid.shape[1]
        axes.set_position([left + (number % grid.shape[1]) * width, place.y0, width - 0.03, place.height])
        for height, arm in enumerate(ARMS):
            about, colour = arms[height]["by_environment"][name], _colour(arm)
            each = np.maximum(list(about["detectors"].values()), _LEAST)
            axes.plot(each, np.full(len(each), -height), "|", color=colour, markersize=5, alpha=0.75)
            mean = about["false_alarms"]
            axes.plot(np.maximum([mean["low"], mean["high"]], _LEAST), [-height] * 2, color=colour, linewidth=2.2, alpha=0.45)
            axes.plot(max(mean["mean"], _LEAST), -height, "o", color=colour, markersize=4)
        axes.axvline(0.01, color=QUIET, linewidth=0.6, zorder=0)
        axes.set_xscale("log")
        axes.set_xlim(_LEAST * 0.8, 1.2)
        _per_cent(axes, (0.001, 0.01, 0.1, 1.0))
        axes.set_title(_NAMES[name], weight="bold")
        axes.set_yticks(-np.arange(len(ARMS)), list(ARMS))
        if number // grid.shape[1] == grid.shape[0] - 1:
            axes.set_xlabel("false alarms on real nominal windows (%)")
    return figure


_SHOWN = {
    "real": (REAL, "-"),
    "ours + GAN": (ENHANCED, "-"),
    "ours + AR": (ENHANCED, ":"),
    "enhanced + GAN": (GENERATED, "-"),
    "enhanced + AR": (GENERATED, ":"),
    "coarse": (COARSE, "--"),
}


def recall(found: Findings) -> matplotlib.figure.Figure:
    """Recall at the real rate of false alarms against severity, a kind of anomaly a panel."""
    curves = found["recall_curves"]
    at = {arm: np.mean([curves[kind][arm]["recall_at_real_rate"] for kind in curves]) for arm in _SHOWN}
    figure, down = new_sheet(
        DOUBLE,
        4.4,
        f"With the threshold set on real telemetry, detectors trained on the second generator's noise find {100 * at['ours + GAN']:.0f} % "
        f"of anomalies, on real telemetry {100 * at['real']:.0f} %, on the paper's generated noise {100 * at['enhanced + GAN']:.0f} %",
        f"Recall at 1 % false alarms on real nominal windows, whatever the arm's own threshold; means over detectors, environments and {_scope(found)}.",
    )
    grid = panels(figure, down + 0.22, 2, 4, right=1.1, gap=(0.42, 0.16), sharex=True, sharey=True)
    for axes, (kind, arms) in zip(grid.ravel(), curves.items(), strict=True):
        for arm, (colour, style) in _SHOWN.items():
            axes.plot(arms[arm]["severity"], arms[arm]["recall_at_real_rate"], style, color=colour)
        axes.set_title(kind.replace("_", " "))
        axes.set_xscale("log")
        axes.set_xticks([0.5, 1, 2, 4, 8], ["0.5", "1", "2", "4", "8"])
        axes.minorticks_off()
        axes.set_ylim(0, 1.02)
    label_ends(grid[0, -1], {arm: (curves[list(curves)[3]][arm]["recall_at_real_rate"], colour) for arm, (colour, _) in _SHOWN.items()})
    for axes in grid[-1]:
        axes.set_xlabel("severity (sd of the noise)")
    for axes in grid[:, 0]:
        axes.set_ylabel("recall")
    return figure


def realism_value(found: Findings) -> matplotlib.figure.Figure:
    """Which measure of realism predicts what noise is worth to a detector."""
    measures = sorted(found["measures"]["predicts"].items(), key=lambda each: each[1]["rho"])
    (best, strongest), (_, weakest) = measures[0], measures[-1]
    figure, down = new_sheet(
        DOUBLE,
        3.9,
        f"The measure that best predicts a noise's value to detectors: {best} (rank correlation {strongest['rho']:.2f}); the worst reaches {weakest['rho']:.2f}",
        f"Spearman's rho between the departure from real noise and the share of the false-alarm gap closed, over {found['measures']['num_rows']} "
        "noises of all environments and seeds, with 95 % intervals; −1 would be perfect.",
    )
    axes = panels(figure, down + 0.12, 1, 1)[0, 0]
    place = axes.get_position()
    axes.set_position([2.5 / DOUBLE, place.y0, 1 - 2.7 / DOUBLE, place.height])
    for height, (_, about) in enumerate(measures):
        colour = ENHANCED if about["high"] < 0 else COARSE
        axes.plot([about["low"], about["high"]], [-height] * 2, color=colour, linewidth=2, alpha=0.5)
        axes.plot(about["rho"], -height, "o", color=colour, markersize=4)
    axes.set_yticks(-np.arange(len(measures)), [f"{about['section']}  {name}" for name, about in measures])
    axes.axvline(0, color=QUIET, linewidth=0.6, zorder=0)
    axes.set_xlim(-1.02, max(0.02, axes.get_xlim()[1]))
    axes.set_xlabel("rank correlation with the gap closed")
    return figure


def scale_and_share(found: Findings) -> matplotlib.figure.Figure:
    """False alarms and recall against the scale of the noise, and against the share of real windows mixed in."""
    rows = found["variations"]
    shown = {
        "enhanced": (GENERATED, "--"),
        "enhanced + GAN": (GENERATED, "-"),
        "enhanced + AR": (GENERATED, ":"),
        "ours + GAN": (ENHANCED, "-"),
    }
    (only_scaled,) = (arm for arm in SCALED if arm not in MIXED)

    def curve(arm: str, x: str, fixed: Mapping[str, float], value: str) -> np.ndarray:
        points = [(row[x], row[value]) for row in rows if row["arm"] == arm and all(row[key] == each for key, each in fixed.items())]
        return np.array(sorted(points)).T

    scaled = {row["scale"]: row for row in rows if row["arm"] == "ours + GAN" and row["real_share"] == 0}
    low, own, high = (scaled[scale] for scale in (0.75, 1.0, 1.5))
    figure, down = new_sheet(
        DOUBLE,
        4.6,
        f"Noise has to have the right scale: the second generator's, at {low['scale']:g} times its own, leaves {100 * low['false_alarms']:.0f} % "
        f"false alarms, at its own {100 * own['false_alarms']:.1f} %, at {high['scale']:g} times {100 * high['false_alarms']:.0f} %",
        f"Means over the five detectors that are no networks, environments and {_scope(found)}.",
    )
    grid = panels(figure, down + 0.2, 2, 2, right=1.15, gap=(0.2, 0.62), sharex="col")
    for row, (value, label) in enumerate((("false_alarms", "false alarms (%)"), ("recall", "recall (%)"))):
        for column, (x, fixed) in enumerate((("scale", {"real_share": 0.0}), ("real_share", {"scale": 1.0}))):
            axes, ends = grid[row, column], {}
            for arm, (colour, style) in shown.items():
                points = curve(arm, x, fixed, value)
                if points.size and points.shape[1] > 2:
                    marked = {"color": colour, "marker": "o", "markersize": 2.5, "clip_on": False}
                    axes.plot(points[0] * (100 if column else 1), 100 * points[1], style, **marked)
                    ends[arm] = (100 * points[1], colour)
                    if arm == only_scaled:  # its name is not beside the right panels
                        axes.annotate(
                            arm, (points[0][1], 100 * points[1][1]), (4, 3), textcoords="offset points", color=IN_PRINT.get(colour, colour)
                        )
            axes.set_ylabel(label)
            axes.set_ylim(0, 104 if row == 0 else None)
            if column:
                axes.set_xscale("symlog", linthresh=1)
                axes.set_xticks([0, 1, 5, 25, 100], ["0", "1", "5", "25", "100"])
                axes.minorticks_off()
                label_ends(axes, ends)
    grid[1, 0].set_xlabel("scale of the noise (1: as generated)")
    grid[1, 1].set_xlabel("real windows mixed in (%)")
    return figure


_METHODS = {
    "identity": (COARSE, "--", "coarse"),
    "ridge": (AVERAGE, ":", "ridge"),
    "paper": (GENERATED, "-", "paper's enhancer"),
    "more windows": (ENHANCED, ":", "more windows"),
    "randomised": (ENHANCED, "-", "randomised"),
}


def degraded_modes(found: Findings) -> matplotlib.figure.Figure:
    """Error against severity, a degraded mode a panel."""
    rows, errors = found["modes"]["by_mode"], found["modes"]["nrmse"]
    modes = list(dict.fromkeys(row["mode"] for row in rows if row["mode"] != "nominal"))
    figure, down = new_sheet(
        DOUBLE,
        4.2,
        f"The paper's enhancer errs by {errors['paper']['inside']:.2f} up to severity {found['modes']['largest_trained']} and by "
        f"{errors['paper']['outside']:.2f} beyond; trained over randomised configurations up to there, by {errors['randomised']['inside']:.2f} and "
        f"{errors['randomised']['outside']:.2f}",
        f"Root mean square error of the enhanced signal against the true degraded one, in units of the nominal signal's standard deviation; grey: severities "
        f"that the randomised enhancer was trained on; {in_seeds(found['modes']['seeds'])}.",
    )
    grid = panels(figure, down + 0.22, 2, 3, right=1.15, gap=(0.42, 0.36), sharex=True)
    for axes, mode in zip(grid.ravel(), modes, strict=True):
        ends = {}
        axes.axvspan(0, LARGEST_TRAINED, color="#f3f3f3", zorder=0)
        for method, (colour, style, label) in _METHODS.items():
            nominal = [(0.0, row["nrmse"]) for row in rows if row["method"] == method and row["mode"] == "nominal"]
            points = nominal + sorted((row["severity"], row["nrmse"]) for row in rows if row["method"] == method and row["mode"] == mode)
            axes.plot(*np.transpose(points), style, color=colour)
            ends[label] = ([points[-1][1]], colour)
        axes.set_title(mode.replace("_", " "))
        axes.set_ylim(0, None)
        axes.yaxis.set_major_formatter("{x:g}")
        axes.set_xticks([0, 0.5, 1], ["0", "0.5", "1"])
        if axes is grid[0, -1]:
            label_ends(axes, ends)
    for axes in grid[-1]:
        axes.set_xlabel("severity")
    for axes in grid[:, 0]:
        axes.set_ylabel("error (sd of the signal)")
    return figure


def out_of_range(found: Findings) -> matplotlib.figure.Figure:
    """Error of a window against its out-of-range score."""
    trust, curves = found["modes"]["trust"], found["trust_curves"]
    figure, down = new_sheet(
        DOUBLE,
        2.7,
        f"The out-of-range score rises with the error: rank correlation {trust['paper']['rank_correlation']:.2f} for the paper's enhancer, "
        f"{trust['randomised']['rank_correlation']:.2f} for the randomised one",
        "Tenths of all windows, nominal and degraded, by their score: median error and the range of the middle 80 %.",
    )
    grid = panels(figure, down + 0.22, 1, len(curves), gap=(0.2, 0.3), sharey=True)[0]
    for axes, method in zip(grid, SCORED, strict=True):
        about = curves[method]
        axes.fill_between(about["score"], about["low"], about["high"], color="#e4eff7", linewidth=0)
        axes.plot(about["score"], about["median"], "o-", color=ENHANCED, markersize=2.5)
        axes.set_title(_METHODS[method][2])
        axes.set_xlabel("out-of-range score")
        axes.set_ylim(0, None)
    grid[0].set_ylabel("error (sd of the signal)")
    return figure


FIGURES: dict[str, Figure] = {
    "false_alarms": Figure(
        21,
        "False alarms by training arm",
        "Four panels, one for each kind of noise. Thirteen training arms from top to bottom, the false-alarm rate on a logarithmic axis: a dot "
        "with an interval for the mean over seven detectors, small marks for each of them, a line at the one per cent they are set for.",
        false_alarms,
    ),
    "recall": Figure(
        22,
        "Recall against severity",
        "Eight panels, one for each kind of anomaly: recall at a real false-alarm rate of one per cent against the severity in standard "
        "deviations of the noise, for detectors trained on six arms.",
        recall,
    ),
    "realism_value": Figure(
        23,
        "Which measure predicts detector value",
        "Measures of realism from top to bottom, sorted by their rank correlation with the share of the false-alarm gap closed, with intervals.",
        realism_value,
    ),
    "scale_and_share": Figure(
        24,
        "Noise scale and real share",
        "Two columns: false alarms and recall against the scale of the noise, and against the share of real windows mixed in.",
        scale_and_share,
    ),
    "degraded_modes": Figure(
        25,
        "Error in degraded modes",
        "Six panels, one for each degraded mode: error against severity for the coarse signal, ridge regression and three enhancers; the "
        "severities that the randomised enhancer was trained on are shaded.",
        degraded_modes,
    ),
    "out_of_range": Figure(
        26,
        "Error against the out-of-range score",
        "Three panels, one for each enhancer: median error of a window against its out-of-range score, rising, with a band.",
        out_of_range,
    ),
}
"""The experiment's figures by name; `Figure.draw` takes the findings."""
