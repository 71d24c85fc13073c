"""Estimates the cluster size for a data set from the results of `benchmarks.fleet`: `python -m benchmarks.sizing`.

The command fills the tables of docs/sizing.md and draws `figures/fleet_sizing`. It does not measure anything.
"""

import argparse
import json
from collections.abc import Iterator
from pathlib import Path

import matplotlib.figure
import numpy as np

from benchmarks.fleet import PARTS, ROWS
from enhsim_tf.common.atomic_files import replace_file
from enhsim_tf.common.plot_style import BLUE_TINT, DOUBLE, ENHANCED, GENERATED, LINE, QUIET, REAL, new_sheet, panels
from enhsim_tf.reproduce.figure import Figure, save
from enhsim_tf.reproduce.publish.results import fill_parts

ROOT = Path(__file__).parents[1]
ONE, TWO, RAY = ROWS
WINDOWS = 10**9
CLUSTERS = {"a laptop": 8, "a server": 64, "10 servers": 640, "100 servers": 6_400}  # cores, those that compute
GIB, MB = 2**30, 1e6


def medians(found: dict) -> dict[str, dict[str, float]]:
    """Returns the median over the repetitions of each row."""
    return {
        name: {key: float(np.median([each[key] for each in rows])) for key in rows[0] if rows[0][key] is not None}
        for name, rows in found["rows"].items()
    }


def projected(found: dict, cores: int, num_windows: int = WINDOWS) -> dict[str, float]:
    """Projects the cost of a data set to a number of cores like the measured ones, with one worker on each core.

    The projection assumes that each core reaches the rate of one of two concurrent workers after start-up, and that nothing else
    limits the rate. The result includes the rates that storage and the driver would have to sustain.

    Args:
        found: Results of `benchmarks.fleet`.
        cores: Number of cores.
        num_windows: Number of windows in the data set.

    Returns:
        Hours, core-hours, terabytes, and, for each second, the windows, the megabytes to write and the shards to record.
    """
    two = medians(found)[TWO]
    rate = two["windows_a_second_once_running"] / 2 * cores
    return {
        "hours": num_windows / rate / 3_600,
        "core_hours": num_windows / rate / 3_600 * cores,
        "terabytes": num_windows * two["bytes_a_window"] / 1e12,
        "windows_a_second": rate,
        "mb_a_second": rate * two["bytes_a_window"] / MB,
        "shards_a_second": rate / two["shard"],
    }


def bars(found: dict) -> Iterator[tuple[str, str, bool]]:
    """Returns each target with the measured value, and whether the target is reached."""
    rows, large = found["rows"], found["large"]
    ratios = [two["windows_a_second"] / one["windows_a_second"] for one, two in zip(rows[ONE], rows[TWO], strict=True)]
    yield "two workers against one, at least 1.6 times the rate", spread(ratios, "{:.2f}"), bool(np.median(ratios) >= 1.6)
    number = f"{large[TWO]['windows']:,} windows"
    if RAY in large:
        ratio = large[RAY]["windows_a_second"] / large[TWO]["windows_a_second"]
        ratios = [ray["windows_a_second"] / two["windows_a_second"] for two, ray in zip(rows[TWO], rows[RAY], strict=True)]
        fewer = f"{ratio:.2f}; with {rows[TWO][0]['windows']:,}: {spread(ratios, '{:.2f}')}"
        yield f"Ray against local, {number}, at least 0.8 times the rate", fewer, bool(ratio >= 0.8)
    for what, key, most in (("driver", "driver_bytes", 1.0), ("largest worker", "largest_worker_bytes", 1.5)):
        peak = max(each[key] for each in large.values()) / GIB
        yield f"memory of the {what}, {number}, below {most:g} GiB", f"{peak:.2f} GiB", bool(peak < most)
    yield "the same bytes from every engine and number of workers", "yes" if found["same_bytes"] else "no", found["same_bytes"]


def spread(values: list[float], form: str) -> str:
    """Formats a median with its range."""
    low, middle, high = (form.format(value) for value in (min(values), np.median(values), max(values)))
    return f"{middle} ({low} to {high})"


