"""What a practitioner should do: five sentences, each with its number, for the README and the report.

All numbers come from the findings of the experiments. Where a number is missing, the sentence says so.
"""

from collections.abc import Mapping
from typing import Any

from enhsim_tf.reproduce.caption import in_seeds
from enhsim_tf.reproduce.factorial.cells import WITHOUT_NETWORK
from enhsim_tf.reproduce.publish.wording import Findings, in_list, interval, mean_of, per_cent, points
from enhsim_tf.reproduce.robustness.targets import MARGIN

LEAST_SEEDS = 3
"""Number of seeds below which a difference is reported without a conclusion."""


def sentences(found: Findings, factorial: Findings | None = None, labelled: Findings | None = None) -> dict[str, str]:
    """The five sentences by question.

    Args:
        found: The findings on robustness.
        factorial: The findings of the factorial experiment, or None.
        labelled: The findings of the study of real telemetry, or None.
    """
    return {
        "a clean simulator": _clean(found),
        "a linear map and resampled residuals": _linear(factorial),
        "a network": _network(found, factorial),
        "generated noise": _noise(factorial),
        "nothing here": _nothing(labelled),
    }


def bullets(found: Findings, factorial: Findings | None = None, labelled: Findings | None = None) -> str:
    """The five sentences as a Markdown list."""
    return "\n".join(f"- {sentence}" for sentence in sentences(found, factorial, labelled).values())


def _clean(found: Findings) -> str:
    arms = found["arms"]
    coarse, truth, real = (arms[name] for name in ("coarse", "truth", "real"))
    kept = len(coarse["c8"]["kept"]) + len(truth["c8"]["kept"])
    where = (
        "It sufficed in none of the environments here"
        if not kept
        else f"It met the criterion of C8 in {kept} of {2 * truth['c8']['of']} pairs here"
    )
    return (
        f"**A clean simulator suffices**, if at all, where noise is negligible. {where}. Detectors trained on a perfect but noiseless signal flag "
        f"{per_cent(truth['false_alarms']['mean'])} of real nominal windows, and detectors trained on the coarse simulator flag "
        f"{per_cent(coarse['false_alarms']['mean'])}. Even with thresholds set on real windows, these detectors find "
        f"{per_cent(truth['recall_at_real_rate'])} and {per_cent(coarse['recall_at_real_rate'])} of the anomalies, against "
        f"{per_cent(real['recall_at_real_rate'])} after training on real telemetry."
    )


def _linear(factorial: Findings | None) -> str:
    about = (factorial or {}).get("cells", {}).get(WITHOUT_NETWORK.name)
    if about is None:
        return "**A linear map and resampled residuals**: not measured yet."
    against, real = factorial["contrasts"]["no network, real"], factorial["cells"]["real"]
    within = [name for name, each in against["by_environment"].items() if each["false_alarms"]["high"] <= MARGIN]
    beyond = {name: each["false_alarms"] for name, each in against["by_environment"].items() if name not in within}
    others = "".join(f"; on {name} noise the difference is {points(each)} points" for name, each in beyond.items())
    everywhere = len(within) == len(against["by_environment"])
    where = "in every environment" if everywhere else f"on {in_list(within)} noise" if within else "in none of the environments"
    return (
        f"**A linear map and resampled residuals suffice** {where} here, to within {points(MARGIN)} percentage points of false alarms. This method adds whole "
        "windows of the residuals to the output of ridge regression, without any network. Detectors trained in this way meet the criterion of claim C8 in "
        f"{about['kept']} of {about['pairs']} pairs of environment and detector. They flag {interval(about['false_alarms'])} of real nominal windows, against "
        f"{interval(real['false_alarms'])} after training on real telemetry{others}. Start with this method, and replace it only by a method that gives better results."
    )


