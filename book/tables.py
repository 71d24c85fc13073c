"""The marked tables of the README and of the pages in `docs/`, written from the files that commands wrote: `python -m book --tables`.

A marked table stands between `<!-- NAME: generated -->` and `<!-- end of NAME -->`. The sentences around it are written by hand.
"""

import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

from benchmarks.report import speed_table
from enhsim_tf.common.atomic_files import replace_file
from enhsim_tf.common.errors import InputError
from enhsim_tf.paper.settings import decisions

TOLERANCE = 0.25  # relative: another processor gives other numbers, and no other result
_NUMBER = re.compile(r"(?<![\w.])-?\d[\d,]*(?:\.\d+)?")


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


def verdicts(root: Path) -> str:
    """The box of the README: for each claim the published verdict, that of the run in `figures/`, and what decides it."""
    from enhsim_tf.paper.report import as_markdown, box, read_published  # with the networks, TensorFlow

    found = json.loads((root / "figures" / "results.json").read_text(encoding="utf-8"))
    return as_markdown(box(found["claims"], read_published()))


def settings_table(root: Path) -> str:
    """The table of decisions: each setting, the paper's and the author's value, and where the value comes from."""
    rows = [
        (f"`{row['setting']}`", row["value"], row["paper"], row["author"], ": ".join(filter(None, (row["source"], row["why"]))))
        for row in decisions()
    ]
    return markdown(("setting", "here", "paper", "author's code", "source"), rows)


def speed(root: Path) -> str:
    """The table of the benchmarks."""
    return speed_table(json.loads((root / "benchmarks" / "results.json").read_text(encoding="utf-8"))["rows"])


def markdown(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Formats a table."""
    return "\n".join("| " + " | ".join(row) + " |" for row in (header, ["---"] * len(header), *rows))


TABLES: dict[str, tuple[str, Callable[[Path], str]]] = {
    "verdicts": ("README.md", verdicts),
    "settings": ("docs/decisions.md", settings_table),
    "speed": ("docs/speed.md", speed),
}
"""The page and the function of each marked table, by the name in its markers."""
