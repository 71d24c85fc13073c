"""The figures of the experiment on robustness, drawn from its findings alone."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.figure
import numpy as np
from matplotlib.axes import Axes

from enhsim_tf.common.figure import Figure
from enhsim_tf.common.number_words import in_words
from enhsim_tf.common.plot_style import AVERAGE, COARSE, DOUBLE, ENHANCED, GENERATED, QUIET, REAL, label_ends, new_sheet, panels
from enhsim_tf.detection.registry import DETECTORS
from studies.common.figures import in_seeds
from studies.robustness.degraded_modes import LARGEST_TRAINED, SCORED
from studies.robustness.replicate import ARMS, MIXED, SCALED

Findings = Mapping[str, Any]
_NAMES = {
    "white": "white noise",
    "autoregressive": "coloured noise, AR(1)",
    "heteroscedastic": "heteroscedastic noise",
    "shot": "shot noise",
}
_LEAST = 2e-4  # rates below this are drawn here, because the axis is logarithmic
_SHORT = {"residual + convolutional GAN": "residual + conv. GAN"}  # for labels beside a curve


def _colour(arm: str) -> str:
    if arm in ("real", "truth"):
        return REAL
    return COARSE if arm == "coarse" else ENHANCED if arm.startswith("residual") else GENERATED


def _per_cent(axes: Axes, ticks: Sequence[float]) -> None:
    axes.set_xticks(ticks, [f"{100 * tick:g}" for tick in ticks])
    axes.minorticks_off()


def _signed(value: float) -> str:
    """A number with two decimals and a minus sign instead of a hyphen."""
    return f"{value:.2f}".replace("-", "−")


def _scope(found: Findings) -> str:
    return f"{in_seeds(found['seeds'])}, {found['num_windows']:,} nominal windows each"


def false_alarms(found: Findings) -> matplotlib.figure.Figure:
    """False alarms by arm and detector, an environment a panel."""
    arms, paper, residual, real = (
        [found["arms"][name] for name in ARMS],
        *(found["arms"][n] for n in ("enhanced + GAN", "residual + convolutional GAN", "real")),
    )
    environments = found["environments"]
    figure, down = new_sheet(
        DOUBLE,
        6.4,
        f"Detectors trained with noise of the paper's GAN raise false alarms on {100 * paper['false_alarms']['mean']:.0f} % of nominal windows on average, "
        f"those trained with noise of the convolutional GAN on {100 * residual['false_alarms']['mean']:.1f} %, "
        f"and those trained on real telemetry on {100 * real['false_alarms']['mean']:.1f} %",
        f"Vertical line: the rate that thresholds are set for, 1 %. Dot and bar: mean over {len(real['by_environment'][environments[0]]['detectors'])} "
        f"detectors with its 95 % interval over seeds; small marks: single detectors; rates below {100 * _LEAST:g} % are drawn at {100 * _LEAST:g} %. "
        f"Example telemetry stands in for real telemetry; {_scope(found)}.",
    )
    rows = -(-len(environments) // 2)
    grid = panels(figure, down + 0.22, rows, min(2, len(environments)), gap=(0.42, 0.16), sharey=True, sharex=True)
    left = 1.95 / DOUBLE
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


# line styles and markers differ, so that the curves can be told apart in greyscale
_SHOWN = {
    "real": {"color": REAL, "linestyle": "-", "linewidth": 1.8},
    "residual + convolutional GAN": {"color": ENHANCED, "linestyle": "-", "marker": "o", "markersize": 2.5},
    "residual + AR": {"color": ENHANCED, "linestyle": ":"},
    "enhanced + GAN": {"color": GENERATED, "linestyle": "--", "marker": "s", "markersize": 2.5},
    "enhanced + AR": {"color": GENERATED, "linestyle": ":"},
    "coarse": {"color": COARSE, "linestyle": "-."},
}


def recall(found: Findings) -> matplotlib.figure.Figure:
    """Recall at the real rate of false alarms against severity, a kind of anomaly a panel."""
    curves = found["recall_curves"]
    at = {arm: np.mean([curves[kind][arm]["recall_at_real_rate"] for kind in curves]) for arm in _SHOWN}
    figure, down = new_sheet(
        DOUBLE,
        4.4,
        f"With the threshold set on real telemetry, detectors trained with noise of the convolutional GAN find {100 * at['residual + convolutional GAN']:.0f} % "
        f"of anomalies, those trained on real telemetry {100 * at['real']:.0f} %, and those with noise of the paper's GAN {100 * at['enhanced + GAN']:.0f} %",
        "Recall at the real rate: the threshold is set for 1 % false alarms on real windows. Means over detectors, environments and "
        f"{in_seeds(found['seeds'])}.",
    )
    grid = panels(figure, down + 0.22, 2, 4, right=1.45, gap=(0.42, 0.16), sharex=True, sharey=True)
    for axes, (kind, arms) in zip(grid.ravel(), curves.items(), strict=True):
        for arm, style in _SHOWN.items():
            axes.plot(arms[arm]["severity"], arms[arm]["recall_at_real_rate"], **style, clip_on=False)
        axes.set_title(kind.replace("_", " "))
        axes.set_xscale("log")
        axes.set_xticks([0.5, 1, 2, 4, 8], ["0.5", "1", "2", "4", "8"])
        axes.minorticks_off()
        axes.set_ylim(0, 1.02)
    label_ends(
        grid[0, -1],
        {_SHORT.get(arm, arm): (curves[list(curves)[3]][arm]["recall_at_real_rate"], style["color"]) for arm, style in _SHOWN.items()},
    )
    for axes in grid[-1]:
        axes.set_xlabel("severity (noise sd)")
    for axes in grid[:, 0]:
        axes.set_ylabel("recall")
    return figure


def realism_value(found: Findings) -> matplotlib.figure.Figure:
    """Rank correlation of each measure of realism with the share of the false-alarm gap that a noise closes."""
    measures = sorted(found["measures"]["predicts"].items(), key=lambda each: each[1]["rho"])
    (best, strongest), (within, inside) = measures[0], min(measures, key=lambda each: each[1]["within"])
    there = _signed(inside["within"])
    is_tie = _signed(strongest["within"]) == there
    names = f"“{best}” and “{within}” do" if is_tie else f"“{within}” does"
    inside_too = "within each kind of noise, on average, " + ("it does too" if within == best else f"{names} ({there})")
    figure, down = new_sheet(
        DOUBLE,
        3.9,
        f"Of all measures of realism, “{best}” best predicts how much a noise model reduces false alarms (rank correlation {_signed(strongest['rho'])}); {inside_too}",
        "Dot and bar: Spearman's rank correlation between a measure's distance from real noise and the share of the false-alarm gap (coarse to real "
        f"training) that the noise model closes, with its 95 % interval, over {found['measures']['num_rows']} noise models of all environments and seeds. "
        "Cross: mean of the correlations within each environment. A perfect predictor has −1.",
    )
    axes = panels(figure, down + 0.12, 1, 1)[0, 0]
    place = axes.get_position()
    axes.set_position([2.5 / DOUBLE, place.y0, 1 - 2.7 / DOUBLE, place.height])
    for height, (_, about) in enumerate(measures):
        colour = ENHANCED if about["high"] < 0 else COARSE
        axes.plot([about["low"], about["high"]], [-height] * 2, color=colour, linewidth=2, alpha=0.5)
        axes.plot(about["rho"], -height, "o", color=colour, markersize=4)
        axes.plot(about["within"], -height, "x", color=REAL, markersize=4)
    axes.set_yticks(-np.arange(len(measures)), [name for name, _ in measures])
    axes.axvline(0, color=QUIET, linewidth=0.6, zorder=0)
    axes.set_xlim(-1.02, max(0.02, *(about[end] + 0.03 for _, about in measures for end in ("high", "within"))))
    axes.set_xlabel("rank correlation with the share of the gap closed")
    return figure


_FEATURES = ("isolation forest", "one-class SVM")  # detectors that use features of a window instead of its samples


def scale_and_share(found: Findings) -> matplotlib.figure.Figure:
    """False alarms and recall against the scale of the noise, and against the share of real windows mixed in."""
    rows = found["variations"]
    scaled = {row["scale"]: row for row in found["variations"] if row["arm"] == "residual + convolutional GAN" and row["real_share"] == 0}
    quiet, own, loud = (scaled[scale] for scale in (0.75, 1.0, 1.5))

    def found_by_values(row: Mapping[str, Any]) -> float:
        return 100 * float(np.mean([about["recall"] for name, about in row["by_detector"].items() if name not in _FEATURES]))

    in_environments = ", ".join(f"{100 * quiet['by_environment'][name]:.0f} % ({name})" for name in found["environments"])
    figure, down = new_sheet(
        DOUBLE,
        4.8,
        f"With noise of the convolutional GAN scaled by {quiet['scale']:g}, the false-alarm rate is {in_environments}; scaled by {loud['scale']:g}, detectors "
        f"that use the samples of a window find {found_by_values(loud):.0f} % of anomalies, and {found_by_values(own):.0f} % with noise as generated",
        f"Means over {len(loud['by_detector'])} detectors (no neural networks), environments and {in_seeds(found['seeds'])}. Right: real windows replace some "
        "of the windows for training and threshold (solid) or for training only (dashed). Dotted: upper bound for the solid curves, 1 % divided by the share of real windows.",
    )
    grid = panels(figure, down + 0.2, 2, 2, right=1.45, gap=(0.2, 1.8), sharex="col")
    shares = [arm for arm in MIXED if arm != "residual, no noise"]
    for row, (value, label) in enumerate((("false_alarms", "false alarms (%)"), ("recall", "recall (%)"))):
        left, right = grid[row]
        ends: dict[str, Any] = {}
        for arm in SCALED:
            points = sorted((each["scale"], 100 * each[value]) for each in rows if each["arm"] == arm and each["real_share"] == 0)
            left.plot(*np.transpose(points), **_SHOWN[arm], clip_on=False)
            ends[_SHORT.get(arm, arm)] = ([points[-1][1]], _SHOWN[arm]["color"])
        right_ends: dict[str, Any] = {}
        for arm in shares:
            colour = COARSE if arm == "enhanced" else _SHOWN[arm]["color"]
            for both, style in ((True, "-"), (False, "--")):
                points = sorted(
                    (100 * each["real_share"], 100 * each[value])
                    for each in rows
                    if each["arm"] == arm and each["scale"] == 1 and (each["real_threshold"] == both or each["real_share"] == 0)
                )
                right.plot(*np.transpose(points), style, color=colour, marker="o", markersize=2.5, clip_on=False)
                if not both:
                    right_ends[_SHORT.get(arm, arm)] = ([points[-1][1]], colour)
        if not row:
            share = np.geomspace(1, 100, 50)
            right.plot(share, 100 / share, ":", color=QUIET)
        right.set_xscale("symlog", linthresh=1)
        right.set_xticks([0, 1, 5, 25, 100], ["0", "1", "5", "25", "100"])
        right.minorticks_off()
        for axes in grid[row]:
            axes.set_ylabel(label)
            axes.set_ylim(0, 104)
        label_ends(left, ends)
        label_ends(right, right_ends)
    grid[1, 0].set_xlabel("scale of the noise (1: as generated)")
    grid[1, 1].set_xlabel("real windows mixed in (%)")
    return figure


_METHODS = {
    "identity": (COARSE, "-.", "coarse"),
    "ridge, randomised": (AVERAGE, ":", "ridge, randomised"),
    "paper": (GENERATED, "--", "paper's enhancer"),
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
        f"Above severity {found['modes']['largest_trained']}, the error of the paper's enhancer is {errors['paper']['outside']:.2f} and that of the coarse signal "
        f"{errors['identity']['outside']:.2f}; trained on randomised configurations up to that severity, a network has {errors['randomised']['outside']:.2f} "
        f"and ridge regression {errors['ridge, randomised']['outside']:.2f}",
        "Root-mean-square error of the enhanced signal with respect to the true degraded signal, in standard deviations of the nominal signal. "
        "“More windows”: the paper's network, trained on more nominal windows for fewer epochs. “Randomised”: trained on random configurations of all modes, "
        f"with severities in the grey area. Mean over {in_seeds(found['modes']['seeds'])}.",
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
        "All windows, nominal and degraded, in ten groups of increasing score: median error, and the range from the 10th to the 90th percentile.",
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
        f"with an interval for the mean over {in_words(len(DETECTORS))} detectors, a small mark for each detector, and a line at the target "
        "rate of one per cent.",
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
        "Which measure of realism predicts false alarms",
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
