"""Fills the generated parts of `docs/noise.md` from the findings of the experiments on noise and on the number of real windows."""

import inspect
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from enhsim_tf.common.atomic_files import replace_file
from enhsim_tf.reproduce.learning_curve.arms import CLASSIFIER
from enhsim_tf.reproduce.noise_gallery import GALLERY
from enhsim_tf.reproduce.noise_ladder.findings import ARMS, FORMER, FORMER_RULES, MAX_RECALL_DIFFERENCE, PRESENT, REAL, fewer_seeds
from enhsim_tf.reproduce.publish.results import fill_parts
from enhsim_tf.reproduce.publish.wording import in_list

Findings = Mapping[str, Any]
PAGE = Path("docs/noise.md")
_ENOUGH = 2 / 3  # of the families must keep the limit on realism
_NAMED = 3  # measures that are named for a family


def fill_page(path: Path, noise: Findings | None = None, curve: Findings | None = None) -> None:
    """Writes the generated parts of the page between their markers.

    Args:
        path: The page; nothing is done where it does not exist.
        noise: The findings of the experiment on noise, or None to keep its parts.
        curve: The findings of the experiment on the number of real windows, or None to keep its part.

    Raises:
        InputError: If the markers of a part are not there once.
    """
    if not path.is_file():
        return
    parts = {}
    if noise is not None:
        parts |= {"families": families(noise), "limits": limits(noise), "unrealistic": unrealistic(noise)}
    if curve is not None:
        parts["learning curve"] = learning_curve(curve)
    text = fill_parts(path.read_text(encoding="utf-8"), parts, path.name)
    with replace_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def families(found: Findings) -> str:
    """The table of false-alarm rates, a row for each family and a column for each present noise model, and what the families are."""
    used = {name for about in found["families"].values() for name in about["rungs"]}
    names = [name for name in (REAL, *ARMS) if name in used and name not in FORMER]
    lines = [f"| family | half | {' | '.join(names)} | chosen by the rule |", "|---" * (len(names) + 3) + "|"]
    for family, about in sorted(found["families"].items(), key=lambda item: item[1]["half"] != "looked at"):
        half = f"{about['half']} (see above)" if about["half"] == "revised" else about["half"]
        rates = [f"{about['rungs'][name]['alarms']:.1%}" if name in about["rungs"] else "" for name in names]
        lines.append(f"| {family.replace('_', ' ')} | {half} | {' | '.join(rates)} | {', '.join(_chosen(about['choices']))} |")
    kinds = [f"- {family.replace('_', ' ')}: {_kind(family)}" for family in found["families"]]
    return "\n".join([_scope(found), "", *lines, "", "The families (AR(1): autoregressive of first order):", "", *kinds])


def _kind(family: str) -> str:
    """What a family of noise is: the first sentence about its process."""
    return (inspect.getdoc(type(GALLERY[family])) or "").partition("\n")[0]


def _chosen(choices: Sequence[Findings]) -> list[str]:
    """The models that the present rule chooses, or the former rules where the present one has judged no seed."""
    by_present = sorted({each["chosen"] for each in choices if each["rule"] == PRESENT})
    return by_present or sorted({f"{each['chosen']} ({each['rule']} rule)" for each in choices})


def _scope(found: Findings) -> str:
    said = f"False alarms on nominal windows with real noise, thresholds set for 1 % ({_seeds(found['seeds'])}, budget {found['budget']}"
    fewer = "; ".join(f"{in_list(names)}: {_seeds(seeds)} alone" for seeds, names in fewer_seeds(found).items())
    return f"{said}; {fewer}):" if fewer else f"{said}):"


def _seeds(seeds: Sequence[int]) -> str:
    return f"seed {seeds[0]}" if len(seeds) == 1 else f"seeds {in_list([str(seed) for seed in seeds])}"


