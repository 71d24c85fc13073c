"""The book without building it, the marked tables of its pages, and the code of CONTRIBUTING.md."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import enhsim_tf
from book import __main__ as command
from book import tables
from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.reading.channels import Channels

ROOT = Path(__file__).parents[2]


def test_every_page_is_in_the_table_of_contents():
    listed = re.findall(
        r"\b(?:root|file|glob): (\S+)", (ROOT / "book" / "_toc.yml").read_text(encoding="utf-8")
    )
    patterns = {name for name in listed if "*" in name}
    assert {f"docs/{page.stem}" for page in (ROOT / "docs").glob("*.md")} <= set(listed)
    assert patterns == {"notebooks/*", "studies/*/README"}
    assert [name for name in set(listed) - patterns if not (ROOT / f"{name}.md").is_file()] == []


def test_links_between_pages_lead_to_files():
    pages = [
        *ROOT.glob("*.md"),
        *(ROOT / "docs").glob("*.md"),
        *(ROOT / "studies").rglob("README.md"),
    ]
    links = [
        (page, link)
        for page in pages
        for link in re.findall(r"\]\((?!\w+:|#)([^)#\s]+)", page.read_text(encoding="utf-8"))
    ]
    assert len(links) > 50
    assert [(page.name, link) for page, link in links if not (page.parent / link).exists()] == []


def test_the_reference_lists_the_public_names():
    assert set(
        re.findall(r"^   (\w+)$", (ROOT / "book" / "api.md").read_text(encoding="utf-8"), re.M)
    ) == set(enhsim_tf.__all__)


def test_missing_packages_are_named_in_one_line(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(command.importlib.util, "find_spec", lambda name: None)
    assert command.main(["--out", str(tmp_path / "book")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "sphinx, myst_nb" in said and not (tmp_path / "book").exists()


# the marked tables


def test_no_marked_table_is_stale():
    assert list(tables.stale(ROOT)) == [], "run `python -m book --tables`"


def test_another_processor_is_not_another_result():
    assert tables.agree(
        "| C1 | partly | error 0.093; 1,200 |", "| C1 | partly | error 0.106; 1,000 |"
    )
    assert not tables.agree("| C1 | partly | error 0.093 |", "| C1 | partly | error 0.5 |")
    assert not tables.agree("| C1 | partly | error 0.093 |", "| C1 | reproduced | error 0.093 |")


def test_a_table_stands_between_its_markers():
    page = "before\n<!-- a: generated -->\nold\n<!-- end of a -->\nafter\n"
    assert tables.fill_part(page, "a", "new", "page.md") == page.replace("old", "new")
    with pytest.raises(InputError, match="markers of 'b' once in page.md"):
        tables.fill_part(page, "b", "new", "page.md")


# the code of CONTRIBUTING.md


def test_the_examples_for_contributors_work(tmp_path):
    names = {
        "np": np,
        "pd": pd,
        "Path": Path,
        "Any": Any,
        "Channels": Channels,
        "InputError": InputError,
    }
    for block in re.findall(
        r"```python\n(\S.*?)```", (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"), re.S
    ):
        exec(block, names)
    windows = np.array([[0.0, 1.0], [2.0, 3.0], [0.0, 4.0]])[:, :, None]
    assert names["WindowRange"]().fit(windows).score(windows).tolist() == [0, 0, 3]
    assert names["Ramp"](4.0).run(np.arange(6)).ravel().tolist() == [0, 0.25, 0.5, 0.75, 0, 0.25]
    (tmp_path / "x.jsonl").write_text(
        '{"volts": 1.5, "mode": "on"}\n{"volts": 2.5, "mode": "off"}\n'
    )
    (channel,) = names["read_json_lines"](tmp_path / "x.jsonl", None).values()
    assert channel.tolist() == [1.5, 2.5]
    (tmp_path / "bad.jsonl").write_text("{")
    with pytest.raises(InputError):
        names["read_json_lines"](tmp_path / "bad.jsonl", None)
