"""The HTML page of a run: what is on it, its structure for screen readers, and that it loads and runs nothing."""

import html.parser
import itertools
import re
import struct

import pytest

from enhsim_tf.reproduce import report as page
from enhsim_tf.reproduce.paper.claims import CLAIMS
from enhsim_tf.reproduce.paper.figures import FIGURES
from enhsim_tf.reproduce.paper.judgements import NOT_MEASURED, NOT_REPRODUCED, NOT_TESTED, PARTLY, REPRODUCED

HOSTILE = "\"'><img src=x onerror=alert(1)><script>alert(2)</script></table>{{ 7 * 7 }}&lt;" + "T1_" * 80 + ".npy"
VERDICTS = (REPRODUCED, PARTLY, NOT_REPRODUCED, NOT_TESTED, NOT_MEASURED)
VALUES = {0.0421: "0.0421", 1.0: "1", 998.6: "999", 999.6: "1,000", -1234.4: "-1,234", None: "–"}


def found_of(**changed):
    """Results as `report.results` makes them, with each verdict and each kind of value."""
    claims = []
    for claim, verdict, value in zip(CLAIMS, itertools.cycle(VERDICTS), itertools.cycle(VALUES), strict=False):
        said = {key: getattr(claim, key) for key in ("id", "sentence", "section", "figure", "statistic", "tolerance", "expected")}
        details = {f"{claim.id} number {count}": count / 3 for count in range(len(claims))}
        claims.append(said | {"verdict": verdict, "value": value, "finding": f"we found {claim.id}", "details": details})
    found = {"budget": "full", "seed": 0, "source": "the paper's example", "verdict": "[¬Re]", "this_run_s": 41.2, "claims": claims}
    found |= {
        "versions": {"python": "3.11.7", "keras": "3.15.1"},
        "timings": {"enhancer": 30.0, "figures": 7.5},
        "from_cache": ["enhancer"],
    }
    return found | changed


