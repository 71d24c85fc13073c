"""The page of a run: what is on it, its structure for screen readers, and that it loads and runs
nothing, whatever names it shows.
"""

import html.parser
import itertools
import re

import matplotlib.image
import numpy as np
import pytest

from enhsim_tf.paper import report
from enhsim_tf.paper.claims import CLAIMS, judge
from enhsim_tf.paper.figures import FIGURES
from enhsim_tf.paper.settings import Settings

HOSTILE = (
    "\"'><img src=x onerror=alert(1)><script>alert(2)</script></table>{{ 7 * 7 }}&lt;"
    + "T1_" * 80
    + ".npy"
)
LEFT_OPEN = ("meta", "img", "input", "wbr")


def found_of(name="the paper's example"):
    """What a run found, with the first claim measured."""
    limits = {limit.name for limit in CLAIMS[0].limits} | {
        limit.high for limit in CLAIMS[0].limits if isinstance(limit.high, str)
    }
    records = [
        judge(claim, dict.fromkeys(limits, 0.0421) if claim is CLAIMS[0] else {})
        for claim in CLAIMS
    ]
    about = {"budget": "full", "seconds": 41.2, "stages": {name: 30.0}, "from_cache": [name]}
    return report.results(records, "[¬Re]", Settings(), report.read_published(), **about)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a stand-in for each figure, as PNG and SVG."""
    folder = tmp_path_factory.mktemp("report")
    for name in FIGURES:
        matplotlib.image.imsave(folder / f"{name}.png", np.zeros((70, 144)))
        (folder / f"{name}.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg"/>')
    return folder


class Page(html.parser.HTMLParser):
    """All tags with their attributes, and the words; refuses what is not closed in order."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.words = [], [], ""
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag not in LEFT_OPEN:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, text):
        self.words += f" {text}"

    def of(self, *tags):
        return [attributes for tag, attributes in self.tags if tag in tags]


def read(folder, found):
    return Page(report.write_page(folder, found, Settings()).read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def page(folder):
    return read(folder, found_of())


def test_every_figure_and_every_claim_is_on_the_page(page):
    assert [each["id"] for each in page.of("figure")] == list(FIGURES)
    assert [each["alt"] for each in page.of("img")] == [about.alt for about in FIGURES.values()]
    words = " ".join(page.words.split())
    assert all(claim.sentence in words for claim in CLAIMS) and "0.0421" in words


def test_figures_are_in_the_order_of_their_numbers():
    assert [about.number for about in FIGURES.values()] == list(range(1, 15))


def test_hostile_names_are_escaped(folder, page):
    hostile = read(folder, found_of(HOSTILE))
    assert [tag for tag, _ in hostile.tags] == [
        tag for tag, _ in read(folder, found_of("plain")).tags
    ]
    assert {name for _, attributes in hostile.tags for name in attributes} <= {
        name for _, attributes in page.tags for name in attributes
    }
    assert HOSTILE in hostile.words


def test_nothing_is_loaded_and_nothing_runs(page, folder):
    assert not page.of("script", "link", "iframe", "object", "embed", "base")
    for _, attributes in page.tags:
        assert not [
            name
            for name in attributes
            if name.startswith("on") or name in ("srcset", "background", "poster")
        ]
        assert attributes.get("src", "data:").startswith("data:")
    style = re.search(
        r"<style>(.*?)</style>", (folder / "report.html").read_text(encoding="utf-8"), re.S
    )[1]
    assert not re.search(r"url\(|@import|https?:", style)
    (policy,) = (each["content"] for each in page.of("meta") if "http-equiv" in each)
    assert "default-src 'none'" in policy and "script-src" not in policy


def test_headings_are_in_order_and_links_lead_to_places(page):
    levels = [int(tag[1]) for tag, _ in page.tags if re.fullmatch("h[1-4]", tag)]
    assert levels[0] == 1 and levels.count(1) == 1
    assert all(after - before <= 1 for before, after in itertools.pairwise(levels))
    ids = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(ids) == len(set(ids))
    assert {each["href"][1:] for each in page.of("a") if each["href"].startswith("#")} <= set(ids)


def test_what_the_box_shows_is_what_decides():
    limit = {
        "name": "x",
        "words": "x",
        "value": 0.25,
        "low": None,
        "high": 0.1,
        "decides": "basic",
        "holds": False,
    }
    record = {"id": "C1", "short": "s", "verdict": "not reproduced", "deciding": limit}
    rows = report.box([record], {"claims": {"C1": {"verdict": "undecided", "runs": [6, 3, 1]}}})
    assert list(rows[0].values()) == [
        "C1 s",
        "undecided (6/3/1)",
        "not reproduced",
        "x: 0.25, needed at most 0.1",
    ]
    assert all(value in report.as_text(rows) for value in rows[0].values())