def tables(found: dict) -> dict[str, str]:
    """Returns the generated parts of docs/sizing.md."""
    lines = [
        "| | windows a second, whole run | once running | first shard after | memory: driver, largest worker |",
        "|---|---|---|---|---|",
    ]
    for name, rows in found["rows"].items():
        middle = medians(found)[name]
        whole, running = (spread([each[key] for each in rows], "{:,.0f}") for key in ("windows_a_second", "windows_a_second_once_running"))
        memory = ", ".join(f"{middle[key] / GIB:.2f} GiB" for key in ("driver_bytes", "largest_worker_bytes"))
        lines.append(f"| {name} | {whole} | {running} | {middle['first_shard_s']:.0f} s | {memory} |")
    for name, each in found["large"].items():
        memory = ", ".join(f"{each[key] / GIB:.2f} GiB" for key in ("driver_bytes", "largest_worker_bytes"))
        rates = f"{each['windows_a_second']:,.0f} | {each['windows_a_second_once_running']:,.0f} | {each['first_shard_s']:.0f} s"
        lines.append(f"| {name}, {each['windows']:,} windows, once | {rates} | {memory} |")
    first = next(iter(found["rows"].values()))[0]
    lines += [
        "",
        f"{first['windows']:,} windows of {first['samples']} samples where nothing else is said, {len(found['rows'][ONE])} repetitions in turn: median (range). "
        f"{first['bytes_a_window']:,.0f} bytes a window on disk, of {4 * first['samples']:,} in memory. {found['machine']['cores']} cores, "
        f"TensorFlow {found['machine']['tensorflow']}.",
        "",
        "| bar | measured | |",
        "|---|---|---|",
        *(f"| {bar} | {value} | {'reached' if reached else '**not reached**'} |" for bar, value, reached in bars(found)),
    ]
    return {"measured": "\n".join(lines), "parts": parts_table(found), "projection": projection_table(found)}


def parts_table(found: dict) -> str:
    """Returns the table of the time that a worker spends on each part of its work."""
    parts = found[PARTS]
    whole = sum(parts["seconds_a_window"].values())
    lines = ["| part | ms a window | share |", "|---|---|---|"]
    lines += [f"| {name} | {1e3 * value:.3f} | {value / whole:.0%} |" for name, value in parts["seconds_a_window"].items()]
    enhancer, product = (parts[key] / 1e9 for key in ("enhancer_flop_a_second", "matrix_product_flop_a_second"))
    driver = ", ".join(f"{name} {each['shards_a_second']:,.0f}" for name, each in found["driver"].items())
    return "\n".join(lines) + (
        f"\n\nOne process, one thread, {parts['windows']:,} windows. The enhancer's {parts['enhancer_parameters'] / 1e6:.1f} million weights are "
        f"multiplied at {enhancer:.0f} GFLOP/s; the machine's own matrix product in one thread reaches {product:.0f}. "
        f"Without any work between, the driver hands out and gets back this many shards a second: {driver}."
    )


def projection_table(found: dict) -> str:
    """Returns the table of the projected cost of 10^9 windows."""
    lines = [
        "| | cores | 10^9 windows take | core-hours | to be written | shards to be recorded |",
        "|---|---|---|---|---|---|",
    ]
    for name, cores in CLUSTERS.items():
        on = projected(found, cores)
        time = (
            f"{on['hours'] / 24:.1f} days"
            if on["hours"] > 48
            else f"{on['hours']:.1f} h"
            if on["hours"] > 1
            else f"{60 * on['hours']:.0f} min"
        )
        lines.append(
            f"| {name} | {cores:,} | {time} | {on['core_hours']:,.0f} | {on['mb_a_second']:,.0f} MB/s | {_plain(on['shards_a_second'])} a second |"
        )
    on = projected(found, 1)
    cores = {name: each["shards_a_second"] / on["shards_a_second"] for name, each in found["driver"].items()}
    fed = ", ".join(f"{name} {round(number, -2):,.0f}" for name, number in cores.items())
    return "\n".join(lines) + (
        f"\n\n{on['terabytes']:.1f} TB in all; {1e3 / on['windows_a_second']:.3f} ms of a core for each window. One driver could keep about "
        f"this many cores at work, by what it hands out and gets back: {fed}; larger shards (`shard:` in the scenario file) make it more."
    )


def _plain(number: float) -> str:
    return f"{number:,.0f}" if number >= 10 else f"{number:.1f}"


