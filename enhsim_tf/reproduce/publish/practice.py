"""What a practitioner should do: five sentences, each with its number, and the evidence behind each of them.

The README and the report have the sentences, the tables of the report the evidence. All numbers come from the findings of the experiments. Where a number is missing, the
sentence says so.
"""

import dataclasses
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from enhsim_tf.reproduce.caption import in_seeds
from enhsim_tf.reproduce.factorial.cells import WITHOUT_NETWORK
from enhsim_tf.reproduce.learning_curve.arms import SIMULATOR
from enhsim_tf.reproduce.publish.wording import Findings, in_list, interval, mean_of, modes_tried, modes_where_better, per_cent, points
from enhsim_tf.reproduce.robustness.targets import MARGIN
from enhsim_tf.reproduce.spacecraft.study import DEGRADED_ARM, GENERATED_ARM

LEAST_SEEDS = 3
"""Number of seeds below which a difference is reported without a conclusion."""
CLOSE = 0.01
"""Recall that a detector may lose with clean training windows and still count as equal."""
LOUD = 0.5
"""A detector that flags at least this share of nominal windows with any training data is named."""
GOOD_ENOUGH = 0.9
"""Scores of one line are named whose area under the precision-recall curve is at least this share of the best one's."""
FITTED, RESAMPLED = "simulator + autoregression", "simulator + residual windows"
ONE_LINE = "moving deviation"
"""Arms of the experiment on the number of real windows."""


@dataclasses.dataclass(frozen=True)
class Answer:
    """When something suffices, pays or does not help.

    Args:
        sentence: One sentence with its number, for the README and the report.
        evidence: Further sentences, for the tables of the report.
    """

    sentence: str
    evidence: str = ""


def answers(
    found: Findings,
    factorial: Findings | None = None,
    labelled: Findings | None = None,
    curve: Findings | None = None,
    battery: Findings | None = None,
) -> dict[str, Answer]:
    """The five answers by question.

    Args:
        found: The findings on robustness.
        factorial: The findings of the factorial experiment, or None.
        labelled: The findings of the study of real telemetry, or None.
        curve: The findings of the experiment on the number of real windows, or None.
        battery: The findings of the study of a battery, or None.
    """
    return {
        "a clean simulator": _clean(found, battery),
        "a linear map and resampled residuals": _linear(factorial, curve),
        "a network": _network(found, factorial),
        "generated noise": _noise(factorial, curve),
        "nothing here": _nothing(labelled),
    }


def short(answered: Mapping[str, Answer]) -> str:
    """The sentences as a Markdown list."""
    return "\n".join(f"- {answer.sentence}" for answer in answered.values())


def evidence(answered: Mapping[str, Answer]) -> str:
    """The evidence behind the sentences as a Markdown list."""
    return "\n".join(f"- *{question.capitalize()}.* {answer.evidence}" for question, answer in answered.items() if answer.evidence)


def _clean(found: Findings, battery: Findings | None) -> Answer:
    coarse, truth, real = (found["arms"][name] for name in ("coarse", "truth", "real"))
    recall = {name: [about["recalls_at_real_rate"][name] for about in (truth, coarse, real)] for name in real["recalls_at_real_rate"]}
    perfect, square = ([name for name, each in recall.items() if each[place] >= each[2] - CLOSE] for place in (0, 1))
    kept = len(coarse["c8"]["kept"]) + len(truth["c8"]["kept"])
    quiet, of_quiet = _little_noise(battery)
    flagged = [per_cent(_mean_rate(arm, names)) for arm, names in ((truth, perfect), (coarse, square)) if names]
    own = f"; with their own thresholds, these flag {in_list(flagged)} of real nominal windows" if flagged else ""
    sentence = (
        f"**A clean simulator suffices** {quiet}only with thresholds set on real windows and only for few detectors: {len(perfect)} of {len(recall)} lose at most "
        f"{points(CLOSE, 0)} point of recall if they are trained on the perfect signal without noise ({in_list(perfect) or 'none'}), and {len(square)} if trained on the coarse "
        f"simulator ({in_list(square) or 'none'}){own}."
    )
    shares = "; ".join(f"{name} {in_list([per_cent(share) for share in recall[name]])}" for name in perfect)
    behind = (
        f"({len(recall)} detectors, {len(found['environments'])} kinds of noise, {in_seeds(found['seeds'])}.) With its own thresholds it meets the criterion of claim "
        f"C8 in {kept} of {2 * truth['c8']['of']} pairs of environment and detector. With thresholds set on real windows, detectors trained on the noiseless signal, on "
        f"the coarse simulator and on real telemetry find these shares of the anomalies: {shares + '; ' if shares else ''}all detectors "
        f"{per_cent(truth['recall_at_real_rate'])}, {per_cent(coarse['recall_at_real_rate'])} and "
        f"{per_cent(real['recall_at_real_rate'])}. {_one_line(found, real['recalls_at_real_rate'])}{of_quiet}"
    )
    return Answer(sentence, behind)


