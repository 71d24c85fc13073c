"""The words of the report on robustness: how numbers are written, and the sentences that follow from a comparison of them."""

import inspect
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from enhsim_tf.reproduce.settings import Settings

Findings = Mapping[str, Any]
DEVELOPMENT_SEEDS = range(100, 200)  # designs are chosen on these, and nothing is reported of them
REAL_NOISE, AS_IT_IS = "real noise", "as it is"  # of the tries: what no generator made, and the design that nothing was changed in


def number(value: float, digits: int = 1) -> str:
    """A number with so many decimals; what rounds to nought has no sign."""
    return f"{round(value, digits) + 0.0:.{digits}f}"


def per_cent(value: float, digits: int = 1) -> str:
    """A share as per cent."""
    return f"{number(100 * value, digits)} %"


def interval(about: Mapping[str, float], digits: int = 1) -> str:
    """A mean of shares with its interval, in per cent."""
    mean, low, high = (number(100 * about[name], digits) for name in ("mean", "low", "high"))
    return f"{mean} % ({low} to {high})"


def points(about: Mapping[str, float] | float, digits: int = 1) -> str:
    """A difference of shares in points of per cent, with its interval where it has one."""
    if not isinstance(about, Mapping):
        return number(100 * about, digits)
    mean, low, high = (number(100 * about[name], digits) for name in ("mean", "low", "high"))
    return f"{mean} ({low} to {high})"


def p_value(value: float) -> str:
    """A p-value with one significant digit."""
    return f"{value:.1g}" if value >= 0.0001 else "below 0.0001"


def in_list(names: Sequence[str]) -> str:
    """Names one after the other, the last behind an "and"."""
    return " and ".join(", ".join(names).rsplit(", ", 1))


def reached(is_reached: bool) -> str:
    """Whether a bar was reached."""
    return "reached" if is_reached else "**not reached**"


def share(text: str) -> str:
    """A share of the table of designs in per cent; nothing where it was not measured."""
    return per_cent(float(text)) if text else ""


def share_c8(found: Findings, arm: str = "enhanced + GAN") -> tuple[int, int]:
    """In how many pairs of environment and detector an arm keeps the ledger's rule of claim C8, and of how many."""
    about = found["arms"][arm]["c8"]
    return len(about["kept"]), about["of"]


def verdict_c8(found: Findings) -> str:
    """Verdict on claim C8, that detectors trained on the paper's output are robust: the rule asks it of every detector."""
    kept, total = share_c8(found)
    return "holds" if kept == total else "does not hold"


def kept_c8(found: Findings, most: int = 6) -> str:
    """The pairs of environment and detector that keep the rule, in words; none where there are many."""
    kept = found["arms"]["enhanced + GAN"]["c8"]["kept"]
    detectors: dict[str, list[str]] = {}
    for environment, detector in kept if len(kept) <= most else ():
        detectors.setdefault(detector, []).append(environment)
    return "; ".join(f"{detector} on {in_list(names)} noise" for detector, names in detectors.items())


def first_trial(found: Findings) -> str:
    """Whether the finding of the first trial is confirmed, environment by environment."""
    from enhsim_tf.reproduce.robustness.findings import EVERYTHING

    groups: dict[str, list[str]] = {"Confirmed": [], "In part": [], "Refuted": []}
    for name, about in found["alarms_on_everything"].items():
        word = "Confirmed" if about["replicates"] == about["of"] else "In part" if about["replicates"] else "Refuted"
        ends = dict.fromkeys(per_cent(about[end]) for end in ("low", "high"))  # one where they are the same
        groups[word].append(f"{name} ({about['replicates']} of {about['of']} replicates; {' to '.join(ends)})")
    said = [f"**{word}** on {', '.join(names)}" for word, names in groups.items() if names]
    return f"{'; '.join(said)}. Everything: at least {per_cent(EVERYTHING, 0)} of the windows."


