"""The figures of the paper that show series: 2, 4 to 8 and 12 to 14, one function each, drawn from arrays alone.

Their titles say what the arrays hold, whichever run they come from; nothing is computed here but what a title counts.
"""

import datetime
from collections.abc import Mapping
from typing import Any

import matplotlib.dates
import matplotlib.figure
import numpy as np
from matplotlib.axes import Axes

from enhsim_tf.fidelity import nrmse, roughness
from enhsim_tf.reproduce.diagrams import AVERAGE, COARSE, DOUBLE, EDGE, ENHANCED, FOOT, GENERATED, LINE, QUIET, REAL, sheet

Arrays = Mapping[str, np.ndarray]
_DASHES = (0, (4, 2))


def source_target(data: Arrays) -> matplotlib.figure.Figure:
    """Figure 2."""
    figure, down = sheet(
        DOUBLE,
        3.1,
        "The enhancer learns from pairs: a coarse simulation, and the telemetry of the same times",
        f"{len(data['source'])} of the training windows, which begin at random and are all of one size.",
    )
    axes = _panels(figure, down + 0.2, 2, len(data["source"]), sharex=True, sharey=True)
    for column, begin in enumerate(data["begin"]):
        axes[0, column].set_title(_moment(float(begin), str(data["begin_unit"])), loc="right", color=QUIET, size=7)
        axes[0, column].plot(data["time"], data["source"][column], color=COARSE, linewidth=1.2)
        axes[1, column].plot(data["time"], data["target"][column], color=REAL, linewidth=0.6)
    for row, name in enumerate(("Source", "Target")):
        axes[row, 0].set_title(name, weight="bold")
    _name_axes(axes, data)
    return figure


def enhanced_simulation(data: Arrays) -> matplotlib.figure.Figure:
    """Figure 4."""
    before, after, ridge = (float(data[key]) for key in ("identity_nrmse", "nrmse", "ridge_nrmse"))
    cuts = "cuts the error of the coarse simulation" if after < before else "does not cut the error of the coarse simulation:"
    truth = "true signal" if data["truth_is_known"] else "telemetry"
    shown = [nrmse(data[key], data["truth"]) for key in ("coarse", "enhanced")]
    figure, down = sheet(
        DOUBLE,
        3.6,
        f"Enhancing {cuts} from {before:.2f} to {after:.2f}",
        f"Root-mean-square error over held-out windows, in standard deviations of the {truth}; ridge regression reaches {ridge:.2f}. "
        f"In the held-out window shown: {shown[0]:.2f} coarse, {shown[1]:.2f} enhanced.",
    )
    above, below = _panels(figure, down + 0.05, 2, 1, right=0.85, height_ratios=(3, 1), sharex=True)[:, 0]
    above.plot(data["time"], data["coarse"], color=COARSE, linewidth=1.2)
    above.plot(data["time"], data["enhanced"], color=ENHANCED, linewidth=1.6)
    above.plot(data["time"], data["truth"], color=REAL, linewidth=0.8, linestyle=_DASHES if data["truth_is_known"] else "-")
    _label_ends(above, {"coarse": (data["coarse"], COARSE), "enhanced": (data["enhanced"], ENHANCED), truth: (data["truth"], REAL)})
    below.axhline(0, color=LINE, linewidth=0.6)
    below.plot(data["time"], data["enhanced"] - data["truth"], color=ENHANCED, linewidth=0.8)
    _beside(below, 0.5, f"enhanced\n− {truth}", ENHANCED)
    _name_axes(np.array([[above], [below]]), data)
    return figure


def real_or_generated(data: Arrays) -> matplotlib.figure.Figure:
    """Figure 5."""
    return _guess(data, "windows of telemetry")


