"""The figure of the factorial experiment, drawn from its findings alone."""

from collections.abc import Mapping
from typing import Any

import matplotlib.figure
import numpy as np
from matplotlib.axes import Axes

from enhsim_tf.common.figure import Figure
from enhsim_tf.common.plot_style import COARSE, DOUBLE, ENHANCED, GENERATED, QUIET, new_sheet, panels
from studies.common.figures import in_list, in_seeds
from studies.factorial.cells import AUTOREGRESSION, CONVOLUTIONAL_GAN, LEVELS, WHOLE_WINDOWS

_SHOWN = {  # colour, marker and fill differ, so that the comparisons can be told apart in greyscale
    WHOLE_WINDOWS: (ENHANCED, "o", ENHANCED),
    AUTOREGRESSION: (COARSE, "s", "white"),
    CONVOLUTIONAL_GAN: (GENERATED, "^", GENERATED),
}
_ROWS = {
    "windows": "windows: 1,500\nto 15,000",
    "extraction": "extraction: moving\naverage to residual",
    "enhancer": "enhancer: network\nto ridge regression",
    "generator": "generator: paper's\nGAN to {}",
}
_PANELS = {"gap_closed": "points of the gap in false alarms", "recall_at_real_rate": "points of recall at the real rate"}
_LINE, _SPACE = 0.3, 0.5  # height of a line in inches, and space between two factors in lines
_SINGLE_ORDERS = {"first": "<", "last": ">"}  # markers of the change if a factor is switched first and last


def contributions(found: Mapping[str, Any]) -> matplotlib.figure.Figure:
    """Contribution of each factor to the two outcomes, with one mark for each generator that replaces the paper's GAN."""
    shares = found["shares"]
    name, main = next(iter(shares.items()))
    closed = main["gap_closed"]
    parts = parts_of_difference(closed)
    ranked = sorted(parts, key=lambda factor: -parts[factor])
    verbs = dict.fromkeys(ranked, "") | {ranked[0]: "accounts for "}
    said = in_list([f"the {factor} {verbs[factor]}{_signed(100 * parts[factor])}\N{NO-BREAK SPACE}%" for factor in ranked])
    figure, down = new_sheet(
        DOUBLE,
        2.5 + _LINE * len(LEVELS) * (len(shares) + _SPACE),
        f"The paper's pipeline closes {100 * closed['paper']['mean']:.0f} % of the gap in false alarms, and ridge regression with {name} of its residuals "
        f"{100 * closed['switched']['mean']:.0f} %. Of this difference, {said}",
        "Change that switching a factor makes, as the mean over all orders of switching the four factors (Shapley value). Bars: 95 % intervals over "
        f"environments and seeds; letters: {in_list(found['environments'])} noise alone; triangles: change if the factor is switched first (pointing left) "
        f"or last (pointing right); numbers at the right: means. On 15,000 windows the network trains for fewer epochs. {_runs(shares)}",
    )
    grid = panels(figure, down + 0.42, 1, 2, gap=(0.2, 0.25), sharey=True)[0]
    left, heights = 1.35 / DOUBLE, _heights(shares)
    width = (1 - left - 0.02) / 2
    for number, (axes, (outcome, label)) in enumerate(zip(grid, _PANELS.items(), strict=True)):
        place = axes.get_position()
        axes.set_position([left + number * width, place.y0, width - 0.03, place.height])
        for generator in shares:
            colour, marker, face = _SHOWN[generator]
            for factor in LEVELS:
                about, at = shares[generator][outcome]["factors"][factor], heights[generator, factor]
                mean, low, high = (100 * about["share"][key] for key in ("mean", "low", "high"))
                for when, single in _SINGLE_ORDERS.items():
                    hollow = {"markersize": 4, "markeredgewidth": 0.8, "markerfacecolor": "none", "linestyle": "none"}
                    axes.plot(100 * about[when]["mean"], at, single, color=colour, **hollow)
                axes.plot([low, high], [at] * 2, color=colour, linewidth=2, alpha=0.6)
                style = {
                    "markerfacecolor": face,
                    "markersize": 5,
                    "linestyle": "none",
                    "label": generator if factor == next(iter(LEVELS)) else None,
                }
                axes.plot(mean, at, marker, color=colour, **style)
                numbered = {"transform": axes.get_yaxis_transform(), "ha": "right", "va": "center", "fontsize": 7, "color": colour}
                axes.text(1.0, at, _signed(mean), **numbered)
        values = [
            100 * value
            for about in shares.values()
            for each in about[outcome]["factors"].values()
            for value in each["by_environment"].values()
        ]
        axes.update_datalim([(value, 0) for value in values])  # letters do not widen the axes by themselves
        axes.margins(x=0.06)
        axes.autoscale_view(scaley=False)
        lowest, highest = axes.get_xlim()
        axes.set_xlim(lowest, highest + 0.08 * (highest - lowest))  # space for the numbers at the right
        _letters(axes, shares, outcome, heights)
        axes.axvline(0, color=QUIET, linewidth=0.6, zorder=0)
        middles = [np.mean([heights[generator, factor] for generator in shares]) for factor in LEVELS]
        axes.set_yticks(middles, [_ROWS[factor].format(name if len(shares) == 1 else "another one") for factor in LEVELS])
        axes.set_ylim(min(heights.values()) - 0.9, 0.6)
        axes.set_xlabel(label)
    handles, labels = grid[0].get_legend_handles_labels()
    _, height = figure.get_size_inches()
    titled = {"title": "generator that replaces the paper's GAN", "title_fontsize": 7.5, "fontsize": 7.5, "frameon": False}
    figure.legend(
        handles, labels, loc="upper left", bbox_to_anchor=(left - 0.01, 1 - down / height), ncols=len(labels), alignment="left", **titled
    )
    return figure


