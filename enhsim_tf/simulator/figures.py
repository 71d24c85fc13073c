"""The figures of a report, of scores and of injected anomalies: series of up to three channels, and how the detectors do."""

from collections.abc import Sequence

import matplotlib.dates
import matplotlib.figure
import matplotlib.style
import numpy as np
import pandas as pd
from matplotlib import font_manager
from matplotlib.axes import Axes

from enhsim_tf.common.errors import counted, printable, spoken
from enhsim_tf.common.plot_style import (
    COARSE,
    DASHED,
    DOUBLE,
    EDGE,
    ENHANCED,
    GENERATED,
    IN_PRINT,
    LINE,
    QUIET,
    REAL,
    STYLE,
    new_sheet,
    panels,
    title_words,
)
from enhsim_tf.simulator.detector_choice import RATE
from enhsim_tf.simulator.report import Report
from enhsim_tf.simulator.scoring import told_times
from enhsim_tf.simulator.simulator import EnhancedSimulator

_MOST_CHANNELS = 3
_MOST_NAMED = 20  # spans of a panel that have their names above it
_MOST_POINTS = (
    4_000  # of a curve; beyond, the smallest and the largest value of each stretch are drawn
)


@matplotlib.style.context(STYLE)
def report_figure(report: Report) -> matplotlib.figure.Figure:
    """Draws a report: for each channel real, coarse and enhanced telemetry, and generated telemetry; false alarms and recall of the detectors."""
    shown = report.channels[:_MOST_CHANNELS]
    first, rows = report.nrmse[shown[0]], max(2, len(shown))
    nearer = 1 - first["enhanced"] / first["coarse"] if first["coarse"] > 0 else 0.0
    message = f"{drawable(shown[0], 30)}: " + (
        f"enhanced {nearer:.0%} nearer to the telemetry than coarse"
        if nearer > 0
        else "enhancing brings the coarse signal no nearer"
    )
    where = "held-out telemetry" if report.is_held_out else "the telemetry of the fit"
    subtitle = f"Measured on {where}; noise: {report.noise_model}; detector that score uses: {report.detector}."
    figure, down = new_sheet(DOUBLE, 0.9 + 1.77 * rows, message, subtitle)
    grid = panels(figure, down + 0.24, rows, 3, gap=(0.62, 0.9))
    for row, name in enumerate(shown):
        own = {kind: values[:, row] for kind, values in report.examples.items()}
        signal, made = grid[row, :2]
        signal.plot(own["real"], color=REAL, linewidth=0.7)
        signal.plot(own["coarse"], color=COARSE, linewidth=1.0, linestyle=DASHED, zorder=3)
        signal.plot(own["enhanced"], color=ENHANCED, linewidth=1.5)
        made.plot(own["generated"], color=GENERATED, linewidth=0.7)
        for axes in (signal, made):
            axes.locator_params(axis="y", nbins=4)
            axes.ticklabel_format(axis="y", useOffset=False)
            axes.set_xlabel("sample" if row == len(shown) - 1 else "")
        signal.set_ylabel(drawable(name, 14), parse_math=False)
    title_words(grid[0, 0], [("real", REAL), ("coarse (dashed)", COARSE), ("enhanced", ENHANCED)])
    title_words(grid[0, 1], [("generated", GENERATED)])
    names = [each["name"] for each in report.detectors]
    for axes, key, label in (
        (grid[0, 2], "false_alarms", f"false alarms (%),\nset for {RATE:.0%} (line)"),
        (grid[1, 2], "recall", "injected anomalies\nfound (%)"),
    ):
        values = [100 * each[key] for each in report.detectors]
        axes.hlines(range(len(names)), 0, values, color=QUIET, linewidth=0.8)
        for place, (name, value) in enumerate(zip(names, values, strict=True)):
            is_used = name == report.detector
            axes.plot(
                value,
                place,
                "o",
                color=ENHANCED if is_used else REAL,
                markersize=5 if is_used else 3,
                clip_on=False,
            )
        axes.set_yticks(range(len(names)), names, fontsize=6)
        axes.set_ylim(len(names) - 0.6, -0.6)
        axes.set_xlim(0, max(2.0, *values) if key == "false_alarms" else 100)
        axes.set_xlabel(label)
    grid[0, 2].axvline(100 * RATE, color=LINE, linewidth=0.6, zorder=0)
    for unused in (*grid[len(shown) :, :2].flat, *grid[2:, 2]):
        unused.remove()
    _foot(figure, f"enhsim-tf fit · windows of {report.window:,} samples")
    return figure


