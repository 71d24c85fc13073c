"""The figures of the paper that show series (2, 4 to 8 and 12 to 14), one function each.

Titles depend on the arrays only, so that they are correct for any run.
"""

from collections.abc import Mapping

import matplotlib.dates
import matplotlib.figure
import numpy as np
from matplotlib.axes import Axes

from enhsim_tf.common.plot_style import (
    AVERAGE,
    COARSE,
    DOUBLE,
    EDGE,
    ENHANCED,
    FOOT,
    GENERATED,
    LINE,
    QUIET,
    REAL,
    beside,
    label_ends,
    name_axes,
    new_sheet,
    panels,
    title_words,
)
from enhsim_tf.realism.measures import nrmse, roughness

Arrays = Mapping[str, np.ndarray]
_DASHES = (0, (4, 2))


def source_target(data: Arrays) -> matplotlib.figure.Figure:
    """Figure 2."""
    figure, down = new_sheet(
        DOUBLE,
        3.1,
        "The enhancer learns from pairs: a coarse simulation, and the telemetry of the same times",
        "Some of the training windows. They begin at random offsets of the series and are all of one size.",
    )
    axes = panels(figure, down + 0.2, 2, len(data["source"]), sharex=True, sharey=True)
    for column, begin in enumerate(data["begin"]):
        axes[0, column].set_title(_moment(float(begin), str(data["begin_unit"])), loc="right", color=QUIET, size=7)
        axes[0, column].plot(data["time"], data["source"][column], color=COARSE, linewidth=1.2)
        axes[1, column].plot(data["time"], data["target"][column], color=REAL, linewidth=0.6)
    for row, name in enumerate(("Source", "Target")):
        axes[row, 0].set_title(name, weight="bold")
    name_axes(axes, data)
    return figure


def enhanced_simulation(data: Arrays) -> matplotlib.figure.Figure:
    """Figure 4."""
    before, after, ridge = (float(data[key]) for key in ("identity_nrmse", "nrmse", "ridge_nrmse"))
    cuts = "cuts the error of the coarse simulation" if after < before else "does not cut the error of the coarse simulation:"
    truth = "true signal" if data["truth_is_known"] else "telemetry"
    shown = [nrmse(data[key], data["truth"]) for key in ("coarse", "enhanced")]
    figure, down = new_sheet(
        DOUBLE,
        3.6,
        f"Enhancing {cuts} from {before:.2f} to {after:.2f}",
        f"Root-mean-square error over held-out windows in standard deviations of the {truth} (NRMSE); ridge regression reaches {ridge:.2f}. "
        f"In the held-out window shown: {shown[0]:.2f} coarse, {shown[1]:.2f} enhanced.",
    )
    above, below = panels(figure, down + 0.1, 2, 1, right=0.85, height_ratios=(3, 1), sharex=True)[:, 0]
    above.plot(data["time"], data["coarse"], color=COARSE, linewidth=1.2)
    above.plot(data["time"], data["enhanced"], color=ENHANCED, linewidth=1.4)
    above.plot(data["time"], data["truth"], color=REAL, linewidth=0.8, linestyle=_DASHES if data["truth_is_known"] else "-")
    label_ends(above, {"coarse": (data["coarse"], COARSE), "enhanced": (data["enhanced"], ENHANCED), truth: (data["truth"], REAL)})
    below.axhline(0, color=LINE, linewidth=0.6)
    below.plot(data["time"], data["enhanced"] - data["truth"], color=ENHANCED, linewidth=0.8)
    beside(below, 0.5, f"enhanced\n− {truth}", ENHANCED)
    name_axes(np.array([[above], [below]]), data)
    return figure


def real_or_generated(data: Arrays) -> matplotlib.figure.Figure:
    """Figure 5."""
    return _guess(data, "windows of telemetry")


def real_or_generated_noise(data: Arrays) -> matplotlib.figure.Figure:
    """Figure 6."""
    generated, real, number = (float(data[f"rank_{key}"]) for key in ("generated", "real", "windows"))
    ranks = f"{number:,.0f} windows of generated noise fill {generated:.0f}, as many of real noise {real:.0f} (effective rank)"
    return _guess(data, "windows of noise", f"An eye does not count dimensions: {ranks}. ")


