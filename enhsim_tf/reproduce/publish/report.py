"""Writes the report on robustness and its tables in `docs/`, the generated parts of other pages and the last lines of the command.

All numbers come from the findings. A test renders the report again from the tables and compares.
"""

import csv
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from enhsim_tf.common.atomic_files import make_folder, replace_file
from enhsim_tf.reproduce.caption import in_seeds
from enhsim_tf.reproduce.publish import factorial_text, practice
from enhsim_tf.reproduce.publish.objections import objections
from enhsim_tf.reproduce.publish.wording import (
    Findings,
    interval,
    mean_of,
    number,
    p_value,
    per_cent,
    points,
    reached,
    share,
    share_c8,
    tries_found,
    verdict_c8,
    words,
)
from enhsim_tf.reproduce.spacecraft.residual import TABLE, residual_table, summarise

PATHS = {"report.md.jinja": Path("docs") / "REPORT.md", "report_tables.md.jinja": Path("docs") / "REPORT_TABLES.md"}
"""The files of the report by template: the text, and its tables."""
TABLES = (Path("docs") / "designs.csv", Path("docs") / "tries.csv")  # designs tried before and after the targets were tested


def render(
    found: Findings,
    labelled: Findings | None = None,
    designs: Sequence[Mapping[str, str]] = (),
    tries: Sequence[Mapping[str, str]] = (),
    timing: Findings | None = None,
    factorial: Findings | None = None,
    curve: Findings | None = None,
    noise: Findings | None = None,
    battery: Findings | None = None,
    template: str = "report.md.jinja",
) -> str:
    """The report, or the file of its tables, as Markdown.

    Args:
        found: The findings.
        labelled: The findings of the study of real telemetry, or None if it was not run.
        designs: Designs that were tried during the development of the convolutional GAN, as `designs_of` reads them.
        tries: Designs that were tried where the convolutional GAN misses a target.
        timing: The benchmark of its training iteration, as `timing_of` reads it.
        factorial: The findings of the factorial experiment, or None if it was not run.
        curve: The findings of the experiment on the number of real windows, or None if it was not run.
        noise: The findings of the experiment on noise, or None if it was not run.
        battery: The findings of the study of a battery, or None if it was not run.
        template: One of `PATHS`.
    """
    import jinja2

    from enhsim_tf.reproduce.settings import make_settings

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {
        "per_cent": per_cent,
        "interval": interval,
        "points": points,
        "p_value": p_value,
        "reached": reached,
        "in_seeds": in_seeds,
        "share": share,
        "mean_of": mean_of,
        "capitalise": lambda text: text[:1].upper() + text[1:],
    }
    answered = practice.answers(found, factorial, labelled, curve, battery)
    settings, tried = make_settings(found["budget"]), [_tried(row) for row in tries]
    return environment.get_template(template).render(
        found=found,
        labelled=labelled,
        quietest=labelled and quietest(labelled),
        factorial=factorial,
        factorial_text=factorial_text,
        practice=practice.short(answered),
        evidence=practice.evidence(answered),
        objections=objections(found, factorial, labelled, noise),
        designs=designs,
        tries=tried,
        tries_found=tries_found(tried),
        timing=timing,
        controls=found["negative_controls"],
        settings=settings,
        words=words(found, settings),
        c8=share_c8(found),
        c8_residual=share_c8(found, "residual + convolutional GAN"),
    )


def quietest(labelled: Findings) -> str:
    """The arm with generated noise that has the fewest false alarms in the study of real telemetry."""
    arms = labelled["arms"]
    return min((name for name in arms if " + " in name), key=lambda name: arms[name]["false_alarms"]["mean"])


def render_all(root: Path, found: Findings) -> dict[Path, str]:
    """The files of the report, rendered with everything that the project stores.

    Args:
        root: Folder of the project.
        found: The findings on robustness.
    """
    others = (findings_of(root, name) for name in ("factorial", "learning_curve", "noise", "battery"))
    stored = findings_of(root, "labelled"), *(designs_of(root / path) for path in TABLES), timing_of(root), *others
    return {path: render(found, *stored, template=template) for template, path in PATHS.items()}


def findings_of(root: Path, name: str) -> Findings | None:
    """The findings of an experiment that are stored in the project, or None.

    Args:
        root: Folder of the project.
        name: Name of the experiment's folder of figures. With `labelled` come the rows of the residual detector, as `residual`.
    """
    path = root / "figures" / name / "findings.json"
    found = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None
    residual = path.parent / TABLE
    if found is not None and name == "labelled" and residual.is_file():
        import pandas as pd

        found["residual"] = {row["detector"]: row for row in summarise(pd.read_csv(residual)).to_dict("records")}
    return found


