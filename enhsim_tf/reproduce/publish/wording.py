"""Text of the report on robustness: the format of numbers, and sentences that depend on comparisons of numbers."""

import inspect
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from enhsim_tf.reproduce.paper.judgements import WORDS, verdict_of_cases

if TYPE_CHECKING:
    from enhsim_tf.reproduce.settings import Settings

Findings = Mapping[str, Any]
DEVELOPMENT_SEEDS = range(100, 200)  # designs are chosen on these seeds, and no results on them are reported
REAL_NOISE, AS_IT_IS = "real noise", "as it is"  # rows of the tries: held-out real noise, and the unchanged design


def number(value: float, digits: int = 1) -> str:
    """A number with a fixed number of decimals; a number that rounds to zero has no sign."""
    return f"{round(value, digits) + 0.0:.{digits}f}"


def per_cent(value: float, digits: int = 1) -> str:
    """A share in per cent."""
    return f"{number(100 * value, digits)} %"


def interval(about: Mapping[str, float], digits: int = 1) -> str:
    """The mean of a share with its interval, in per cent."""
    mean, low, high = (number(100 * about[name], digits) for name in ("mean", "low", "high"))
    return f"{mean} % ({low} to {high})"


def points(about: Mapping[str, float] | float, digits: int = 1) -> str:
    """A difference of shares in percentage points, with its interval if it has one."""
    if not isinstance(about, Mapping):
        return number(100 * about, digits)
    mean, low, high = (number(100 * about[name], digits) for name in ("mean", "low", "high"))
    return f"{mean} ({low} to {high})"


def mean_of(about: Mapping[str, float] | float) -> float:
    """A rate, which is given as a number or by its mean and interval."""
    return float(about["mean"]) if isinstance(about, Mapping) else float(about)


def p_value(value: float) -> str:
    """A p-value with one significant digit."""
    return f"{value:.1g}" if value >= 0.0001 else "below 0.0001"


def in_list(names: Sequence[str]) -> str:
    """Joins names with commas, and the last one with "and"."""
    names = list(names)
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))


def reached(is_reached: bool) -> str:
    """Says whether a target is reached."""
    return "reached" if is_reached else "**not reached**"


def share(text: str) -> str:
    """A share from the table of designs in per cent; empty if it was not measured."""
    return per_cent(float(text)) if text else ""


def share_c8(found: Findings, arm: str = "enhanced + GAN") -> tuple[int, int]:
    """The number of pairs of environment and detector in which an arm meets the criterion of claim C8, and the number of all pairs."""
    about = found["arms"][arm]["c8"]
    return len(about["kept"]), about["of"]


def verdict_c8(found: Findings) -> str:
    """Verdict on claim C8, that detectors trained on the paper's output are robust, in the words and by the rule of the table of claims."""
    return WORDS[verdict_of_cases(*share_c8(found))]


def kept_c8(found: Findings, most: int = 6) -> str:
    """The pairs of environment and detector that meet the criterion, as text; empty if there are many."""
    kept = found["arms"]["enhanced + GAN"]["c8"]["kept"]
    detectors: dict[str, list[str]] = {}
    for environment, detector in kept if len(kept) <= most else ():
        detectors.setdefault(detector, []).append(environment)
    return "; ".join(f"{detector} on {in_list(names)} noise" for detector, names in detectors.items())


def targets_missed(found: Findings) -> str:
    """Says in which environments the convolutional GAN reaches its targets, and which of them it misses in the others."""
    named = {"excess_reached": "false alarms", "recall_reached": "recall", "autoregression_reached": "comparison with the autoregression"}
    missed = {name: [words for key, words in named.items() if not bar[key]] for name, bar in found["bars"].items()}
    reached_on = [name for name, each in missed.items() if not each]
    said = [f"all are reached on {in_list(reached_on)} noise"] if reached_on else []
    said += [f"missed on {name} noise: {in_list(each)}" for name, each in missed.items() if each]
    return "; ".join(said)


def first_trial(found: Findings) -> str:
    """Says for each environment whether the finding of the first trial is confirmed."""
    from enhsim_tf.reproduce.robustness.findings import EVERYTHING

    groups: dict[str, list[str]] = {"Confirmed": [], "In part": [], "Refuted": []}
    for name, about in found["alarms_on_everything"].items():
        word = "Confirmed" if about["replicates"] == about["of"] else "In part" if about["replicates"] else "Refuted"
        ends = dict.fromkeys(per_cent(about[end]) for end in ("low", "high"))  # a single number if both are equal
        groups[word].append(f"{name} ({about['replicates']} of {about['of']} replicates; {' to '.join(ends)})")
    said = [f"**{word}** on {', '.join(names)}" for word, names in groups.items() if names]
    return f"{'; '.join(said)}. Everything: at least {per_cent(EVERYTHING, 0)} of the windows."