def limits(found: Findings) -> str:
    """What became of each limit, as a list."""
    kept = found["limits"]
    lines = []
    for half in ("looked at", "unseen"):
        own = kept[half]
        if not own["of"]:
            continue
        worst = max(own["excess"], key=own["excess"].get)
        lines.append(
            f"- Excess of false alarms of the {kept['rung']} over real windows, {half} families, at most {100 * own['limit']:g} "
            f"point{'s' * (own['limit'] != 0.01)}: {own['kept']} of {own['of']} families; the largest excess is {100 * own['excess'][worst]:.1f} "
            f"points ({worst.replace('_', ' ')}{_range(found['families'][worst]['rungs'][kept['rung']])})."
        )
    for family, excess in kept["revised"].items():
        lines.append(
            f"- {family.replace('_', ' ').capitalize()} noise, for which the {kept['rung']} was changed after its first result: {round(100 * excess, 1) + 0.0:.1f} points."
        )
    others = [f"{name} {about['kept']} of {about['of']}" for name, about in kept["within"].items() if about["of"] and name != kept["rung"]]
    lines.append(f"- Families on which each of the other models keeps these limits: {', '.join(others)}.")
    strict = [f"{name} {about['kept']}" for name, about in kept["within_strict"].items() if about["of"]]
    lines.append(
        f"- Families on which each model stays within {100 * kept['looked at']['limit']:g} point of the real windows: {', '.join(strict)}."
    )
    recall, realism = kept["recall"], kept["realism"]
    lines += [
        f"- Recall at the real rate within {100 * recall['limit']:g} points of that after training on real windows: {recall['kept']} of "
        f"{recall['of']} families with the {kept['rung']}{_differences(recall['missed'], 2)}.{_other_recalls(found, recall['limit'])}",
        f"- Recall at own thresholds more than {100 * recall['limit']:g} points below that after training on real windows"
        f"{_losses(recall['lost_by_model'][kept['rung']])}{_other_losses(recall['lost_by_model'], kept['rung'])}.",
        f"- Every measure of realism within {realism['limit']:g} times its floor: {realism['families_with_all']} of {realism['of']} families "
        f"(required: two thirds). On average, {realism['mean_share']:.0%} of the measures of a family are within it."
        f"{_of_chosen(realism['chosen'], kept['choice'][PRESENT]['seeds'])}",
    ]
    if kept["choice"][PRESENT]["of"]:
        lines.append(_choice(kept["choice"][PRESENT], kept["rung"]))
    former = [
        f"{said} on {kept['choice'][rule]['kept']} of {kept['choice'][rule]['of']} families "
        f"({_seeds(kept['choice'][rule]['seeds'])}; by the present count on {kept['choice'][rule]['kept_above_real']})"
        for rule, said in FORMER_RULES.items()
        if kept["choice"][rule]["of"]
    ]
    if former:
        lines.append(
            f"- What was tried before kept the limit on the choice, with the fewest alarms as the best, as follows: {'; '.join(former)}."
        )
    lines += [_alone(seed, about, kept["rung"]) for seed, about in found["alone"].items() if len(found["alone"]) > 1]
    return "\n".join([*lines, "", *_realism(realism["by_model"])])


def _alone(seed: str, about: Findings, learnt: str) -> str:
    """What became of the limits on one seed alone."""
    alarms, recall, choice = about["alarms"], about["recall"], about["choice"]
    realism = ", ".join(f"{name} {values['families_with_all']}" for name, values in about["realism"].items())
    chosen = (
        f" The choice within its limit on {choice['kept_above_real']} of {choice['of']}{_differences(choice['missed_above_real'])}; with the fewest "
        f"alarms as the best on {choice['kept']}{_differences(choice['missed'])}. Among the models that find as much: "
        f"{choice['kept_that_finds']}{_found_less(choice)}."
        if choice["of"]
        else ""
    )
    return (
        f"- Seed {seed} alone: false alarms of the {learnt} within the limits on {alarms['kept']} of {alarms['of']} families"
        f"{_differences(alarms['missed'], 2)}. Recall at the real rate within {100 * MAX_RECALL_DIFFERENCE:g} points on {recall['kept']}"
        f"{_differences(recall['missed'], 2)}. Recall at own thresholds more than {100 * MAX_RECALL_DIFFERENCE:g} points lower{_losses(about['lost'])}. "
        f"Families with every measure of realism within the limit: {realism}.{chosen}"
    )


def _choice(choice: Findings, learnt: str) -> str:
    """How far the choice of the present rule is from the best model."""
    worst, least = (max(choice[measure], key=choice[measure].__getitem__) for measure in ("excess", "lost"))
    on_a_seed, on_each_seed = (" on at least one seed", " on each seed") if len(choice["seeds"]) > 1 else ("", "")
    models = f"{' or '.join(map(str, choice['judged']))} models{' in the mean over seeds' * (len(choice['seeds']) > 1)}"
    return (
        f"- Excess of the model that the rule chooses within {100 * choice['limit']:g} points of that of the best of {models} "
        f"({_seeds(choice['seeds'])}), where a model with fewer alarms than after training on real windows has no excess: "
        f"{choice['kept_above_real']} of {choice['of']} families{_differences(choice['missed_above_real'])}. If the model with the fewest alarms "
        f"is the best one, however few they are: {choice['kept']} of {choice['of']} families{_differences(choice['missed'])}. "
        f"Among the models that lose at most {100 * MAX_RECALL_DIFFERENCE:g} points of recall, and if the chosen one loses no more either: "
        f"{choice['kept_that_finds']} of {choice['of']} families{_found_less(choice)}. On "
        f"{_families(choice['none_passes'])}, no model passes{on_a_seed}, and the smallest departure decides. The {learnt} passes on "
        f"{choice['learnt_passes']} families{on_each_seed}. "
        f"Detectors trained with the chosen model flag at most {100 * choice['excess'][worst]:.1f} points more windows than after training on real "
        f"windows ({worst.replace('_', ' ')}), and lose at most {100 * choice['lost'][least]:.1f} points of recall ({least.replace('_', ' ')})."
        f"{_below_real(choice)}"
    )