def _mean_rate(arm: Findings, names: Sequence[str]) -> float:
    """The false-alarm rate at own thresholds, mean over the environments and the named detectors."""
    rates = [about["detectors"][name] for about in arm["by_environment"].values() for name in names]
    return sum(rates) / len(rates)


def _one_line(found: Findings, real: Mapping[str, float]) -> str:
    """Which detectors find less than the best score of one line, even after training on real telemetry."""
    known = {name: about["recall_at_real_rate"] for name, about in found["controls"].items() if "recall_at_real_rate" in about}
    best = max(known, key=known.__getitem__)
    less = [name for name, recall in real.items() if recall < known[best]]
    beyond = f"more than these detectors after training on real telemetry: {in_list(less)}" if less else "less than every detector"
    return f"The best score of one line ({best}) finds {per_cent(known[best])}, {beyond}."


def _little_noise(battery: Findings | None) -> tuple[str, str]:
    """What a noiseless simulator is worth on telemetry whose noise is small: the beginning of the sentence, and its evidence."""
    if battery is None:
        return "", " Telemetry with little noise was not tested."
    from enhsim_tf.reproduce.battery.detectors import CLEAN, ENHANCED, REAL_120, RESAMPLED  # imported here, because it imports TensorFlow

    arms = [about["detectors"] for about in battery["regimes"].values()]
    clean, enhanced, noisy, real = CLEAN, ENHANCED, RESAMPLED, REAL_120
    shared = [name for name in arms[0][clean] if all(name in each[arm] for each in arms for arm in (clean, enhanced, noisy, real))]

    def means(arm: str, measure: str) -> str:
        values = [[each[arm][name][measure] for name in shared] for each in arms]
        values = [[value["mean"] if isinstance(value, Mapping) else value for value in each] for each in values]
        return in_list([per_cent(sum(each) / len(each)) for each in values])

    alarms = {arm: means(arm, "false_alarms") for arm in (clean, enhanced, noisy, real)}
    recall = {arm: means(arm, "recall_at_real_rate") for arm in (enhanced, noisy)}
    said = (
        f"where the noise is small, as on a battery (trained on a simulator without noise, detectors flag {alarms[clean]} of real nominal windows in two regimes); with the "
        "four kinds of noise here, "
    )
    behind = (
        f" In the two regimes of the [battery](battery.md) ({len(shared)} detectors), detectors flag {alarms[clean]} after training on the fine "
        f"simulator without noise, {alarms[enhanced]} on the enhanced signal without noise, {alarms[noisy]} with its residuals added, and {alarms[real]} on 120 "
        f"real orbits. Recall at the real rate is {recall[noisy]} with added residuals and {recall[enhanced]} without them."
    )
    return said, behind


