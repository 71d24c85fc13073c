"""Targets for the convolutional GAN, which were fixed before the runs, and whether they are reached."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from studies.robustness.averages import by_block, by_replicate, interval

if TYPE_CHECKING:
    import pandas as pd

KINDS_OF_NOISE = {"Gaussian": ("white", "autoregressive"), "not Gaussian": ("heteroscedastic", "shot")}
BARS = {"white": (0.01, 0.02), "autoregressive": (0.01, 0.02), "heteroscedastic": (0.01, 0.02), "shot": (0.03, None)}
"""Largest excess of the false-alarm rate over that of training on real telemetry, for its mean and its upper 95 % bound."""
LARGEST_RECALL_DIFFERENCE, LARGEST_RATIO = 0.02, 2.0
MARGIN = 0.005
"""An arm is not worse than another if its false-alarm rate is higher by at most this, at the upper 95 % bound."""


def bars(alarms: "pd.DataFrame", recall: "pd.DataFrame", ratios: "pd.DataFrame", environments: Sequence[str]) -> dict[str, Any]:
    """Compares the convolutional GAN with its targets in each environment.

    The targets are the excess of false alarms, recall, false alarms compared with a fitted autoregression, and realism.

    Args:
        alarms: The table `alarms`.
        recall: The table `recall`.
        ratios: As `realism_findings.floor_ratios` gives them.
        environments: Names of the environments.
    """
    rate, found = by_block(alarms), by_replicate(recall, "recall")
    excess, over = rate["residual + convolutional GAN"] - rate["real"], rate["residual + convolutional GAN"] - rate["residual + AR"]
    difference = found["residual + convolutional GAN"] - found["real"]
    reports = {}
    for name in environments:
        largest, bound = BARS[name]
        about, recalled, against = interval(excess, name), interval(difference, name), interval(over, name)
        is_gaussian, ratio = name in KINDS_OF_NOISE["Gaussian"], ratios.loc["residual + convolutional GAN", name]
        reports[name] = {
            "excess": about,
            "largest_excess": largest,
            "largest_bound": bound,
            "excess_reached": bool(about["mean"] <= largest and (bound is None or about["high"] <= bound)),
            "recall_difference": recalled,
            "recall_reached": bool(abs(recalled["mean"]) <= LARGEST_RECALL_DIFFERENCE),
            "over_autoregression": against,
            "autoregression_asked": "not worse" if is_gaussian else "better",
            "autoregression_reached": bool(against["high"] <= MARGIN if is_gaussian else against["high"] < 0),
            "ratios": {measure: float(value) for measure, value in ratio.items()},
            "measures_within": int((ratio <= LARGEST_RATIO).sum()),
            "num_measures": int(len(ratio)),
        }
    return reports


def not_inferior(alarms: "pd.DataFrame") -> dict[str, Any]:
    """Compares the false alarms of each pipeline's GAN with those of the bootstrap of the noise that it learnt from."""
    rate, found = by_block(alarms), {}
    for pipeline, gan in (("enhanced", "enhanced + GAN"), ("residual", "residual + convolutional GAN")):
        about = interval(rate[gan] - rate[f"{pipeline} + bootstrap"])
        found[pipeline] = {"difference": about, "margin": MARGIN, "reached": bool(about["high"] <= MARGIN)}
    return found