def real_or_generated_noise(data: Arrays) -> matplotlib.figure.Figure:
    """Figure 6."""
    generated, real, number = (float(data[f"rank_{key}"]) for key in ("generated", "real", "windows"))
    verdict = "An eye is easily fooled, a number is not" if generated < 0.8 * real else "A number agrees"
    return _guess(
        data,
        "windows of noise",
        f"{verdict}: {number:,.0f} windows of generated noise fill {generated:.0f} dimensions (effective rank), as many of real noise "
        f"{real:.0f}. ",
    )


def real_or_generated_series(data: Arrays) -> matplotlib.figure.Figure:
    """Figure 7."""
    return _guess(data, "stretches of telemetry", columns=1)


def source_noise(data: Arrays) -> matplotlib.figure.Figure:
    """Figure 8."""
    width, deviation = int(data["width"]), float(data["standard_deviation"])
    figure, down = sheet(
        DOUBLE,
        3.4,
        f"What a centred moving average of {width} samples leaves is noise of standard deviation {deviation:.3g}",
        "Over the whole training part, of which one window is shown. White noise would lose "
        f"{1 - np.sqrt(1 - 1 / width):.1%} of its standard deviation to the average.",
    )
    above, below = _panels(figure, down + 0.05, 2, 1, right=0.95, height_ratios=(3, 2), sharex=True)[:, 0]
    above.plot(data["time"], data["telemetry"], color=REAL, linewidth=0.5)
    above.plot(data["time"], data["average"], color=AVERAGE, linewidth=1.8)
    _label_ends(above, {"telemetry": (data["telemetry"][-20:], REAL), "moving\naverage": (data["average"][-20:], AVERAGE)})
    below.plot(data["time"], data["noise"], color=REAL, linewidth=0.5)
    for side in (-deviation, deviation):
        below.axhline(side, color=AVERAGE, linewidth=1.2, linestyle=_DASHES)
    _label_ends(below, {"+ 1 sd": (deviation, AVERAGE), "noise": (0.0, REAL), "− 1 sd": (-deviation, AVERAGE)})
    _name_axes(np.array([[above], [below]]), data)
    return figure


def accuracy_loss(data: Arrays) -> matplotlib.figure.Figure:
    """Figure 12."""
    iteration = data["iteration"]
    real, generated = (float(data[f"accuracy_{kind}"][-1]) for kind in ("real", "generated"))
    figure, down = sheet(
        DOUBLE,
        2.9,
        f"After {int(iteration[-1]):,} iterations the discriminator is right on {real:.0%} of real and {generated:.0%} of generated noise",
        "Judged on a fresh batch of each kind at every record; the first is before training.",
    )
    axes = _panels(figure, down + 0.22, 1, 2, right=0.75, gap=(0, 1.15))[0]
    for panel, measure, chance, name, unit in zip(
        axes,
        ("accuracy", "loss"),
        (0.5, np.log(2)),
        ("Accuracy", "Loss"),
        ("share judged rightly", "binary cross-entropy (nats)"),
        strict=True,
    ):
        of_real, of_generated = data[f"{measure}_real"], data[f"{measure}_generated"]
        panel.axhline(chance, color=LINE, linewidth=0.8, linestyle=(0, (1, 1.5)))
        panel.plot(iteration, of_real, color=REAL, linewidth=1.2, marker="o", markersize=3.5, clip_on=False)
        panel.plot(
            iteration,
            of_generated,
            color=GENERATED,
            linewidth=1.2,
            linestyle=_DASHES,
            marker="s",
            markersize=3.5,
            markerfacecolor="white",
            clip_on=False,
        )
        panel.set(ylim=(0, 1 if measure == "accuracy" else 1.08 * max(of_real.max(), of_generated.max(), chance)))
        panel.set_title(name, weight="bold")
        panel.set_ylabel(unit)
        panel.set_xlabel("iteration")
        panel.xaxis.set_major_formatter("{x:,.0f}")
        words = "chance\n(0.5)" if measure == "accuracy" else "chance\n(ln 2)"
        _label_ends(panel, {"real": (of_real, REAL), "generated": (of_generated, GENERATED), words: (chance, QUIET)})
    return figure