def _other_recalls(found: Findings, limit: float) -> str:
    """Where those other present models miss the limit on recall at the real rate that keep the limits on false alarms on every family."""
    kept, told = found["limits"], []
    for name, about in kept["within"].items():
        if name in FORMER or name == kept["rung"] or about["kept"] < about["of"]:
            continue
        own = {family: about["rungs"][name]["recall_difference"] for family, about in found["families"].items() if name in about["rungs"]}
        missed = {family: value for family, value in own.items() if abs(value) > limit}
        if own:
            told.append(f"with {name} {len(own) - len(missed)} of {len(own)}{_differences(missed, mark=',')}")
    return f" Of the models that keep the limits on false alarms everywhere: {'; '.join(told)}." if told else ""


def _of_chosen(realism: Findings, seeds: Sequence[int]) -> str:
    """The same for the noise of the models that are chosen on some seeds."""
    if not realism["of"]:
        return ""
    missed = f"; not on {_families(realism['missed'])}" if realism["missed"] else ""
    on_each_seed = " on each seed" if len(seeds) > 1 else ""
    return (
        f" The noise of the model that the rule chooses keeps the limit{on_each_seed} on {realism['families_with_all']} of {realism['of']} "
        f"families{missed}."
    )


def _found_less(choice: Findings) -> str:
    """The families that the choice misses if recall counts, with what it misses."""
    missed = [
        f"{name.replace('_', ' ')} ({100 * choice['lost'][name]:.1f} points of recall lost)"
        if choice["lost"][name] > MAX_RECALL_DIFFERENCE
        else f"{name.replace('_', ' ')} ({100 * regret:+.1f} points)"
        for name, regret in choice["missed_that_finds"].items()
    ]
    return f"; not on {in_list(missed)}" if missed else ""


def _range(values: Findings) -> str:
    """The range over seeds, if there are several."""
    if len(values["seeds"]) < 2:
        return ""
    low, high = (100 * value for value in values["excess_range"])
    return f"; {low:.1f} to {high:.1f} over {len(values['seeds'])} seeds"


def _below_real(choice: Findings) -> str:
    """Where a choice misses the limit although its detectors flag no more than after training on real windows."""
    quiet = [name.replace("_", " ") for name in choice["missed"] if choice["excess"][name] <= 0]
    return (
        f" On {in_list(quiet)} noise, the chosen model raises fewer false alarms than real windows, and the best model fewer still."
        if quiet
        else ""
    )


def _families(names: Sequence[str]) -> str:
    return in_list([name.replace("_", " ") for name in names]) + " noise" if names else "no family"


def _differences(missed: Findings, digits: int = 1, mark: str = ";") -> str:
    """The families that miss a limit, with their differences in points."""
    if not missed:
        return ""
    return f"{mark} not on " + in_list([f"{name.replace('_', ' ')} ({100 * value:+.{digits}f} points)" for name, value in missed.items()])


def _losses(lost: Findings) -> str:
    """The families on which thresholds are so high that anomalies are missed, with the loss in points."""
    if not lost:
        return ": none"
    return ": " + in_list([f"{name.replace('_', ' ')} ({100 * value:.1f} points)" for name, value in lost.items()])


def _other_losses(lost: Mapping[str, Findings], learnt: str) -> str:
    """The same for the other models."""
    told = [f"{name}{_losses(families)}" for name, families in lost.items() if families and name != learnt]
    return f"; with the other models: {'; '.join(told)}" if told else ""


