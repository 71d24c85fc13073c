"""The book without building it, the marked tables of its pages, and the code of CONTRIBUTING.md."""

import re

import pytest

import enhsim_tf
from book import __main__ as command
from book import tables
from enhsim_tf.common.errors import InputError
from tests.clone import ROOT


def test_every_page_is_in_the_table_of_contents():
    listed = re.findall(
        r"\b(?:root|file|glob): (\S+)", (ROOT / "book" / "_toc.yml").read_text(encoding="utf-8")
    )
    patterns = {name for name in listed if "*" in name}
    pages = {f"docs/{page.stem}" for page in (ROOT / "docs").glob("*.md")}
    lessons = {f"notebooks/{lesson.stem}" for lesson in (ROOT / "notebooks").glob("*.ipynb")}
    assert pages | lessons <= set(listed) and patterns == {"studies/*/README"}
    others = set(listed) - patterns - lessons
    assert [name for name in others if not (ROOT / f"{name}.md").is_file()] == []


def test_links_between_pages_lead_to_files():
    pages = [
        *ROOT.glob("*.md"),
        *(ROOT / "docs").glob("*.md"),
        *(ROOT / "studies").rglob("README.md"),
    ]
    pattern = r"\]\((?!\w+:|#)([^)#\s]+)"
    links = [
        page.parent / link
        for page in pages
        for link in re.findall(pattern, page.read_text(encoding="utf-8"))
    ]
    assert len(links) > 50
    assert [link for link in links if not link.exists()] == []


def test_the_reference_lists_the_public_names():
    names = re.findall(r"^   (\w+)$", (ROOT / "book" / "api.md").read_text("utf-8"), re.M)
    assert set(names) == set(enhsim_tf.__all__)


def test_missing_packages_are_named_in_one_line(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(command.importlib.util, "find_spec", lambda name: None)
    assert command.main(["--out", str(tmp_path / "book")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "sphinx, myst_nb" in said and not (tmp_path / "book").exists()


# the marked tables


def test_no_marked_table_is_stale():
    assert list(tables.stale(ROOT)) == [], "run `python -m book --tables`"


def test_another_processor_is_not_another_result():
    row = "| C1 | partly | error 0.093; 1,200 |"
    assert tables.agree(row, "| C1 | partly | error 0.106; 1,000 |")
    for other in ("| C1 | partly | error 0.5; 1,200 |", row.replace("partly", "reproduced")):
        assert not tables.agree(row, other)


def test_a_table_stands_between_its_markers():
    page = "before\n<!-- a: generated -->\nold\n<!-- end of a -->\nafter\n"
    assert tables.fill_part(page, "a", "new", "page.md") == page.replace("old", "new")
    with pytest.raises(InputError, match="markers of 'b' once in page.md"):
        tables.fill_part(page, "b", "new", "page.md")


# the summary of a job


def test_the_summary_has_a_row_for_each_claim(capsys):
    assert command.main(["--summary", str(ROOT / "figures" / "results.json")]) == 0
    rows = [line for line in capsys.readouterr().out.splitlines() if line.startswith("| C")]
    assert [row[2:4] for row in rows] == [f"C{number}" for number in range(1, 10)]


def test_a_run_that_wrote_no_results_has_no_summary(tmp_path, capsys):
    assert command.main(["--summary", str(tmp_path / "results.json")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