def combined(data: Arrays) -> matplotlib.figure.Figure:
    """Figure 13."""
    clean, noisy, real = (roughness(data[key]) for key in ("enhanced", "combined", "telemetry"))
    figure, down = sheet(
        DOUBLE,
        4.2,
        "Generated noise makes the enhanced signal as restless as telemetry"
        if abs(noisy - real) < abs(clean - real)
        else "Generated noise does not make the enhanced signal as restless as telemetry",
        f"Standard deviation of first differences in the window shown: {clean:.3f} enhanced, {noisy:.3f} with noise added, "
        f"{real:.3f} in held-out telemetry of the same times.",
    )
    axes = _panels(figure, down + 0.2, 3, 1, sharex=True, sharey=True)
    first, second, third = axes[:, 0]
    first.plot(data["time"], data["coarse"], color=COARSE, linewidth=1.2)
    first.plot(data["time"], data["enhanced"], color=ENHANCED, linewidth=1.4)
    second.plot(data["time"], data["combined"], color=GENERATED, linewidth=0.6)
    third.plot(data["time"], data["telemetry"], color=REAL, linewidth=0.6)
    for panel, words in (
        (first, (("Simulator output", COARSE), ("enhanced", ENHANCED))),
        (second, (("Enhanced, with generated noise added", GENERATED),)),
        (third, (("Real telemetry, held out, of the same times", REAL),)),
    ):
        _title_words(panel, words)
    _name_axes(axes, data)
    return figure


def telemetry_store(data: Arrays) -> matplotlib.figure.Figure:
    """Figure 14."""
    number, interval = int(data["num_samples"]), float(data["interval_s"])
    has_time = data["time"].dtype.kind == "M"
    figure, down = sheet(
        DOUBLE,
        2.5,
        f"The telemetry store holds {number:,} samples of “{data['name']}”",
        f"One every {interval:g} s; the first {len(data['values']):,} as read back."
        if has_time
        else f"The first {len(data['values']):,} as read back; the source gives no times.",
    )
    panel = _panels(figure, down + 0.05, 1, 1)[0, 0]
    panel.plot(data["time"], data["values"], color=REAL, linewidth=0.4)
    if has_time:
        locator = matplotlib.dates.AutoDateLocator()
        panel.xaxis.set_major_locator(locator)
        panel.xaxis.set_major_formatter(matplotlib.dates.ConciseDateFormatter(locator, show_offset=False))
    _name_axes(np.array([[panel]]), data | {"time_unit": f"UTC, from {str(data['time'][0])[:10]}" if has_time else "samples"})
    return figure


# -- what several of them need ---------------------------------------------------------------------------------------------


def _panels(
    figure, down: float, rows: int, columns: int, right: float = 0.15, gap=(0.24, 0.14), height_ratios=None, **shared
) -> np.ndarray:
    """Axes in a grid below the heading, which ends `down` inches from the top; array of shape `(rows, columns)`."""
    width, height = figure.get_size_inches()
    left, bottom = 0.56, FOOT + 0.38
    grid = {
        "left": left / width,
        "right": 1 - right / width,
        "bottom": bottom / height,
        "top": 1 - down / height,
        "hspace": gap[0] * rows / (height - down - bottom - gap[0] * (rows - 1)),
        "wspace": gap[1] * columns / (width - left - right - gap[1] * (columns - 1)),
        "height_ratios": height_ratios,
    }
    return figure.subplots(rows, columns, squeeze=False, gridspec_kw=grid, **shared)


def _name_axes(axes: np.ndarray, data: Mapping[str, Any]) -> None:
    """The time and the value axis of a grid, each with its unit, named once."""
    figure, (width, height) = axes[0, 0].figure, axes[0, 0].figure.get_size_inches()
    last, first = axes[-1, -1].get_position(), axes[0, 0].get_position()
    unit = "dimensionless" if data["unit"] == "1" else str(data["unit"])
    figure.text((first.x0 + last.x1) / 2, (FOOT + 0.04) / height, f"time ({data['time_unit']})", ha="center")
    figure.text(0.17 / width, (first.y1 + last.y0) / 2, f"value ({unit})", rotation=90, ha="center", va="center")


