"""Text about the factorial experiment: its tables, its summary, and the last lines of the command."""

import dataclasses

from enhsim_tf.reproduce.caption import in_seeds
from enhsim_tf.reproduce.factorial.cells import CELLS, LEVELS, PAPER_CELL, WITHOUT_NETWORK
from enhsim_tf.reproduce.publish.wording import Findings, in_list, interval, per_cent, points

ALT = "Contribution of windows, extraction, enhancer and generator to the share of the gap that is closed"


def lines(found: Findings) -> list[str]:
    """The last lines that the command prints: how many cells there are, and the contributions for each generator."""
    said = [coverage(found)]
    for generator, about in found["shares"].items():
        closed = about["gap_closed"]
        parts_of = ", ".join(f"{factor} {points(each['share'])}" for factor, each in closed["factors"].items())
        said.append(f"{generator}: gap closed from {interval(closed['paper'])} to {interval(closed['switched'])}; points by {parts_of}")
    return said


def coverage(found: Findings) -> str:
    """How many runs were computed, and what the others are. A run is a cell in one environment and with one seed."""
    seeds = found["seeds"]
    said = (
        f"{found['num_cells']} of {found['of_cells']} runs (a cell, an environment and a seed; {in_seeds(seeds)}, {seeds[0]} to {seeds[-1]}, in "
        f"{len(found['environments'])} environments)"
    )
    return said if found["num_cells"] == found["of_cells"] else f"{said}; the command continues with the others"


def paper_cell(found: Findings) -> str:
    """What the paper's pipeline closes of the gap, with the number of detectors and seeds."""
    about = found["cells"][PAPER_CELL.name]
    return f"{per_cent(about['gap_closed'], 0)}, with {len(found['detectors'])} detectors and {in_seeds(about['seeds'])},"


def contributions(found: Findings) -> str:
    """The contribution of each factor, in a table with one column for each generator that replaces the paper's GAN."""
    shares = found["shares"]
    if not shares:
        return "No seed has all cells of a comparison yet."
    rows = [f"| points of the gap in false alarms closed by | {' | '.join(shares)} |", f"|---|{'---|' * len(shares)}"]
    ends = {"paper": "*the paper's pipeline*", "switched": "*all four switched*"}
    rows.append(f"| {ends['paper']} | {' | '.join(points(about['gap_closed']['paper']) for about in shares.values())} |")
    for factor, levels in LEVELS.items():
        change = f"{levels[0]} to {levels[1]}" if factor != "generator" else f"{levels[0]} to the column's"
        cells = [points(about["gap_closed"]["factors"][factor]["share"]) for about in shares.values()]
        rows.append(f"| {factor}: {change} | {' | '.join(cells)} |")
    rows.append(f"| {ends['switched']} | {' | '.join(points(about['gap_closed']['switched']) for about in shares.values())} |")
    rows.append(f"| seeds | {' | '.join(str(len(about['seeds'])) for about in shares.values())} |")
    return "\n".join(rows)


def by_environment(found: Findings) -> str:
    """The contributions of the main comparison in each environment, and the share of each factor in the difference between the two ends."""
    if not found["shares"]:
        return "No seed has all cells of a comparison yet."
    generator, about = next(iter(found["shares"].items()))
    names, closed = found["environments"], about["gap_closed"]
    parts = parts_of_difference(closed)
    rows = [f"| with {generator}, points | {' | '.join(names)} | share of the difference |", f"|---|{'---|' * len(names)}---|"]
    for factor, each in closed["factors"].items():
        rows.append(f"| {factor} | {' | '.join(points(each['by_environment'][name]) for name in names)} | {per_cent(parts[factor], 0)} |")
    return "\n".join(rows)


def contrasts_table(found: Findings) -> str:
    """The differences that the conclusions use, as far as their cells exist."""
    rows = ["| first | minus second | false alarms (points) | recall at the real rate (points) | seeds |", "|---|---|---|---|---|"]
    for about in found["contrasts"].values():
        differences = " | ".join(points(about[name]) for name in ("false_alarms", "recall_at_real_rate"))
        rows.append(f"| {about['first']} | {about['second']} | {differences} | {len(about['seeds'])} |")
    return "\n".join(rows)