def real_or_generated_series(data: Arrays) -> matplotlib.figure.Figure:
    """Figure 7."""
    return _guess(
        data,
        "stretches of telemetry",
        "A generated one is made of overlapping windows, without seams, but its noise repeats a pattern every half window. ",
        columns=1,
    )


def source_noise(data: Arrays) -> matplotlib.figure.Figure:
    """Figure 8."""
    width, deviation = int(data["width"]), float(data["standard_deviation"])
    figure, down = new_sheet(
        DOUBLE,
        3.4,
        f"What a centred moving average of {width} samples leaves is noise of standard deviation {deviation:.3g}",
        "Over the training part, of which one window is shown. White noise would lose "
        f"{100 * (1 - np.sqrt(1 - 1 / width)):.1f} % of its standard deviation to the average.",
    )
    above, below = panels(figure, down + 0.1, 2, 1, right=0.95, height_ratios=(3, 2), sharex=True)[:, 0]
    above.plot(data["time"], data["telemetry"], color=REAL, linewidth=0.5)
    above.plot(data["time"], data["average"], color=AVERAGE, linewidth=1.8)
    label_ends(
        above, {"telemetry": (np.mean(data["telemetry"][-20:]), REAL), "moving\naverage": (np.nanmean(data["average"][-20:]), AVERAGE)}
    )
    below.plot(data["time"], data["noise"], color=REAL, linewidth=0.5)
    for side in (-deviation, deviation):
        below.axhline(side, color=AVERAGE, linewidth=1.2, linestyle=_DASHES)
    label_ends(below, {"+ 1 sd": (deviation, AVERAGE), "noise": (0.0, REAL), "− 1 sd": (-deviation, AVERAGE)})
    name_axes(np.array([[above], [below]]), data)
    return figure


def accuracy_loss(data: Arrays) -> matplotlib.figure.Figure:
    """Figure 12."""
    iteration = data["iteration"]
    real, generated = (float(data[f"accuracy_{kind}"][-1]) for kind in ("real", "generated"))
    figure, down = new_sheet(
        DOUBLE,
        2.9,
        f"After {int(iteration[-1]):,} iterations the discriminator is right on {100 * real:.0f} % of real and {100 * generated:.0f} % of generated noise",
        "Judged on a fresh batch of each kind at every record; the first is before training.",
    )
    accuracy, loss = panels(figure, down + 0.22, 1, 2, right=0.75, gap=(0, 1.15))[0]
    before, *after = zip(data["loss_real"], data["loss_generated"], strict=True)
    top = 1.4 * np.max(after, initial=np.log(2))
    if max(before) > top:  # the loss before training may be so large that the rest of the curve could not be read
        beyond = [f"{value:.2g} {kind}" for value, kind in zip(before, ("real", "generated"), strict=True) if value > top]
        note = f"before training, off scale:\n{', '.join(beyond)}"
        loss.annotate(note, (0.22, 0.99), xycoords="axes fraction", size=7, color=QUIET, va="top")
    _plot_judgements(accuracy, data, "accuracy", 1, "share judged rightly", (0.5, "0.5"))
    _plot_judgements(loss, data, "loss", top, "binary cross-entropy (nats)", (np.log(2), "ln 2"))
    return figure


def combined(data: Arrays) -> matplotlib.figure.Figure:
    """Figure 13."""
    clean, noisy, real = (roughness(data[key]) for key in ("enhanced", "combined", "telemetry"))
    compared = "less" if noisy < 0.9 * real else "more" if noisy > 1.1 * real else "as"
    figure, down = new_sheet(
        DOUBLE,
        4.2,
        f"With generated noise added, the enhanced signal is {compared} restless {'as' if compared == 'as' else 'than'} telemetry",
        f"Standard deviation of first differences in this window: {clean:.3f} enhanced, {noisy:.3f} with noise, {real:.3f} in held-out "
        "telemetry.",
    )
    axes = panels(figure, down + 0.2, 3, 1, sharex=True, sharey=True)
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
        title_words(panel, words)
    name_axes(axes, data)
    return figure


