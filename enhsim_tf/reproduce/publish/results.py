"""Results of a run: the table on the terminal, `results.json`, and the generated parts of the README and other pages."""

import collections
import json
import math
import platform
import re
import shutil
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from enhsim_tf.common.atomic_files import replace_file
from enhsim_tf.common.errors import InputError
from enhsim_tf.reproduce.paper.over_seeds import is_tie, title_verdict, titles_of_seeds, verdict_over
from enhsim_tf.reproduce.paper.pipeline import Experiment
from enhsim_tf.reproduce.settings import deviations
from enhsim_tf.reproduce.stages import VERSIONS

_SPEED = "C2"
_REACH = 0.5  # of the width of the range over seeds: farther outside of it, a value is that of another version of the code
PAPER = "the paper's example"  # what `results.json` names as the source where no file of real telemetry is


def results(experiment: Experiment, claims: list[dict], drawn_s: float, total_s: float) -> dict[str, Any]:
    """All results of a run, as stored in `results.json`. The time of each stage is that of its original run.

    Args:
        experiment: What was run.
        claims: The judged claims.
        drawn_s: Seconds that the figures took.
        total_s: Seconds that this run took.
    """
    stages = experiment.stages
    timings = stages.seconds | {"figures": drawn_s}
    return {
        "budget": experiment.settings.budget,
        "seed": experiment.settings.seed,
        "source": PAPER if experiment.is_paper else experiment.source.path.name,
        "verdict": title_verdict(claims),
        "versions": {"python": platform.python_version(), **VERSIONS},
        "claims": claims,
        "timings": {name: round(seconds, 2) for name, seconds in timings.items()},
        "from_cache": [name for name, cached in stages.cached.items() if cached],
        "this_run_s": round(total_s, 2),
    }


def table(claims: list[dict]) -> str:
    """The claims as a table that fits the width of the terminal."""
    width = max(60, min(shutil.get_terminal_size((120, 24)).columns, 140))
    lines = []
    for claim in claims:
        lines.append(f"{claim['id']}  {claim['verdict']:24}  {claim['statistic']}: {short(claim['value'])} ({claim['tolerance']})")
        lines += textwrap.wrap(claim["finding"], width, initial_indent="    ", subsequent_indent="    ")
    return "\n".join(lines)


def read_spread(folder: Path, found: Mapping[str, Any]) -> dict[str, Any] | None:
    """The ranges and verdicts over further seeds, with this run's own in the place of those that its seed had before.

    Those of another budget or of an older run say nothing of this one. On another processor, training rounds differently and a value
    changes as it does from seed to seed; the run is taken for an older one if its first value is farther outside of the range over
    seeds than half of the width of that range. A speed is of one machine at one time and has no range over seeds.

    Args:
        folder: Holds `spread.json`, if further seeds were run.
        found: The results of this run.

    Returns:
        The contents of `spread.json` with this run's values, or None if there is none that belongs to this run.
    """
    path = folder / "spread.json"
    spread = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None
    if spread is None or spread["budget"] != found["budget"] or found["seed"] not in spread["seeds"]:
        return None
    first, here = found["claims"][0], spread["seeds"].index(found["seed"])
    if {claim["id"] for claim in found["claims"]} != set(spread["claims"]):
        return None
    known = _known(spread["claims"][first["id"]])
    if first["value"] is None or not known or not _is_near(first["value"], min(known), max(known)):
        return None
    for claim in found["claims"]:
        over = spread["claims"][claim["id"]]
        over["holds"] = _holds(over)
        over["values"][here], over["verdicts"][here], over["holds"][here] = claim["value"], claim["verdict"], claim.get("holds")
        values = _known(over)
        over["range"] = [min(values), max(values)] if values and claim["id"] != _SPEED else None
    return spread


def _known(about: Mapping[str, Any]) -> list[float]:
    return [value for value in about["values"] if value is not None]


def _is_near(value: float, low: float, high: float) -> bool:
    reach = _REACH * (high - low)
    return low - reach <= value <= high + reach or short(value) in (short(low), short(high))


def disagreement(spread: Mapping[str, Any] | None, claim_id: str) -> str:
    """The number of seeds with each verdict, if seeds differ; otherwise an empty string.

    Of a claim that the paper does not test, what holds here is counted.
    """
    about = spread["claims"][claim_id] if spread is not None else {"verdicts": []}
    counted = collections.Counter(holds or name for name, holds in zip(about["verdicts"], _holds(about), strict=True))
    return ", ".join(f"{number} {name}" for name, number in counted.most_common()) if len(counted) > 1 else ""


def _holds(about: Mapping[str, Any]) -> list[str | None]:
    return about.get("holds") or [None] * len(about["verdicts"])