def _linear(factorial: Findings | None, curve: Findings | None) -> Answer:
    about = (factorial or {}).get("cells", {}).get(WITHOUT_NETWORK.name)
    if about is None:
        return Answer("**A linear map and resampled residuals**: not measured yet.")
    against, real = factorial["contrasts"]["no network, real"], factorial["cells"]["real"]
    within = [name for name, each in against["by_environment"].items() if each["false_alarms"]["high"] <= MARGIN]
    beyond = {name: each["false_alarms"] for name, each in against["by_environment"].items() if name not in within}
    everywhere = len(within) == len(against["by_environment"])
    where = "on every noise" if everywhere else f"on {in_list(within)} noise" if within else "on none of the kinds of noise"
    differences = [f"{name} {points(each['false_alarms'])}" for name, each in against["by_environment"].items()]
    sentence = (
        f"**A linear map and resampled residuals suffice** {where} here: detectors trained on the output of ridge regression plus whole windows of its residuals flag "
        f"at most {points(MARGIN)} points more nominal windows there than after training on real telemetry, by the upper end of the interval "
        f"({', '.join(differences)}); where you have real windows of what you monitor, train on these first."
    )
    others = "".join(f" On {name} noise the difference is {points(each)} points." for name, each in beyond.items())
    behind = (
        f"({len(factorial['detectors'])} detectors, {in_seeds(about['seeds'])}.) This method has no network. Over all "
        f"kinds of noise these detectors flag {interval(about['false_alarms'])} of real nominal windows, against {interval(real['false_alarms'])}. "
        "It meets the criterion of claim C8 in "
        f"{about['kept']} of {about['pairs']} pairs of environment and detector.{others} It does not do better than the real windows from which the residuals are "
        f"taken.{_resampled(curve)} Its use is to make windows that were never recorded, such as faults and other configurations."
    )
    return Answer(sentence, behind)


def _resampled(curve: Findings | None) -> str:
    """In how many environments residual windows pay at any number of real windows."""
    if curve is None:
        return ""
    pays = [name for name, about in curve["environments"].items() if about["pays"].get(RESAMPLED)]
    where = (
        f"only on {in_list(pays)} noise"
        if pays
        else f"for no number of real windows from {curve['numbers'][0]} to {curve['numbers'][-1]:,}"
    )
    return f" In the [experiment on the number of real windows](noise.md), it pays {where}."


def _network(found: Findings, factorial: Findings | None) -> Answer:
    errors = found["modes"]["nrmse"]
    network, ridge = errors["randomised"], errors["ridge, randomised"]
    sentence = (
        "**A network pays** for faults of the severities that it was trained on: with the true response to randomised configurations as its target, it has a normalised "
        f"root-mean-square error (NRMSE) of {network['inside']:.2f} in degraded modes, against {ridge['inside']:.2f} for ridge regression on the same windows; it does not "
        f"pay beyond these severities ({network['outside']:.2f} against {ridge['outside']:.2f}), nor on nominal signals after training on nominal windows "
        f"({errors['more windows']['nominal']:.3f} against {errors['ridge']['nominal']:.3f})."
    )
    nearest = errors["nearest windows, randomised"]
    beyond = (
        f"(White noise, {in_seeds(found['seeds'])}; both learn from 15,000 windows.) After training on randomised configurations, the network has "
        f"{network['nominal']:.3f} on nominal signals and ridge regression {ridge['nominal']:.3f}; the mean of the nearest training windows has {nearest['inside']:.2f} within "
        f"the trained severities and {nearest['outside']:.2f} beyond them.{_where_ridge_is_better(found)}"
    )
    difference = _difference(factorial, "network, ridge")
    if difference is None:
        return Answer(sentence, f"{beyond} The effect of the network on false alarms is not measured yet.")
    return Answer(
        sentence,
        f"{beyond} On nominal telemetry the network {_effect(factorial, 'network, ridge')}: with the same windows and resampled residuals, replacing ridge "
        f"regression by it changes the false-alarm rate by {points(difference)} points ({_seeds(factorial, 'network, ridge')}).",
    )


def _where_ridge_is_better(found: Findings) -> str:
    """The degraded modes in which ridge regression has a smaller error than the network that learnt from the same windows."""
    tried = [mode for mode, _ in modes_tried(found)]
    better = [mode for mode, _ in modes_where_better(found, "ridge, randomised")]
    counts = [f"{mode.replace('_', ' ')} ({better.count(mode)} of {tried.count(mode)} severities)" for mode in dict.fromkeys(better)]
    return f" Ridge regression has the smaller error in these modes: {', '.join(counts)}." if counts else ""


