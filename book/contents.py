"""The table of contents takes every page of `docs/`: those that it does not name follow at one place of it."""

import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

_TITLE = re.compile(r"^.* <|>$")  # of an entry with a title of its own, `Title </docs/page>`
DOCS = Path(__file__).parents[1] / "docs"
PLACE = "/docs/(further pages)"
"""The line of the table of contents that the further pages replace."""


def with_further_pages(index: str, names: list[str]) -> str:
    """Replaces the line `PLACE` of a table of contents by the pages that no other line of it names.

    Args:
        index: The page with the table of contents.
        names: Names of all pages of `docs/`, without their ending.
    """
    named = {_TITLE.sub("", line) for line in index.splitlines()}
    return index.replace(PLACE, "\n".join(page for page in (f"/docs/{name}" for name in names) if page not in named))


def _on_read(app: "Sphinx", page: str, content: list[str]) -> None:
    if page == app.config.root_doc:
        content[0] = with_further_pages(content[0], sorted(path.stem for path in DOCS.glob("*.md")))


def setup(app: "Sphinx") -> dict[str, bool]:
    """Connects the replacement to the reading of the first page."""
    app.connect("source-read", _on_read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
