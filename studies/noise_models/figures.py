"""The figure of the experiment on noise, drawn from its findings."""

from collections.abc import Mapping
from typing import Any

import matplotlib.figure
import numpy as np

from enhsim_tf.common.figure import Figure
from enhsim_tf.common.number_words import in_words
from enhsim_tf.common.plot_style import AVERAGE, COARSE, DOUBLE, ENHANCED, GENERATED, QUIET, REAL, new_sheet, panels
from enhsim_tf.detection.registry import DETECTORS
from enhsim_tf.noise.rung_names import GAN_RUNGS
from studies.common.figures import in_list
from studies.noise_models.findings import fewer_seeds

BASELINE = "residual windows"
_MARKS = {
    "Gaussian": ("s", COARSE, "none"),
    "autoregression": ("^", AVERAGE, "none"),
    "GAN of the paper": ("x", GENERATED, GENERATED),
    "convolutional GAN": ("+", GENERATED, GENERATED),
    "residual windows": ("D", QUIET, "none"),
    "matched residual windows": ("d", QUIET, QUIET),
    "autoregressive network": ("o", ENHANCED, ENHANCED),
    "real": ("|", REAL, REAL),
}
"""Marker, colour and face colour of each rung. The rung without noise is left out: it alarms on nearly every window."""


def false_alarms(found: Mapping[str, Any]) -> matplotlib.figure.Figure:
    """False alarms on nominal windows for each rung of the noise ladder, one row for each family of noise."""
    families = sorted(found["families"].items(), key=lambda item: item[1]["half"] != "looked at")
    kept, rung = found["limits"], found["limits"]["rung"]
    seeds = len(found["seeds"])
    shown = {had: [name for name in names if name in _MARKS] for had, names in fewer_seeds(found).items()}
    told = "; ".join(f"{in_list(names)}: {in_words(len(had))}" for had, names in shown.items() if names)
    fewer = f" ({told})" if told else ""
    strict = [f"{name} {about['kept']}" for name, about in kept["within_strict"].items() if about["of"] and name in _MARKS]
    figure, down = new_sheet(
        DOUBLE,
        2.05 + 0.22 * len(families),
        _message(kept["within"], rung),
        f"Mean over {in_words(len(DETECTORS))} detectors whose thresholds are set for 1 % (vertical line); {in_words(seeds)} seed"
        f"{'s' * (seeds > 1)}{fewer}. The scale is linear below 1 % and logarithmic above. Limits: {100 * kept['looked at']['limit']:.0f} point above real "
        f"windows of the same seeds on the families that the design may look at, {100 * kept['unseen']['limit']:.0f} points on the others. "
        f"Families within {100 * kept['looked at']['limit']:.0f} point: {', '.join(strict)}. "
        "Not shown: without noise, detectors flag nearly all windows.",
    )
    axes = panels(figure, down + 0.45, 1, 1)[0, 0]
    place = axes.get_position()
    axes.set_position([0.2, place.y0 + 0.03, 0.76, place.height - 0.03])
    for name, (marker, colour, inside) in _MARKS.items():
        rows = [(100 * about["rungs"][name]["alarms"], -row) for row, (_, about) in enumerate(families) if name in about["rungs"]]
        if rows:
            values, heights = np.transpose(rows)
            axes.plot(values, heights, marker, color=colour, markerfacecolor=inside, markersize=9 if marker == "|" else 5, label=name)
    axes.axvline(1, color=QUIET, linewidth=0.6, zorder=0)
    looked_at = sum(about["half"] == "looked at" for _, about in families)
    if 0 < looked_at < len(families):
        axes.axhline(0.5 - looked_at, color=QUIET, linewidth=0.6, linestyle=":")
    axes.set_yticks(-np.arange(len(families)), [f"{name.replace('_', ' ')} ({about['half']})" for name, about in families])
    axes.set_xscale("symlog", linthresh=1)
    axes.set_xlim(0, 110)
    axes.set_xticks([0, 0.5, 1, 2, 5, 10, 20, 50, 100], ["0", "0.5", "1", "2", "5", "10", "20", "50", "100"])
    axes.set_xlabel("false alarms on nominal windows (%)")
    axes.legend(frameon=False, ncols=4, loc="lower left", bbox_to_anchor=(-0.22, 1.0), handletextpad=0.2, columnspacing=1.0)
    return figure


def _message(within: Mapping[str, Any], learnt: str) -> str:
    """On how many families the learnt model, resampling and the GANs keep the limits."""
    first, *others = (learnt, BASELINE, *(name for name in within if name in GAN_RUNGS))
    known = [f"on {within[name]['kept']} with {'' if name == BASELINE else 'the '}{name}" for name in others if within[name]["of"]]
    main = f"on {within[first]['kept']} of {within[first]['of']} families with the {first}"
    return f"Limits on false alarms are kept {in_list([main, *known])}"


FIGURES = {
    "false_alarms": Figure(
        17,
        "Noise that no generator was designed for",
        "A row for each family of noise with a mark for each noise model: the false alarms on nominal windows of detectors trained with its "
        "noise. The title counts the families on which each model keeps the limits.",
        false_alarms,
    ),
}