def parts_of_difference(closed: Findings) -> dict[str, float]:
    """The share that each factor has in the difference between the two ends of a comparison; the shares add up to 1.

    Where the ends are equal, there is nothing to share, and every share is zero.

    Args:
        closed: The outcome `gap_closed` of a comparison.
    """
    difference = closed["switched"]["mean"] - closed["paper"]["mean"]
    if not difference:
        return dict.fromkeys(closed["factors"], 0.0)
    return {factor: about["share"]["mean"] / difference for factor, about in closed["factors"].items()}


def cells_table(found: Findings) -> str:
    """All cells in Markdown: false alarms with their interval, recall and the share of the gap closed."""
    names = found["environments"]
    rows = [
        f"| windows / extraction / enhancer / generator | false alarms | {' | '.join(names)} | recall | recall at the real rate | gap closed | C8's criterion met | seeds |",
        "|---|---|" + "---|" * len(names) + "---|---|---|---|---|",
    ]
    for name, about in found["cells"].items():
        each = " | ".join(per_cent(about["by_environment"][environment]["false_alarms"]["mean"]) for environment in names)
        rows.append(
            f"| {name} | {interval(about['false_alarms'])} | {each} | {per_cent(about['recall'])} | {per_cent(about['recall_at_real_rate'])} "
            f"| {per_cent(about['gap_closed'], 0)} | {about['kept']} of {about['pairs']} | {len(about['seeds'])} |"
        )
    return "\n".join(rows)


def page_part(found: Findings) -> str:
    """The figure of the page on what holds, if a comparison is complete, and its table."""
    shown = f"![{ALT}](../figures/factorial/contributions.png)\n\n" if found["shares"] else ""
    return shown + short_table(found)


def short_table(found: Findings) -> str:
    """The table of that page and of the report: the references, the paper's pipeline, the pipeline without networks, and the best cell of each generator."""
    cells = found["cells"]
    without = dataclasses.replace(WITHOUT_NETWORK, windows=LEVELS["windows"][0]).name, WITHOUT_NETWORK.name
    chosen = ["coarse", PAPER_CELL.name, *without]
    for generator in LEVELS["generator"]:
        measured = [name for name in cells if name in CELLS and CELLS[name].generator == generator]
        if measured:
            chosen.append(min(measured, key=lambda name: cells[name]["false_alarms"]["mean"]))
    chosen.append("real")
    rows = [
        "| windows / extraction / enhancer / generator | false alarms | recall at the real rate | gap closed | seeds |",
        "|---|---|---|---|---|",
    ]
    for name in dict.fromkeys(chosen):
        if name in cells:
            about = cells[name]
            closed, note = per_cent(about["gap_closed"], 0), " (no network)" if name in without else ""
            rows.append(
                f"| {name}{note} | {interval(about['false_alarms'])} | {per_cent(about['recall_at_real_rate'])} | {closed} | {len(about['seeds'])} |"
            )
    seeds = found["seeds"]
    so_far = "" if found["num_cells"] == found["of_cells"] else " among those that were computed"
    return "\n".join(rows) + (
        f"\n\nThe paper's pipeline, ridge regression with whole windows of its residuals, and the cell with the fewest false alarms for each generator"
        f"{so_far}. Means over {len(found['detectors'])} detectors ({in_list(found['detectors'])}), with 95 % intervals over environments and seeds "
        f"{seeds[0]} to {seeds[-1]}. From `figures/factorial/findings.json`."
    )


def ranking(found: Findings) -> str:
    """Says which factor contributes how much in the main comparison; empty while no comparison is complete."""
    if not found["shares"]:
        return ""
    generator, about = next(iter(found["shares"].items()))
    closed = about["gap_closed"]
    ranked = sorted(closed["factors"].items(), key=lambda each: -each[1]["share"]["mean"])
    parts = parts_of_difference(closed)
    said = "; ".join(
        [
            f"the {factor} {'accounts ' * (not number)}for {points(each['share'])} points, or {per_cent(parts[factor], 0)}"
            for number, (factor, each) in enumerate(ranked)
        ]
    )
    ends = [f"the {factor} {points(each['first']['mean'], 0)} or {points(each['last']['mean'], 0)}" for factor, each in ranked]
    return (
        f"If all four factors are switched, with {generator} in place of the paper's GAN ({in_seeds(about['seeds'])}), the share of the gap that is closed rises "
        f"from {per_cent(closed['paper']['mean'], 0)} to {per_cent(closed['switched']['mean'], 0)}. Of this difference, {said}. The factors interact: the "
        f"change in points if a factor is switched first or last is, for {in_list(ends)}."
    )