def titles_line(found: Mapping[str, Any], spread: Mapping[str, Any]) -> str:
    """Sentences on the verdict in the title: by most seeds, by each seed alone, and on which claims the seeds are divided equally."""
    alone = collections.Counter(titles_of_seeds(found["claims"], spread))
    counted = ", ".join(f"{number} {'gives' if number == 1 else 'give'} {title}" for title, number in alone.most_common())
    ties = [claim["id"] for claim in found["claims"] if is_tie(spread["claims"][claim["id"]]["verdicts"])]
    divided = f" On {', '.join(ties)} the seeds are divided equally, and the worse verdict counts." if ties else ""
    return (
        f"Of {len(spread['seeds'])} seeds, each judged alone, {counted}. With the verdict of most seeds for each claim, the title is "
        f"{title_verdict(found['claims'], spread)}.{divided}"
    )


PAGES = {
    "claims in short": "README.md",
    "practice": "README.md",
    "claims": "docs/what_holds.md",
    "robustness": "docs/what_holds.md",
    "factorial": "docs/what_holds.md",
    "battery": "docs/what_holds.md",
    "labelled": "docs/spacecraft.md",
    "residual": "docs/spacecraft.md",
    "channels": "docs/spacecraft.md",
    "deviations": "docs/decisions.md",
    "timings": "docs/speed.md",
    "speed": "docs/speed.md",
    "faults": "docs/faults.md",
}
"""The page of each generated part, by the name of its markers."""


def fill_pages(root: Path, parts: Mapping[str, str]) -> None:
    """Writes generated parts between their markers. Pages that do not exist, or that have no generated part at all, are left out.

    Args:
        root: Folder of the project.
        parts: Contents by name, with the names of `PAGES`.

    Raises:
        InputError: If the markers of a part are not once on its page; then no page is changed.
    """
    filled = {}
    for name in dict.fromkeys(PAGES[part] for part in parts):
        path = root / name
        text = path.read_text(encoding="utf-8") if path.is_file() else ""
        if ": generated -->" in text:  # otherwise not a page of this project
            filled[path] = fill_parts(text, {part: content for part, content in parts.items() if PAGES[part] == name}, path.name)
    for path, text in filled.items():
        with replace_file(path) as temporary:
            temporary.write_text(text, encoding="utf-8")


def fill_results(root: Path, folder: Path) -> None:
    """Writes the results of a run into the pages, and the verdict into the title of the README.

    Args:
        root: Folder of the project.
        folder: Holds `results.json` of a full run, and `spread.json` where further seeds were run.
    """
    found = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    spread = read_spread(folder, found)
    parts = {
        "claims in short": claims_in_short(found, spread),
        "claims": claims_table(found, spread),
        "channels": channels_table(sorted(folder.glob("*/results.json"))),
        "deviations": deviations_table(),
        "timings": timings_table(found),
    }
    fill_pages(root, parts)
    readme = root / PAGES["claims in short"]
    text = readme.read_text(encoding="utf-8") if readme.is_file() else ""
    if ": generated -->" in text:
        with replace_file(readme) as temporary:
            temporary.write_text(re.sub(r"\A# (\[.*?\] )?", f"# {title_verdict(found['claims'], spread)} ", text), encoding="utf-8")


NEEDED = {
    "C1": "at most 0.15, and below ridge regression",
    "C2": "at least 10,000, in at most twice the time of the coarse simulator alone",
    "C3": "at least 10 % for every detector",
    "C4": "500 to 1,500",
    "C5": "0.5 to 0.8, within its 95 % interval",
    "C6": "at least 0.8, and other measures",
    "C7": "at most 0.6, and other measures",
    "C8": "for every detector at most twice that of real telemetry plus 1 percentage point",
    "C9": "at most 2 in every mode",
}
"""What each claim needs to be called reproduced, in short; `paper.claims` has the whole tolerances."""


def claims_in_short(found: Mapping[str, Any], spread: Mapping[str, Any] | None = None) -> str:
    """The claims as a Markdown table with a short row each: the sentence, the verdict, the value and what is needed."""
    lines = ["| | the paper says | verdict | value | needed |", "|---|---|---|---|---|"]
    for claim in found["claims"]:
        value = f"{claim['statistic'].partition(':')[0]}: {_value(claim, spread)}{_beside(claim)}"
        verdict = f"**{verdict_over(claim, spread)}**" + (f"; {claim['holds']} here" if claim.get("holds") else "")
        lines.append(f"| {claim['id']} | {claim['sentence']} | {verdict} | {value} | {NEEDED[claim['id']]} |")
    said = "" if spread is None else f" In brackets: the range over seeds; verdicts are those of most seeds. {titles_line(found, spread)}"
    return "\n".join(lines) + f"\n\nSeed {found['seed']}, {found['budget']} budget.{said}"


def _beside(claim: Mapping[str, Any]) -> str:
    """The number that the value has to be compared with, where the value alone does not show why the verdict is what it is."""
    details = claim.get("details") or {}
    if claim["id"] == "C1" and "ridge_nrmse" in details:
        return f"; ridge regression {details['ridge_nrmse']:.3f}, nearest windows {details['nearest_nrmse']:.3f}"
    if claim["id"] == "C2" and "cost_ratio" in details:
        return f", in {details['cost_ratio']:.1f} times the time of the coarse simulator"
    return ""


