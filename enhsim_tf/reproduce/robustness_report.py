"""What the experiment on robustness found, in words: the report in `docs/`, the README's table, the lines of the command.

No number is written here: each comes from the findings, and a test renders the report again from the tables.
"""

import csv
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from enhsim_tf.files import make_folder, replace_file
from enhsim_tf.reproduce.caption import in_seeds

Findings = Mapping[str, Any]
PATH = Path("docs") / "REPORT.md"
TABLES = (Path("docs") / "designs.csv", Path("docs") / "tries.csv")  # on the way to the second generator; where it misses a bar


def number(value: float, digits: int = 1) -> str:
    """A number with so many decimals; what rounds to nought has no sign."""
    return f"{round(value, digits) + 0.0:.{digits}f}"


def per_cent(value: float, digits: int = 1) -> str:
    """A share as per cent."""
    return f"{number(100 * value, digits)} %"


def interval(about: Mapping[str, float], digits: int = 1) -> str:
    """A mean of shares with its interval, in per cent."""
    mean, low, high = (number(100 * about[name], digits) for name in ("mean", "low", "high"))
    return f"{mean} % ({low} to {high})"


def p_value(value: float) -> str:
    """A p-value with one significant digit."""
    return f"{value:.1g}" if value >= 0.0001 else "below 0.0001"


def reached(is_reached: bool) -> str:
    """Whether a bar was reached."""
    return "reached" if is_reached else "**not reached**"


def share_c8(found: Findings, arm: str = "enhanced + GAN") -> tuple[int, int]:
    """In how many pairs of environment and detector an arm keeps the ledger's rule of claim C8, and of how many.

    False alarms are at most twice the real-trained rate plus a point, and recall is at most five points below the
    real-trained one.
    """
    kept, total = 0, 0
    for name in found["environments"]:
        given, real = (found["arms"][each]["by_environment"][name] for each in (arm, "real"))
        for detector, rate in real["detectors"].items():
            is_quiet = given["detectors"][detector] <= 2 * rate + 0.01
            kept += is_quiet and given["recalls"][detector] >= real["recalls"][detector] - 0.05
            total += 1
    return kept, total


def verdict_c8(found: Findings) -> str:
    """Verdict on claim C8, that detectors trained on the paper's output are robust: it holds where all pairs keep the rule."""
    kept, total = share_c8(found)
    return "holds" if kept == total else "holds in part" if kept else "does not hold"


def first_trial(found: Findings) -> str:
    """Whether the finding of the first trial is confirmed, environment by environment."""
    from enhsim_tf.reproduce.findings import EVERYTHING

    groups: dict[str, list[str]] = {"Confirmed": [], "In part": [], "Refuted": []}
    for name, about in found["alarms_on_everything"].items():
        word = "Confirmed" if about["replicates"] == about["of"] else "In part" if about["replicates"] else "Refuted"
        ends = dict.fromkeys(per_cent(about[end]) for end in ("low", "high"))  # one where they are the same
        groups[word].append(f"{name} ({about['replicates']} of {about['of']} replicates; {' to '.join(ends)})")
    said = [f"**{word}** on {', '.join(names)}" for word, names in groups.items() if names]
    return f"{'; '.join(said)}. Everything: at least {per_cent(EVERYTHING, 0)} of the windows."


def render(
    found: Findings,
    labelled: Findings | None = None,
    designs: Sequence[Mapping[str, str]] = (),
    tries: Sequence[Mapping[str, str]] = (),
    template: str = "robustness_report.md.jinja",
) -> str:
    """The report as Markdown.

    Args:
        found: The findings.
        labelled: Those of the study of real telemetry, or None where there was none.
        designs: Rows of what was tried on the way to the second generator, as `designs_of` reads them.
        tries: Those of what was tried where it misses a bar.
        template: Its template, beside this module.
    """
    import jinja2

    from enhsim_tf.reproduce import degraded_modes, findings, replicates

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
        "p_value": p_value,
        "reached": reached,
        "in_seeds": in_seeds,
        "share": share,
    }
    asked = [found["bars"][name] for name in findings.KINDS_OF_NOISE["Gaussian"] if name in found["bars"]]
    words = {
        "arms": replicates.ARMS,
        "methods": degraded_modes.METHODS,
        "noises": ["real", *(noise for pipeline in ("ours", "enhanced") for noise in _noises(pipeline, replicates.ARMS))],
        "contrasts": findings.CONTRASTS,
        "verdict_c8": verdict_c8(found),
        "first_trial": first_trial(found),
        "is_realistic": all(bar["measures_within"] == bar["num_measures"] for bar in asked),
    }
    return environment.get_template(template).render(
        found=found,
        labelled=labelled,
        designs=designs,
        tries=[_tried(row) for row in tries],
        words=words,
        c8=share_c8(found),
        c8_ours=share_c8(found, "ours + GAN"),
    )


