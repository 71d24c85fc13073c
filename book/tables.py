"""The marked tables of the README and of the pages in `docs/`, written from the files that commands wrote: `python -m book --tables`.

A marked table stands between `<!-- NAME: generated -->` and `<!-- end of NAME -->`. The sentences around it are written by hand.
"""

import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.report import speed_table
from enhsim_tf.common.atomic_files import replace_file
from enhsim_tf.common.errors import InputError
from enhsim_tf.reproduce.paper.over_seeds import verdict_over
from enhsim_tf.reproduce.results import disagreement, read_spread, short
from enhsim_tf.reproduce.settings import deviations

TOLERANCE = 0.25  # relative: another processor gives other numbers, and no other result
_NUMBER = re.compile(r"(?<![\w.])-?\d[\d,]*(?:\.\d+)?")

CLAIMS_IN_SHORT = {
    "C1": ("the enhancer learns the waveform", "error {value:.3f}; ridge regression {ridge_nrmse:.3f}"),
    "C2": ("it costs little time", "{cost_ratio:.1f} times the coarse simulator's; required: 2"),
    "C3": ("without noise, it is too clean", "{value:.0%} false alarms; required: 10%"),
    "C4": ("1,000 iterations suffice", "from iteration {value:,.0f} on; required: 500 to 1,500"),
    "C5": ("the two networks stay balanced", "accuracy {value:.3f}; required: 0.5 to 0.8, within its interval"),
    "C6": ("the noise is similar", "standard deviation {scale_difference:.1%} off; effective rank {rank:.0f} of {real_rank:.0f}"),
    "C7": ("the sum resembles telemetry", "AUC {value:.2f}; required: 0.6"),
    "C8": ("detectors become robust", "{value:.0%} false alarms; asked for: 1%"),
    "C9": ("new faults are realistic", "up to {value:.1f} times the nominal error; required: 2"),
}
"""Each claim in a few words, and what decides its verdict, with the numbers of a run in braces."""


def refresh(root: Path) -> list[Path]:
    """Writes each table between its markers.

    Args:
        root: Folder of the project.

    Returns:
        The pages.

    Raises:
        InputError: If the markers of a table are not once on its page.
    """
    texts = {path: path.read_text(encoding="utf-8") for path in {root / page for page, _ in TABLES.values()}}
    for name, (page, table) in TABLES.items():
        texts[root / page] = fill_part(texts[root / page], name, table(root), page)
    for path, text in texts.items():
        with replace_file(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return sorted(texts)


def stale(root: Path) -> Iterator[str]:
    """Yields the name and page of each table that differs from what `refresh` would write by more than `TOLERANCE`."""
    for name, (page, table) in TABLES.items():
        if not agree(part(root / page, name), table(root)):
            yield f"{name} in {page}"


def agree(old: str, new: str) -> bool:
    """Whether two texts have the same words, and numbers that differ by at most `TOLERANCE`."""
    if _NUMBER.sub("#", old) != _NUMBER.sub("#", new):
        return False
    numbers = ([float(number.replace(",", "")) for number in _NUMBER.findall(text)] for text in (old, new))
    return all(math.isclose(*pair, rel_tol=TOLERANCE, abs_tol=0.02) for pair in zip(*numbers, strict=True))


def part(page: Path, name: str) -> str:
    """Returns the marked table of a page.

    Raises:
        InputError: If the markers are not once on the page.
    """
    found = _marked(name).findall(page.read_text(encoding="utf-8"))
    if len(found) != 1:
        raise InputError(f"Expected the markers of '{name}' once in {page.name}. Received: {len(found)}. Put them back.")
    return found[0][1]


def fill_part(text: str, name: str, content: str, where: str) -> str:
    """Replaces the text between the markers of a table.

    Args:
        text: Markdown that holds the markers once.
        name: The name in the markers.
        content: The table.
        where: The text's name, for the error.

    Raises:
        InputError: If the markers are not there once.
    """
    text, count = _marked(name).subn(lambda match: f"{match[1]}{content}\n{match[3]}", text)
    if count != 1:
        raise InputError(f"Expected the markers of '{name}' once in {where}. Received: {count}. Put them back.")
    return text


def _marked(name: str) -> re.Pattern:
    return re.compile(rf"(<!-- {name}: generated -->\n)(.*?)\n?(<!-- end of {name} -->)", re.DOTALL)


def claims_in_short(root: Path) -> str:
    """The table of the README: each claim in a few words, its verdict, and what decides it."""
    found, spread = _results(root)
    rows = []
    for claim in found["claims"]:
        words, decides = CLAIMS_IN_SHORT[claim["id"]]
        value = math.nan if claim["value"] is None else claim["value"]
        rows.append(
            (
                f"{claim['id']} {words}",
                claim.get("holds") or verdict_over(claim, spread),
                decides.format(**claim["details"], value=value).replace("%", " %"),
            )
        )
    return markdown(("claim", "verdict", "measured"), rows)


def claims_table(root: Path) -> str:
    """The table of the report: the sentence of the paper, statistic, value with its range over seeds, tolerance and verdict."""
    found, spread = _results(root)
    rows = [
        (
            claim["id"],
            f"{claim['sentence']} ({claim['section']})",
            f"{claim['statistic']}: {_value(claim, spread)}",
            claim["tolerance"],
            f"**{claim.get('holds') or verdict_over(claim, spread)}**" + _seeds(claim, spread),
        )
        for claim in found["claims"]
    ]
    return markdown(("", "the paper says (section)", "measured", "required", "verdict"), rows)


def settings_table(root: Path) -> str:
    """The table of decisions: each setting, the paper's and the author's value, and the source of the value."""
    return markdown(
        ("setting", "here", "paper", "author's code", "source"), [(f"`{row.pop('setting')}`", *row.values()) for row in deviations()]
    )


def speed(root: Path) -> str:
    """The table of the benchmarks."""
    return speed_table(json.loads((root / "benchmarks" / "results.json").read_text(encoding="utf-8"))["rows"])


def markdown(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Formats a table."""
    return "\n".join("| " + " | ".join(row) + " |" for row in (header, ["---"] * len(header), *rows))


def _results(root: Path) -> tuple[dict[str, Any], dict[str, Any] | None]:
    found = json.loads((root / "figures" / "results.json").read_text(encoding="utf-8"))
    return found, read_spread(root / "figures", found)


def _value(claim: Mapping[str, Any], spread: Mapping[str, Any] | None) -> str:
    """The value of the statistic, with its range over seeds where it has one."""
    over = None if spread is None else spread["claims"][claim["id"]]
    if over is None or over["range"] is None:
        return short(claim["value"])
    return "{} ({} to {})".format(*map(short, (claim["value"], *over["range"])))


def _seeds(claim: Mapping[str, Any], spread: Mapping[str, Any] | None) -> str:
    """The number of seeds with each verdict, where seeds differ."""
    differ = disagreement(spread, claim["id"])
    return f" ({differ})" if differ else ""


TABLES: dict[str, tuple[str, Callable[[Path], str]]] = {
    "claims in short": ("README.md", claims_in_short),
    "claims": ("docs/report.md", claims_table),
    "settings": ("docs/decisions.md", settings_table),
    "speed": ("docs/speed.md", speed),
}
"""The page and the function of each marked table, by the name in its markers."""