def _beside(axes: Axes, height: float, text: str, color: str) -> None:
    """A label right of the axes, at a height from 0 to 1."""
    axes.annotate(
        text, (1, height), (5, 0), "axes fraction", "offset points", color=color, va="center", linespacing=1.05, annotation_clip=False
    )


def _label_ends(axes: Axes, curves: Mapping[str, tuple[Any, str]]) -> None:
    """Labels right of the ends of curves, moved apart where they would touch; values of a curve, or one height, and colour."""
    low, high = axes.get_ylim()
    inches = axes.get_position().height * axes.figure.get_size_inches()[1]
    ends = sorted((float(np.nanmean(np.atleast_1d(values)[-5:])), name, color) for name, (values, color) in curves.items())
    at = np.array([(value - low) / (high - low) for value, _, _ in ends])
    room = np.array([0.13 * (1 + name.count("\n")) / inches for _, name, _ in ends])
    for _ in range(200):  # neighbours push each other apart until nobody touches
        overlap = np.maximum((room[1:] + room[:-1]) / 2 - np.diff(at), 0)
        at[1:] += overlap / 2
        at[:-1] -= overlap / 2
    for height, (_, name, color) in zip(at, ends, strict=True):
        _beside(axes, height, name, color)


def _title_words(axes: Axes, words) -> None:
    """A title whose words have the colours of the curves they name."""
    place = 0.0
    for word, color in words:
        text = axes.annotate(word, (place, 1), (0, 4), "axes fraction", "offset points", color=color, weight="bold", annotation_clip=False)
        width = axes.get_position().width * axes.figure.get_size_inches()[0]
        place += (0.075 * len(text.get_text()) + 0.15) / width


def _guess(data: Arrays, what: str, remark: str = "", columns: int = 4) -> matplotlib.figure.Figure:
    """Real and generated rows among each other, to be told apart; the answer stands upside down at the foot."""
    number, generated = len(data["rows"]), int(data["is_generated"].sum())
    rows = -(-number // columns)
    counted = {1: "One", 2: "Two", 3: "Three", 4: "Four"}.get(generated, str(generated))
    total = {2: "two", 4: "four", 8: "eight"}.get(number, str(number))
    verb = "is" if generated == 1 else "are"
    figure, down = sheet(
        DOUBLE,
        1.24 + 0.95 * rows + 0.16 * bool(remark) if columns > 1 else 1.3 + 0.72 * rows,
        f"{counted} of these {total} {what} {verb} generated. Which?",
        f"{remark}A counterpart of the paper’s borrowed picture of a generated face, not a reproduction of it.",
    )
    axes = _panels(figure, down + 0.2, rows, columns, gap=(0.24, 0.14), sharex=True, sharey=True)
    letters = "abcdefghijklmnop"[:number]
    for panel, row, letter in zip(axes.flat, data["rows"], letters, strict=True):
        panel.plot(data["time"], row, color=REAL, linewidth=0.5)
        panel.set_title(letter, weight="bold")
    _name_axes(axes, data)
    answer = ", ".join(letter for letter, is_generated in zip(letters, data["is_generated"], strict=True) if is_generated)
    width, height = figure.get_size_inches()
    figure.text(
        1 - EDGE / width, (FOOT + 0.04) / height, f"generated: {answer}", size=7, color=QUIET, rotation=180, ha="right", gid="answer"
    )
    return figure


def _moment(begin: float, unit: str) -> str:
    """When a window begins, in words."""
    return f"from {datetime.timedelta(seconds=round(begin))}" if unit == "s" else f"from sample {begin:,.0f}"
