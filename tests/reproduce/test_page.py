"""Tests the HTML page: structure and escaping with a parser, behaviour, colours and print with a headless browser."""

import base64
import html.parser
import itertools
import json
import re
import shutil
import struct
import zlib

import pytest

from enhsim_tf.reproduce import report as page
from enhsim_tf.reproduce.paper.claims import CLAIMS
from enhsim_tf.reproduce.paper.figures import FIGURES
from enhsim_tf.reproduce.paper.judgements import NOT_MEASURED, NOT_REPRODUCED, NOT_TESTED, PARTLY, REPRODUCED
from enhsim_tf.reproduce.settings import deviations

HOSTILE = "\"'><img src=x onerror=alert(1)><script>alert(2)</script></table>{{ 7 * 7 }}&lt;" + "T1_" * 80 + ".npy"
VERDICTS = (REPRODUCED, PARTLY, NOT_REPRODUCED, NOT_TESTED, NOT_MEASURED)
VALUES = {
    0.0421: "0.0421",
    1.0: "1",
    55.0: "55",
    998.6: "999",
    999.6: "1,000",
    210427.25: "210,427",
    -0.5: "-0.5",
    -1234.4: "-1,234",
    None: "–",
}


def found_of(**changed):
    """Results as `report.results` makes them, with each verdict and each kind of value."""
    claims = []
    for claim, verdict, value in zip(CLAIMS, itertools.cycle(VERDICTS), VALUES, strict=False):
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


