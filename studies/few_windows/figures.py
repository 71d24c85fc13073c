"""The figure of the learning curve, drawn from its findings."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.figure
import matplotlib.ticker
from matplotlib.axes import Axes

from enhsim_tf.common.figure import Figure
from enhsim_tf.common.number_words import in_words
from enhsim_tf.common.plot_style import AVERAGE, COARSE, DOUBLE, ENHANCED, FOOT, GENERATED, QUIET, REAL, new_sheet, panels
from studies.common.figures import in_list
from studies.few_windows.arms import ADVERSARIAL, CLASSIFIER_ON_REAL, CORAL, SIMULATOR, THRESHOLD_ON_REAL
from studies.few_windows.arms import REAL as REAL_ARM
from studies.few_windows.findings import most_seeds

_CURVES = {
    REAL_ARM: ("the real windows alone", "|", "-", REAL),
    SIMULATOR + "autoregression": ("simulator + autoregression", "^", "--", AVERAGE),
    SIMULATOR + "residual windows": ("simulator + residual windows", "D", "-", ENHANCED),
    THRESHOLD_ON_REAL: ("residual windows, threshold on real", "d", ":", ENHANCED),
    SIMULATOR + "autoregressive network": ("simulator + autoregressive network", "o", "-", GENERATED),
    CORAL: ("CORAL", "s", ":", COARSE),
    ADVERSARIAL: ("domain-adversarial classifier", "x", ":", QUIET),
    CLASSIFIER_ON_REAL: ("classifier without simulator", "+", "-", QUIET),
}
"""Label, marker, line style and colour of each arm that is drawn."""


def curves(found: Mapping[str, Any]) -> matplotlib.figure.Figure:
    """False alarms and recall over the number of real windows, a column for each environment."""
    environments, numbers = found["environments"], found["numbers"]
    figure, down = new_sheet(DOUBLE, 4.9, _message(found), _subtitle(found))
    grid = panels(figure, down + 0.75, 2, len(environments), gap=(0.3, 0.2), sharex=True, sharey="row")
    for (name, about), (upper, lower) in zip(environments.items(), grid.T, strict=True):
        for arm, (label, marker, line, colour) in _CURVES.items():
            curve = about["arms"].get(arm)
            if curve is None:
                continue
            at = [number for number in numbers if str(number) in curve["rate"]]
            style = {"marker": marker, "linestyle": line, "color": colour, "markersize": 3.5, "linewidth": 1.0, "markerfacecolor": "none"}
            if len(at) == 1:  # a single mark has to be seen among the lines
                style |= {"markerfacecolor": colour, "markersize": 5, "zorder": 4}
            upper.plot(at, [100 * curve["rate"][str(number)] for number in at], label=label, **style)
            lower.plot(at, [100 * curve["recall_at_real_rate"][str(number)] for number in at], **style)
        _finish(upper, lower, numbers, name)
    grid[0, 0].set_ylabel("false alarms (%)")
    grid[1, 0].set_ylabel("recall (%)")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    height = figure.get_size_inches()[1]
    figure.legend(handles, labels, frameon=False, ncols=3, loc="upper left", bbox_to_anchor=(0.07, 1 - (down - 0.02) / height))
    figure.text(0.53, (FOOT + 0.02) / height, "number of real windows k (disjoint; logarithmic)", ha="center")
    return figure


def _finish(upper: Axes, lower: Axes, numbers: list[int], name: str) -> None:
    upper.axhline(1, color=QUIET, linewidth=0.6, zorder=0)
    upper.set_title(name, loc="left")
    upper.set_yscale("symlog", linthresh=1)
    upper.set_ylim(0, 110)
    upper.set_yticks([0, 0.5, 1, 2, 5, 10, 20, 50, 100], ["0", "0.5", "1", "2", "5", "10", "20", "50", "100"])
    upper.yaxis.set_minor_locator(matplotlib.ticker.NullLocator())
    lower.set_ylim(0, 100)
    lower.set_xscale("log")
    lower.set_xlim(numbers[0] / 1.25, numbers[-1] * 1.25)
    shown = [number for number in numbers if number in (10, 100, 1_000, 10_000)] or numbers
    lower.set_xticks(shown, [f"{number:,}" for number in shown], fontsize=7)
    lower.xaxis.set_minor_locator(matplotlib.ticker.NullLocator())


def _message(found: Mapping[str, Any]) -> str:
    """The answer in the title: with how many real windows a simulator pays on each kind of noise."""
    numbers, by_places = found["numbers"], {}
    for name, about in found["environments"].items():
        places = tuple(number for number in numbers if any(number in arm for arm in about["pays"].values()))
        by_places.setdefault(places, []).append(name)
    said = [f"{_places(places, numbers)} on {in_list(names)} noise" for places, names in by_places.items() if places]
    nowhere = by_places.get((), [])
    if not said:
        return "A fitted simulator with a simple noise model pays nowhere on this curve"
    return f"A fitted simulator with a simple noise model pays {', '.join(said)}" + (
        f", and nowhere on {in_list(nowhere)} noise" if nowhere else ""
    )


def _places(places: Sequence[int], numbers: Sequence[int]) -> str:
    if list(places) == list(numbers[: len(places)]) and len(places) > 1:
        return f"with up to {places[-1]:,} real windows"
    return f"with {in_list([f'{number:,}' for number in places])} real windows"


def _subtitle(found: Mapping[str, Any]) -> str:
    seeds = len(found["seeds"])
    return (
        f"Detectors trained on k real windows, or on a simulator fitted to the same k windows; anomalies of 4 standard deviations; mean over four detectors and "
        f"{in_words(seeds)} seed{'s' * (seeds > 1)}. Thresholds are set for 1 % (horizontal line; linear below it). A simulator pays where its "
        "excess of false alarms is at most half that of the real windows and its recall at most 3 points lower. Recall is that at 1 % false alarms; "
        "single detectors find more than the mean." + _classifiers(found)
    )


def _classifiers(found: Mapping[str, Any]) -> str:
    """What the classifiers are, and which of the drawn arms have fewer seeds than the others."""
    arms = next(iter(found["environments"].values()))["arms"]
    said = ""
    if CLASSIFIER_ON_REAL in arms and ADVERSARIAL in arms:
        said = " The classifiers learn injected anomalies, the domain-adversarial one from windows of the simulator."
    fewer: dict[int, list[str]] = {}
    for arm, (label, *_) in _CURVES.items():
        number = most_seeds(arms[arm]) if arm in arms else 0
        if 0 < number < len(found["seeds"]):
            fewer.setdefault(number, []).append(label)
    return said + "".join(
        f" {in_words(number).capitalize()} seed{'s' * (number > 1)}: {in_list(labels)}." for number, labels in fewer.items()
    )


FIGURES = {
    "learning_curve": Figure(
        18,
        "How many real windows suffice",
        "A column for each environment: above, the false alarms of detectors over the number of real windows, for each kind of training "
        "data; below, their recall at 1 % false alarms. The title says up to how many windows the simulator pays.",
        curves,
    ),
}