def designs_of(path: Path) -> list[dict[str, str]]:
    """The rows of a table of designs that were tried, one row per training; empty if there is no such file."""
    if not path.is_file():
        return []
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def timing_of(root: Path) -> Findings | None:
    """The benchmark of a training iteration of the convolutional GAN: `ratio`, `bar` and `reached`; or None."""
    path = root / "benchmarks" / "results.json"
    rows = json.loads(path.read_text(encoding="utf-8"))["rows"] if path.is_file() else []
    return next((row for row in rows if row["of"] == "second"), None)


def _tried(row: Mapping[str, str]) -> dict[str, Any]:
    """A row of the tries as the report shows it, with the number of measures within twice their baseline and the largest ratio."""
    from enhsim_tf.realism.real_floor import MEASURES
    from enhsim_tf.reproduce.robustness.targets import LARGEST_RATIO

    ratios = {measure.name: float(row[measure.name]) for measure in MEASURES}
    worst = max(ratios, key=ratios.__getitem__)
    within = sum(ratio <= LARGEST_RATIO for ratio in ratios.values())
    return {**row, "within": within, "number": len(ratios), "worst": worst, "largest": number(ratios[worst])}


def report(found: Findings, root: Path) -> None:
    """Writes the report, and the generated parts of the pages that exist.

    Args:
        found: The findings of a full run.
        root: Folder of the project.
    """
    from enhsim_tf.reproduce.publish.results import fill_pages
    from enhsim_tf.reproduce.spacecraft import run

    labelled, factorial, curve, battery = (findings_of(root, name) for name in ("labelled", "factorial", "learning_curve", "battery"))
    for path, text in render_all(root, found).items():
        make_folder(root / path.parent)
        with replace_file(root / path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    parts = {"practice": practice.short(practice.answers(found, factorial, labelled, curve, battery)), "robustness": table(found)}
    if labelled is not None:
        parts["labelled"] = run.table(labelled)
        parts["residual"] = residual_table(labelled.get("residual", {}))
    if factorial is not None:
        parts["factorial"] = factorial_text.page_part(factorial)
    fill_pages(root, parts)


def table(found: Findings) -> str:
    """The table of the page on what holds: false alarms by arm and environment, and recall."""
    from enhsim_tf.detection.anomalies import INJECTIONS, SEVERITIES
    from enhsim_tf.detection.registry import DETECTORS
    from enhsim_tf.reproduce.settings import make_settings

    names = found["environments"]
    lines = [
        f"| trained on | {' | '.join(names)} | recall | gap closed |",
        f"|---|{'---|' * len(names)}---|---|",
    ]
    for arm, about in found["arms"].items():
        cells = [interval(about["by_environment"][name]["false_alarms"]) for name in names]
        lines.append(f"| {arm} | {' | '.join(cells)} | {per_cent(about['recall'])} | {per_cent(about['gap_closed'], 0)} |")
    seeds, rate = found["seeds"], make_settings(found["budget"]).robustness.false_alarm_rate
    return "\n".join(lines) + (
        f"\n\nFalse alarms on {found['num_windows']:,} nominal windows of the example telemetry that stands in for real telemetry: mean over {len(DETECTORS)} detectors "
        f"whose thresholds are set for {per_cent(rate, 0)}, with its 95 % interval over {in_seeds(seeds)} ({seeds[0]} to {seeds[-1]}) and blocks of time. *Recall* is "
        f"measured at the arm's own threshold, as the mean over {len(INJECTIONS)} kinds of anomaly and {len(SEVERITIES)} severities. *Gap closed* is the share of the "
        "difference in false-alarm rate between *coarse* and *real* that the arm removes, as the mean over replicates. "
        "From `figures/robustness/findings.json`."
    )


def verdict_lines(found: Findings) -> list[str]:
    """The last lines that the command prints."""
    kept, total = share_c8(found)
    lines = [
        f"C8  {verdict_c8(found)}: with noise of the paper's GAN, false alarms and recall are near those of training on real telemetry "
        f"in {kept} of {total} pairs of environment and detector"
    ]
    for name, bar in found["bars"].items():
        words = {True: "reached", False: "not reached"}[bar["excess_reached"] and bar["recall_reached"] and bar["autoregression_reached"]]
        lines.append(
            f"    {name:15} convolutional GAN: against training on real telemetry, false alarms {points(bar['excess'])} points, "
            f"recall {points(bar['recall_difference'])} points: {words}"
        )
    return lines
