"""The marked tables of the README and of the pages in `docs/`, written from the files that commands
wrote: `python -m book --tables`.

A marked table stands between `<!-- NAME: generated -->` and `<!-- end of NAME -->`. The sentences
around it are written by hand.
"""

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
    """Yields the name and page of each table that differs from what `refresh` would write by more
    than `TOLERANCE`.
    """
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
    """The claims of the README, each with its published verdict."""
    published = json.loads(
        (root / "enhsim_tf" / "paper" / "published.json").read_text(encoding="utf-8")
    )["claims"]
    short = {
        claim["id"]: claim["short"]
        for claim in json.loads((root / "figures" / "results.json").read_text(encoding="utf-8"))[
            "claims"
        ]
    }
    rows = [
        (
            f"{id} {short[id]}",
            each["verdict"] + (f" ({each['decided_by']})" if each["decided_by"] else ""),
        )
        for id, each in published.items()
    ]
    return markdown(["claim", "verdict"], rows)


def summary(path: Path) -> str:
    """The verdicts of one run as Markdown, for the summary of a job.

    Args:
        path: The `results.json` of `python -m enhsim_tf.reproduce`.
    """
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        rows = [list(row.values()) for row in found["box"]]
        header = list(found["box"][0])
        about = f"{found['budget']} budget, seed {found['seed']}, {found['seconds']:.0f} s"
    except (OSError, ValueError, KeyError, IndexError) as error:
        raise InputError(
            f"Expected the results.json of a whole reproduction. Received: {path} ({error})."
        ) from error
    return f"## {found['title']} The reproduction: {about}\n\n{markdown(header, rows)}"


def measurements(root: Path) -> str:
    """What each limit of the claims asks for, and what the deciding readings measured over seeds
    and roundings. A limit that holds in all runs of all readings at a tenth of its distance is
    marked.
    """
    from enhsim_tf.paper.claims import CLAIMS, SHOWN, WHOLE, Limit  # with the networks, TensorFlow
    from enhsim_tf.paper.report import needed, short
    from studies.readings.run import DECIDING
    from studies.readings.summary import measurements

    table, rows = _table_of_readings(root), []
    words = {SHOWN: "({})", WHOLE: "{} for *reproduced*"}
    columns = [name for name in DECIDING if name in set(table["reading"])]
    for claim in CLAIMS:
        runs = measurements(table, claim.id)
        of_name: dict[str, list[Limit]] = {}
        for limit in claim.limits:
            of_name.setdefault(limit.name, []).append(limit)
        for name, limits in of_name.items():
            known = runs.reindex(columns={name, *runs}).dropna(subset=[name])
            asked = []
            for limit in limits:
                ends = dict(zip(("low", "high"), limit.ends(known.median()), strict=True))
                asked_for = needed(
                    {end: value if math.isfinite(value) else None for end, value in ends.items()}
                )
                is_met = [limit.holds(run, 0.1) for run in known.to_dict("records")]
                mark = "¹" if is_met and all(is_met) else ""
                asked.append(words.get(limit.decides, "{}").format(asked_for) + mark)
            row = [claim.id, limits[0].words, ", ".join(asked)]
            for column in columns:
                part = known[known.index.get_level_values("reading") == column]
                low, middle, high = map(short, part[name].quantile([0, 0.5, 1]))
                held = [sum(map(limit.holds, part.to_dict("records"))) for limit in limits]
                spread = f" ({low}–{high})" if len(part) > 1 else ""
                told = f"{middle}{spread}; {', '.join(map(str, held))}"
                row.append(told if len(part) else "")
            rows.append(row)
    header = ["claim", "measured", "needed"]
    for column in columns:
        number = len(table.loc[table["reading"] == column, ["rounding", "seed"]].drop_duplicates())
        header.append(f"{column}: median (range); limits hold, of {number}")
    return markdown(header, rows)


def signs(root: Path) -> str:
    """The title with each statistic of C6, in both columns and at three factors of all limits."""
    from studies.readings.summary import signs  # with the networks, TensorFlow

    return markdown(*signs(_table_of_readings(root)))


def effects(root: Path) -> str:
    """The effects of the factorial."""
    from studies.readings.summary import effects  # with the networks, TensorFlow

    return markdown(*effects(_table_of_readings(root)))


def author_code(root: Path) -> str:
    """The author's code beside the networks of this project in his configuration."""
    import pandas as pd

    from studies.author_code.summary import beside

    his = root / "studies" / "author_code" / "results" / "measurements.parquet"
    if not his.is_file():
        return "No run has finished yet."
    return markdown(*beside(pd.read_parquet(his), _table_of_readings(root)))


def readings(root: Path) -> str:
    """The most common verdict of each reading on each claim that it touches."""
    from studies.readings.summary import most_common, verdicts  # with the networks, TensorFlow

    return markdown(*most_common(verdicts(_table_of_readings(root))))


def _table_of_readings(root: Path) -> "pd.DataFrame":
    import pandas as pd

    return pd.read_parquet(root / "studies" / "readings" / "results" / "measurements.parquet")


def settings_table(root: Path) -> str:
    """The table of decisions: each setting, the paper's and the author's value, and why this value.
    The page says where the author's code is, and that reasons without a source are ours.
    """
    from enhsim_tf.paper.report import decisions  # with the networks, TensorFlow
    from enhsim_tf.paper.settings import GAN_CODE, MLP_CODE, PAPER

    rows = []
    for row in decisions():
        why = f"paper, {row['why']}" if row["source"] == PAPER else row["why"]
        why = why.replace(f"{GAN_CODE} and {MLP_CODE}", "code")
        why = why.replace(GAN_CODE, "code").replace(MLP_CODE, "code")
        rows.append((f"`{row['setting']}`", row["value"], row["paper"], row["author"], why))
    return markdown(("setting", "here", "paper", "code", "why"), rows)


def speed(root: Path) -> str:
    """The table of the benchmarks, without the times of imports."""
    rows = json.loads((root / "benchmarks" / "results.json").read_text(encoding="utf-8"))["rows"]
    return speed_table([row for row in rows if row["comparison"] != "import tensorflow"])


def markdown(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Formats a table."""
    return "\n".join(
        "| " + " | ".join(row) + " |" for row in (header, ["---"] * len(header), *rows)
    )


TABLES: dict[str, tuple[str, Callable[[Path], str]]] = {
    "verdicts": ("README.md", verdicts),
    "measurements": ("docs/report.md", measurements),
    "signs": ("docs/report.md", signs),
    "readings": ("studies/readings/README.md", readings),
    "effects": ("studies/readings/README.md", effects),
    "author_code": ("studies/author_code/README.md", author_code),
    "settings": ("docs/decisions.md", settings_table),
    "speed": ("docs/speed.md", speed),
}
"""The page and the function of each marked table, by the name in its markers."""