def words(found: Findings, settings: "Settings") -> dict[str, Any]:
    """Values for the template that are not in the findings: names, settings, and sentences that depend on comparisons."""
    from enhsim_tf.detection import anomalies, evaluation
    from enhsim_tf.detection.registry import DETECTORS
    from enhsim_tf.reproduce import statistics
    from enhsim_tf.reproduce.robustness import degraded_modes, replicate, targets

    gaussian = [name for name in targets.KINDS_OF_NOISE["Gaussian"] if name in found["bars"]]
    asked = [found["bars"][name] for name in gaussian]
    trial = inspect.signature(evaluation.make_trial).parameters
    scaled = by_scale(found)
    confirmed = [name for name, about in found["alarms_on_everything"].items() if about["replicates"] == about["of"]]
    return {
        "arms": replicate.ARMS,
        "methods": {name: about for name, about in degraded_modes.METHODS.items() if name in found["modes"]["nrmse"]},
        "noises": ["real", *(noise for pipeline in ("residual", "enhanced") for noise in _noises(pipeline, replicate.ARMS))],
        "estimated": (
            "real",
            "residual: extracted",
            "residual + convolutional GAN",
            "residual + AR",
            "enhanced: extracted",
            "enhanced + GAN",
        ),
        "verdict_c8": verdict_c8(found),
        "kept_c8": kept_c8(found),
        "targets_missed": targets_missed(found),
        "first_trial": first_trial(found),
        "first_confirmed": in_list(confirmed),
        "is_realistic": all(bar["measures_within"] == bar["num_measures"] for bar in asked),
        "gaussian_names": gaussian,
        "other_names": [name for name in found["bars"] if name not in gaussian],
        "detectors": list(DETECTORS),
        "quick": replicate.QUICK_DETECTORS,
        "kinds": [kind.replace("_", " ") for kind in anomalies.INJECTIONS],
        "is_ar_as_good": all(bar["over_autoregression"]["mean"] >= -targets.MARGIN for bar in asked),
        "opposite": opposite_signs(found),
        "development": DEVELOPMENT_SEEDS,
        "severities": [f"{severity:g}" for severity in anomalies.SEVERITIES],
        "durations": anomalies.DURATIONS,
        "prevalence": evaluation.PREVALENCE,
        "trace_severity": trial["trace_severity"].default,
        "max_buffer": round(min(settings.telemetry.orbit_period_s, settings.telemetry.rotation_period_s) / settings.telemetry.interval_s),
        "recall_points": number(100 * targets.LARGEST_RECALL_DIFFERENCE, 0),
        "margin": targets.MARGIN,
        "largest_ratio": number(targets.LARGEST_RATIO, 0),
        "one_line": one_line(found),
        "by_detector": by_detector(found),
        "modes_found": modes_found(found),
        "least_p": statistics.wilcoxon_signed_rank([1.0] * len(found["seeds"])),  # the p-value if all signs agree
        "quieter": scaled[max(scale for scale in scaled if scale < 1)],
        "louder": scaled[min(scale for scale in scaled if scale > 1)],
    }


def one_line(found: Findings) -> str:
    """What the best control of one line finds, and which arms and detectors find less."""
    controls = {name: about["recall_at_real_rate"] for name, about in found["controls"].items() if "recall_at_real_rate" in about}
    best = max(controls, key=controls.__getitem__)
    arms = {name: about["recall_at_real_rate"] for name, about in found["arms"].items() if about["recall_at_real_rate"] < controls[best]}
    single = {name: recall for name, recall in found["arms"]["real"]["recalls_at_real_rate"].items() if recall < controls[best]}
    said = f"The best score of one line of code ({best}) finds {per_cent(controls[best])}."
    if arms:
        said += f" That is more than the mean over detectors for these arms: {'; '.join(f'*{name}* {per_cent(recall)}' for name, recall in arms.items())}."
    if single:
        said += f" It is also more than some detectors find after training on real telemetry: {in_list([f'{name} ({per_cent(recall)})' for name, recall in single.items()])}."
    return said


def by_detector(found: Findings, nearly_all: float = 0.9) -> str:
    """Which detectors the gap in false alarms is about, and which of them the paper's noise makes worse."""
    rates = {arm: _rates(found["arms"][arm]["by_environment"].values()) for arm in ("coarse", "enhanced + GAN")}
    loud = [name for name, rate in rates["coarse"].items() if rate >= nearly_all]
    worse = {name: (rate, rates["enhanced + GAN"][name]) for name, rate in rates["coarse"].items() if rates["enhanced + GAN"][name] > rate}
    said = f"The gap is mainly that of detectors that flag at least {per_cent(nearly_all, 0)} of the windows after training on the coarse signal: {in_list(loud)}."
    if worse:
        changes = in_list([f"the {name} from {per_cent(before)} to {per_cent(after)}" for name, (before, after) in worse.items()])
        said += f" Noise of the paper's GAN lowers their rates, but raises those of others: {changes}."
    return said