def _noise(factorial: Findings | None, curve: Findings | None) -> Answer:
    few, behind = _few_windows(curve)
    many, against = _many_windows(factorial)
    start = f"**Generated noise pays** {few}" if few else "**Generated noise** was not shown to pay"
    return Answer(
        f"{start}; {many}.",
        f"{behind}{against}It is needed for longer stretches of noise than were recorded; no experiment here measures what that is worth.",
    )


def _few_windows(curve: Findings | None) -> tuple[str, str]:
    """Where a fitted noise model, other than resampled windows, pays at few real windows: the clause and its evidence."""
    if curve is None:
        return "", ""
    pays: dict[tuple[int, ...], list[str]] = {}
    for name, about in curve["environments"].items():
        if numbers := about["pays"].get(FITTED):
            pays.setdefault(tuple(numbers), []).append(name)
    if not pays:
        return "", ""
    where = "; ".join(
        f"with {in_list([f'{number:,}' for number in numbers])} windows on {in_list(names)} noise" for numbers, names in pays.items()
    )
    least, first = curve["numbers"][0], next(iter(pays.values()))[0]
    arms = curve["environments"][first]["arms"]
    rates = {arm: _with_quantiles(arms[arm], str(least)) for arm in (FITTED, RESAMPLED, "real")}
    recall = [per_cent(arms[arm]["recall_at_real_rate"][str(least)], 0) for arm in (FITTED, "real")]
    clause = (
        f"where real windows are few and a fitted autoregression describes the noise: with {least} real windows of {first} noise, detectors flag {rates[FITTED]} of "
        f"nominal windows, against {rates['real']} after training on these {least} windows (brackets: 10 % and 90 % quantiles of the seeds)"
    )
    behind = (
        f"The autoregression, which is not a network, pays {where} ({in_seeds(curve['seeds'])}; in brackets the 10 % and 90 % quantiles over seeds; [details](noise.md)). "
        f"With {least} windows of {first} noise, resampled residual windows give {rates[RESAMPLED]}. Recall at a matched false-alarm rate is {in_list(recall)}, so most of "
        f"the gain is a better threshold.{_simpler(curve['environments'][first], str(least))} On the other noises no simulator with a simple noise model "
        f"pays{_learnt_pays(curve['environments'], {name for names in pays.values() for name in names})}. "
    )
    return clause, behind


def _learnt_pays(environments: Mapping[str, Findings], others: Collection[str]) -> str:
    """Where a simulator with noise of a network pays by the same rule, except in the environments where a simple model does."""
    told = [
        f"{arm} with {in_list([f'{number:,}' for number in numbers])} windows on {name} noise ({in_seeds(group['seeds'])})"
        for name, about in environments.items()
        if name not in others
        for group in about["few_seeds"]
        for arm in group["names"]
        if arm.startswith(SIMULATOR) and (numbers := about["others_pay"][arm]["pays"])
    ]
    return f". By the same rule, these pay there: {in_list(told)}" if told else ""


def _simpler(about: Findings, least: str) -> str:
    """What else pays in an environment by the same rule, and what a score of one line finds there."""
    pays = [arm for arm, numbers in about["pays"].items() if int(least) in numbers and arm != FITTED]
    pays += [arm for arm, other in about["others_pay"].items() if int(least) in other["pays"]]
    told = [f"{arm} ({per_cent(about['arms'][arm]['rate'][least])})" for arm in pays]
    line = about["arms"].get(ONE_LINE)
    said = f" By the same rule, these pay there, too: {in_list(told)}." if told else ""
    if line is None:
        return said
    return (
        f"{said} A score of one line ({ONE_LINE}) finds {per_cent(line['recall_at_real_rate'][least], 0)} at the matched rate, but flags "
        f"{per_cent(line['rate'][least])} at a threshold set on so few windows."
    )