def _value(claim: Mapping[str, Any], spread: Mapping[str, Any] | None) -> str:
    """The value of the statistic, with its range over seeds where that is known."""
    over = None if spread is None else spread["claims"][claim["id"]]
    if over is None or over["range"] is None:
        return short(claim["value"])
    known = len(_known(over))
    among = f" in {known} seeds, none in {len(over['values']) - known}" if known < len(over["values"]) else ""
    return "{} ({} to {}{})".format(*map(short, (claim["value"], *over["range"])), among)


def fill_parts(text: str, parts: Mapping[str, str], where: str) -> str:
    """Replaces the text between markers.

    Args:
        text: Markdown that holds the markers of each part once.
        parts: Contents by name.
        where: The text's name, for the error.

    Raises:
        InputError: If the markers of a part are not there once.
    """
    for name, content in parts.items():
        pattern = re.compile(rf"(<!-- {name}: generated -->\n).*?(<!-- end of {name} -->)", re.DOTALL)
        text, count = pattern.subn(lambda match, content=content: f"{match[1]}{content}\n{match[2]}", text)
        if count != 1:
            raise InputError(f"Expected the markers of '{name}' once in {where}. Received: {count}. Put them back.")
    return text


def claims_table(found: Mapping[str, Any], spread: Mapping[str, Any] | None = None) -> str:
    """The claims as a Markdown table, with the range over seeds where it is known."""
    lines = ["| | the paper says | statistic (tolerance) | value | verdict | what we found |", "|---|---|---|---|---|---|"]
    for claim in found["claims"]:
        value, verdict, differ = _value(claim, spread), f"**{verdict_over(claim, spread)}**", disagreement(spread, claim["id"])
        verdict += f" (over seeds: {differ})" if differ else ""
        lines.append(
            f"| {claim['id']} | {claim['sentence']} ({claim['section']}) | {claim['statistic']} ({claim['tolerance']}) | {value} "
            f"| {verdict} | {claim['finding']} |"
        )
    about = f"Seed {found['seed']}, {found['budget']} budget"
    if spread is not None:
        about += f"; in brackets the range over {len(spread['seeds'])} seeds, {spread['seeds'][0]} to {spread['seeds'][-1]}, and the verdict of most of them"
    said = [f"{about}. From `figures/results.json`."] + ([] if spread is None else [titles_line(found, spread)])
    return "\n".join(lines) + "\n\n" + " ".join(said)


def short(value: float | None) -> str:
    """A number with three significant digits, or without decimals from 1,000 on; a dash if there is no number."""
    if value is None or not math.isfinite(value):
        return "–"
    return f"{value:.3g}" if abs(value) < 999.5 else f"{value:,.0f}"


def channels_table(files: Sequence[Path]) -> str:
    """Results on real channels in Markdown, one row for each `results.json`."""
    names, judged = ("nrmse", "ridge_nrmse", "identity_nrmse"), ("C1", "C4", "C5", "C6", "C7")
    lines = [
        "| channel | enhanced | ridge regression | coarse | enhanced, in step | ridge, in step | coarse, in step "
        f"| disjoint test windows | {' | '.join(judged)} |",
        "|---|---|---|---|---|---|---|---|" + "---|" * len(judged),
    ]
    for file in files:
        found = json.loads(file.read_text(encoding="utf-8"))
        claims = {claim["id"]: claim for claim in found["claims"]}
        errors = [f"{claims['C1']['details'][prefix + name]:.3f}" for prefix in ("", "synchronised_") for name in names]
        number = claims["C3"]["finding"].partition(" ")[0]  # the finding of an unmeasured C3 begins with this number
        verdicts = " | ".join(claims[name]["verdict"] for name in judged)
        lines.append(f"| `{found['source']}` | {' | '.join(errors)} | {number} | {verdicts} |")
    return "\n".join(lines)


def deviations_table() -> str:
    """The deviations table in Markdown: each setting, the paper's and the author's value, and the source of the value."""
    lines = ["| setting | this project | paper | author's code | source |", "|---|---|---|---|---|"]
    lines += [f"| `{row['setting']}` | {row['value']} | {row['paper']} | {row['author']} | {row['source']} |" for row in deviations()]
    return "\n".join(lines)


def timings_table(found: Mapping[str, Any]) -> str:
    """Time of each stage in seconds, in Markdown."""
    rows = [f"| {name} | {seconds:.1f} |" for name, seconds in found["timings"].items()]
    total = sum(found["timings"].values())
    lines = ["| stage | seconds |", "|---|---|", *rows, f"| **sum** | **{total:.0f}** |"]
    if found["from_cache"]:
        lines += ["", f"Found in the cache, with the seconds that they took when they were done: {', '.join(found['from_cache'])}."]
    return "\n".join(lines)
