"""`docs/verdicts.md`: the earlier and the present verdict on each claim side by side, with the reason for what changed."""

import collections
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from enhsim_tf.common.atomic_files import replace_file
from enhsim_tf.reproduce.paper.judgements import NOT_TESTED
from enhsim_tf.reproduce.paper.over_seeds import of_most
from enhsim_tf.reproduce.publish.results import fill_parts, read_spread, short, titles_line

PATH, BEFORE = Path("docs") / "verdicts.md", Path("docs") / "verdicts_before.json"
REASONS = {
    "C1": "Ridge regression chooses its penalty by cross-validation over blocks of time, where it had a fixed one. On the same training windows its "
    "error is {ridge_nrmse} (before: {before_ridge_nrmse}), that of the mean of the nearest training windows {nearest_nrmse} and that of the "
    "network {nrmse}.",
    "C2": "The paper compares with the coarse simulator, and the earlier rule did not. Signal and noise take {cost_ratio} times as long as the coarse "
    "simulator alone (before: {before_cost_ratio}, measured on another day).",
    "C3": "The rule is the same; there are more seeds.",
    "C4": "The earlier rule looked at the end of training, which says nothing of the number of iterations that are needed. After 1,000 iterations "
    "the standard deviation of the noise is {sd_ratio} of the real one, after 2,000 {sd_ratio_at_end}.",
    "C5": "That the discriminator improves faster was not measured, and chance decided on the balance. It classifies {early_accuracy} of the rows "
    "correctly in the first half of training and {late_accuracy} in the second.",
    "C6": "The rule is the same; there are more seeds.",
    "C7": "The rule is the same; there are more seeds.",
    "C8": "One detector of three was enough for *holds in part*, while the report asked for every pair. Now half of them are needed, here and in the "
    "report. The criterion is met by {cases met} of 3 detectors.",
    "C9": "One mode of six was enough for *holds in part*. Now half of them are needed. The criterion is met in {cases met} of 6 modes.",
}
_SHARES = ("early_accuracy", "late_accuracy")  # written in per cent


def fill_verdicts(path: Path, before: Path, folder: Path) -> None:
    """Writes the generated parts of `docs/verdicts.md` between their markers.

    Args:
        path: The document; nothing is done where it does not exist.
        before: The earlier tolerances and verdicts.
        folder: Holds `results.json` of a full run and `spread.json`; nothing is done without further seeds.
    """
    found = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    spread = read_spread(folder, found)
    if not path.is_file() or spread is None:
        return
    earlier = json.loads(before.read_text(encoding="utf-8"))
    parts = {"verdicts": verdicts_table(found, spread, earlier), "rules": rules_table(found, earlier), "seeds": seeds_table(found, spread)}
    text = fill_parts(path.read_text(encoding="utf-8"), parts, path.name)
    with replace_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def verdicts_table(found: Mapping[str, Any], spread: Mapping[str, Any], earlier: Mapping[str, Any]) -> str:
    """Each claim with its earlier and present verdict by the number of seeds, and the reason."""
    lines = ["| | before | now | reason |", "|---|---|---|---|"]
    for claim in found["claims"]:
        name, was, now = claim["id"], earlier["claims"][claim["id"]], spread["claims"][claim["id"]]
        ranges = {key: _range(now["details"].get(key), key) for key in now["details"]}
        ranges |= {f"before_{key}": _range(about, key) for key, about in was["details"].items()}
        lines.append(f"| {name} | {_counted(was)} | **{_most(now)}** ({_counted(now)}) | {REASONS[name].format(**ranges)} |")
    seeds = spread["seeds"]
    said = f"Before: {len(earlier['seeds'])} seeds; now: {len(seeds)} seeds, {seeds[0]} to {seeds[-1]}; ranges are over seeds."
    return "\n".join(lines) + f"\n\n{said} {titles_line(found, spread)}"


def rules_table(found: Mapping[str, Any], earlier: Mapping[str, Any]) -> str:
    """The statistic and the tolerance of each claim whose rule changed, before and now."""
    lines = ["| | before | now |", "|---|---|---|"]
    for claim in found["claims"]:
        was = earlier["claims"][claim["id"]]
        if (was["statistic"], was["tolerance"]) != (claim["statistic"], claim["tolerance"]):
            lines.append(f"| {claim['id']} | {was['statistic']} ({was['tolerance']}) | {claim['statistic']} ({claim['tolerance']}) |")
    return "\n".join(lines)


def seeds_table(found: Mapping[str, Any], spread: Mapping[str, Any]) -> str:
    """The statistic of each claim and its verdict, seed by seed."""
    names = [claim["id"] for claim in found["claims"]]
    lines = ["| seed | " + " | ".join(names) + " |", "|---|" + "---|" * len(names)]
    for number, seed in enumerate(spread["seeds"]):
        cells = []
        for name in names:
            about = spread["claims"][name]
            cells.append(f"{short(about['values'][number])}, {_words(about)[number]}")
        lines.append(f"| {seed} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _words(about: Mapping[str, Any]) -> list[str]:
    """The verdict of each seed; of a claim that the paper does not test, whether it holds."""
    if set(about["verdicts"]) == {NOT_TESTED} and about.get("holds"):
        return list(about["holds"])
    return list(about["verdicts"])


def _most(about: Mapping[str, Any]) -> str:
    words = _words(about)
    return of_most(words) if words == about["verdicts"] else collections.Counter(words).most_common(1)[0][0]


def _counted(about: Mapping[str, Any]) -> str:
    counted = collections.Counter(_words(about)).most_common()
    return counted[0][0] if len(counted) == 1 else ", ".join(f"{number} {word}" for word, number in counted)


def _range(about: Sequence[float] | None, key: str) -> str:
    """A range such as `0.1 to 0.2`, or one number if both ends are written alike."""
    if about is None:
        return "–"
    ends = [f"{end:.1%}" if key in _SHARES else short(end) for end in about]
    return ends[0] if ends[0] == ends[1] else f"{ends[0]} to {ends[1]}"