def _with_quantiles(arm: Mapping[str, Any], number: str) -> str:
    return f"{per_cent(arm['rate'][number])} ({points(arm['low'][number])} to {points(arm['high'][number])})"


def _many_windows(factorial: Findings | None) -> tuple[str, str]:
    known = (("convolutional GAN, whole windows", "ridge regression"), ("convolutional GAN, whole windows, network", "the network"))
    chosen = next(((name, enhancer) for name, enhancer in known if _difference(factorial, name) is not None), None)
    if chosen is None:
        return "with many windows, its false alarms have not been compared with those of whole residual windows yet", ""
    name, enhancer = chosen
    clause = (
        f"with many windows, replacing whole residual windows by noise of the convolutional GAN {_effect(factorial, name)} "
        f"on average over {len(factorial['environments'])} kinds of noise ({points(_difference(factorial, name))} points)"
    )
    parts = {each: about["false_alarms"] for each, about in factorial["contrasts"][name]["by_environment"].items()}
    widest = max(parts, key=lambda each: parts[each]["high"] - parts[each]["low"])
    return (
        clause,
        f"The comparison with many windows uses {enhancer} and the same residuals ({_seeds(factorial, name)}); the interval is widest "
        f"on {widest} noise, {points(parts[widest])} points. ",
    )


def _nothing(labelled: Findings | None) -> Answer:
    if labelled is None:
        return Answer("**No training data help enough** where telemetry changes after training. This is not measured yet.")
    arms = labelled["arms"]
    controls = {name: about for name, about in labelled["controls"].items() if "found" in about}
    best = max(controls, key=lambda name: controls[name]["auc_pr"])
    simple = sorted(
        (name for name in controls if controls[name]["auc_pr"] >= GOOD_ENOUGH * controls[best]["auc_pr"]),
        key=lambda name: -controls[name]["auc_pr"],
    )
    rates = {name: mean_of(about["false_alarms"]) for name, about in (arms | controls).items()}
    quiet = min((name for name in arms if " + " in name and name != DEGRADED_ARM), key=rates.__getitem__)
    sentence = (
        f"**No training data help every detector** on {len(labelled['channels'])} channels of a spacecraft: with thresholds for 1 %, detectors flag on average "
        f"{per_cent(rates['real'])} of later nominal windows after training on the real past, and at least {per_cent(rates[quiet])} after training on generated telemetry "
        f"with noise, while simple scores of one line of code flag {in_list([f'{per_cent(rates[name])} ({name})' for name in simple])}."
    )
    return Answer(
        sentence,
        f"(Means over detectors, channels and {in_seeds(labelled['seeds'])}; fewest with *{quiet}*.){_without_told_apart(labelled, quiet, best)}{_on_the_past(labelled)}"
        f"{_by_detector(labelled)} The area under the precision-recall curve "
        f"(AUC-PR) of the score of one line ({best}) is {controls[best]['auc_pr']:.2f}.{_residual(labelled)}",
    )


def _without_told_apart(labelled: Findings, quiet: str, best: str) -> str:
    """The same false alarms without the channels on which detectors of most arms flag most windows."""
    told_apart, arms = labelled["told_apart"], labelled["arms"]
    if not told_apart or len(told_apart) == len(labelled["channels"]):
        return ""
    rates = [per_cent(about["usable"]["false_alarms"]) for about in (arms["real"], arms[quiet], labelled["controls"][best])]
    return (
        f" Without {in_list(told_apart)}, where detectors flag more than half of the windows in the median arm with noise, the false alarms in this order are "
        f"{in_list(rates)}."
    )


def _on_the_past(labelled: Findings) -> str:
    """What simulated windows without noise are worth if the threshold is set on the real past instead."""
    clean = [name for name in ("enhanced", "coarse") if "false_alarms_past" in labelled["arms"].get(name, {})]
    told = [
        f"*{name}* {per_cent(about['false_alarms_past']['mean'])} and {per_cent(about['found_past']['mean'], 0)}"
        for name, about in ((name, labelled["arms"][name]) for name in ("real", *clean))
        if "false_alarms_past" in about
    ]
    if not clean:
        return ""
    return f" With thresholds set on the real past, also for training windows without noise, false alarms and the share of sequences found are: {', '.join(told)}."


