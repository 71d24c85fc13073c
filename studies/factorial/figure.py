"""The figure of the factorial study, drawn from its findings alone."""

from collections.abc import Mapping
from typing import Any

import matplotlib.figure
import numpy as np

from enhsim_tf.common.figure import Figure
from enhsim_tf.common.plot_style import AVERAGE, DOUBLE, QUIET, RESIDUALS, new_sheet, panels
from studies.common.figures import leave_room, legend
from studies.factorial.cells import AUTOREGRESSION, LEVELS, WHOLE_WINDOWS

_SHOWN = {  # colour and marker differ, so that the comparisons can be told apart in greyscale
    WHOLE_WINDOWS: (RESIDUALS, "o"),
    AUTOREGRESSION: (AVERAGE, "s"),
}
_FACTORS = {
    "windows": "windows: 1,500\nto 15,000",
    "extraction": "extraction: moving\naverage to residual",
    "enhancer": "enhancer: network\nto ridge regression",
    "generator": "generator: paper's\nGAN to another one",
}
_PANELS = {
    "gap_closed": "change of the gap closed (points)",
    "recall_at_real_rate": "change of recall (points)",
}
_APART = 0.24  # distance of two generators, where that of two factors is 1


def contributions(found: Mapping[str, Any]) -> matplotlib.figure.Figure:
    """Contribution of each factor to the two outcomes, with a mark for each generator that replaces
    the paper's GAN.
    """
    figure, down = new_sheet(
        DOUBLE,
        3.9,
        "Replacing the GAN lowers false alarms most, except by an autoregression",
        "Change that switching a factor makes, as the mean over all orders of switching the four "
        "factors (Shapley value), with 95 % "
        "intervals over kinds of noise and seeds. Left: share of the gap in false alarms between "
        "the coarse simulator and real telemetry. "
        "Right: recall at 1 % false alarms on real windows.",
    )
    grid = panels(figure, down + 0.42, 1, 2, sharey=True)
    leave_room(grid, 1.35, 1 - 1.35 / DOUBLE - 0.02)
    for axes, (outcome, label) in zip(grid[0], _PANELS.items(), strict=True):
        for line, (generator, (colour, marker)) in enumerate(_SHOWN.items()):
            at = -np.arange(len(LEVELS)) - _APART * (line - (len(_SHOWN) - 1) / 2)
            shares = [
                found["shares"][generator][outcome]["factors"][factor]["share"] for factor in LEVELS
            ]
            mean, low, high = (
                100 * np.array([share[key] for share in shares]) for key in ("mean", "low", "high")
            )
            axes.hlines(at, low, high, color=colour, linewidth=2, alpha=0.6)
            axes.plot(mean, at, marker, color=colour, markersize=5, label=generator)
        axes.axvline(0, color=QUIET, linewidth=0.6, zorder=0)
        axes.set_yticks(-np.arange(len(LEVELS)), [_FACTORS[factor] for factor in LEVELS])
        axes.set_xlabel(label)
        axes.margins(x=0.06)
    legend(
        figure,
        grid[0, 0],
        (1.35 / DOUBLE - 0.01, down),
        loc="upper left",
        ncols=len(_SHOWN),
        title="generator that replaces the paper's GAN",
        alignment="left",
        fontsize=7.5,
        title_fontsize=7.5,
    )
    return figure


FIGURES: dict[str, Figure] = {
    "contributions": Figure(
        1,
        "Which part of the pipeline lowers false alarms",
        "Two panels, the share of the false-alarm gap and recall at the real rate. Four factors "
        "from top to bottom (windows, extraction, enhancer, "
        "generator), each with a mark and an interval for each generator that replaces the "
        "paper's.",
        contributions,
    ),
}
"""The study's figure by name; `Figure.draw` takes the findings."""
