"""The table of contents takes every page of `docs/`: a line of it stands for the pages that no other line names."""

import re
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

DOCS = Path(__file__).parents[1] / "docs"
_TITLE = re.compile(r"^.* <|>$")  # of an entry with a title of its own, `Title </docs/page>`
_OTHERS = "others: "  # begins a line with a pattern of pages, `others: /docs/*`


def with_other_pages(index: str, names: list[str]) -> str:
    """Replaces each line `others: PATTERN` of a table of contents by the pages of that pattern that no line before or after names.

    Args:
        index: The page with the table of contents.
        names: Names of all pages of `docs/`, without their ending.
    """
    lines = index.splitlines()
    named = {_TITLE.sub("", line) for line in lines}
    left = [page for page in (f"/docs/{name}" for name in names) if page not in named]
    found = []
    for line in lines:
        if line.startswith(_OTHERS):
            taken = [page for page in left if fnmatchcase(page, line.removeprefix(_OTHERS))]
            left = [page for page in left if page not in taken]
            found += taken
        else:
            found.append(line)
    return "\n".join(found) + "\n"


def _on_read(app: "Sphinx", page: str, content: list[str]) -> None:
    if page == app.config.root_doc:
        content[0] = with_other_pages(content[0], sorted(path.stem for path in DOCS.glob("*.md")))


def setup(app: "Sphinx") -> dict[str, bool]:
    """Connects the replacement to the reading of the first page."""
    app.connect("source-read", _on_read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