def _by_detector(labelled: Findings) -> str:
    """For which detector generated telemetry helps most, and which detectors flag most windows whatever they are trained on."""
    arms = {name: about["by_detector"] for name, about in labelled["arms"].items() if name != DEGRADED_ARM}
    real, generated = arms["real"], arms[GENERATED_ARM]
    noisy = [real, *(about for name, about in arms.items() if " + " in name)]
    loud = [name for name in real if min(about[name]["false_alarms"] for about in noisy) >= LOUD]
    most = max((name for name in real if name not in loud), key=lambda name: real[name]["false_alarms"] - generated[name]["false_alarms"])
    nearly_all, few = (per_cent(labelled["arms"]["real"][name], 0) for name in ("flag_nearly_all", "flag_few"))
    at = per_cent(labelled["rates"][0], 0)
    flags = [per_cent(about[most]["false_alarms"]) for about in (generated, real)]
    finds = [per_cent(about[most]["found_by_rate"][0], 0) for about in (generated, real)]
    rest = {name: about[most] for name, about in arms.items() if name not in ("real", GENERATED_ARM)}
    same = [
        f"*{name}* ({per_cent(about['false_alarms'])} flagged, AUC-PR {about['auc_pr']:.2f})"
        for name, about in rest.items()
        if about["found_by_rate"][0] >= generated[most]["found_by_rate"][0]
    ]
    fewest = min((name for name in rest if " + " in name), key=lambda name: rest[name]["false_alarms"])
    ranked = max(arms, key=lambda name: arms[name][most]["auc_pr"])
    flagged = f" At least half of the windows are flagged with any training data by: {in_list(loud)}." if loud else ""
    return (
        f" These means hide two groups: after training on the real past, {nearly_all} of the combinations of detector, channel "
        f"and seed flag at least 99 % of the windows, and {few} at most 1 %."
        f"{flagged} The {most} gains most from generated telemetry (*{GENERATED_ARM}*): it flags {flags[0]} and finds {finds[0]} of the "
        f"labelled sequences at {at} false alarms, with an AUC-PR of {generated[most]['auc_pr']:.2f}, against {flags[1]} and {finds[1]} after training on the real past."
        f"{f' It finds as many after training on {in_list(same)}.' if same else ''} It flags fewest "
        f"windows with *{fewest}* ({per_cent(rest[fewest]['false_alarms'])}), and its AUC-PR is highest with *{ranked}* ({arms[ranked][most]['auc_pr']:.2f})."
    )


def _residual(labelled: Findings) -> str:
    """What the simulator is worth there as a model of the signal, if this was measured."""
    row = labelled.get("residual", {}).get("residual, scale followed")
    if row is None:
        return ""
    return (
        " The simulator can also be used as a model instead of a source of data: the residual of the simulator that is aligned with each window "
        f"(`score --detector residual`) flags {per_cent(row['mean_false_alarms'])}, with an AUC-PR of {row['auc_pr']:.2f} ({_ahead(row)})"
        f"{_ridge_residual(labelled)}{_discord(labelled)}. "
        "With so few channels this difference is not "
        "established, and two bounds of this detector were set after results of one seed had been seen."
    )


def _ahead(row: Mapping[str, Any]) -> str:
    return f"higher than that of the scores of one line on {row['channels_ahead']} of {row['channels']} channels"


def _ridge_residual(labelled: Findings) -> str:
    row = labelled["residual"].get("ridge residual, scale followed")
    if row is None:
        return ""
    return f"; with ridge regression in place of the network, it flags {per_cent(row['mean_false_alarms'])} ({row['auc_pr']:.2f}, {_ahead(row)})"


def _discord(labelled: Findings) -> str:
    row = labelled.get("residual", {}).get("left discord")
    return (
        ""
        if row is None
        else f"; the left discord of the matrix profile, which needs no simulator, flags {per_cent(row['mean_false_alarms'])} ({row['auc_pr']:.2f})"
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
