"""Links of the README in the pages of the book that include a section of it."""

import posixpath
import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

_LINK = re.compile(r"\]\((?!\w+:)([^)\s]+)\)")
_SECTIONS = {
    "how-long-it-takes": "book/speed.md#how-long-it-takes",
    "on-a-real-spacecraft": "book/own_telemetry.md#on-a-real-spacecraft",
    "when-something-goes-wrong": "book/faults.md",
    "where-the-paper-leaves-a-choice": "book/decisions.md",
}
"""Where the book has the sections of the README to which the README itself links."""
_FOLDERS = {"notebooks/": "book/lessons.md"}
"""The same for folders, which have no page of their own."""


def relink(text: str, page: str) -> str:
    """Rewrites the links of the README so that they hold on a page that includes it.

    Args:
        text: Markdown whose links are relative to the root of the repository.
        page: Path of the page, relative to the root.

    Raises:
        KeyError: If the text links to a section that is not listed in this module.
    """

    def changed(link: re.Match) -> str:
        target = _SECTIONS[link[1][1:]] if link[1].startswith("#") else _FOLDERS.get(link[1], link[1])
        path, hash_sign, section = target.partition("#")
        return f"]({posixpath.relpath(path, posixpath.dirname(page))}{hash_sign}{section})"

    return _LINK.sub(changed, text)


def _on_include(app: "Sphinx", path: Path, page: str, content: list[str]) -> None:
    if path == Path("README.md"):
        content[0] = relink(content[0], f"{app.env.docname}.md")


def setup(app: "Sphinx") -> dict[str, bool]:
    """Connects the rewriting to the inclusion of files."""
    app.connect("include-read", _on_include)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