def draw_sizing(found: dict) -> matplotlib.figure.Figure:
    """Draws the rates, the distribution of the time over the parts of the work, and the projection."""
    rows, parts = found["rows"], found[PARTS]["seconds_a_window"]
    most, whole = max(parts, key=parts.get), sum(parts.values())
    hours = {name: projected(found, cores)["hours"] for name, cores in CLUSTERS.items()}
    figure, down = new_sheet(
        DOUBLE,
        2.9,
        f"The {most} takes {parts[most] / whole:.0%} of a worker's time; on 640 cores, 10⁹ windows would be {60 * hours['10 servers']:.0f} minutes",
        "Left and middle: measured. Right: projected, as if cores alone counted; grey: what a store would have to take in.",
    )
    rates, shares, projection = panels(figure, down + 0.22, 1, 3, right=0.2, gap=(0, 0.9))[0]
    names = {ONE: "local,\n1 worker", TWO: "local,\n2 workers", RAY: "Ray,\n2 workers"}
    for place, name in enumerate(rows):
        values = [each["windows_a_second"] for each in rows[name]]
        colour = GENERATED if name == RAY else ENHANCED
        rates.bar(place, np.median(values), 0.62, color=colour if name != ONE else BLUE_TINT, edgecolor=colour)
        rates.plot([place] * 2, [min(values), max(values)], color=REAL, linewidth=1.2)
        rates.annotate(f"{np.median(values):,.0f}", (place, max(values)), (0, 2), textcoords="offset points", ha="center", size=7)
    rates.set_xticks(range(len(rows)), [names[name] for name in rows])
    rates.set_ylim(0, 1.16 * max(each["windows_a_second"] for each in rows[TWO]))
    rates.set_ylabel("windows a second")
    rates.set_title("Rate, whole run", weight="bold")
    for place, (name, value) in enumerate(reversed(parts.items())):
        shares.barh(place, 1e3 * value, 0.62, color=ENHANCED if name == most else BLUE_TINT, edgecolor=ENHANCED)
        shares.annotate(f"{value / whole:.0%}", (1e3 * value, place), (3, 0), textcoords="offset points", va="center", size=7)
    shares.set_yticks(range(len(parts)), [name.replace(" and ", "\nand ").replace("coarse ", "coarse\n") for name in reversed(parts)])
    shares.tick_params(axis="y", length=0)
    shares.set_xlim(0, 1.25e3 * max(parts.values()))
    shares.set_xlabel("ms a window, one thread")
    shares.set_title("Where the time goes", weight="bold")
    cores = np.geomspace(4, 12_800, 50)
    projection.loglog(cores, [projected(found, each)["hours"] for each in cores], color=ENHANCED, linewidth=1.4)
    for name, each in CLUSTERS.items():
        on = projected(found, each)
        projection.plot(each, on["hours"], "o", color=ENHANCED, markersize=4)
        written = f"{on['mb_a_second']:,.0f} MB/s" if on["mb_a_second"] < 1_000 else f"{on['mb_a_second'] / 1e3:,.1f} GB/s"
        projection.annotate(f"{name}\n", (each, on["hours"]), (5, -1), textcoords="offset points", size=7)
        projection.annotate(written, (each, on["hours"]), (5, 0), textcoords="offset points", size=7, color=QUIET)
    projection.axhline(1, color=LINE, linewidth=0.6, linestyle=":", zorder=0)
    projection.annotate("an hour", (1, 1), (0, 2), ("axes fraction", "data"), "offset points", size=6.5, color=QUIET, ha="right")
    projection.set_xlim(4, 900_000)
    projection.set_xticks([10, 100, 1_000, 10_000], ["10", "", "1,000", ""])
    projection.set_yticks([0.01, 0.1, 1, 10, 100], ["0.01", "0.1", "1", "10", "100"])
    projection.set_ylim(0.007, 100)
    projection.minorticks_off()
    projection.set(xlabel="cores", ylabel="hours")
    projection.set_title("10⁹ windows, projected", weight="bold")
    return figure


FIGURES = {
    "fleet_sizing": Figure(
        0,
        "Sizing of large data sets",
        "Three panels: windows a second with one and two local workers and with two of Ray; the milliseconds that each part of the work takes "
        "a window; the hours that a thousand million windows would take against the number of cores.",
        draw_sizing,
    )
}


def main(arguments: list[str] | None = None) -> int:
    """Draws the figure and fills the tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.sizing", description="Tables and figure of docs/sizing.md.")
    parser.add_argument("--results", type=Path, default=Path(__file__).with_name("fleet.json"), help="what benchmarks.fleet wrote")
    parser.add_argument("--page", type=Path, default=ROOT / "docs" / "sizing.md", help="the page with the tables (default: %(default)s)")
    parser.add_argument("--figures", type=Path, default=ROOT / "figures", help="folder of the figure (default: %(default)s)")
    options = parser.parse_args(arguments)
    found = json.loads(options.results.read_text(encoding="utf-8"))
    cores, version = found["machine"]["cores"], found["machine"]["tensorflow"]
    caption = f"{cores} cores, TensorFlow {version} · python -m benchmarks.fleet, python -m benchmarks.sizing"
    for file in save("fleet_sizing", found, options.figures, caption, False, figures=FIGURES):
        print(file)
    text = fill_parts(options.page.read_text(encoding="utf-8"), tables(found), options.page.name)
    with replace_file(options.page) as temporary:
        temporary.write_text(text, encoding="utf-8")
    print(options.page)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
