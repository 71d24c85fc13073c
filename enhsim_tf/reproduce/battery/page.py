"""Fills the generated parts of `docs/battery.md` from the findings of the study of the battery."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from enhsim_tf.common.atomic_files import replace_file
from enhsim_tf.reproduce.battery.detectors import ARMS, COARSE, ENHANCED, REAL_15, REAL_60, REAL_120, RESAMPLED, RESIDUALS
from enhsim_tf.reproduce.battery.errors import ENHANCERS, FLOOR
from enhsim_tf.reproduce.battery.findings import C9_RATIO, LARGEST_GAP, LARGEST_SHARE, LEAST_DETECTORS, LEAST_SPEED, TRUSTED
from enhsim_tf.reproduce.battery.labelled import DIFFERENCE
from enhsim_tf.reproduce.publish.results import fill_pages, fill_parts

Findings = Mapping[str, Any]


PAGE = "docs/battery.md"
SHOWN_ON_FAULTS = ("coarse itself", "paper's network", "ridge, voltage", "ridge, voltage and current", "ridge, all columns", "chosen")
"""Enhancers in the table of errors on faults."""
LEAST_GAIN = 0.0005  # of the error (NRMSE); smaller differences are not counted


def fill_page(root: Path, found: Findings) -> None:
    """Writes the generated parts of the study's page between their markers, and what it says about claim C9 on the page of the claims.

    Args:
        root: Folder of the project; pages that do not exist are left out.
        found: The findings.

    Raises:
        InputError: If the markers of a part are not there once.
    """
    path = root / PAGE
    if path.is_file():
        text = fill_parts(path.read_text(encoding="utf-8"), parts_of(found), path.name)
        with replace_file(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    fill_pages(root, {"battery": "\n\n".join(said(found) for said in (degraded_configurations, speed_penalty, clean_signal))})


def degraded_configurations(found: Findings) -> str:
    """What the study says about claim C9."""
    told = []
    for regime, about in found["regimes"].items():
        bar = about["bars"]["C9"]
        worse, of = len(about["bars"]["faults"]["worse_than_coarse"]), sum(len(each["chosen"]) for each in about["faults"].values())
        told.append(
            f"in the {regime} regime, its error on faults is at most {bar['largest_ratio']:.1f} times its nominal error, and below the coarse "
            f"simulator's error in {of - worse} of {of} cases"
        )
    holds = all(about["bars"]["C9"]["is_reached"] for about in found["regimes"].values())
    return (
        "Claim C9 is also tested with a real pair of simulators, a coarse and a fine one of a satellite's battery, in which the same faults "
        f"are simulated ([the study](battery.md), {len(found['seeds'])} seeds). With the enhancer that held-out telemetry chooses, "
        f"{'; '.join(told)}. By the criterion of the table (at most {C9_RATIO:g} times the nominal error in every case, and below the coarse "
        f"simulator's error), C9 {'holds there' if holds else 'does not hold there either'}."
    )


def speed_penalty(found: Findings) -> str:
    """What the study says about claim C2: the time of the coarse run and the paper's network, in times of the coarse run alone."""
    told = []
    for regime, about in found["regimes"].items():
        coarse, network = (about["seconds"][name] for name in ("coarse simulator", "paper's network"))
        told.append(
            f"{(coarse + network) / coarse:.2f} times in the {regime} regime ({1000 * network:.2f} ms after {1000 * coarse:.1f} ms)"
        )
    return (
        "For claim C2, the coarse simulator of the table is a formula, which takes almost no time. After a run of the battery's coarse simulator, the paper's network "
        f"brings the time for the signal of an orbit to {' and '.join(told)}; the tolerance is two times. The tolerance does not judge memory, which the paper names too."
    )


def clean_signal(found: Findings) -> str:
    """What the study says about claim C3: false alarms of detectors that were trained on the enhanced signal without noise."""
    told = []
    for regime, about in found["regimes"].items():
        rates = [each["false_alarms"]["mean"] for each in about["detectors"][ENHANCED].values()]
        told.append(f"{100 * np.mean(rates):.1f} % ({100 * min(rates):.1f} to {100 * max(rates):.1f} by detector) in the {regime} regime")
    return (
        "Claim C3 depends on how large the noise is. The noise of the battery's sensor is small, and detectors trained on the enhanced signal without noise flag "
        f"{' and '.join(told)}, where the claim's limit is at least 10 %: there, the signal is not too clean."
    )


def parts_of(found: Findings) -> dict[str, str]:
    """The generated parts of the page by the names of their markers."""
    return {
        "scope": _scope(found),
        "summary": _summary(found),
        "targets": _targets(found),
        "errors": _errors(found),
        "faults": _faults(found),
        "speed": _speed(found),
        "detectors": _detectors(found),
        "recall": _recall(found),
    }


