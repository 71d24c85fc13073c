"""The two figures of speed, drawn from the content of `results.json` alone."""

from pathlib import Path


def draw(results: dict, folder: Path) -> list[Path]:
    """Draws what the results hold; the files written."""
    import matplotlib

    matplotlib.use("agg")
    rows = results["rows"]
    compared = [row for row in rows if "ratio" in row and row.get("bar")]
    grown = {row["x"]: row["growth"] for row in rows if "growth" in row}
    written = _save(_ratios(compared), folder / "speed_ratios") if compared else []
    return written + (_save(_growth(grown), folder / "speed_growth") if len(grown) == 2 else [])


def _save(figure, path: Path) -> list[Path]:
    import matplotlib.pyplot as plt

    path.parent.mkdir(parents=True, exist_ok=True)
    files = [path.with_suffix(suffix) for suffix in (".png", ".svg")]
    for file in files:
        metadata = {"Date": None} if file.suffix == ".svg" else {}
        figure.savefig(file, dpi=160, bbox_inches="tight", metadata=metadata)
    plt.close(figure)
    return files


def _ratios(rows: list[dict]):
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(9, 0.55 * len(rows) + 1.3))
    for place, row in enumerate(reversed(rows)):
        ratio, reached = row["ratio"], row["reached"]
        colour = "#0072b2" if reached else "#d55e00"
        axes.plot([ratio["low"], ratio["high"]], [place, place], color=colour, linewidth=2, solid_capstyle="butt")
        axes.plot(ratio["median"], place, "o", color=colour, markersize=6)
        axes.plot([row["bar"]] * 2, [place - 0.3, place + 0.3], color="black", linewidth=1.5)
        text = f"{ratio['median']:.2f}"
        axes.annotate(text, (ratio["median"], place), xytext=(0, 7), textcoords="offset points", ha="center", fontsize=8, color=colour)
    axes.axvline(1, color="0.6", linewidth=0.8, zorder=0)
    axes.set_yticks(range(len(rows)), [f"{row['work']}\nagainst {row['comparison']}" for row in reversed(rows)], fontsize=8)
    axes.set_ylim(-0.6, len(rows) - 0.2)
    axes.set_xscale("log")
    ticks = [0.1, 0.2, 0.3, 0.5, 0.7, 1, 1.5, 2, 3]
    low, high = min(row["ratio"]["low"] for row in rows), max(row["ratio"]["high"] for row in rows)
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    axes.set_xlim(min(0.18, 0.9 * low), max(2.0, 1.1 * high))
    axes.set_xlabel("time, ours / theirs: median (dot) and range over repetitions (line); bar to reach (black tick)")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return figure


def _growth(grown: dict[str, list[dict]]):
    import matplotlib.pyplot as plt

    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(11, 3.4), layout="constrained")
    windows, lengths = grown["num_windows"], grown["window"]
    numbers = [each["num_windows"] for each in windows]
    _curve(left, numbers, [each["seconds"] for each in windows], "#0072b2", "measured")
    left.set(xlabel="windows generated to Parquet", ylabel="time in s", title="generation")
    left.plot(numbers, [windows[-1]["seconds"] * number / numbers[-1] for number in numbers], ":", color="0.5", label="in proportion")
    _curve(middle, numbers, [each["peak_mb"] for each in windows], "#0072b2", "measured")
    middle.set(xlabel="windows generated to Parquet", ylabel="peak memory in MB", title="memory of generation")
    middle.set_ylim(100, 10_000)
    length = [each["window"] for each in lengths]
    _curve(right, length, [each["enhancer_ms"] for each in lengths], "#0072b2", "enhancer, one step")
    _curve(right, length, [each["gan_ms"] for each in lengths], "#d55e00", "noise GAN, one iteration")
    right.set(xlabel="samples of a window", ylabel="time in ms", title="training")
    right.set_ylim(10, 1_000)
    right.set_xticks(length, [str(each) for each in length])
    right.minorticks_off()
    for axes in (left, right):
        axes.legend(frameon=False, fontsize=8)
    return figure


def _curve(axes, x: list[float], y: list[float], colour: str, label: str) -> None:
    axes.loglog(x, y, "o-", color=colour, label=label, markersize=4, linewidth=1.4)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
