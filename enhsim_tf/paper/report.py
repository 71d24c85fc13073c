"""What a run writes beside its figures: the box of verdicts, `results.json`, and the whole run on
one page, `report.html`.

The box has the same content on the terminal, in `results.json`, in the report and in the README:
for each claim the published verdict, which rests on many seeds and several readings, the verdict of
this run, and the measurement that decides.
"""

import base64
import dataclasses
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2
import matplotlib.image

from enhsim_tf.common.atomic_files import replace_file
from enhsim_tf.common.stages import VERSIONS
from enhsim_tf.paper.claims import NOT_MEASURED, NOT_REPRODUCED, OF_UNTESTED, PARTLY, REPRODUCED
from enhsim_tf.paper.figures import FIGURES
from enhsim_tf.paper.settings import Settings

PUBLISHED = Path(__file__).with_name("published.json")
UNDECIDED = "undecided"
# classes of the style sheet
_KINDS = {
    REPRODUCED: "good",
    PARTLY: "half",
    NOT_REPRODUCED: "bad",
    UNDECIDED: "open",
    NOT_MEASURED: "none",
}
_KINDS |= {words: _KINDS[verdict] for verdict, words in OF_UNTESTED.items()}
# of a setting, by the type of its value
_WORDS = {
    bool: {True: "yes", False: "no"}.get,
    str: str,
    int: "{:,}".format,
    float: "{:,g}".format,
}


def read_published() -> dict[str, Any]:
    """The published verdicts, which the study of readings writes.

    They are `title`, `basis` (what they rest on, in words) and `claims`: for each id `verdict`,
    `runs` (in how many it is reproduced, partly and not), `by_reading` (the same for each deciding
    reading), `decided_by` (what turns an undecided claim, or None) and `ranges` (for measurements
    with a limit the lowest and the highest value over these runs).
    """
    return json.loads(PUBLISHED.read_text(encoding="utf-8"))


def short(value: float) -> str:
    """A number with three significant digits; more if it would be rounded up to 1."""
    return (
        f"{value:,.0f}"
        if abs(value) >= 1_000
        else f"{value:.5f}"
        if 0.9995 <= value < 1
        else f"{value:.3g}"
    )


def needed(limit: Mapping[str, Any]) -> str:
    """The range of a limit."""
    low, high = (None if limit[end] is None else short(limit[end]) for end in ("low", "high"))
    return (
        f"from {low} to {high}" if low and high else f"at least {low}" if low else f"at most {high}"
    )


def box(records: Sequence[Mapping[str, Any]], published: Mapping[str, Any]) -> list[dict[str, str]]:
    """The rows of the box, for the records of `claims.judge_all` and the published verdicts."""
    rows = []
    for record in records:
        known = published["claims"][record["id"]]
        limit = record["deciding"]
        rows.append(
            {
                "claim": f"{record['id']} {record['short']}",
                "published": f"{known['verdict']} ({'/'.join(map(str, known['runs']))})",
                "this run": record["verdict"],
                "because": f"{limit['words']}: {short(limit['value'])}, needed {needed(limit)}"
                if limit
                else "",
            }
        )
    return rows


def as_text(rows: Sequence[Mapping[str, str]]) -> str:
    """A table for the terminal."""
    widths = {name: max(len(name), *(len(row[name]) for row in rows)) for name in rows[0]}
    lines = [
        [name.ljust(width) for name, width in widths.items()],
        ["-" * width for width in widths.values()],
    ]
    lines += [[row[name].ljust(width) for name, width in widths.items()] for row in rows]
    return "\n".join("  ".join(line).rstrip() for line in lines)


def decisions(settings: Settings | None = None) -> list[Mapping[str, str]]:
    """The table of decisions: for each setting its value, what paper and author say, the source,
    and the reason.
    """
    settings = settings or Settings()
    rows = []
    for field in dataclasses.fields(Settings):
        about = field.metadata
        value = getattr(settings, field.name)
        number = _WORDS[type(value)](value)
        words = {key: about[key] for key in ("paper", "author", "source", "why")}
        rows.append({"setting": field.name, "value": f"{number} {about['unit']}".strip(), **words})
    return rows


def results(
    records: Sequence[Mapping[str, Any]],
    title: str,
    settings: Settings,
    published: Mapping[str, Any],
    **about: Any,
) -> dict[str, Any]:
    """The content of `results.json`.

    Args:
        records: Records of the claims.
        title: The sign of this run.
        settings: All settings.
        published: Published verdicts.
        **about: What else is known of the run: `budget`, `seconds`, `stages`, `from_cache`.
    """
    return {
        "title": title,
        "published": published,
        "box": box(records, published),
        "claims": list(records),
        "seed": settings.seed,
        "settings": {row["setting"]: row["value"] for row in decisions(settings)},
        "versions": VERSIONS,
        **about,
    }


def write_page(folder: Path, found: Mapping[str, Any], settings: Settings) -> Path:
    """Writes `report.html` into the folder of the figures, from the content of `results.json`. It
    loads nothing and runs no script.
    """
    loader = jinja2.FileSystemLoader(Path(__file__).parent)
    environment = jinja2.Environment(
        loader=loader,
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"short": short, "needed": needed, "kind": _KINDS.get}
    pictures = [_picture(folder, name, found["claims"]) for name in FIGURES]
    rows = decisions(settings)
    text = environment.get_template("report.html.jinja").render(
        found=found,
        pictures=pictures,
        numbers={picture["name"]: picture["number"] for picture in pictures},
        widest=max(picture["width"] for picture in pictures),
        tally=Counter(record["verdict"] for record in found["claims"]),
        decisions=rows,
        sources=Counter(row["source"] for row in rows),
        is_smoke=found["budget"] == "smoke",
    )
    with replace_file(folder / "report.html") as temporary:
        temporary.write_text(text, encoding="utf-8")
    return folder / "report.html"


def _picture(folder: Path, name: str, records: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    height, width, _ = matplotlib.image.imread(folder / f"{name}.png").shape
    drawing = base64.b64encode((folder / f"{name}.svg").read_bytes()).decode()
    svg = f"data:image/svg+xml;base64,{drawing}"
    about = {key: getattr(FIGURES[name], key) for key in ("number", "title", "alt")}
    shown_by = [record for record in records if record["figure"] == name]
    return about | {"name": name, "width": width, "height": height, "svg": svg, "records": shown_by}