def hostile_of(found):
    """The same results with hostile words wherever a word can come from a file, a channel or a detector."""
    for claim in found["claims"]:
        claim |= {key: claim[key] + HOSTILE for key in ("sentence", "section", "statistic", "tolerance", "finding", "verdict")}
        claim["details"] = {name + HOSTILE: value for name, value in claim["details"].items()}
    words = {"source": HOSTILE, "versions": {HOSTILE: HOSTILE}, "timings": {HOSTILE: 1.0}, "from_cache": [HOSTILE], "verdict": HOSTILE}
    return found | words


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a stand-in for each figure, as PNG and SVG; of a PNG, only the size is read."""
    folder = tmp_path_factory.mktemp("report")
    for name in FIGURES:
        (folder / f"{name}.png").write_bytes(b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sII", 13, b"IHDR", 1440, 700))
        (folder / f"{name}.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg"/>')
    return folder


class Element:
    def __init__(self, tag, attributes=(), parent=None):
        self.tag, self.attributes, self.parent, self.children = tag, dict(attributes), parent, []

    def find(self, *tags):
        """Elements below, in order; of all tags if none is given."""
        for child in (child for child in self.children if isinstance(child, Element)):
            if child.tag in tags or not tags:
                yield child
            yield from child.find(*tags)

    @property
    def text(self):
        return " ".join("".join(child if isinstance(child, str) else child.text for child in self.children).split())


class Reader(html.parser.HTMLParser):
    """Builds the tree and refuses what is not closed in order."""

    def __init__(self, text):
        super().__init__()
        self.here = self.tree = Element("")
        self.feed(text)
        assert self.here is self.tree, f"{self.here.tag} is not closed"

    def handle_starttag(self, tag, attributes):
        child = Element(tag, attributes, self.here)
        self.here.children.append(child)
        if tag not in ("meta", "img", "input", "wbr"):
            self.here = child

    def handle_startendtag(self, tag, attributes):
        self.here.children.append(Element(tag, attributes, self.here))

    def handle_endtag(self, tag):
        assert self.here.tag == tag, f"</{tag}> closes {self.here.tag}"
        self.here = self.here.parent

    def handle_data(self, text):
        self.here.children.append(text)


def read(folder, found=None):
    return Reader(page.write_page(folder, found or found_of(), list(FIGURES)).read_text(encoding="utf-8")).tree


@pytest.fixture(scope="module")
def tree(folder):
    return read(folder)


def test_every_figure_has_its_caption_and_text_alternative(tree):
    figures = {figure.attributes["id"]: figure for figure in tree.find("figure")}
    assert list(figures) == list(FIGURES)
    for name, about in FIGURES.items():
        (image,) = figures[name].find("img")
        assert image.attributes["alt"] == about.alt
        assert f"Figure {about.number} {about.title}" in figures[name].text


def test_every_claim_is_there_with_verdict_value_and_finding(tree):
    rows = {row.attributes.get("id"): row.text for row in tree.find("tr")}
    for claim in found_of()["claims"]:
        for words in (
            claim["sentence"],
            claim["verdict"],
            VALUES[claim["value"]],
            claim["statistic"],
            claim["tolerance"],
            claim["finding"],
        ):
            assert words in rows[claim["id"]]


def test_a_smoke_run_is_marked_and_has_no_verdict(folder, tree):
    smoke = read(folder, found_of(budget="smoke"))
    assert next(smoke.find("aside")).text.startswith("Smoke run – no results") and "[¬Re]" not in smoke.text
    assert not list(tree.find("aside")) and "[¬Re]" in next(tree.find("title")).text


def test_hostile_names_are_escaped(folder, tree):
    hostile = read(folder, hostile_of(found_of()))
    assert not list(hostile.find("script"))
    assert len(list(hostile.find("img"))) == len(list(tree.find("img")))
    known = {name for element in tree.find() for name in element.attributes}
    assert {name for element in hostile.find() for name in element.attributes} <= known
    assert hostile.text.count(HOSTILE) >= 6 * len(CLAIMS) + 5  # a claim has six such words, the run five


def test_nothing_is_loaded_and_nothing_runs(tree):
    assert not list(tree.find("script", "link", "iframe", "object", "embed", "base"))
    for element in tree.find():
        assert not [name for name in element.attributes if name.startswith("on") or name in ("srcset", "background", "poster")]
        assert element.attributes.get("src", "data:").startswith("data:")
    assert not re.search(r"url\(|@import|https?:", next(tree.find("style")).text)
    (policy,) = (meta.attributes["content"] for meta in tree.find("meta") if "http-equiv" in meta.attributes)
    assert "default-src 'none'" in policy and "script-src" not in policy


def test_headings_are_in_order_and_links_lead_to_places(tree):
    levels = [int(heading.tag[1]) for heading in tree.find("h1", "h2", "h3", "h4")]
    assert levels[0] == 1 and levels.count(1) == 1
    assert all(after - before <= 1 for before, after in itertools.pairwise(levels))
    ids = [element.attributes["id"] for element in tree.find() if "id" in element.attributes]
    assert len(ids) == len(set(ids))
    targets = [link.attributes["href"] for link in tree.find("a")]
    assert {target[1:] for target in targets if target.startswith("#")} <= set(ids)
    assert all(next(table.find("caption")).text for table in tree.find("table"))


def test_a_missing_or_broken_figure_is_refused_and_the_old_page_stays(folder, refused):
    before = page.write_page(folder, found_of(), list(FIGURES)).read_bytes()
    name = "fig08_source_noise"
    content = (folder / f"{name}.png").read_bytes()
    for broken, words in ((b"", "PNG"), (None, f"no {name}.png")):
        (folder / f"{name}.png").unlink() if broken is None else (folder / f"{name}.png").write_bytes(broken)
        with refused(words):
            page.write_page(folder, found_of(), list(FIGURES))
    (folder / f"{name}.png").write_bytes(content)
    assert (folder / "report.html").read_bytes() == before and not list(folder.glob(".*"))
