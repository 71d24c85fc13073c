"""Formats the results as text, for the terminal and for the table of docs/speed.md."""

from pathlib import Path

from benchmarks.rows import bar_of_reproduction, reproduction
from book.tables import fill_parts
from enhsim_tf.common.atomic_files import replace_file


def line_of(row: dict) -> str:
    """Formats a row for the terminal."""
    if "skipped" in row:
        return f"{row['work']:60} {row['comparison']:28} skipped: {row['skipped']}"
    if "growth" in row:
        ends = [", ".join(f"{key} {value:.4g}" for key, value in each.items() if not isinstance(value, dict)) for each in row["growth"]]
        return "\n    ".join([row["work"], *ends])
    if "bar_faults" in row:
        words = "reached" if row["reached"] else "NOT REACHED"
        return f"{row['work']:60} {row['faults']:,} faults in {row['seconds']:.0f} s, <= {row['bar_faults']:,} {words}"
    ours, unit, ratio = row["ours"], row["unit"], row["ratio"]
    bar = f"<= {row['bar']:.2f}" if row.get("bar") else f"< {row['bar_s']} s" if "bar_s" in row else ""
    words = {True: "reached", False: "NOT REACHED", None: ""}[row["reached"]]
    measured = f"{ours['median']:8.3g} {unit:2}  {ratio['median']:5.2f} ({ratio['low']:.2f} to {ratio['high']:.2f})"
    return f"{row['work']:60} {row['comparison']:28} {measured:32} {bar:8} {words}"


def markdown(results: list[dict]) -> str:
    """Formats the comparisons as Markdown tables, one for each result file, with the description of the machine."""
    return "\n\n".join(_table(each) for each in results)


def _table(results: dict) -> str:
    lines = [
        "| work | enhsim_tf | compared with | time of enhsim_tf / comparison: median (range) | target | | page faults, enhsim_tf / comparison |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in results["rows"]:
        work = f"{row['work']} *" if "machine" in row else row["work"]
        words = {True: "reached", False: "**not reached**", None: ""}[row.get("reached")]
        if "skipped" in row:
            lines.append(f"| {work} | | {row['comparison']} | skipped: {row['skipped']} | | | |")
        elif "bar_faults" in row:
            lines.append(f"| {work} | {row['seconds']:.0f} s | | | at most {row['bar_faults']:,} | {words} | {row['faults']:,} |")
        elif "ratio" in row and "bar_s" not in row:
            ratio, bar = row["ratio"], f"at most {row['bar']:.2f}" if row["bar"] else ""
            faults = " / ".join(_few(row[key]) for key in ("faults", "their_faults") if key in row)
            figures = f"{row['ours']['median']:.3g} {row['unit']} | {row['comparison']} | {ratio['median']:.2f} ({ratio['low']:.2f} to {ratio['high']:.2f})"
            lines.append(f"| {work} | {figures} | {bar} | {words} | {faults} |")
        elif "bar_s" in row:
            lines.append(f"| {work} | {row['ours']['median']:.2g} s | | | below {row['bar_s']} s | {words} | |")
    others = {machine_in_words(row["machine"]) for row in results["rows"] if "machine" in row}
    marked = "".join(f" Rows with * were measured on another processor: {words}" for words in sorted(others))
    about = results["machine"]
    return "\n".join(lines) + f"\n\n{machine_in_words(about)}{marked} From `benchmarks/{file_of(about)}`."


def _few(number: float) -> str:
    return f"{number:,.0f}" if number >= 10 else f"{number:.2g}"


def machine_in_words(about: dict) -> str:
    """Describes the machine in a sentence."""
    sets = [
        each
        for each in ("avx2", "avx_vnni", "avx512f", "avx512_vnni", "avx512_bf16", "amx_tile")
        if each in about.get("instruction_sets", ())
    ]
    instructions = f" ({', '.join(sets)})" if sets else ""
    words = f"{about['cores']} cores{instructions}, TensorFlow {about['tensorflow']}."
    if about.get("as_without_avx512"):
        words += " Kept to AVX2; the comparisons with oneDNN off, as TensorFlow has it on such a processor."
    return words


def file_of(about: dict) -> str:
    """Returns the name of the result file for a machine."""
    return "results_avx2.json" if about.get("as_without_avx512") else "results.json"


def with_words(results: dict) -> list[dict]:
    """Recomputes the rows that are derived from other rows, so that they have the same numbers and the current wording."""
    measured = [row for row in results["rows"] if row.get("of") != "reproduction"]
    return measured + [{"of": "reproduction", **row} for row in reproduction(measured, bar_of_reproduction(results["machine"]))]


def fill_page(root: Path, results: list[dict]) -> None:
    """Writes the table into the page on speed."""
    path = root / "docs" / "speed.md"
    text = fill_parts(path.read_text(encoding="utf-8"), {"speed": markdown(results)}, path.name)
    with replace_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