def _scope(found: Findings) -> str:
    seeds, regimes = found["seeds"], found["regimes"]
    runs = {key: sum(about["runs"][key] for about in regimes.values()) for key in ("number", "reduced")}
    most = max(about["runs"]["most_reductions"] for about in regimes.values())
    return (
        f"The numbers on this page come from {'one seed' if len(seeds) == 1 else f'{len(seeds)} seeds'} with PyBaMM {found['versions']['pybamm']}, "
        f"budget {found['budget']}. Of {runs['number']:,} recorded runs, {runs['reduced']} were recorded with a reduced current because a solver failed "
        f"at the full one (at most {most} reductions of a tenth); none was left out. The runs that the classifiers learn from are not counted here."
    )


def _summary(found: Findings) -> str:
    return "\n".join(f"- {line}" for regime, about in found["regimes"].items() for line in _sentences(regime, about))


def _sentences(regime: str, about: Mapping[str, Any]) -> list[str]:
    nominal, detectors = {name: each["mean"] for name, each in about["nominal"].items()}, about["detectors"]
    paper = nominal["paper's network"]
    said = [
        f"*{regime}*, error on nominal orbits: the coarse simulator {nominal['coarse itself']:.3f}, with a level and a gain {nominal['level and gain']:.3f}, "
        f"the paper's network {paper:.3f}; ridge regression on the voltage {nominal['ridge, voltage']:.3f}, on voltage and current "
        f"{nominal['ridge, voltage and current']:.3f}, on all columns {nominal['ridge, all columns']:.3f}, and with a network on what it leaves "
        f"{nominal['ridge and network']:.3f}; floor {nominal[FLOOR]:.3f}."
    ]
    arms = [arm for arm in (COARSE, RESAMPLED, REAL_15, REAL_60, REAL_120) if arm in detectors]
    rates = ", ".join(f"{arm} {_percent(detectors[arm], 'false_alarms')}" for arm in arms)
    said.append(f"*{regime}*, false alarms by training, means over the detectors that ran in every seed: {rates}.")
    ways = {
        "detectors trained on enhanced windows with residuals drawn again": RESAMPLED,
        "detectors trained on as many real orbits": REAL_120,
        "classifiers with simulated faults in training": f"{RESAMPLED}, faults in training",
        "the residual of the enhanced run": next(iter(RESIDUALS)),
        "classifiers of that residual with simulated faults in training": DIFFERENCE,
        "the residual of the coarse run, without an enhancer": list(RESIDUALS)[1],
    }
    recalls = "; ".join(
        f"{words} {_percent(detectors[arm], 'recall')} (false alarms {_percent(detectors[arm], 'false_alarms')})"
        for words, arm in ways.items()
        if arm in detectors
    )
    return [*said, f"*{regime}*, fault windows found: {recalls}."]


def _percent(detectors: Mapping[str, Any], key: str) -> str:
    most = max(each["num_seeds"] for each in detectors.values())
    return f"{100 * _mean({name: each for name, each in detectors.items() if each['num_seeds'] == most}, key):.1f} %"


