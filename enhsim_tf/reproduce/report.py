"""`report.html`: the whole run on one HTML page, which can be read offline.

The page is designed for screens, phones, printers and screen readers. Text and numbers come from `results.json`, and pictures
from the files that `figure.save` wrote to the same folder. The page contains no script and loads no other resource, and its
content security policy forbids both.
"""

import base64
import dataclasses
import itertools
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from enhsim_tf.common.atomic_files import replace_file
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.figure import Figure
from enhsim_tf.reproduce.paper.claims import changed
from enhsim_tf.reproduce.paper.figures import FIGURES
from enhsim_tf.reproduce.paper.judgements import NOT_MEASURED, NOT_REPRODUCED, NOT_TESTED, PARTLY, REPRODUCED
from enhsim_tf.reproduce.paper.over_seeds import title_verdict, verdict_over
from enhsim_tf.reproduce.results import PAPER, disagreement, read_spread, short, titles_line
from enhsim_tf.reproduce.settings import deviations

NAME = "report.html"
PIPELINE = "fig01_pipeline"
# icon and colour of each verdict in the style sheet; unknown verdicts are shown like those not measured
_KINDS = {REPRODUCED: "good", PARTLY: "half", NOT_REPRODUCED: "bad", NOT_TESTED: "open", NOT_MEASURED: "none"}
_CONTROL = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]"
)  # characters that are replaced by a question mark
_TYPES = {"png": "image/png", "svg": "image/svg+xml"}
_ORIGINS = {
    "paper": "from the paper’s text",
    "author": "from the author’s public code",
    "our": "choices of this project, each with its reason",
}


@dataclasses.dataclass(frozen=True)
class Picture:
    """A figure on the page.

    Args:
        name: One of `FIGURES`.
        number: Its number in the paper.
        title: Its caption.
        alt: Text alternative.
        width: Pixels of the PNG.
        height: Pixels of the PNG.
        png: The PNG as a data URI, to download.
        svg: The SVG as a data URI, to look at.
        size: Size of the download in words.
        claims: The claims that point to it.
    """

    name: str
    number: int
    title: str
    alt: str
    width: int
    height: int
    png: str
    svg: str
    size: str
    claims: list[Mapping[str, Any]]


def write_page(folder: Path, found: Mapping[str, Any], figures: Sequence[str]) -> Path:
    """Writes the HTML report of a run to the folder of its figures.

    Args:
        folder: Holds each figure as PNG and SVG, and `spread.json` where further seeds were run.
        found: What `results.json` holds.
        figures: Names of the figures, in the order of the page; the pipeline goes to its top.

    Returns:
        The path of the page.

    Raises:
        InputError: A figure is unknown, or one of its files is missing or no picture; an older page stays as it is.
    """
    folder = Path(folder)
    pictures = [_picture(folder, name, found["claims"]) for name in figures]
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,  # names of files and channels are untrusted input
        finalize=lambda value: _CONTROL.sub("?", value) if type(value) is str else value,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "short": short,
        "kind": lambda verdict: _KINDS.get(verdict, "none"),
    }
    rows, spread = deviations(), read_spread(folder, found)
    text = environment.get_template("report.html.jinja").render(
        found=found,
        changed=changed(found["claims"]),
        is_smoke=found["budget"] == "smoke",
        is_paper=found["source"] == PAPER,
        pipeline=next((picture for picture in pictures if picture.name == PIPELINE), None),
        pictures=[picture for picture in pictures if picture.name != PIPELINE],
        numbers={picture.name: picture.number for picture in pictures},
        widest=max((picture.width for picture in pictures), default=1),
        verdict=title_verdict(found["claims"], spread),
        spread=spread,
        differ={claim["id"]: disagreement(spread, claim["id"]) for claim in found["claims"]},
        verdict_of={claim["id"]: verdict_over(claim, spread) for claim in found["claims"]},
        titles=titles_line(found, spread) if spread else "",
        tally=_tally([verdict_over(claim, spread) for claim in found["claims"]], _KINDS),
        groups={name: list(group) for name, group in itertools.groupby(rows, lambda row: row["setting"].partition(".")[0])},
        num_settings=len(rows),
        origins=_tally([_origin(row["source"]) for row in rows], _ORIGINS),
        origin_words=_ORIGINS,
        ribbon=_ribbon(),
    )
    with replace_file(folder / NAME) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return folder / NAME


def _picture(folder: Path, name: str, claims: Sequence[Mapping[str, Any]], figures: Mapping[str, Figure] = FIGURES) -> Picture:
    """Reads the two files of a figure."""
    if name not in figures:
        raise InputError(f"Expected the name of a figure, such as {PIPELINE}. Received: {name!r}.")
    content = {}
    for kind in ("png", "svg"):
        path = folder / f"{name}.{kind}"
        if not path.is_file():
            raise InputError(f"Expected {name}.png and {name}.svg in {folder}. Received: no {path.name}. Draw the figure first.")
        content[kind] = path.read_bytes()
    if not content["png"].startswith(b"\x89PNG\r\n\x1a\n"):
        raise InputError(f"Expected a PNG in {folder / name}.png. Received: other content. Draw the figure again.")
    about = figures[name]
    width, height = (int.from_bytes(content["png"][at : at + 4], "big") for at in (16, 20))  # where a PNG keeps them
    uris = {kind: f"data:{words};base64," + base64.b64encode(content[kind]).decode() for kind, words in _TYPES.items()}
    shown = [claim for claim in claims if claim["figure"] == name]
    size = f"{len(content['png']) / 1000:,.0f} kB"
    return Picture(name, about.number, about.title, about.alt, width, height, uris["png"], uris["svg"], size, shown)


def _tally(words: Sequence[str], order: Mapping[str, str]) -> dict[str, int]:
    """The number of occurrences of each word, in the given order, without words that do not occur."""
    return {word: words.count(word) for word in [*order, *sorted(set(words) - set(order))] if word in words}


def _origin(source: str) -> str:
    """Where a setting comes from: `paper`, `author` or `our` (a choice of this project)."""
    return next(origin for origin in _ORIGINS if source.startswith(origin))


def _ribbon() -> dict[str, str]:
    """The pipeline as three curves (coarse, enhanced, with noise) on a drawing of 1,200 by 100, as SVG paths."""
    across = np.arange(0, 1201, 2)
    waves = [(0.5, np.sin(2 * np.pi * (across + 1) / 480)), (0.25, np.sin(2 * np.pi * (across + 1) / 120))]
    coarse, enhanced = (sum(amplitude * form(wave) for amplitude, wave in waves) for form in (np.sign, np.positive))
    noisy = enhanced + 0.08 * np.random.default_rng(0).standard_normal(len(across))
    paths = {}
    for part, (name, heights) in enumerate({"coarse": coarse, "enhanced": enhanced, "noisy": noisy}.items()):
        here = slice(200 * part, 200 * (part + 1) + 1)
        paths[name] = "M" + "L".join(f"{x} {50 - 50 * y:.1f}" for x, y in zip(across[here], heights[here], strict=True))
    return paths
