"""The results as text: a line of the terminal's table, and the README's table."""

from pathlib import Path

from benchmarks.rows import reproduction
from enhsim_tf.files import replace_file
from enhsim_tf.reproduce.report import fill_parts


def line_of(row: dict) -> str:
    """A row of the table."""
    if "skipped" in row:
        return f"{row['work']:60} {row['comparison']:28} skipped: {row['skipped']}"
    if "growth" in row:
        ends = [", ".join(f"{key} {value:.4g}" for key, value in each.items() if not isinstance(value, dict)) for each in row["growth"]]
        return "\n    ".join([row["work"], *ends])
    ours, unit, ratio = row["ours"], row["unit"], row["ratio"]
    bar = f"<= {row['bar']:.2f}" if row.get("bar") else f"< {row['bar_s']} s" if "bar_s" in row else ""
    words = {True: "reached", False: "NOT REACHED", None: ""}[row["reached"]]
    measured = f"{ours['median']:8.3g} {unit:2}  {ratio['median']:5.2f} ({ratio['low']:.2f} to {ratio['high']:.2f})"
    return f"{row['work']:60} {row['comparison']:28} {measured:32} {bar:8} {words}"


def markdown(results: dict) -> str:
    """The comparisons as a Markdown table, with the machine they were measured on."""
    lines = ["| work | ours | compared with | ours / theirs: median (range) | bar | |", "|---|---|---|---|---|---|"]
    for row in results["rows"]:
        if "skipped" in row:
            lines.append(f"| {row['work']} | | {row['comparison']} | skipped: {row['skipped']} | | |")
        elif "ratio" in row and "bar_s" not in row:
            ratio, bar = row["ratio"], f"at most {row['bar']:.2f}" if row["bar"] else ""
            words = {True: "reached", False: "**not reached**", None: ""}[row["reached"]]
            figures = f"{row['ours']['median']:.3g} {row['unit']} | {row['comparison']} | {ratio['median']:.2f} ({ratio['low']:.2f} to {ratio['high']:.2f})"
            lines.append(f"| {row['work']} | {figures} | {bar} | {words} |")
        elif "bar_s" in row:
            words = "reached" if row["reached"] else "**not reached**"
            lines.append(f"| {row['work']} | {row['ours']['median']:.2g} s | | | below {row['bar_s']} s | {words} |")
    machine = results["machine"]
    return "\n".join(lines) + f"\n\n{machine['cores']} cores, TensorFlow {machine['tensorflow']}. From `benchmarks/results.json`."


def with_words(rows: list[dict]) -> list[dict]:
    """Kept rows with what is put together from the others put together anew: the same numbers, in today's words."""
    measured = [row for row in rows if row.get("of") != "reproduction"]
    return measured + [{"of": "reproduction", **row} for row in reproduction(measured)]


def fill_readme(path: Path, results: dict) -> None:
    """Writes the table between the README's speed markers."""
    text = path.read_text(encoding="utf-8")
    with replace_file(path) as temporary:
        temporary.write_text(fill_parts(text, {"speed": markdown(results)}, path.name), encoding="utf-8")
