"""Checks a built book: it loads nothing from a network, and every link within it leads to a file and a place that exist."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

_LOADED = {"script": "src", "link": "href", "img": "src", "iframe": "src", "source": "src", "video": "src", "audio": "src", "embed": "src"}
"""Elements for which a browser loads a file, and the attribute that names it."""
_NOT_LOADED = {"canonical", "search", "next", "prev", "index", "author", "help", "license"}
"""Kinds of `link` that only name another page."""


@dataclass
class Page:
    """What a page loads, where it links to, and the places in it to which a link can lead."""

    loaded: list[str] = field(default_factory=list)
    links: list[str] = field(default_factory=list)
    places: set[str] = field(default_factory=set)


class _Reader(HTMLParser):
    def __init__(self):
        super().__init__()
        self.page = Page()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self.page.places |= {values[name] for name in ("id", "name") if values.get(name)}
        if tag == "a" and "href" in values:
            self.page.links.append(values["href"])
        target = values.get(_LOADED.get(tag, ""), "")
        if target:
            is_loaded = tag != "link" or not _NOT_LOADED & set(values.get("rel", "").split())
            (self.page.loaded if is_loaded else self.page.links).append(target)


def read(path: Path) -> Page:
    """Reads a page of HTML."""
    reader = _Reader()
    reader.feed(path.read_text(encoding="utf-8"))
    return reader.page


def problems(folder: Path) -> Iterator[str]:
    """Yields one line for each problem of the HTML and CSS files of a folder; links to other sites are not followed."""
    folder = folder.resolve()
    pages = {path: read(path) for path in sorted(folder.rglob("*.html")) if path.parent.name != "_static"}  # there lie templates
    for path, page in pages.items():
        name = path.relative_to(folder)
        for target in page.loaded:
            if urlsplit(target).netloc:
                yield f"{name}: loads {target}"
        for target in (*page.loaded, *page.links):
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                continue
            aim = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not aim.is_file():
                yield f"{name}: there is no file {target}"
            elif aim in pages and parts.fragment and unquote(parts.fragment) not in pages[aim].places:
                yield f"{name}: there is no place {target}"
    for path in sorted(folder.rglob("*.css")):
        text = path.read_text(encoding="utf-8")
        if any(form in text for form in ("url(http", 'url("http', "url('http", "url(//", '@import "http', "@import url(http")):
            yield f"{path.relative_to(folder)}: loads from a network"
