"""Tests of the book without building it: its table of contents, its links and the check of its pages."""

import re
from fnmatch import fnmatchcase
from pathlib import Path

import pytest

from book import __main__ as command
from book import api_pages
from book.contents import DOCS, with_other_pages
from book.from_readme import relink
from book.html_check import problems

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text("utf-8")
PAGES = sorted((ROOT / "book").glob("*.md"))
INCLUDED = re.compile(r'\.\./README\.md\n:start-after: "(.*)"\n:end-before: "(.*)"')


def entries(page):
    """Names that the tables of contents of a page list, from the root of the repository, with patterns as they are."""
    text = page.read_text("utf-8")
    if page.stem == "index":
        text = with_other_pages(text, sorted(path.stem for path in DOCS.glob("*.md")))
    lines = [line for table in re.findall(r"```\{toctree\}\n(.*?)```", text, re.S) for line in table.splitlines()]
    names = [re.sub(r"^.* <|>$", "", line) for line in lines if line and not line.startswith(":")]
    return [name.removeprefix("/") if name.startswith("/") else f"book/{name}" for name in names]


def test_every_page_and_notebook_is_in_the_table_of_contents_once():
    listed = [entry for page in PAGES for entry in entries(page)]
    sources = [
        *PAGES,
        *DOCS.glob("*.md"),
        *(ROOT / "notebooks").glob("*.ipynb"),
        *(ROOT / f"{name}.md" for name in ("SECURITY", "CONTRIBUTING", "CHANGELOG")),
    ]
    names = {path.relative_to(ROOT).with_suffix("").as_posix() for path in sources} - {"book/index"}
    assert len(names) > 40
    assert {name: [entry for entry in listed if fnmatchcase(name, entry)] for name in names} == {
        name: [entry for entry in listed if fnmatchcase(name, entry)][:1] or ["one"] for name in names
    }
    assert [entry for entry in listed if entry != "book/api/*" and not any(fnmatchcase(name, entry) for name in names)] == []


def test_pages_that_no_line_names_stand_in_the_place_of_their_pattern():
    index = "/docs/b\nothers: /docs/R*\nTitle </docs/c>\nothers: /docs/*\nlast\n"
    assert with_other_pages(index, ["R", "a", "b", "c", "d"]) == "/docs/b\n/docs/R\nTitle </docs/c>\n/docs/a\n/docs/d\nlast\n"


def test_the_first_page_includes_the_readme():
    (included,) = [INCLUDED.findall(page.read_text("utf-8")) for page in PAGES if page.stem == "index"]
    ((begin, end),) = included
    assert README.count(begin) == README.count(end) == 1 and README.index(begin) < README.index(end)
    assert len(README.splitlines()) <= 150


def test_links_of_the_readme_lead_from_a_page_to_files_and_to_its_own_sections():
    text = relink(README, "README.md", "book/page.md")
    links = re.findall(r"\]\((?!\w+:)([^)#\s]+)(#[^)\s]+)?\)", text)
    assert len(links) > 10
    for path, section in links:
        target = ROOT / "book" / path
        assert target.is_file(), path
        if section:
            headings = re.findall(r"^#+ (.*)", README + target.read_text("utf-8"), re.M)
            assert section[1:] in {re.sub(r"[^\w -]", "", heading).lower().replace(" ", "-") for heading in headings}, section


def test_links_to_the_readme_lead_to_the_book():
    text = "[a](../README.md), [b](b.md#x), [c](../README.md#what-a-practitioner-should-do), [d](https://e.org/README.md)"
    found = relink(text, "docs/page.md", "docs/page.md")
    assert found == "[a](../book/index.md), [b](b.md#x), [c](../book/index.md#what-a-practitioner-should-do), [d](https://e.org/README.md)"
    with pytest.raises(KeyError):
        relink("[a](#a-section-that-nothing-lists)", "README.md", "book/page.md")


def test_every_module_but_those_of_the_commands_is_on_one_page_of_the_reference():
    modules = [module for found in api_pages.pages().values() for module in found]
    paths = [
        path.relative_to(ROOT).with_suffix("")
        for path in (ROOT / "enhsim_tf").rglob("*.py")
        if path.name not in ("__init__.py", "__main__.py")
    ]
    assert sorted(modules) == sorted(".".join(path.parts) for path in paths if path.parts[1] != "cli")


def test_docstrings_are_turned_from_markdown_code():
    assert api_pages.prepare_docstring("function", ["Adds `a` to ``b``.", "", ":func:`c`"]) == ["Adds ``a`` to ``b``.", "", ":func:`c`"]
    assert api_pages.prepare_docstring("data", ["Maps: `a`."]) == ["", "Maps: ``a``."]


def test_the_check_of_pages_finds_what_is_broken_and_what_is_loaded(tmp_path):
    (tmp_path / "good.html").write_text(
        '<link rel="stylesheet" href="a.css"><h1 id="top"></h1><a href="https://x.org">x</a>', encoding="utf-8"
    )
    (tmp_path / "a.css").write_text("a { color: red }", encoding="utf-8")
    assert list(problems(tmp_path)) == []
    (tmp_path / "bad.html").write_text(
        '<script src="https://x.org/a.js"></script><a href="good.html#top"></a><a href="good.html#none"></a><img src="no.png"><a href="#here"></a>',
        encoding="utf-8",
    )
    (tmp_path / "b.css").write_text("@font-face { src: url(https://x.org/a.woff) }", encoding="utf-8")
    assert sorted(problems(tmp_path)) == [
        "b.css: loads from a network",
        "bad.html: loads https://x.org/a.js",
        "bad.html: there is no file no.png",
        "bad.html: there is no place #here",
        "bad.html: there is no place good.html#none",
    ]


def test_missing_packages_are_named_in_one_line(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(command.importlib.util, "find_spec", lambda name: None)
    assert command.main(["--out", str(tmp_path / "book")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "sphinx, myst_nb" in said and not (tmp_path / "book").exists()


def test_a_formula_becomes_mathml():
    pytest.importorskip("docutils.utils.math")
    from docutils import nodes

    from book import mathml

    class Writer:
        body: list[str] = []

    with pytest.raises(nodes.SkipNode):
        mathml.visit_block(Writer, nodes.math_block("", r"\frac{a}{2}"))
    assert re.sub(r"\s+", "", "".join(Writer.body)).count("<mfrac><mi>a</mi><mn>2</mn></mfrac>") == 1