@matplotlib.style.context(STYLE)
def score_figure(
    frame: pd.DataFrame, simulator: EnhancedSimulator, name: str
) -> matplotlib.figure.Figure:
    """Draws the scores that `scoring.score` returns: series, enhanced run if there is one, scores and events; `name` is that of the source."""
    single, number = len(simulator.channels) == 1, len(frame.attrs["events"])
    channels = ["value"] if single else _shown_channels(frame, simulator)
    share = frame["flag"].sum() / max(1, frame["score"].notna().sum())
    title = (
        f"{drawable(name, 30)}: {counted(number, 'event')}, {share:.1%} of scored samples flagged"
    )
    subtitle = f"Detector: {frame.attrs['detector']}. Shaded: events. Dashed: threshold."
    if len(channels) < len(simulator.channels):
        subtitle += (
            f" Drawn: the {len(channels)} of {len(simulator.channels)} channels that depart most."
        )
    sheet = _Sheet(
        frame, [*(simulator.channels if single else channels), "score"], title, subtitle, "score"
    )
    *_, last = sheet.axes
    for axes, channel in zip(sheet.axes, channels, strict=False):
        sheet.curve(axes, frame[channel], REAL, 0.6)
        enhanced = "enhanced" if single else f"enhanced {channel}"
        if enhanced in frame:
            sheet.curve(axes, frame[enhanced], ENHANCED, 1.0)
            title_words(
                axes,
                [("telemetry", REAL), ("enhanced run", ENHANCED)] if axes is sheet.axes[0] else [],
            )
    if "score_after" in frame:
        sheet.curve(last, frame["score_after"], ENHANCED, 0.7)
        title_words(
            last, [("against what was learnt", REAL), ("against the new operating point", ENHANCED)]
        )
    sheet.curve(last, frame["score"], REAL, 0.7)
    last.axhline(1, color=QUIET, linewidth=0.8, linestyle=DASHED)
    if np.nanmax(frame["score"].to_numpy(), initial=0.0) > 20:
        last.set_yscale("log")
    for axes in sheet.axes:
        sheet.shade(axes, [(event["begin"], event["end"], "") for event in frame.attrs["events"]])
    return sheet.figure


@matplotlib.style.context(STYLE)
def inject_figure(frame: pd.DataFrame, channels: Sequence[str]) -> matplotlib.figure.Figure:
    """Draws telemetry of these channels into which `datasets.inject` has put anomalies: the first ones that are changed."""
    anomalies, changed = frame.attrs["anomalies"], int(frame["mask"].sum())
    own = {name: [each for each in anomalies if each.channel in (None, name)] for name in channels}
    shown = [name for name in channels if own[name]][:_MOST_CHANNELS]
    title = f"{drawable(spoken(channels), 30)}: {counted(len(anomalies), 'anomaly')}, {changed:,} of {len(frame):,} samples changed"
    subtitle = f"Shaded: {', '.join(dict.fromkeys(each.kind for each in anomalies))}."
    if len(shown) < len(channels):
        subtitle += f" Drawn: {len(shown)} of {len(channels)} channels."
    sheet = _Sheet(frame, shown, title, subtitle, "inject", above=0.4)
    for axes, name in zip(sheet.axes, shown, strict=True):
        sheet.curve(axes, frame["value" if len(channels) == 1 else name], REAL, 0.6)
        sheet.shade(axes, [(each.begin, each.end, each.kind) for each in own[name]])
    return sheet.figure