def words(found: Findings, settings: "Settings") -> dict[str, Any]:
    """What the template says that is no number of the findings: names, what was fixed before, and what follows from a comparison."""
    from enhsim_tf.detection import anomalies as injections
    from enhsim_tf.detection import evaluation as robustness
    from enhsim_tf.detection.registry import DETECTORS
    from enhsim_tf.reproduce import statistics as inference
    from enhsim_tf.reproduce.robustness import degraded_modes
    from enhsim_tf.reproduce.robustness import replicate as replicates
    from enhsim_tf.reproduce.robustness import targets as bars

    gaussian = [name for name in bars.KINDS_OF_NOISE["Gaussian"] if name in found["bars"]]
    asked, controls = [found["bars"][name] for name in gaussian], found["controls"].values()
    trial = inspect.signature(robustness.make_trial).parameters
    scaled = by_scale(found)
    confirmed = [name for name, about in found["alarms_on_everything"].items() if about["replicates"] == about["of"]]
    return {
        "arms": replicates.ARMS,
        "methods": degraded_modes.METHODS,
        "noises": ["real", *(noise for pipeline in ("residual", "enhanced") for noise in _noises(pipeline, replicates.ARMS))],
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
        "first_trial": first_trial(found),
        "first_confirmed": in_list(confirmed),
        "is_realistic": all(bar["measures_within"] == bar["num_measures"] for bar in asked),
        "gaussian_names": gaussian,
        "other_names": [name for name in found["bars"] if name not in gaussian],
        "detectors": list(DETECTORS),
        "quick": replicates.QUICK_DETECTORS,
        "kinds": [kind.replace("_", " ") for kind in injections.INJECTIONS],
        "is_ar_as_good": all(bar["over_autoregression"]["mean"] >= -bars.MARGIN for bar in asked),
        "opposite": opposite_signs(found),
        "development": DEVELOPMENT_SEEDS,
        "severities": [f"{severity:g}" for severity in injections.SEVERITIES],
        "durations": injections.DURATIONS,
        "prevalence": robustness.PREVALENCE,
        "trace_severity": trial["trace_severity"].default,
        "max_buffer": round(min(settings.telemetry.orbit_period_s, settings.telemetry.rotation_period_s) / settings.telemetry.interval_s),
        "recall_points": number(100 * bars.LARGEST_RECALL_DIFFERENCE, 0),
        "margin": bars.MARGIN,
        "largest_ratio": number(bars.LARGEST_RATIO, 0),
        "best_control": max(about["recall_at_real_rate"] for about in controls if "recall_at_real_rate" in about),
        "modes_found": modes_found(found),
        "least_p": inference.wilcoxon_signed_rank([1.0] * len(found["seeds"])),  # where all signs are the same
        "quieter": scaled[max(scale for scale in scaled if scale < 1)],
    }


def by_scale(found: Findings) -> dict[float, Findings]:
    """What the second generator's noise does at each scale, without any real window."""
    return {row["scale"]: row for row in found["variations"] if row["arm"] == "residual + convolutional GAN" and row["real_share"] == 0}


def opposite_signs(found: Findings, least: float = 0.1) -> str:
    """The contrasts whose sign is not the same in all environments; log-odds nearer to nought than the least have none."""
    said = []
    for contrast in (each for name in ("paper", "second") for each in found["contrasts"][name]):
        more, less = ([name for name in found["environments"] if sign * contrast["parts"][name] > least] for sign in (1, -1))
        if more and less:
            said.append(f"*{contrast['first']}* alarms more than *{contrast['second']}* on {in_list(more)} noise, less on {in_list(less)}")
    return "; ".join(said)


def modes_found(found: Findings) -> str:
    """What the degraded modes show against the baselines that cost nothing."""
    errors = found["modes"]["nrmse"]
    at = {name: {where: f"{errors[name][where]:.2f}" for where in ("inside", "outside")} for name in errors}
    cells = {(row["method"], row["mode"], row["severity"]): row["nrmse"] for row in found["modes"]["by_mode"] if row["mode"] != "nominal"}
    network = {key[1:]: error for key, error in cells.items() if key[0] == "randomised"}
    better = sum(cells["ridge, randomised", *key] < error for key, error in network.items())
    coarse = sum(cells["identity", *key] < error for key, error in network.items())
    worse = "above" if errors["paper"]["outside"] > errors["identity"]["outside"] else "below"
    return (
        f"Outside, the paper's enhancer errs by {at['paper']['outside']}, {worse} the coarse signal left as it is ({at['identity']['outside']}) "
        f"and against {at['moving average']['outside']} of the smoothed one. Training over random configurations is what helps, where the true response to them is known "
        "as it is here (their targets are the true degraded signal with noise): linear regression over them "
        f"errs by {at['ridge, randomised']['inside']} inside and {at['ridge, randomised']['outside']} outside, the network that learnt from the same by "
        f"{at['randomised']['inside']} and {at['randomised']['outside']}. In {better} of {len(network)} pairs of mode and severity the regression is nearer than that "
        f"network, in {coarse} the untouched coarse signal."
    )


def tries_found(tries: Sequence[Mapping[str, Any]]) -> str:
    """How many measures the tries keep within twice their floor: the design as it is and the best other, environment by environment.

    Args:
        tries: Rows of the tries with how many measures are `within`, of which `number`.
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
        before = f"{mean[AS_IT_IS]:.3g} as it is" if AS_IT_IS in mean else ""
        after = f"{mean[other]:.3g} at best otherwise ({other})" if other else ""
        said.append(f"on {environment} noise {', '.join(filter(None, (before, after)))}")
    full = sum(row["within"] == row["number"] for row in trainings)
    return f"Measures kept, of {trainings[0]['number']}: {'; '.join(said)}. {full or 'None'} of the {len(trainings)} trainings keeps all."


def _noises(pipeline: str, arms: Iterable[str]) -> list[str]:
    """What the measures of realism judge of a pipeline: what its generators learn from, and what they make of it."""
    return [f"{pipeline}: extracted", *(arm for arm in arms if arm.startswith(f"{pipeline} + "))]
