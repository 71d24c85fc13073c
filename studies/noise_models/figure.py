"""The figure of the study of noise models, drawn from its findings."""

from collections.abc import Mapping
from typing import Any

import matplotlib.figure
import numpy as np

from enhsim_tf.common.figure import Figure
from enhsim_tf.common.plot_style import (
    AVERAGE,
    DOUBLE,
    LEARNT,
    QUIET,
    REAL,
    RESIDUALS,
    new_sheet,
    panels,
)

_MARKS = {  # marker, colour and face of each model that is shown
    "real": ("|", REAL, REAL),
    "autoregression": ("^", AVERAGE, "none"),
    "matched residual windows": ("s", RESIDUALS, "none"),
    "mixture density network": ("o", LEARNT, LEARNT),
}


def false_alarms(found: Mapping[str, Any]) -> matplotlib.figure.Figure:
    """False alarms and lost recall on each family of noise, by noise model."""
    families = sorted(found["families"].items(), key=lambda item: not item[1]["looked_at"])
    figure, down = new_sheet(
        DOUBLE,
        max(2.6, 1.5 + 0.22 * len(families)),
        "Matched residual windows keep false alarms near 1 % on all families",
        "Detectors trained with noise of each model, judged on real windows; means of seven. "
        "Lines: the target of 1 % and the tolerance of 3 points. "
        "Above the dots: families that the design of the network looked at.",
    )
    left, right = panels(figure, down + 0.3, 1, 2, gap=(0.05, 0.1))[0]
    place = left.get_position()
    left.set_position([0.17, place.y0, 0.42, place.height])
    right.set_position([0.63, place.y0, 0.34, place.height])
    for axes, key, line in ((left, "alarms", 1.0), (right, "lost", 3.0)):
        for name, (marker, colour, face) in _MARKS.items():
            rows = [
                (100 * about["models"][name][key], -row)
                for row, (_, about) in enumerate(families)
                if name in about["models"]
            ]
            if rows and not (name == "real" and key == "lost"):
                values, heights = np.transpose(rows)
                axes.plot(
                    values,
                    heights,
                    marker,
                    color=colour,
                    markerfacecolor=face,
                    markersize=9 if marker == "|" else 5,
                    label=name,
                )
        axes.axvline(line, color=QUIET, linewidth=0.6, zorder=0)
        looked_at = sum(about["looked_at"] for _, about in families)
        if 0 < looked_at < len(families):
            axes.axhline(0.5 - looked_at, color=QUIET, linewidth=0.6, linestyle=":")
        axes.set_yticks(
            -np.arange(len(families)),
            [name.replace("_", " ") for name, _ in families] if axes is left else [],
        )
    left.set_xscale("symlog", linthresh=1)
    left.set_xlim(0, 60)
    ticks = [0, 0.5, 1, 2, 5, 10, 20, 50]
    left.set_xticks(ticks, map(str, ticks))
    left.set_xlabel("false alarms (%)")
    right.set_xlim(-8, 8)
    right.set_xlabel("recall lost (points)")
    left.legend(
        frameon=False,
        ncols=4,
        loc="lower left",
        bbox_to_anchor=(-0.38, 1.0),
        handletextpad=0.2,
        columnspacing=1.0,
    )
    return figure


FIGURES = {
    "false_alarms": Figure(
        17,
        "Noise models on fourteen families of noise",
        "A row for each family of noise with a mark for each noise model: the false alarms on "
        "nominal windows of detectors trained with its "
        "noise, and the recall that they lose.",
        false_alarms,
    ),
}
