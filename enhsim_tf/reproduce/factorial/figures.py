"""The figure of the factorial experiment, drawn from its findings alone."""

from collections.abc import Mapping
from typing import Any

import matplotlib.figure
import numpy as np

from enhsim_tf.common.plot_style import COARSE, DOUBLE, ENHANCED, GENERATED, QUIET, new_sheet, panels
from enhsim_tf.reproduce.caption import in_seeds
from enhsim_tf.reproduce.factorial.cells import AUTOREGRESSION, CONVOLUTIONAL_GAN, LEVELS, WHOLE_WINDOWS
from enhsim_tf.reproduce.figure import Figure
from enhsim_tf.reproduce.publish.wording import in_list

_SHOWN = {  # colour, marker and fill differ, so that the comparisons can be told apart in greyscale
    WHOLE_WINDOWS: (ENHANCED, "o", ENHANCED),
    AUTOREGRESSION: (COARSE, "s", "white"),
    CONVOLUTIONAL_GAN: (GENERATED, "^", GENERATED),
}
_ROWS = {
    "windows": "windows:\n1,500 to 15,000",
    "extraction": "extraction: moving\naverage to residual",
    "enhancer": "enhancer: network\nto ridge regression",
    "generator": "generator: paper's\nGAN to the other one",
}
_PANELS = {"gap_closed": "share of the false-alarm gap (points)", "recall_at_real_rate": "recall at the real rate (points)"}


def contributions(found: Mapping[str, Any]) -> matplotlib.figure.Figure:
    """Contribution of each factor to the two outcomes, with one mark for each generator that replaces the paper's GAN."""
    shares = found["shares"]
    name, main = next(iter(shares.items()))
    closed = main["gap_closed"]
    ranked = sorted(LEVELS, key=lambda factor: -closed["factors"][factor]["share"]["mean"])
    said = in_list([f"the {factor} for {round(100 * closed['factors'][factor]['share']['mean'])}" for factor in ranked])
    figure, down = new_sheet(
        DOUBLE,
        3.6,
        f"The paper's pipeline closes {100 * closed['paper']['mean']:.0f} % of the gap in false alarms, and ridge regression with {name} of its residuals "
        f"{100 * closed['switched']['mean']:.0f} %. Of this difference in points, {said.replace('for', 'accounts for', 1)}",
        "Change that switching a factor makes, as the mean over all orders of switching the four factors (Shapley value). Bars: 95 % intervals over "
        f"environments and seeds; faint marks: single environments; crosses: change if the factor is switched first or last. {_runs(shares)}",
    )
    grid = panels(figure, down + 0.42, 1, 2, gap=(0.2, 0.25), sharey=True)[0]
    left, offsets = 1.35 / DOUBLE, np.linspace(0.22, -0.22, len(_SHOWN))
    width = (1 - left - 0.02) / 2
    for number, (axes, (outcome, label)) in enumerate(zip(grid, _PANELS.items(), strict=True)):
        place = axes.get_position()
        axes.set_position([left + number * width, place.y0, width - 0.03, place.height])
        for (generator, (colour, marker, face)), offset in zip(_SHOWN.items(), offsets, strict=True):
            if generator not in shares:
                continue
            for height, factor in enumerate(LEVELS):
                about, at = shares[generator][outcome]["factors"][factor], offset - height
                mean, low, high = (100 * about["share"][key] for key in ("mean", "low", "high"))
                axes.plot(
                    [100 * value for value in about["by_environment"].values()],
                    [at] * len(about["by_environment"]),
                    marker,
                    color=colour,
                    markersize=2.5,
                    alpha=0.35,
                )
                axes.plot(
                    [100 * about[when]["mean"] for when in ("first", "last")],
                    [at] * 2,
                    "x",
                    color=colour,
                    markersize=4,
                    markeredgewidth=0.8,
                )
                axes.plot([low, high], [at] * 2, color=colour, linewidth=2, alpha=0.6)
                style = {"markerfacecolor": face, "markersize": 5, "linestyle": "none", "label": generator if not height else None}
                axes.plot(mean, at, marker, color=colour, **style)
        axes.margins(x=0.06)
        axes.axvline(0, color=QUIET, linewidth=0.6, zorder=0)
        axes.set_yticks(-np.arange(len(LEVELS)), [_ROWS[factor] for factor in LEVELS])
        axes.set_ylim(-len(LEVELS) + 0.5, 0.5)
        axes.set_xlabel(label)
    handles, labels = grid[0].get_legend_handles_labels()
    _, height = figure.get_size_inches()
    titled = {"title": "generator that replaces the paper's GAN", "title_fontsize": 7.5, "fontsize": 7.5, "frameon": False}
    figure.legend(
        handles, labels, loc="upper left", bbox_to_anchor=(left - 0.01, 1 - down / height), ncols=len(labels), alignment="left", **titled
    )
    return figure


def _runs(shares: Mapping[str, Any]) -> str:
    """How many seeds each comparison rests on."""
    said = {generator: in_seeds(about["seeds"]) for generator, about in shares.items()}
    if len(set(said.values())) == 1:
        return f"{next(iter(said.values())).capitalize()}."
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