class _Sheet:
    """One panel for each label, in one column over the times of a table, with `above` inches of free space above each panel."""

    def __init__(
        self,
        frame: pd.DataFrame,
        labels: Sequence[str],
        title: str,
        subtitle: str,
        command: str,
        above: float = 0.2,
    ):
        times = told_times(frame)
        has_time = hasattr(times, "tz")
        self.times = matplotlib.dates.date2num(times) if has_time else times.to_numpy(np.float64)
        steps = np.diff(self.times)
        self.step = np.median(steps)
        self.gaps = 1 + np.flatnonzero(steps > 1.5 * self.step)  # the samples after a gap
        self.figure, down = new_sheet(DOUBLE, 1.0 + (0.95 + above) * len(labels), title, subtitle)
        self.axes = panels(
            self.figure, down + above, len(labels), 1, gap=(above + 0.04, 0.0), sharex=True
        )[:, 0]
        for axes, label in zip(self.axes, labels, strict=True):
            axes.set_ylabel(drawable(label, 14), parse_math=False)
        last = self.axes[-1]
        if has_time:
            locator = matplotlib.dates.AutoDateLocator(minticks=3, maxticks=7)
            last.xaxis.set_major_locator(locator)
            last.xaxis.set_major_formatter(matplotlib.dates.ConciseDateFormatter(locator))
        last.set_xlabel(
            "time (UTC)" if has_time else "time (s)" if frame.attrs["counts"] else "sample"
        )
        _foot(self.figure, f"enhsim-tf {command} · {len(frame):,} samples")

    def curve(self, axes: Axes, series: pd.Series, color: str, width: float) -> None:
        """Draws a series with a break at each gap; of a long one the envelope, so that no spike is lost."""
        times, gaps, values = self.times, self.gaps, series.to_numpy()
        if len(values) > _MOST_POINTS:
            edges = np.union1d(
                np.linspace(0, len(values), _MOST_POINTS // 2 + 1).astype(int)[:-1], gaps
            )
            low, high = np.fmin.reduceat(values, edges), np.fmax.reduceat(values, edges)
            times, values, gaps = (
                np.repeat(times[edges], 2),
                np.stack([low, high], axis=1).ravel(),
                2 * np.searchsorted(edges, gaps),
            )
        axes.plot(
            np.insert(times, gaps, times[gaps]),
            np.insert(values, gaps, np.nan),
            color=color,
            linewidth=width,
        )

    def shade(self, axes: Axes, spans: Sequence[tuple[int, int, str]]) -> None:
        """Shades stretches of time, each given by its first sample, its end and a word; if they are few, writes the words in three lines above."""
        (low, high), taken = axes.get_xlim(), [0.0] * 3 if len(spans) <= _MOST_NAMED else []
        for begin, end, word in spans:
            first, after = (
                self.times[begin],
                self.times[end - 1] + self.step,
            )  # the next sample may come after a gap
            axes.axvspan(first, after, color=GENERATED, alpha=0.3, linewidth=0.5)
            width = 0.012 + 0.0085 * len(word)  # of text of 7 points, in widths of the panel
            is_last = (first - low) / (high - low) + width > 1
            left = (after - low) / (high - low) - width if is_last else (first - low) / (high - low)
            line = next((line for line, until in enumerate(taken) if until <= left), None)
            if line is not None:
                taken[line] = left + width
                style = {
                    "color": IN_PRINT[GENERATED],
                    "fontsize": 7,
                    "ha": "right" if is_last else "left",
                }
                place = after if is_last else first, 1
                axes.annotate(
                    word,
                    place,
                    (0, 2 + 8.5 * line),
                    axes.get_xaxis_transform(),
                    "offset points",
                    **style,
                )


def _foot(figure: matplotlib.figure.Figure, text: str) -> None:
    figure.text(EDGE / DOUBLE, 0.08 / figure.get_size_inches()[1], text, size=7, color=QUIET)


def _shown_channels(frame: pd.DataFrame, simulator: EnhancedSimulator) -> list[str]:
    """The channels that are drawn: of many, those that add most to the Mahalanobis distance of the flagged samples from nominal telemetry."""
    names, some = (
        list(simulator.channels),
        frame[frame["flag"] if frame["flag"].any() else frame["score"].notna()],
    )
    if len(names) <= _MOST_CHANNELS or simulator.nominal is None:
        return names[:_MOST_CHANNELS]
    nominal = np.concatenate(
        simulator.judged_series(simulator.nominal, simulator.nominal_run)
    ).astype(np.float64)
    left = some[names].to_numpy() - (
        some[[f"enhanced {name}" for name in names]].to_numpy() if simulator.is_run_model else 0.0
    )
    unit = np.maximum(nominal.std(axis=0), 1e-9)
    inverse = np.linalg.pinv(np.cov(nominal / unit, rowvar=False))
    size = np.mean(((left - nominal.mean(axis=0)) / unit @ inverse) ** 2, axis=0) / np.diag(inverse)
    return [names[place] for place in sorted(np.argsort(-size, kind="stable")[:_MOST_CHANNELS])]


def drawable(text: str, most_letters: int) -> str:
    """Returns text as one line that the font can draw: unknown characters are replaced, and longer text is shortened."""
    letters = font_manager.get_font(font_manager.findfont("DejaVu Sans")).get_charmap()
    known = "".join(letter if ord(letter) in letters else "?" for letter in printable(text))
    return known if len(known) <= most_letters else f"{known[: most_letters - 3]}..."