def size_of(name):
    """Pixels of the stand-in for a figure: single or double width."""
    return (700, 600) if name in ("fig03_enhancer", "fig09_generator", "fig10_discriminator") else (1440, 700 + FIGURES[name].number)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a stand-in for each figure, as PNG and SVG."""
    folder = tmp_path_factory.mktemp("report")
    for name in FIGURES:
        width, height = size_of(name)
        parts = (
            b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0),
            b"IDAT" + zlib.compress(bytes((width + 1) * height)),
            b"IEND",
        )
        chunks = (struct.pack(">I", len(part) - 4) + part + struct.pack(">I", zlib.crc32(part)) for part in parts)
        (folder / f"{name}.png").write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunks))
        shape = f'width="{width / 4}pt" height="{height / 4}pt" viewBox="0 0 {width} {height}"'
        (folder / f"{name}.svg").write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {shape}><title>{name}</title></svg>')
    return folder


class Element:
    def __init__(self, tag, attributes=(), parent=None):
        self.tag, self.attributes, self.parent, self.children = tag, dict(attributes), parent, []

    def find(self, tag="", **attributes):
        """Elements below, in order, of a tag and with attributes; `class_` asks for one of several classes."""
        wanted = {key.rstrip("_").replace("_", "-"): value for key, value in attributes.items()}
        for child in (child for child in self.children if isinstance(child, Element)):
            has = {key: value in (child.attributes.get(key) or "").split() for key, value in wanted.items() if key == "class"}
            has |= {key: child.attributes.get(key) == value for key, value in wanted.items() if key != "class"}
            if tag in ("", child.tag) and all(has.values()):
                yield child
            yield from child.find(tag, **attributes)

    @property
    def text(self):
        return re.sub(r"\s+", " ", "".join(child if isinstance(child, str) else child.text for child in self.children)).strip()


class Reader(html.parser.HTMLParser):
    """Builds the tree and refuses what is not closed in order."""

    def __init__(self, text):
        super().__init__()
        self.here = self.tree = Element("")
        self.feed(text)
        assert self.here is self.tree, f"{self.here.tag} is not closed"

    def handle_starttag(self, tag, attributes):
        assert len(dict(attributes)) == len(attributes), "an attribute twice"
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
    path = page.write_page(folder, found or found_of(), list(FIGURES))
    assert path == folder / "report.html"
    return Reader(path.read_text(encoding="utf-8")).tree


@pytest.fixture(scope="module")
def tree(folder):
    return read(folder)


def rows_of(table):
    return [[cell for cell in row.children if isinstance(cell, Element)] for body in table.find("tbody") for row in body.find("tr")]


# -- what is on it ---------------------------------------------------------------------------------------------------------


def test_every_figure_is_there_with_title_words_and_download(tree, folder):
    figures = list(tree.find("figure"))
    assert [figure.attributes["id"] for figure in figures] == list(FIGURES)
    for name, figure in zip(FIGURES, figures, strict=True):
        (image,), (link,), about = figure.find("img"), figure.find("a", download=f"{name}.png"), FIGURES[name]
        assert image.attributes["alt"] == about.alt
        assert (int(image.attributes["width"]), int(image.attributes["height"])) == size_of(name)
        assert f"Figure {about.number} {about.title}" in next(figure.find("figcaption")).text
        for uri, kind, words in ((image.attributes["src"], "svg", "svg+xml"), (link.attributes["href"], "png", "png")):
            start, content = uri.split(",")
            assert start == f"data:image/{words};base64"
            assert base64.b64decode(content) == (folder / f"{name}.{kind}").read_bytes()
        assert {link.text for link in figure.find("a") if "download" not in link.attributes} == {
            claim.id for claim in CLAIMS if claim.figure == name
        }


def test_the_pipeline_comes_first_whatever_the_order(folder):
    text = page.write_page(folder, found_of(), sorted(FIGURES, reverse=True)).read_text(encoding="utf-8")
    names = [figure.attributes["id"] for figure in Reader(text).tree.find("figure")]
    assert names == ["fig01_pipeline", *sorted(FIGURES, reverse=True)[:-1]]


def test_every_claim_is_there_in_words_and_colour(tree):
    rows, claims = rows_of(next(tree.find("table", class_="claims"))), found_of()["claims"]
    kinds = {}
    assert len(rows) == len(claims) == len(CLAIMS)
    for (said, verdict, measured, finding), claim in zip(rows, claims, strict=True):
        assert said.parent.attributes["id"] == claim["id"] and said.text.startswith(f"{claim['id']} {claim['sentence']}")
        (badge,) = verdict.find("span", class_="badge")
        kinds[badge.text] = (badge.attributes["class"], next(badge.find("use")).attributes["href"])
        assert badge.text == claim["verdict"]
        assert ("changed" in verdict.text) == (claim["verdict"] != claim["expected"])
        assert measured.text == f"{VALUES[claim['value']]} {claim['statistic']} Tolerance: {claim['tolerance']}"
        assert finding.text.startswith(claim["finding"])
        assert [name.text for name in finding.find("dt")] == list(claim["details"])
    assert set(kinds) == set(VERDICTS) and len(set(kinds.values())) == len({sign for _, sign in kinds.values()}) == len(VERDICTS)
    tally = [item.text for item in next(tree.find("ul", class_="tally")).find("li")]
    assert tally == ["2reproduced", "2partly", "2not reproduced", "2not tested by the paper", "1not measured"]


def test_every_setting_and_every_number_of_the_run_is_there(tree):
    _, settings, timings, versions = tree.find("table")
    rows = [[cell.text.replace("–", "-") for cell in row] for row in rows_of(settings) if len(row) > 1]
    assert rows == [list(row.values()) for row in deviations()]
    assert [[cell.text for cell in row[:2]] for row in rows_of(timings)] == [["enhancer from the cache", "30.0"], ["figures", "7.5"]]
    assert next(timings.find("tfoot")).text.replace(" ", "") == "Sum37.5"
    assert [[cell.text for cell in row] for row in rows_of(versions)] == [["python", "3.11.7"], ["keras", "3.15.1"]]


def test_ranges_over_seeds_only_where_they_belong_to_the_run(folder):
    claims = {claim["id"]: {"values": [claim["value"]] * 2, "verdicts": [claim["verdict"]] * 2} for claim in found_of()["claims"]}
    claims["C1"]["values"][1], claims["C2"]["verdicts"] = 0.0411, [PARTLY, NOT_REPRODUCED]
    spread = {"budget": "full", "seeds": [0, 1], "claims": claims}
    try:
        (folder / "spread.json").write_text(json.dumps(spread))
        shown = read(folder).text
        assert "0.0421 (0.0411 to 0.0421)" in shown and "over seeds 0, 1" in shown
        assert shown.count("over seeds: 1 partly, 1 not reproduced") == 2, "in the row of C2 and beside its figure"
        assert "by the verdicts of most seeds" in shown and "1 (1 to 1)" not in shown, "a speed has no range"
        older = found_of()
        older["claims"][0]["value"] = 0.0431
        for other in (found_of(seed=7), found_of(budget="smoke"), older):
            assert "0.0411" not in (text := read(folder, other).text) and "over seeds" not in text
    finally:
        (folder / "spread.json").unlink()


def test_a_smoke_run_is_marked_and_has_no_verdict(folder, tree):
    smoke = read(folder, found_of(budget="smoke"))
    (strip,) = smoke.find("aside")
    assert strip.text.startswith("Smoke run – no results")
    assert next(smoke.find("title")).text.startswith("SMOKE RUN")
    assert "[¬Re]" not in smoke.text and "changed; expected" not in smoke.text
    assert not list(tree.find("aside")) and "[¬Re]" in next(tree.find("title")).text and "no results" not in tree.text


def test_a_channel_is_named_and_expects_nothing(folder):
    text = read(folder, found_of(source="T-1.npy")).text
    assert "Evaluated on T-1.npy" in text and "changed; expected" not in text


# -- how it is built -------------------------------------------------------------------------------------------------------


def test_hostile_names_are_escaped(folder, tree):
    hostile = read(folder, hostile_of(found_of()))
    for tag in ("img", "table", "figure", "td", "dd"):  # the hostile run has one stage and one package less
        assert sum(1 for _ in tree.find(tag)) - sum(1 for _ in hostile.find(tag)) == (3 if tag == "td" else 0)
    assert not list(hostile.find("script"))
    known = {name for element in tree.find() for name in element.attributes}
    assert {name for element in hostile.find() for name in element.attributes} <= known
    assert hostile.text.count(HOSTILE) >= 6 * len(CLAIMS) + 5  # a claim has six such words, the run five


def test_nothing_is_loaded_and_nothing_runs(tree, folder):
    assert not [element.tag for element in tree.find() if element.tag in ("script", "link", "iframe", "object", "embed", "base")]
    for element in tree.find():
        assert not [name for name in element.attributes if name.startswith("on") or name in ("srcset", "background", "poster")]
        assert element.attributes.get("src", "data:").startswith("data:")
        if not element.attributes.get("href", "#").startswith(("#", "data:image/png")):
            assert element.tag == "a"  # followed by a reader only
    (style,) = tree.find("style")
    assert not re.search(r"url\(|@import|https?:", style.text)
    (policy,) = tree.find("meta", http_equiv="Content-Security-Policy")
    assert "default-src 'none'" in policy.attributes["content"] and "script-src" not in policy.attributes["content"]


def test_headings_landmarks_tables_and_targets(tree):
    assert next(tree.find("html")).attributes["lang"] == "en"
    levels = [int(element.tag[1]) for element in tree.find() if re.fullmatch("h[1-6]", element.tag)]
    assert levels[0] == 1 and levels.count(1) == 1
    assert all(after - before <= 1 for before, after in itertools.pairwise(levels))
    for tag in ("header", "main", "footer", "nav"):
        assert sum(1 for _ in tree.find(tag)) == 1
    ids = [element.attributes["id"] for element in tree.find() if "id" in element.attributes]
    assert len(ids) == len(set(ids))
    targets = [element.attributes[key] for element in tree.find() for key in ("href", "aria-labelledby") if key in element.attributes]
    assert {target.removeprefix("#") for target in targets if not target.startswith(("data:", "https:"))} <= set(ids)
    skip = next(next(tree.find("body")).find("a"))
    assert skip.attributes["href"] == "#main" and next(tree.find("main")).attributes["id"] == "main"
    for table in tree.find("table"):
        assert next(table.find("caption")).text
        width = sum(1 for cell in next(table.find("thead")).find() if cell.tag in ("th", "td"))
        assert all(header.attributes["scope"] in ("col", "row", "rowgroup") for header in table.find("th"))
        for row in rows_of(table):
            assert sum(int(cell.attributes.get("colspan", 1)) for cell in row) == width
            assert row[0].tag == "th"
        if "cards" in table.attributes.get("class", ""):  # what is no longer laid out as a table says that it is one
            roles = {"caption": "caption", "thead": "rowgroup", "tbody": "rowgroup", "tr": "row", "td": "cell"}
            assert table.attributes["role"] == "table"
            assert all(part.attributes.get("role") == roles[part.tag] for part in table.find() if part.tag in roles)
            headers = {"col": "columnheader", "row": "rowheader", "rowgroup": "rowheader"}
            assert all(part.attributes["role"] == headers[part.attributes["scope"]] for part in table.find("th"))


def test_the_same_run_gives_the_same_page(folder):
    pages = [page.write_page(folder, found_of(), list(FIGURES)).read_bytes() for _ in range(2)]
    assert pages[0] == pages[1]


def test_a_missing_or_broken_figure_is_refused_and_the_old_page_stays(folder, tmp_path, refused):
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    before = page.write_page(tmp_path, found_of(), list(FIGURES)).read_bytes()
    with refused("fig99"):
        page.write_page(tmp_path, found_of(), ["fig99_nothing"])
    (tmp_path / "fig08_source_noise.png").write_bytes(b"")
    with refused("fig08_source_noise.png", "PNG"):
        page.write_page(tmp_path, found_of(), list(FIGURES))
    (tmp_path / "fig04_enhanced_simulation.svg").unlink()
    with refused("fig04_enhanced_simulation.svg"):
        page.write_page(tmp_path, found_of(), list(FIGURES))
    assert (tmp_path / "report.html").read_bytes() == before
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize("value", VALUES)
def test_numbers_in_short(value):
    assert page.short(value) == VALUES[value]
