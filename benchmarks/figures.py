"""Draws the two figures of the benchmarks from `results.json`, in the common style of all figures."""

import textwrap
from collections.abc import Sequence
from pathlib import Path

import matplotlib.figure
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis

from enhsim_tf.common.figure import Figure, save
from enhsim_tf.common.plot_style import DOUBLE, ENHANCED, FOOT, GENERATED, LINE, QUIET, REAL, beside, new_sheet, panels


def draw(results: dict, folder: Path) -> list[Path]:
    """Draws the figures for which there are results, and returns the files."""
    rows, machine = results["rows"], results.get("machine", {})
    data = {
        "rows": [row for row in rows if "ratio" in row and row.get("bar")],
        "growth": {row["x"]: row["growth"] for row in rows if "growth" in row},
    }
    where = f"{machine['cores']} cores, TensorFlow {machine['tensorflow']} · " if machine else ""
    names = (["speed_ratios"] if data["rows"] else []) + (["speed_growth"] if len(data["growth"]) == 2 else [])
    folder.mkdir(parents=True, exist_ok=True)
    return [
        file
        for name in names
        for file in save(name, data, folder, f"{where}python -m benchmarks", bool(results.get("quick")), figures=FIGURES)
    ]


def ratios(data: dict) -> matplotlib.figure.Figure:
    """Draws each comparison with its range and its target."""
    rows = data["rows"]
    missed = [f"{row['work']} against {row['comparison']}" for row in rows if not row["reached"]]
    reached = f"{len(rows) - len(missed)} of these {len(rows)} bars are reached" if missed else f"All of these {len(rows)} bars are reached"
    figure, down = new_sheet(
        DOUBLE,
        1.35 + 0.36 * len(rows),
        f"{reached}{'; not reached: ' if missed else ''}{'; '.join(missed)}",
        "Time of enhsim_tf / time of the comparison; less is faster. Dot and line: median and range over repetitions. Black tick: the bar, which the "
        "median is to stay below (blue: it does, orange: not; both in numbers at the right). Grey line: the same time.",
    )
    ((axes,),) = panels(figure, down + 0.02, 1, 1, right=0.85)
    place, left = axes.get_position(), 2.35 / DOUBLE
    axes.set_position([left, place.y0, place.x1 - left, place.height])
    axes.axvline(1, color=LINE, linewidth=0.8, zorder=0)
    for height, row in enumerate(reversed(rows)):
        ratio, colour = row["ratio"], ENHANCED if row["reached"] else GENERATED
        axes.plot([ratio["low"], ratio["high"]], [height, height], color=colour, linewidth=1.6, solid_capstyle="butt")
        axes.plot(ratio["median"], height, "o", color=colour, markersize=4.5)
        axes.plot([row["bar"]] * 2, [height - 0.3, height + 0.3], color=REAL, linewidth=1.4)
        sign = "≤" if row["reached"] else ">"
        beside(axes, (height + 0.6) / (len(rows) + 0.3), f"{ratio['median']:.2f} {sign} {row['bar']:.2f}", colour)
    words = [f"{row['work']}\nagainst {row['comparison']}" for row in reversed(rows)]
    axes.set_yticks(range(len(rows)), ["\n".join(line for part in each.split("\n") for line in textwrap.wrap(part, 42)) for each in words])
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(-0.6, len(rows) - 0.3)  # as the numbers at the right are placed
    low, high = min(row["ratio"]["low"] for row in rows), max(max(row["ratio"]["high"], row["bar"]) for row in rows)
    axes.set_xscale("log")
    ticks = [0.1, 0.2, 0.3, 0.5, 0.7, 1, 1.5, 2, 3]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    axes.set_xlim(min(0.18, 0.9 * low), max(2.0, 1.1 * high))
    figure.text(left + (place.x1 - left) / 2, (FOOT + 0.04) / figure.get_size_inches()[1], "time, enhsim_tf / comparison", ha="center")
    return figure


