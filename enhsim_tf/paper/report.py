"""What a run writes beside its figures: the box of verdicts, `results.json`, and the whole run on one page, `report.html`.

The box has the same content on the terminal, in `results.json`, in the report and in the README: for each claim the published verdict,
which rests on many seeds and several readings, the verdict of this run, and the measurement that decides.
"""

import base64
import importlib.metadata
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from enhsim_tf.common.atomic_files import replace_file
from enhsim_tf.paper.claims import CHANGES, NOT_MEASURED, NOT_REPRODUCED, OF_UNTESTED, PARTLY, REPRODUCED
from enhsim_tf.paper.figures import FIGURES, KINDS
from enhsim_tf.paper.settings import Settings, decisions

PUBLISHED = Path(__file__).with_name("published.json")
UNDECIDED = "undecided"
_KINDS = {REPRODUCED: "good", PARTLY: "half", NOT_REPRODUCED: "bad", UNDECIDED: "open", NOT_MEASURED: "none"}  # classes of the style sheet
_KINDS |= {words: _KINDS[verdict] for verdict, words in OF_UNTESTED.items()}
_TYPES = {"png": "image/png", "svg": "image/svg+xml"}


def read_published(path: Path = PUBLISHED) -> dict[str, Any] | None:
    """The published verdicts, which the study of readings writes; None if there are none yet.

    They are `title`, `basis` (what they rest on, in words) and `claims`: for each id `verdict`, `agreeing` and `of` (numbers of runs of
    the reference), `decided_by` (the reading that decides an undecided claim, or None) and `ranges` (for each measurement the lowest and
    the highest value over seeds and processors).
    """
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None


def short(value: float) -> str:
    """A number with three significant digits."""
    return f"{value:,.0f}" if abs(value) >= 1_000 else f"{value:.3g}"


def needed(limit: Mapping[str, Any]) -> str:
    """The range of a limit."""
    low, high = (None if limit[end] is None else short(limit[end]) for end in ("low", "high"))
    return f"from {low} to {high}" if low and high else f"at least {low}" if low else f"at most {high}"


def box(records: Sequence[Mapping[str, Any]], published: Mapping[str, Any] | None) -> list[dict[str, str]]:
    """The rows of the box.

    Args:
        records: Records of `claims.judge_all`.
        published: Published verdicts, or None.
    """
    rows = []
    for record in records:
        known, limit = (published or {"claims": {}})["claims"].get(record["id"]), record["deciding"]
        rows.append(
            {
                "claim": f"{record['id']} {record['short']}",
                "published": f"{known['verdict']}, {known['agreeing']} of {known['of']} runs" if known else "-",
                "this run": record["verdict"],
                "because": f"{limit['words']}: {short(limit['value'])}, needed {needed(limit)}" if limit else "",
            }
        )
    return rows


def as_text(rows: Sequence[Mapping[str, str]]) -> str:
    """A table for the terminal."""
    widths = {name: max(len(name), *(len(row[name]) for row in rows)) for name in rows[0]}
    lines = [[name.ljust(width) for name, width in widths.items()], ["-" * width for width in widths.values()]]
    lines += [[row[name].ljust(width) for name, width in widths.items()] for row in rows]
    return "\n".join("  ".join(line).rstrip() for line in lines)


def results(
    records: Sequence[Mapping[str, Any]], title: str, settings: Settings, published: Mapping[str, Any] | None, **about: Any
) -> dict[str, Any]:
    """The content of `results.json`.

    Args:
        records: Records of the claims.
        title: The sign of this run.
        settings: All settings.
        published: Published verdicts, or None.
        **about: What else is known of the run: `budget`, `seconds`, `stages`, `from_cache`, `telemetry`, `command`.
    """
    packages = ("tensorflow", "keras", "numpy", "pandas", "scikit-learn")
    return {
        "title": title,
        "published": {name: (published or {}).get(name) for name in ("title", "basis", "claims")},
        "box": box(records, published),
        "claims": list(records),
        "seed": settings.seed,
        "settings": {row["setting"]: row["value"] for row in decisions(settings)},
        "versions": {name: importlib.metadata.version(name) for name in packages},
        **about,
    }


def write_page(folder: Path, found: Mapping[str, Any], settings: Settings) -> Path:
    """Writes `report.html`, which loads nothing and runs no script.

    Args:
        folder: Folder of the figures.
        found: The content of `results.json`.
        settings: All settings.

    Returns:
        The path of the page.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "short": short,
        "needed": needed,
        "kind": _KINDS.get,
        "first_word": lambda words: words.split()[0].split("'")[0].lower(),
    }
    pictures, rows = [_picture(folder, name, found["claims"]) for name in FIGURES], decisions(settings)
    text = environment.get_template("report.html.jinja").render(
        found=found,
        pictures=pictures,
        numbers={picture["name"]: picture["number"] for picture in pictures},
        widest=max(picture["width"] for picture in pictures),
        tally=_tally([record["verdict"] for record in found["claims"]]),
        decisions=rows,
        sources=_tally([row["source"] for row in rows]),
        changes=CHANGES,
        ribbon=_ribbon(),
        is_smoke=found["budget"] == "smoke",
        is_paper=found["telemetry"] == "the paper's example",
    )
    with replace_file(folder / "report.html") as temporary:
        temporary.write_text(text, encoding="utf-8")
    return folder / "report.html"


def _picture(folder: Path, name: str, records: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    content = {kind: (folder / f"{name}.{kind}").read_bytes() for kind in KINDS}
    width, height = (int.from_bytes(content["png"][at : at + 4], "big") for at in (16, 20))  # where a PNG keeps them
    about = {
        "name": name,
        "number": FIGURES[name].number,
        "title": FIGURES[name].title,
        "alt": FIGURES[name].alt,
        "width": width,
        "height": height,
    }
    data = {kind: f"data:{_TYPES[kind]};base64,{base64.b64encode(content[kind]).decode()}" for kind in KINDS}
    return about | data | {"records": [record for record in records if record["figure"] == name]}


def _tally(words: Sequence[str]) -> dict[str, int]:
    return {word: words.count(word) for word in dict.fromkeys(words)}


def _ribbon() -> dict[str, str]:
    """The pipeline as three curves (coarse, enhanced, with noise) on a drawing of 1,200 by 100, as SVG paths."""
    across = np.arange(0, 1201, 2)
    waves = [(0.5, np.sin(2 * np.pi * (across + 1) / 480)), (0.25, np.sin(2 * np.pi * (across + 1) / 120))]
    coarse, enhanced = (sum(size * form(wave) for size, wave in waves) for form in (np.sign, np.positive))
    noisy = enhanced + 0.08 * np.random.default_rng(0).standard_normal(len(across))
    paths = {}
    for part, (name, heights) in enumerate({"coarse": coarse, "enhanced": enhanced, "noisy": noisy}.items()):
        here = slice(200 * part, 200 * (part + 1) + 1)
        paths[name] = "M" + "L".join(f"{x} {50 - 50 * y:.1f}" for x, y in zip(across[here], heights[here], strict=True))
    return paths
