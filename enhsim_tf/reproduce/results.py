"""Results of a run: the table on the terminal and `results.json`."""

import collections
import json
import math
import platform
import shutil
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from enhsim_tf.common.stages import VERSIONS
from enhsim_tf.reproduce.paper.over_seeds import is_tie, title_verdict, titles_of_seeds
from enhsim_tf.reproduce.paper.pipeline import Experiment

_SPEED = "C2"
_REACH = 0.5  # of the width of the range over seeds: farther outside of it, a value is that of another version of the code
PAPER = "the paper's example"  # what `results.json` names as the source where no file of real telemetry is


def results(experiment: Experiment, claims: list[dict], drawn_s: float, total_s: float) -> dict[str, Any]:
    """All results of a run, as stored in `results.json`. The time of each stage is that of its original run.

    Args:
        experiment: What was run.
        claims: The judged claims.
        drawn_s: Seconds that the figures took.
        total_s: Seconds that this run took.
    """
    stages = experiment.stages
    timings = stages.seconds | {"figures": drawn_s}
    return {
        "budget": experiment.settings.budget,
        "seed": experiment.settings.seed,
        "source": PAPER if experiment.is_paper else experiment.source.path.name,
        "verdict": title_verdict(claims),
        "versions": {"python": platform.python_version(), **VERSIONS},
        "claims": claims,
        "timings": {name: round(seconds, 2) for name, seconds in timings.items()},
        "from_cache": [name for name, cached in stages.cached.items() if cached],
        "this_run_s": round(total_s, 2),
    }


def table(claims: list[dict]) -> str:
    """The claims as a table that fits the width of the terminal."""
    width = max(60, min(shutil.get_terminal_size((120, 24)).columns, 140))
    lines = []
    for claim in claims:
        lines.append(f"{claim['id']}  {claim['verdict']:24}  {claim['statistic']}: {short(claim['value'])} ({claim['tolerance']})")
        lines += textwrap.wrap(claim["finding"], width, initial_indent="    ", subsequent_indent="    ")
    return "\n".join(lines)


def read_spread(folder: Path, found: Mapping[str, Any]) -> dict[str, Any] | None:
    """The ranges and verdicts over further seeds, with this run's own in the place of those that its seed had before.

    Those of another budget or of an older run say nothing of this one. On another processor, training rounds differently and a value
    changes as it does from seed to seed; the run is taken for an older one if its first value is farther outside of the range over
    seeds than half of the width of that range. A speed is of one machine at one time and has no range over seeds.

    Args:
        folder: Holds `spread.json`, if further seeds were run.
        found: The results of this run.

    Returns:
        The contents of `spread.json` with this run's values, or None if there is none that belongs to this run.
    """
    path = folder / "spread.json"
    spread = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None
    if spread is None or spread["budget"] != found["budget"] or found["seed"] not in spread["seeds"]:
        return None
    first, here = found["claims"][0], spread["seeds"].index(found["seed"])
    if {claim["id"] for claim in found["claims"]} != set(spread["claims"]):
        return None
    known = _known(spread["claims"][first["id"]])
    if first["value"] is None or not known or not _is_near(first["value"], min(known), max(known)):
        return None
    for claim in found["claims"]:
        over = spread["claims"][claim["id"]]
        over["holds"] = _holds(over)
        over["values"][here], over["verdicts"][here], over["holds"][here] = claim["value"], claim["verdict"], claim.get("holds")
        values = _known(over)
        over["range"] = [min(values), max(values)] if values and claim["id"] != _SPEED else None
    return spread


def _known(about: Mapping[str, Any]) -> list[float]:
    return [value for value in about["values"] if value is not None]


def _is_near(value: float, low: float, high: float) -> bool:
    reach = _REACH * (high - low)
    return low - reach <= value <= high + reach or short(value) in (short(low), short(high))


def disagreement(spread: Mapping[str, Any] | None, claim_id: str) -> str:
    """The number of seeds with each verdict, if seeds differ; otherwise an empty string.

    Of a claim that the paper does not test, what holds here is counted.
    """
    about = spread["claims"][claim_id] if spread is not None else {"verdicts": []}
    counted = collections.Counter(holds or name for name, holds in zip(about["verdicts"], _holds(about), strict=True))
    return ", ".join(f"{number} {name}" for name, number in counted.most_common()) if len(counted) > 1 else ""


def _holds(about: Mapping[str, Any]) -> list[str | None]:
    return about.get("holds") or [None] * len(about["verdicts"])


def titles_line(found: Mapping[str, Any], spread: Mapping[str, Any]) -> str:
    """Sentences on the verdict in the title: by most seeds, by each seed alone, and on which claims the seeds are divided equally."""
    alone = collections.Counter(titles_of_seeds(found["claims"], spread))
    counted = ", ".join(f"{number} {'gives' if number == 1 else 'give'} {title}" for title, number in alone.most_common())
    ties = [claim["id"] for claim in found["claims"] if is_tie(spread["claims"][claim["id"]]["verdicts"])]
    divided = f" On {', '.join(ties)} the seeds are divided equally, and the worse verdict counts." if ties else ""
    return (
        f"Of {len(spread['seeds'])} seeds, each judged alone, {counted}. With the verdict of most seeds for each claim, the title is "
        f"{title_verdict(found['claims'], spread)}.{divided}"
    )


def short(value: float | None) -> str:
    """A number with three significant digits, or without decimals from 1,000 on; a dash if there is no number."""
    if value is None or not math.isfinite(value):
        return "–"
    return f"{value:.3g}" if abs(value) < 999.5 else f"{value:,.0f}"