def _realism(models: Findings) -> list[str]:
    """How strict the limit of realism is: the same count for every model, and for fresh real noise."""
    real = models[REAL]
    rows = [
        f"| {name} | {about['families_with_all']} of {about['of']} | {about['mean_share']:.0%} |"
        for name, about in models.items()
        if about["of"]
    ]
    tested = [name for name in models if name != REAL and models[name]["of"]]
    most = max(models[name]["families_with_all"] for name in tested)
    is_within_reach = real["families_with_all"] >= _ENOUGH * real["of"]
    return [
        f"With fifteen measures, {'the limit on realism is strict' if is_within_reach else 'two thirds are beyond reach'}: fresh real noise itself, one draw "
        f"for each seed, keeps the limit on {real['families_with_all']} of {real['of']} families, and the best model on {most}. The same count for every model:",
        "",
        "| noise | families with every measure within three times its floor | measures within it, mean |",
        "|---|---|---|",
        *rows,
    ]


def unrealistic(found: Findings) -> str:
    """For each family, which measures still tell the noise of the learnt model from the real noise."""
    rung, lines = found["limits"]["rung"], []
    for family, about in found["families"].items():
        if rung not in about["rungs"]:
            continue
        beyond = {name: ratio for name, ratio in about["rungs"][rung]["beyond"].items() if ratio is not None}
        worst = sorted(beyond, key=beyond.get, reverse=True)[:_NAMED]
        if worst:
            named = ", ".join(f"{name} ({_times(beyond[name])} its floor)" for name in worst)
            lines.append(
                f"- {family.replace('_', ' ')}: {len(beyond)} measure{'s' * (len(beyond) != 1)} beyond three times the floor: {named}."
            )
        else:
            lines.append(f"- {family.replace('_', ' ')}: no measure beyond three times its floor.")
    return "\n".join([f"Noise of the {rung}, by family:", "", *lines])


def _times(ratio: float) -> str:
    return f"{ratio:.1f} times" if ratio < 1_000 else "more than 1,000 times"


def learning_curve(found: Findings) -> str:
    """The verdict for each environment, and a table of false-alarm rates by number of real windows."""
    numbers, lines = found["numbers"], []
    for name, about in found["environments"].items():
        real, bar = about["arms"]["real"], about["bar"]
        pays = {arm: places for arm, places in about["pays"].items() if places}
        where = "; ".join(f"{arm.removeprefix('simulator + ')}: {_numbers(places)}" for arm, places in pays.items()) or "nowhere"
        enough = f"from {about['real_suffices_from']:,} on" if about["real_suffices_from"] else "nowhere on this curve"
        lines.append(
            f"- **{name}**: a simulator with noise of a simple model pays with these numbers of real windows: {where}. "
            f"Real windows alone suffice (excess at most half a point) {enough}. "
            f"With {bar['num_real']} windows, the excess is {100 * real['excess'][str(bar['num_real'])]:.1f} points for the real windows alone and "
            f"{100 * bar['excess']:.1f} for the best simulator ({bar['best'].removeprefix('simulator + ')}): "
            f"{'no excess to halve' if bar['real_excess'] <= 0 else 'at most half' if bar['is_kept'] else 'more than half'}."
        )
    few = {arm for about in found["environments"].values() for arm in _of_few_seeds(about)}
    scope = f"False alarms in % / recall at 1 % false alarms in %, by the number of real windows, means over {_counted(len(found['seeds']), 'seed')}:"
    table = _curve_table({name: about["arms"] for name, about in found["environments"].items()}, numbers, few)
    return "\n".join([*lines, *_others(found), "", scope, "", *table, *_few_seeds(found), *_classifiers(found)])


def _of_few_seeds(about: Findings) -> list[str]:
    """The arms of an environment that have fewer seeds than the others."""
    return [name for group in about["few_seeds"] for name in group["names"]]


def _counted(number: int, what: str) -> str:
    return f"{number:,} {what}{'s' * (number != 1)}"


def _curve_table(environments: Mapping[str, Findings], numbers: Sequence[int], without: Collection[str] = ()) -> list[str]:
    """Rates and recalls of the arms of each environment, one column for each number of real windows."""
    rows = [f"| environment | training | {' | '.join(f'{number:,}' for number in numbers)} |", "|---" * (len(numbers) + 2) + "|"]
    for name, arms in environments.items():
        for arm, curve in arms.items():
            if arm in without:
                continue
            cells = [
                f"{100 * curve['rate'][str(n)]:.1f} / {100 * curve['recall_at_real_rate'][str(n)]:.0f}" if str(n) in curve["rate"] else ""
                for n in numbers
            ]
            rows.append(f"| {name} | {arm} | {' | '.join(cells)} |")
    return rows