def _table(head: list[str], rows: list[list[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _errors(found: Findings) -> str:
    regimes = found["regimes"]
    names = [*ENHANCERS, "chosen", FLOOR]
    rows = []
    for name in names:
        cells = [name]
        for about in regimes.values():
            each = about["nominal"][name]
            cells.append(f"{each['mean']:.4f} ± {each['standard_error']:.4f}")
            cells.append(f"{about['nominal_true'][name]['mean']:.4f}" if name in about["nominal_true"] else "0")
        rows.append(cells)
    head = ["enhancer"] + [f"{regime}, {what}" for regime in regimes for what in ("against telemetry", "against the truth")]
    chosen = "; ".join(
        f"{regime}: " + ", ".join(f"{name} for {number} of {about['num_seeds']} seeds" for name, number in about["chosen"].items())
        for regime, about in regimes.items()
    )
    heat = "; ".join(
        f"{regime}: " + ", ".join(f"{name} {each['mean']:.3f}" for name, each in about["temperature"].items())
        for regime, about in regimes.items()
    )
    return f"{_table(head, rows)}\n\nChosen on held-out blocks of the fitted orbits: {chosen}. Temperature, against telemetry: {heat}."


def _faults(found: Findings) -> str:
    rows = []
    for regime, about in found["regimes"].items():
        for kind, each in about["faults"].items():
            for place, severity in enumerate(each["severities"]):
                cells = [f"{each[name][place]:.3f}" for name in SHOWN_ON_FAULTS]
                rows.append([regime, kind, f"{severity:g}", *cells, f"{100 * each['out_of_range'][place]:.0f} %"])
    head = ["regime", "fault", "severity", *SHOWN_ON_FAULTS, "out of range"]
    return f"{_table(head, rows)}\n\n{_mean_errors(found)}"


def _mean_errors(found: Findings) -> str:
    """The mean error over all faults and severities, and in how many cases each simpler enhancer is nearer than the chosen one."""
    said = []
    for regime, about in found["regimes"].items():
        errors = {name: np.concatenate([each[name] for each in about["faults"].values()]) for name in SHOWN_ON_FAULTS}
        means = "; ".join(f"{name} {np.mean(each):.4f}" for name, each in errors.items())
        nearer = [
            f"{name}, {np.sum(each < errors['chosen'] - LEAST_GAIN)}"
            for name, each in errors.items()
            if name != "chosen" and np.any(each < errors["chosen"] - LEAST_GAIN)
        ]
        better = (
            f" Nearer than *chosen* by more than {LEAST_GAIN:g}, of {len(errors['chosen'])} cases: {'; '.join(nearer)}." if nearer else ""
        )
        said.append(f"- Mean error over all faults and severities, {regime}: {means}.{better}")
    return "\n".join(said)


def _speed(found: Findings) -> str:
    regimes = found["regimes"]
    names = list(next(iter(regimes.values()))["seconds"])
    rows = [[name, *(f"{1000 * about['seconds'][name]:.3f}" for about in regimes.values())] for name in names]
    ratios = "; ".join(
        f"{regime}: {about['bars']['speed']['alone']:,.0f} times faster than the fine simulator without the coarse run that it enhances, "
        f"{about['bars']['speed']['with_coarse']:.1f} times with it"
        for regime, about in regimes.items()
    )
    return f"{_table(['processor time for an orbit (ms)', *regimes], rows)}\n\nThe slowest chosen enhancer, {ratios}."


def _mean(detectors: Mapping[str, Any], key: str) -> float:
    values = [each[key]["mean"] if isinstance(each[key], Mapping) else each[key] for each in detectors.values()]
    return sum(values) / len(values)


def _detectors(found: Findings) -> str:
    rows = []
    for regime, about in found["regimes"].items():
        arms = [arm for arm in (*ARMS, *RESIDUALS) if arm in about["detectors"]]
        arms += [arm for arm in about["detectors"] if arm not in arms]
        for arm in arms:
            each = about["detectors"][arm]
            seeds = {one["num_seeds"] for one in each.values()}
            cells = [
                f"{100 * _mean(each, key):.1f} %" for key in ("false_alarms", "recall", "recall_at_real_rate", "found", "found_by_chance")
            ]
            rows.append([regime, arm, str(len(each)), "-".join(map(str, sorted(seeds))), *cells])
    head = [
        "regime",
        "trained on",
        "detectors",
        "seeds",
        "false alarms",
        "recall",
        "recall at the real rate",
        "runs found",
        "nominal stretches called",
    ]
    return _table(head, rows)


def _recall(found: Findings) -> str:
    rows = []
    for regime, about in found["regimes"].items():
        severities = next(iter(about["faults"].values()))["severities"]
        for arm in about["detectors"]:
            each = about["detectors"][arm]
            cells = []
            for kind in about["faults"]:
                means = [
                    sum(one["by_fault_at_real_rate"][kind][place] for one in each.values()) / len(each) for place in range(len(severities))
                ]
                cells.append(" ".join(f"{100 * value:.0f}" for value in means))
            rows.append([regime, arm, *cells])
    first = next(iter(found["regimes"].values()))
    return _table(["regime", "trained on", *first["faults"]], rows)


def _targets(found: Findings) -> str:
    rows = []
    for regime, about in found["regimes"].items():
        bars = about["bars"]
        worse = bars["faults"]["worse_than_coarse"]
        silent = [each for each in worse if not each["is_warned"]]
        gaps = bars["alarms"]["gaps"]
        told = {
            f"error of the chosen enhancer at most {LARGEST_SHARE:g} of the coarse simulator's": ("error", f"{bars['error']['share']:.3f}"),
            "not behind ridge regression by more than a standard error": (
                "ridge",
                f"{bars['ridge']['behind']:+.4f}, standard error {bars['ridge']['standard_error']:.4f}",
            ),
            f"on every fault below the coarse simulator's error, or out of range in more than {100 * TRUSTED:.0f} % of windows": (
                "faults",
                f"{len(worse)} of {sum(len(each['severities']) for each in about['faults'].values())} cases worse, {len(silent)} of them without a warning",
            ),
            f"at least {LEAST_SPEED:,} times faster than the fine simulator": (
                "speed",
                f"{bars['speed']['with_coarse']:.1f} with the coarse run, {bars['speed']['alone']:,.0f} without",
            ),
            f"false alarms within {100 * LARGEST_GAP:g} points of as many real orbits, at least {LEAST_DETECTORS} of {bars['alarms']['of']} detectors": (
                "alarms",
                f"{bars['alarms']['within']} of {len(gaps)} judged; " + ", ".join(f"{name} {100 * gap:+.1f}" for name, gap in gaps.items()),
            ),
            f"C9: on every fault at most {C9_RATIO:g} times the nominal error, and below the coarse simulator's": (
                "C9",
                f"largest ratio {bars['C9']['largest_ratio']:.1f}; below the coarse error: {'always' if bars['C9']['is_below_coarse'] else 'not always'}",
            ),
        }
        rows += [[regime, target, "reached" if bars[name]["is_reached"] else "missed", numbers] for target, (name, numbers) in told.items()]
    return _table(["regime", "target", "verdict", "measured"], rows)
