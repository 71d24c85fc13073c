"""Formats the results as text, for the terminal and for the table of docs/speed.md."""

from collections.abc import Sequence


def line_of(row: dict) -> str:
    """Formats a row for the terminal."""
    return "  ".join(
        f"{cell:{width}}" for cell, width in zip(_cells(row), (50, 10, 24, 22, 16, 0), strict=True)
    )


def speed_table(rows: Sequence[dict]) -> str:
    """Formats rows as a table in Markdown."""
    header = (
        "work",
        "enhsim_tf",
        "compared with",
        "ratio of times: median (range)",
        "target",
        "reached",
    )
    lines = [header, ["---"] * len(header), *map(_cells, rows)]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def _cells(row: dict) -> tuple[str, ...]:
    if "skipped" in row:
        return row["work"], "", row["comparison"], f"skipped: {row['skipped']}", "", ""
    ratio, target = row["ratio"], row["target"]
    return (
        row["work"],
        f"{row['ours']['median']:.3g} {row['unit']}",
        row["comparison"],
        f"{ratio['median']:.2f} ({ratio['low']:.2f} to {ratio['high']:.2f})",
        "" if target is None else f"at most {target:.2f}",
        "" if target is None else "yes" if ratio["median"] <= target else "**no**",
    )