def _heights(shares: Mapping[str, Any]) -> dict[tuple[str, str], float]:
    """Where each generator and factor stands, in lines from the top: a line for each generator, and space between the factors."""
    return {
        (generator, factor): -(group * (len(shares) + _SPACE) + line)
        for group, factor in enumerate(LEVELS)
        for line, generator in enumerate(shares)
    }


def _letters(axes: Axes, shares: Mapping[str, Any], outcome: str, heights: Mapping[tuple[str, str], float]) -> None:
    """Marks the contribution in each environment by its first letter; letters that would overlap stand below each other."""
    left, right = axes.get_xlim()
    for (generator, factor), height in heights.items():
        before, lower = -np.inf, 0
        by_environment = shares[generator][outcome]["factors"][factor]["by_environment"]
        for environment, share in sorted(by_environment.items(), key=lambda each: each[1]):
            lower = (lower + 1) % 2 if 100 * share - before < 0.03 * (right - left) else 0
            before = 100 * share
            centred = {"ha": "center", "va": "center", "fontsize": 6.5, "color": QUIET}
            axes.text(before, height - 0.36 - 0.25 * lower, environment[0], **centred)


def _signed(value: float) -> str:
    """A number without decimals, with a minus sign where it is negative, and without a sign where it rounds to zero."""
    return f"{round(value) + 0:d}".replace("-", "\N{MINUS SIGN}")


def _runs(shares: Mapping[str, Any]) -> str:
    """How many seeds each comparison rests on."""
    said = {generator: in_seeds(about["seeds"]) for generator, about in shares.items()}
    if len(set(said.values())) == 1:
        seeds = next(iter(shares.values()))["seeds"]
        return f"{next(iter(said.values())).capitalize()} ({seeds[0]}{f' to {seeds[-1]}' * (len(seeds) > 1)})."
    words = "; ".join(f"{generator}: {seeds}" for generator, seeds in said.items())
    return f"{words[:1].upper()}{words[1:]}."


FIGURES: dict[str, Figure] = {
    "contributions": Figure(
        28,
        "Which part of the pipeline lowers false alarms",
        "Two panels, the share of the false-alarm gap and recall at the real rate. Four factors from top to bottom (windows, extraction, enhancer, "
        "generator), each with a mark and an interval for each generator that replaces the paper's.",
        contributions,
    ),
}
"""The experiment's figure by name; `Figure.draw` takes the findings."""


def parts_of_difference(closed: Mapping[str, Any]) -> dict[str, float]:
    """The share that each factor has in the difference between the two ends of a comparison; the shares add up to 1.

    Where the ends are equal, there is nothing to share, and every share is zero.

    Args:
        closed: The outcome `gap_closed` of a comparison.
    """
    difference = closed["switched"]["mean"] - closed["paper"]["mean"]
    if not difference:
        return dict.fromkeys(closed["factors"], 0.0)
    return {factor: about["share"]["mean"] / difference for factor, about in closed["factors"].items()}