def _network(found: Findings, factorial: Findings | None) -> str:
    errors = found["modes"]["nrmse"]
    network, ridge = errors["randomised"], errors["ridge, randomised"]
    degraded = (
        "In degraded modes, if it is trained on randomised configurations and their true response, the network has a normalised root-mean-square error of "
        f"{network['inside']:.2f} for severities within the training range and {network['outside']:.2f} beyond it, against {ridge['inside']:.2f} and "
        f"{ridge['outside']:.2f} for ridge regression"
    )
    nominal = _difference(factorial, "network, ridge")
    if nominal is None:
        return f"**A network pays**, as far as is known, where the map is not linear. {degraded}. On nominal telemetry the comparison is not measured yet."
    return (
        f"**A network pays** where the map is not linear. {degraded}. On nominal telemetry it {_effect(factorial, 'network, ridge')}: with the same windows and "
        f"resampled residuals, replacing ridge regression by the network changes the false-alarm rate by {points(nominal)} points ({_seeds(factorial, 'network, ridge')})."
    )


def _noise(factorial: Findings | None) -> str:
    known = (("convolutional GAN, whole windows", "ridge regression"), ("convolutional GAN, whole windows, network", "the network"))
    chosen = next(((name, enhancer) for name, enhancer in known if _difference(factorial, name) is not None), None)
    if chosen is None:
        return (
            "**Generated noise pays**, as far as is known, where the application needs more noise, or longer stretches of noise, than were recorded, because "
            "resampled residuals never contain anything new. The comparison of its false alarms with those of whole residual windows is not measured yet."
        )
    name, enhancer = chosen
    return (
        f"**Generated noise pays** where the application needs more noise, or longer stretches of noise, than were recorded, because resampled residuals never "
        f"contain anything new. It {_effect(factorial, name)} here: with {enhancer} and the same residuals, replacing whole residual windows by noise of the "
        f"convolutional GAN changes the false-alarm rate by {points(_difference(factorial, name))} points ({_seeds(factorial, name)})."
    )


def _nothing(labelled: Findings | None) -> str:
    if labelled is None:
        return "**No training data help enough** where telemetry changes after training. This is not measured yet."
    arms = labelled["arms"]
    controls = {name: about for name, about in labelled["controls"].items() if "found" in about}
    best = max(controls, key=lambda name: controls[name]["auc_pr"])
    rates = {name: mean_of(about["false_alarms"]) for name, about in (arms | controls).items()}
    quiet = min((name for name in arms if " + " in name), key=rates.__getitem__)
    return (
        f"**No training data help enough** where nominal telemetry itself changes after training. On {len(labelled['channels'])} channels of a spacecraft, detectors "
        f"trained on the real past flag {per_cent(rates['real'])} of later nominal windows, and detectors trained on the generated telemetry with the fewest "
        f"false alarms (*{quiet}*) flag {per_cent(rates[quiet])}. A simple score of one line of code ({best}) flags {per_cent(rates[best])}. The area under the "
        f"precision-recall curve (AUC-PR) on the labelled samples is {controls[best]['auc_pr']:.2f} for this score, and "
        f"{max(about['auc_pr'] for about in arms.values()):.2f} for the best kind of training data.{_residual(labelled)}"
    )


def _residual(labelled: Findings) -> str:
    """What the simulator is worth there as a model of the signal, if this was measured."""
    row = labelled.get("residual", {}).get("residual")
    if row is None:
        return ""
    return (
        " What helps is to use the simulator as a model instead of a source of data: the residual of the simulator that is aligned with each window "
        f"(`score --detector residual`) flags {row['median_false_alarms']:.1%} in the median channel ({row['mean_false_alarms']:.1%} on average), with an AUC-PR of "
        f"{row['auc_pr']:.2f}."
    )


def _difference(factorial: Findings | None, name: str) -> Mapping[str, Any] | None:
    contrast = (factorial or {}).get("contrasts", {}).get(name)
    return None if contrast is None else contrast["false_alarms"]


def _seeds(factorial: Findings, name: str) -> str:
    return in_seeds(factorial["contrasts"][name]["seeds"])


def _effect(factorial: Findings, name: str) -> str:
    """Says whether the first arm of a contrast has fewer false alarms than the second, by more than the margin; few seeds settle nothing."""
    contrast = factorial["contrasts"][name]
    about = contrast["false_alarms"]
    if len(contrast["seeds"]) < LEAST_SEEDS:
        return "has no settled effect on false alarms yet"
    if about["low"] >= -MARGIN and about["high"] <= MARGIN:
        return f"does not change false alarms by more than {points(MARGIN)} points"
    if about["low"] <= 0 <= about["high"]:
        return "does not detectably change false alarms"
    return f"{'lowers' if about['high'] < 0 else 'raises'} false alarms"