def _noises(pipeline: str, arms: Iterable[str]) -> list[str]:
    """What the measures of realism judge of a pipeline: what its generators learn from, and what they make of it."""
    return [f"{pipeline}: extracted", *(arm for arm in arms if arm.startswith(f"{pipeline} + "))]


def findings_of(root: Path, name: str) -> Findings | None:
    """The findings that a project keeps of an experiment, or None.

    Args:
        root: Folder of the project.
        name: `robustness` or `labelled`.
    """
    path = root / "figures" / name / "findings.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None


def designs_of(path: Path) -> list[dict[str, str]]:
    """The rows of a table of designs that were tried, a row a training; none where there is no such file."""
    if not path.is_file():
        return []
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def _tried(row: Mapping[str, str]) -> dict[str, Any]:
    """A row of the tries as the report shows it: how many measures are within twice their floor, and which is furthest."""
    from enhsim_tf.realism import MEASURES
    from enhsim_tf.reproduce.findings import LARGEST_RATIO

    ratios = {measure.name: float(row[measure.name]) for measure in MEASURES}
    worst = max(ratios, key=ratios.__getitem__)
    within = sum(ratio <= LARGEST_RATIO for ratio in ratios.values())
    return {**row, "within": within, "number": len(ratios), "worst": worst, "largest": number(ratios[worst])}


def share(text: str) -> str:
    """A share of the table of designs in per cent; nothing where it was not measured."""
    return per_cent(float(text)) if text else ""


def report(found: Findings, root: Path) -> None:
    """Writes the report and the README's part on the experiment; each only where it exists or may be made.

    Args:
        found: The findings of a full run.
        root: Folder of the project.
    """
    from enhsim_tf.reproduce import labelled_run
    from enhsim_tf.reproduce.report import fill_parts

    labelled = findings_of(root, "labelled")
    make_folder(root / PATH.parent)
    with replace_file(root / PATH) as temporary:
        temporary.write_text(render(found, labelled, *(designs_of(root / path) for path in TABLES)), encoding="utf-8")
    parts = {"robustness": table(found)} | ({} if labelled is None else {"labelled": labelled_run.table(labelled)})
    readme = root / "README.md"
    if readme.is_file():
        text = readme.read_text(encoding="utf-8")
        parts = {name: part for name, part in parts.items() if f"<!-- {name}: generated -->" in text}
        with replace_file(readme) as temporary:
            temporary.write_text(fill_parts(text, parts, readme.name), encoding="utf-8")


def table(found: Findings) -> str:
    """The README's table: false alarms by arm and environment, and recall."""
    names = found["environments"]
    lines = [
        f"| trained on | {' | '.join(names)} | recall | gap closed |",
        f"|---|{'---|' * len(names)}---|---|",
    ]
    for arm, about in found["arms"].items():
        cells = [interval(about["by_environment"][name]["false_alarms"]) for name in names]
        closed = "" if about["gap_closed"] is None else f"{100 * about['gap_closed']:.0f} %"
        lines.append(f"| {arm} | {' | '.join(cells)} | {per_cent(about['recall'])} | {closed} |")
    seeds = found["seeds"]
    return "\n".join(lines) + (
        f"\n\nFalse alarms on {found['num_windows']:,} real nominal windows, mean over seven detectors set for 1 %, with its 95 % interval over "
        f"{in_seeds(seeds)} ({seeds[0]} to {seeds[-1]}); recall at the arm's own threshold, mean over eight kinds of anomaly and five "
        "severities; gap closed: share of the way from *enhanced* to *real*, mean over replicates. "
        "From `figures/robustness/findings.json`."
    )


def verdict_lines(found: Findings) -> list[str]:
    """What the command says at its end."""
    kept, total = share_c8(found)
    lines = [
        f"C8  {verdict_c8(found)}: with the paper's generated noise, false alarms and recall are near the real-trained ones "
        f"in {kept} of {total} pairs of environment and detector"
    ]
    for name, bar in found["bars"].items():
        words = {True: "reached", False: "not reached"}[bar["excess_reached"] and bar["recall_reached"]]
        lines.append(
            f"    {name:15} second generator: excess of false alarms {interval(bar['excess'])}, recall lost {interval(bar['recall_lost'])}: {words}"
        )
    return lines