def growth(data: dict) -> matplotlib.figure.Figure:
    """Draws time and memory of generation against the number of windows, and time of training against the window length."""
    windows, lengths = data["growth"]["num_windows"], data["growth"]["window"]
    numbers, length = [each["num_windows"] for each in windows], [each["window"] for each in lengths]
    memory, first, last = [each["peak_mb"] for each in windows], windows[0], windows[-1]
    times, longer_s = last["num_windows"] / first["num_windows"], last["seconds"] / first["seconds"]
    longer = {key: lengths[-1][f"{key}_ms"] / lengths[0][f"{key}_ms"] for key in ("enhancer", "gan")}
    figure, down = new_sheet(
        DOUBLE,
        2.9,
        f"{times:,.0f} times as many windows take {float(f'{longer_s:.2g}'):,.0f} times as long and {memory[-1] / memory[0]:.2f} times the memory",
        f"Windows are generated and written to Parquet. Windows {length[-1] / length[0]:.0f} times as long take {longer['enhancer']:.1f} times "
        f"the time for a step of the enhancer, {longer['gan']:.1f} times for an iteration of the noise GAN.",
    )
    generation, peak, training = panels(figure, down + 0.22, 1, 3, right=0.8, gap=(0, 0.5))[0]
    proportion = [last["seconds"] * number / numbers[-1] for number in numbers]
    _curve(generation, numbers, [each["seconds"] for each in windows], ENHANCED, "o")
    generation.plot(numbers, proportion, ":", color=QUIET, linewidth=1.0, zorder=1)
    generation.set(xlabel="windows", ylabel="s")
    generation.set_title("Time of generation", weight="bold")
    generation.annotate("dotted:\nin proportion", (0.06, 0.94), xycoords="axes fraction", size=7, color=QUIET, va="top")
    _curve(peak, numbers, memory, ENHANCED, "o")
    peak.set(xlabel="windows", ylabel="MB", ylim=(min(100, 0.5 * min(memory)), max(10_000, 2 * max(memory))))
    peak.set_title("Peak memory of generation", weight="bold")
    ends = []
    for key, name, colour, marker in (
        ("enhancer", "enhancer,\none step", ENHANCED, "o"),
        ("gan", "noise GAN,\none iteration", GENERATED, "s"),
    ):
        values = [each[f"{key}_ms"] for each in lengths]
        _curve(training, length, values, colour, marker)
        ends.append((values, name, colour))
    training.set(xlabel="samples of a window", ylabel="ms")
    training.set_title("Time of training", weight="bold")
    training.set_xticks(length, [f"{each:,}" for each in length])
    for axes, steps in ((generation, (1,)), (peak, (1,)), (training, (1, 2, 5))):
        _plain_ticks(axes.yaxis, axes.get_ylim(), steps)
    for axes in (generation, peak):
        _plain_ticks(axes.xaxis, axes.get_xlim(), (1,), 2)
    training.minorticks_off()
    low, high = np.log(training.get_ylim())
    (lower, name, colour), (upper, other, of_other) = sorted(((np.log(values[-1]) - low) / (high - low), *about) for values, *about in ends)
    upper = max(upper, lower + 0.26)  # makes room for two labels of two lines each
    beside(training, lower, name, colour)
    beside(training, upper, other, of_other)
    return figure


def _curve(axes: Axes, x: list[float], y: list[float], colour: str, marker: str) -> None:
    axes.loglog(x, y, color=colour, marker=marker, markersize=3.5, linewidth=1.2, mfc=colour if marker == "o" else "white")
    axes.margins(x=0.05)


def _plain_ticks(axis: Axis, limits: tuple[float, float], steps: Sequence[int], every: int = 1) -> None:
    """Sets ticks at `steps` times powers of ten, and writes them without exponents, which would be too small to read."""
    places = [step * 10.0**power for power in range(-6, 10) for step in steps]
    places = [place for place in places if limits[0] <= place <= limits[1]][::every]
    axis.set_ticks(places, [f"{place:,.0f}" if place >= 1 else f"{place:g}" for place in places])
    axis.set_ticks([], minor=True)


FIGURES = {
    "speed_ratios": Figure(
        0,
        "Speed beside comparisons",
        "For each piece of work, the ratio of our time to that of the comparison: median, range over repetitions, and the bar to reach. The "
        "title counts the bars that are reached and names those that are not.",
        ratios,
    ),
    "speed_growth": Figure(
        0,
        "Growth of time and memory",
        "Three panels on logarithmic axes: time and peak memory of generation against the number of windows, and time of a training step of "
        "both networks against the length of a window. The title gives the factors.",
        growth,
    ),
}