def _few_seeds(found: Findings) -> list[str]:
    """The arms with fewer seeds, beside the others on the same seeds: a table for each set of seeds."""
    by_seeds: dict[tuple[int, ...], dict[str, Findings]] = {}
    for name, about in found["environments"].items():
        for group in about["few_seeds"]:
            by_seeds.setdefault(tuple(group["seeds"]), {})[name] = group
    lines = []
    for seeds, groups in by_seeds.items():
        tried = [number for number in found["numbers"] if any(str(number) in group["best_detector"] for group in groups.values())]
        rows = _curve_table({name: group["arms"] for name, group in groups.items()}, tried)
        names = list(dict.fromkeys(name for group in groups.values() for name in group["names"]))
        scope = (
            f"{_counted(len(seeds), 'seed')} ({in_list([str(seed) for seed in seeds])}): {in_list(names)}. "
            f"The same table for {'this seed' if len(seeds) == 1 else 'these seeds'} alone:"
        )
        lines += ["", scope, "", *rows]
        if CLASSIFIER in names:
            lines += ["", *_best_detectors(groups)]
    return lines


def _best_detectors(groups: Mapping[str, Findings]) -> list[str]:
    """Beside the classifiers: the detector that finds most of all that have seen no anomaly."""
    best = []
    for name, about in groups.items():
        told = [
            f"{_counted(int(number), 'window')}: {each['name']} {100 * each['recall_at_real_rate']:.0f} %"
            for number, each in about["best_detector"].items()
        ]
        best.append(f"- {name}: {'; '.join(told)}.")
    head = (
        "A row of detectors is a mean. The single detector that finds most, at 1 % false alarms, after training on the real windows alone:"
    )
    return [head, "", *best]


def _others(found: Findings) -> list[str]:
    """Where the arms that decide nothing pay by the same rule, and what they find at their own thresholds."""
    said, names = [], {}
    for name, about in found["environments"].items():
        for arm, other in about["others_pay"].items():
            some = "" if other["tried"] == found["numbers"] else f", {_numbers(other['tried'])} windows"
            names[arm] = f"{arm} ({_counted(other['seeds'], 'seed')}{some})"
            if other["pays"]:
                at = str(other["pays"][-1])
                own, real = (f"{100 * recall:.0f} %" for recall in other["recall"][at])
                said.append(
                    f"- {name}: {arm} with {_numbers(other['pays'])} windows. With {at} windows and its own thresholds it finds {own} of the anomalies; "
                    f"training on the real windows alone finds {real}."
                )
    if not names:
        return []
    listed = "; ".join(names.values())
    if not said:
        return ["", f"By the same rule, none of the other methods pays: {listed}.{_impossible(found)}"]
    return ["", f"Other methods were tried with the same rule: {listed}.{_impossible(found)} They pay only here:", "", *said]


def _impossible(found: Findings) -> str:
    """Where noise networks cannot pay, because on their seeds the real windows alone have no excess to halve."""
    cannot: dict[tuple[int, ...], dict[str, None]] = {}
    for name, about in found["environments"].items():
        for group in about["few_seeds"]:
            for other in (about["others_pay"][arm] for arm in group["names"] if arm in about["others_pay"]):
                if other["cannot"]:
                    cannot.setdefault(tuple(group["seeds"]), {})[f"{name} noise ({_numbers(other['cannot'])} windows)"] = None
    said = [f"on {_seeds(seeds)}, the real windows alone suffice on {in_list(list(places))}" for seeds, places in cannot.items()]
    return f" Noise networks cannot pay where real windows suffice: {'; '.join(said)}." if said else ""


def _classifiers(found: Findings) -> list[str]:
    """What the simulator adds to a classifier that learns from injected anomalies."""
    lines = []
    for name, about in found["environments"].items():
        told = [
            f"{arm} {', '.join(f'{_gain(gain)} with {int(number):,} real windows' for number, gain in gains.items())}"
            for arm, gains in about.get("classifiers", {}).items()
        ]
        if told:
            lines.append(f"- {name}: {'; '.join(told)}.")
    head = (
        "What the simulator adds to a classifier of injected anomalies: recall at 1 % false alarms if it learns from anomalies injected into windows of the "
        "simulator, minus recall if it learns from anomalies injected into the real windows, in percentage points (in brackets the range over "
        "seeds, if there are several):"
    )
    return ["", head, "", *lines] if lines else []


def _gain(gain: Mapping[str, Any]) -> str:
    mean, low, high = (f"{100 * gain[key]:+.1f}" for key in ("mean", "low", "high"))
    return f"{mean} ({low} to {high})" if gain["seeds"] > 1 else mean


def _numbers(places: list[int]) -> str:
    return ", ".join(f"{number:,}" for number in places)
