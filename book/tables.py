"""The marked tables of the README and of the pages in `docs/`, written from the files that commands wrote: `python -m book --tables`.

A marked table stands between `<!-- NAME: generated -->` and `<!-- end of NAME -->`. The sentences around it are written by hand.
"""

import itertools
import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.report import speed_table
from enhsim_tf.common.atomic_files import replace_file
from enhsim_tf.common.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

TOLERANCE = 0.25  # relative: another processor gives other numbers, and no other result
_NUMBER = re.compile(r"(?<![\w.])-?\d[\d,]*(?:\.\d+)?")


def refresh(root: Path) -> list[Path]:
    """Writes each table between its markers on the pages of a clone, and returns the pages."""
    texts = {
        path: path.read_text(encoding="utf-8")
        for path in {root / page for page, _ in TABLES.values()}
    }
    for name, (page, table) in TABLES.items():
        texts[root / page] = fill_part(texts[root / page], name, table(root), page)
    for path, text in texts.items():
        with replace_file(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return sorted(texts)


def stale(root: Path) -> Iterator[str]:
    """Yields the name and page of each table that differs from what `refresh` would write by more than `TOLERANCE`."""
    for name, (page, table) in TABLES.items():
        text = (root / page).read_text(encoding="utf-8")
        if not agree(text, fill_part(text, name, table(root), page)):
            yield f"{name} in {page}"


def agree(old: str, new: str) -> bool:
    """Whether two texts have the same words, and numbers that differ by at most `TOLERANCE`."""
    if _NUMBER.sub("#", old) != _NUMBER.sub("#", new):
        return False
    numbers = (
        [float(number.replace(",", "")) for number in _NUMBER.findall(text)] for text in (old, new)
    )
    return all(
        math.isclose(*pair, rel_tol=TOLERANCE, abs_tol=0.02) for pair in zip(*numbers, strict=True)
    )


def fill_part(text: str, name: str, content: str, where: str) -> str:
    """Replaces the text between the markers of a table, which the page `where` must hold once."""
    marked = re.compile(rf"(<!-- {name}: generated -->\n).*?(<!-- end of {name} -->)", re.DOTALL)
    text, count = marked.subn(lambda match: f"{match[1]}{content}\n{match[2]}", text)
    if count != 1:
        raise InputError(
            f"Expected the markers of '{name}' once in {where}. Received: {count}. Put them back."
        )
    return text


def verdicts(root: Path) -> str:
    """The claims of the README, each with its published verdict and the verdicts of the runs."""
    published = json.loads(
        (root / "enhsim_tf" / "paper" / "published.json").read_text(encoding="utf-8")
    )["claims"]
    short = {
        claim["id"]: claim["short"]
        for claim in json.loads((root / "figures" / "results.json").read_text(encoding="utf-8"))[
            "claims"
        ]
    }
    rows = []
    for id, each in published.items():
        rows.append((f"{id} {short[id]}", each["verdict"], "/".join(map(str, each["runs"]))))
    return markdown(("claim", "verdict", f"reproduced/partly/not, {sum(each['runs'])} runs"), rows)


def measurements(root: Path) -> str:
    """What each limit of the claims asks for, and what the reference measured over seeds and roundings."""
    from enhsim_tf.paper.claims import CLAIMS, OURS, WHOLE  # with the networks, TensorFlow
    from enhsim_tf.paper.report import needed, short

    table = _table_of_readings(root)
    reference = table[table["reading"] == "reference"]
    rows, words = [], {OURS: "({})", WHOLE: "{} for *reproduced*"}
    for claim in CLAIMS:
        runs = reference[reference["claim"] == claim.id].pivot(
            index=["rounding", "seed"], columns="name", values="value"
        )
        for name, group in itertools.groupby(claim.limits, lambda limit: limit.name):
            limits, values, asked, kept = list(group), runs[name], [], []
            for limit in limits:
                ends = {"low": limit.low, "high": limit.upper(runs.median())}
                range_words = needed(
                    {end: None if math.isinf(value) else value for end, value in ends.items()}
                )
                asked.append(words.get(limit.decides, "{}").format(range_words))
                kept.append(str(sum(map(limit.holds, runs.to_dict("records")))))
            found = f"{short(values.median())} ({short(values.min())} to {short(values.max())})"
            rows.append((claim.id, limits[0].words, found, ", ".join(asked), ", ".join(kept)))
    return markdown(("claim", "measured", "median (range)", "needed", "runs that hold"), rows)


def readings(root: Path) -> str:
    """The most common verdict of each reading on each claim that it touches."""
    from studies.readings.summary import most_common, verdicts  # with the networks, TensorFlow

    return markdown(*most_common(verdicts(_table_of_readings(root))))


def _table_of_readings(root: Path) -> "pd.DataFrame":
    import pandas as pd

    return pd.read_parquet(root / "studies" / "readings" / "results" / "measurements.parquet")


def settings_table(root: Path) -> str:
    """The table of decisions: each setting, the paper's and the author's value, and where the value comes from."""
    from enhsim_tf.paper.report import decisions  # with the networks, TensorFlow

    rows = [
        (
            f"`{row['setting']}`",
            row["value"],
            row["paper"],
            row["author"],
            ": ".join(filter(None, (row["source"], row["why"]))),
        )
        for row in decisions()
    ]
    return markdown(("setting", "here", "paper", "author's code", "source: reason"), rows)


def speed(root: Path) -> str:
    """The table of the benchmarks."""
    return speed_table(
        json.loads((root / "benchmarks" / "results.json").read_text(encoding="utf-8"))["rows"]
    )


def markdown(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Formats a table."""
    return "\n".join(
        "| " + " | ".join(row) + " |" for row in (header, ["---"] * len(header), *rows)
    )


TABLES: dict[str, tuple[str, Callable[[Path], str]]] = {
    "verdicts": ("README.md", verdicts),
    "measurements": ("docs/report.md", measurements),
    "readings": ("studies/readings/README.md", readings),
    "settings": ("docs/decisions.md", settings_table),
    "speed": ("docs/speed.md", speed),
}
"""The page and the function of each marked table, by the name in its markers."""