def telemetry_store(data: Arrays) -> matplotlib.figure.Figure:
    """Figure 14."""
    number, interval = int(data["num_samples"]), float(data["interval_s"])
    has_time = data["time"].dtype.kind == "M"
    figure, down = new_sheet(
        DOUBLE,
        2.5,
        f"The telemetry store holds {number:,} samples of “{data['name']}”",
        f"One every {interval:g} s; the first {len(data['values']):,} as read back."
        if has_time
        else f"The first {len(data['values']):,} as read back; the source gives no times.",
    )
    panel = panels(figure, down + 0.1, 1, 1)[0, 0]
    panel.plot(data["time"], data["values"], color=REAL, linewidth=0.4)
    if has_time:
        locator = matplotlib.dates.AutoDateLocator()
        panel.xaxis.set_major_locator(locator)
        panel.xaxis.set_major_formatter(matplotlib.dates.ConciseDateFormatter(locator, show_offset=False))
    name_axes(np.array([[panel]]), data | {"time_unit": f"UTC, from {str(data['time'][0])[:10]}" if has_time else "samples"})
    return figure


def _plot_judgements(axes: Axes, data: Arrays, measure: str, top: float, label: str, chance: tuple[float, str]) -> None:
    """Accuracy or loss on real and generated rows by iteration, with a line at the level of chance."""
    axes.set(ylim=(0, top), ylabel=label, xlabel="iteration")
    axes.margins(x=0.03)
    axes.axhline(chance[0], color=LINE, linewidth=0.8, linestyle=(0, (1, 1.5)))
    ends = {}
    for kind, color, look in (
        ("real", REAL, {"marker": "o"}),
        ("generated", GENERATED, {"marker": "s", "mfc": "white", "linestyle": _DASHES}),
    ):
        axes.plot(data["iteration"], data[f"{measure}_{kind}"], color=color, linewidth=1.2, markersize=3.5, clip_on=top != 1, **look)
        ends[kind] = data[f"{measure}_{kind}"], color
    axes.set_title(measure.capitalize(), weight="bold", pad=8)
    # beside the ends it would push away the two labels that have to stand there: both curves end near it where training is balanced
    axes.set_title(f"dotted: chance ({chance[1]})", loc="right", size=7, color=QUIET, pad=8)
    axes.xaxis.set_major_formatter("{x:,.0f}")
    label_ends(axes, ends)


# -- shared helpers ---------------------------------------------------------------------------------------------


def _guess(data: Arrays, what: str, remark: str = "", columns: int = 4) -> matplotlib.figure.Figure:
    """Real and generated rows in random order; the answer is printed upside down at the bottom."""
    number, generated = len(data["rows"]), int(data["is_generated"].sum())
    rows = -(-number // columns)
    counted = {1: "One", 2: "Two", 3: "Three", 4: "Four"}.get(generated, str(generated))
    total = {2: "two", 4: "four", 8: "eight"}.get(number, str(number))
    verb = "is" if generated == 1 else "are"
    figure, down = new_sheet(
        DOUBLE,
        1.24 + 0.95 * rows + 0.16 * bool(remark) if columns > 1 else 1.3 + 0.72 * rows,
        f"{counted} of these {total} {what} {verb} generated. Which?",
        f"{remark}A counterpart of the paper’s borrowed picture of a generated face, not a reproduction of it.",
    )
    axes = panels(figure, down + 0.2, rows, columns, gap=(0.24, 0.14), sharex=True, sharey=True)
    letters = "abcdefghijklmnop"[:number]
    for panel, row, letter in zip(axes.flat, data["rows"], letters, strict=True):
        panel.plot(data["time"], row, color=REAL, linewidth=0.5)
        panel.set_title(letter, weight="bold")
    name_axes(axes, data)
    answer = ", ".join(letter for letter, is_generated in zip(letters, data["is_generated"], strict=True) if is_generated)
    width, height = figure.get_size_inches()
    figure.text(
        1 - EDGE / width, (FOOT + 0.04) / height, f"generated: {answer}", size=7, color=QUIET, rotation=180, ha="right", gid="answer"
    )
    return figure


def _moment(begin: float, unit: str) -> str:
    """The time at which a window begins, as text."""
    if unit != "s":
        return f"begins at sample {begin:,.0f}"
    days, rest = divmod(round(begin), 86_400)
    return f"begins at {days} d {rest // 3_600:02d}:{rest // 60 % 60:02d}:{rest % 60:02d}"