def _rates(environments: Iterable[Findings]) -> dict[str, float]:
    """The false-alarm rate of each detector, mean over environments."""
    each = [about["detectors"] for about in environments]
    return {name: sum(rates[name] for rates in each) / len(each) for name in each[0]}


def by_scale(found: Findings) -> dict[float, Findings]:
    """The variations with noise of the convolutional GAN at each scale, without real windows."""
    return {row["scale"]: row for row in found["variations"] if row["arm"] == "residual + convolutional GAN" and row["real_share"] == 0}


def opposite_signs(found: Findings, least: float = 0.1) -> str:
    """The contrasts with different signs in different environments; log-odds closer to zero than `least` have no sign."""
    said = []
    for contrast in (each for name in ("paper", "second") for each in found["contrasts"][name]):
        more, less = ([name for name in found["environments"] if sign * contrast["parts"][name] > least] for sign in (1, -1))
        if more and less:
            said.append(
                f"*{contrast['first']}* has more false alarms than *{contrast['second']}* on {in_list(more)} noise, and fewer on {in_list(less)} noise"
            )
    return "; ".join(said)


def modes_tried(found: Findings, method: str = "randomised") -> dict[tuple[str, float], float]:
    """The error of an enhancer in each degraded mode at each severity."""
    return {
        (row["mode"], row["severity"]): row["nrmse"]
        for row in found["modes"]["by_mode"]
        if row["method"] == method and row["mode"] != "nominal"
    }


def modes_where_better(found: Findings, method: str) -> list[tuple[str, float]]:
    """The modes and severities at which a method has a smaller error than the network that is trained on randomised configurations."""
    errors = modes_tried(found, method)
    return [key for key, error in modes_tried(found).items() if errors[key] < error]


def modes_found(found: Findings) -> str:
    """Compares the enhancers with simple baselines in the degraded modes."""
    errors = found["modes"]["nrmse"]
    at = {name: {where: f"{errors[name][where]:.2f}" for where in ("inside", "outside")} for name in errors}
    tried, better, coarse = (
        len(each) for each in (modes_tried(found), modes_where_better(found, "ridge, randomised"), modes_where_better(found, "identity"))
    )
    worse = "above" if errors["paper"]["outside"] > errors["identity"]["outside"] else "below"
    return (
        f"For severities outside the training range, the error of the paper's enhancer is {at['paper']['outside']}, {worse} that of the coarse signal "
        f"({at['identity']['outside']}); that of the smoothed coarse signal is {at['moving average']['outside']}. Training on random configurations reduces the error. It needs "
        "the true response to them, which is known here: the targets are the true degraded signals with noise. Ridge regression trained in this way "
        f"has an error of {at['ridge, randomised']['inside']} inside and {at['ridge, randomised']['outside']} outside, and a network trained on the same windows has "
        f"{at['randomised']['inside']} and {at['randomised']['outside']}. In {better} of {tried} pairs of mode and severity the regression has a smaller error than that "
        f"network, and in {coarse} the coarse signal has."
    )


def tries_found(tries: Sequence[Mapping[str, Any]]) -> str:
    """The number of measures within twice their baseline, for the unchanged design and the best change in each environment.

    Args:
        tries: Rows of the tries, with the number of measures (`number`) and how many of them are `within`.
    """
    trainings = [row for row in tries if row["noise"] != REAL_NOISE]
    if not trainings:
        return ""
    kept: dict[str, dict[str, list[int]]] = {}
    for row in trainings:
        kept.setdefault(row["environment"], {}).setdefault(row["noise"], []).append(row["within"])
    said = []
    for environment, counts in kept.items():
        mean = {noise: sum(each) / len(each) for noise, each in counts.items()}
        other = max(mean.keys() - {AS_IT_IS}, key=lambda noise: (mean[noise], noise), default=None)
        before = f"{mean[AS_IT_IS]:.3g} for the unchanged design" if AS_IT_IS in mean else ""
        after = f"{mean[other]:.3g} for the best change ({other})" if other else ""
        said.append(f"on {environment} noise {', '.join(filter(None, (before, after)))}")
    full = sum(row["within"] == row["number"] for row in trainings)
    kept_all = f"{full or 'None'} of the {len(trainings)} trainings has all measures within."
    return f"Number of measures, of {trainings[0]['number']}, within twice their baseline: {'; '.join(said)}. {kept_all}"


def _noises(pipeline: str, arms: Iterable[str]) -> list[str]:
    """The noises of a pipeline that are compared with real noise: the extracted noise, and that of each noise model."""
    return [f"{pipeline}: extracted", *(arm for arm in arms if arm.startswith(f"{pipeline} + "))]
