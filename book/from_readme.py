"""Links of the README in the first page of the book, which includes it, and links of other pages to the README."""

import posixpath
import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

_README = "README.md"
_LINK = re.compile(r"\]\((?!\w+:)([^)\s]+)\)")
_SECTIONS = {
    "": "book/index.md",
    "what-a-practitioner-should-do": "book/index.md#what-a-practitioner-should-do",
}
"""Where the book has the README, and those of its sections to which a link leads."""
_FOLDERS = {"notebooks": "book/lessons.md"}
"""The same for folders, which have no page of their own."""


def relink(text: str, source: str, page: str) -> str:
    """Rewrites those links of a text in Markdown that would not hold on a page of the book.

    Args:
        text: The text.
        source: Path of the file that the text comes from, relative to the root of the repository.
        page: Path of the page on which it stands: the same, or the page that includes it.

    Raises:
        KeyError: If the text links to a section of the README that is not listed in this module.
    """

    def changed(link: re.Match) -> str:
        path, _, section = link[1].partition("#")
        path = posixpath.normpath(posixpath.join(posixpath.dirname(source), path)) if path else source
        if path == _README:
            target = _SECTIONS[section]
        elif path in _FOLDERS:
            target = _FOLDERS[path]
        elif source == page:
            return link[0]
        else:
            target = f"{path}#{section}" if section else path
        path, hash_sign, section = target.partition("#")
        return f"]({posixpath.relpath(path, posixpath.dirname(page) or '.')}{hash_sign}{section})"

    return _LINK.sub(changed, text)


def _on_include(app: "Sphinx", path: Path, page: str, content: list[str]) -> None:
    if path.suffix == ".md":
        content[0] = relink(content[0], path.as_posix(), f"{app.env.docname}.md")


def _on_read(app: "Sphinx", page: str, content: list[str]) -> None:
    path = f"{page}.md"
    if (Path(app.srcdir) / path).is_file():
        content[0] = relink(content[0], path, path)


def setup(app: "Sphinx") -> dict[str, bool]:
    """Connects the rewriting to the reading of pages and of files that they include."""
    app.connect("include-read", _on_include)
    app.connect("source-read", _on_read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
