"""Refreshes the marked tables of the README and of the pages in `docs/` from the files that commands wrote: `python -m book --tables`."""

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from enhsim_tf.common.atomic_files import replace_file
from enhsim_tf.common.errors import InputError
from enhsim_tf.reproduce.paper.over_seeds import verdict_over
from enhsim_tf.reproduce.results import read_spread, short, titles_line
from enhsim_tf.reproduce.settings import deviations

PAGES = {"claims in short": "README.md", "deviations": "docs/decisions.md"}
"""The page of each marked table, by the name of its markers."""

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


def refresh(root: Path) -> list[Path]:
    """Writes each table between its markers.

    Args:
        root: Folder of the project.

    Returns:
        The pages.

    Raises:
        InputError: If the markers of a table are not once on its page.
    """
    found = json.loads((root / "figures" / "results.json").read_text(encoding="utf-8"))
    parts = {"claims in short": claims_in_short(found, read_spread(root / "figures", found)), "deviations": deviations_table()}
    for name, content in parts.items():
        path = root / PAGES[name]
        text = fill_parts(path.read_text(encoding="utf-8"), {name: content}, path.name)
        with replace_file(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return [root / page for page in PAGES.values()]


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
    known = len([value for value in over["values"] if value is not None])
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


def deviations_table() -> str:
    """The deviations table in Markdown: each setting, the paper's and the author's value, and the source of the value."""
    lines = ["| setting | this project | paper | author's code | source |", "|---|---|---|---|---|"]
    lines += [f"| `{row['setting']}` | {row['value']} | {row['paper']} | {row['author']} | {row['source']} |" for row in deviations()]
    return "\n".join(lines)
