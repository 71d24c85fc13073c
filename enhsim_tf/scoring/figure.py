"""The figure of scores, and the panels over time that other figures share."""

from collections.abc import Sequence

import matplotlib.dates
import matplotlib.figure
import matplotlib.style
import numpy as np
import pandas as pd
from matplotlib import font_manager
from matplotlib.axes import Axes

from enhsim_tf.common.errors import counted, printable
from enhsim_tf.common.plot_style import (
    DASHED,
    DOUBLE,
    EDGE,
    ENHANCED,
    GENERATED,
    IN_PRINT,
    QUIET,
    REAL,
    STYLE,
    new_sheet,
    panels,
    title_words,
)
from enhsim_tf.scoring.score import ScoredTelemetry, told_times
from enhsim_tf.telemetry.series import Clock

MOST_CHANNELS = 3
_MOST_NAMED = 20  # spans of a panel that have their names above it
# of a curve; beyond, the smallest and the largest value of each stretch are drawn
_MOST_POINTS = 4_000


@matplotlib.style.context(STYLE)
def score_figure(scored: ScoredTelemetry, name: str) -> matplotlib.figure.Figure:
    """Draws scored telemetry: series, enhanced run if there is one, scores and events; `name` is
    that of the source.
    """
    frame = scored.table
    number = len(scored.events)
    channels = _shown_channels(scored)
    share = frame["flag"].sum() / max(1, frame["score"].notna().sum())
    title = (
        f"{drawable(name, 30)}: {counted(number, 'event')}, {share:.1%} of scored samples flagged"
    )
    subtitle = (
        "Shaded: events, with what raised them. Flagged: scores that rise above the dashed line."
    )
    if len(channels) < len(scored.columns):
        subtitle += (
            f" Drawn: the {len(channels)} of {len(scored.columns)} channels that depart most."
        )
    sheet = Sheet(frame.index, scored.clock, [*channels, "score"], title, subtitle, "score")
    *_, last = sheet.axes
    for axes, channel in zip(sheet.axes, channels, strict=False):
        sheet.curve(axes, frame[scored.columns[channel]], REAL, 0.6)
        if channel in scored.enhanced:
            sheet.curve(axes, frame[scored.enhanced[channel]], ENHANCED, 1.0)
    if scored.enhanced:
        title_words(sheet.axes[0], [("telemetry", REAL), ("enhanced run", ENHANCED)])
    sheet.curve(last, frame["score"], REAL, 0.7)
    last.axhline(1, color=QUIET, linewidth=0.8, linestyle=DASHED)
    if np.nanmax(frame["score"].to_numpy(), initial=0.0) > 20:
        last.set_yscale("log")
    for axes in sheet.axes:
        spans = [
            (event.begin, event.end, ", ".join(event.views) if axes is last else "")
            for event in scored.events
        ]
        sheet.shade(axes, spans)
    return sheet.figure


class Sheet:
    """One panel for each label, in one column over the times of the rows of a table, with `above`
    inches of free space above each panel.
    """

    def __init__(
        self,
        index: pd.Index,
        clock: Clock,
        labels: Sequence[str],
        title: str,
        subtitle: str,
        command: str,
        above: float = 0.2,
    ):
        times = told_times(index, clock)
        has_time = hasattr(times, "tz")
        self.lines = 1 + int(above / 0.2)  # of words above a panel
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
        last.set_xlabel("time (UTC)" if has_time else "time (s)" if clock.counts else "sample")
        foot(self.figure, f"enhsim-tf {command} · {len(index):,} samples")

    def curve(self, axes: Axes, series: pd.Series, color: str, width: float) -> None:
        """Draws a series with a break at each gap; of a long one the envelope, so that no spike is
        lost.
        """
        times = self.times
        gaps = self.gaps
        values = series.to_numpy()
        if len(values) > _MOST_POINTS:
            edges = np.union1d(
                np.linspace(0, len(values), _MOST_POINTS // 2 + 1).astype(int)[:-1], gaps
            )
            low = np.fmin.reduceat(values, edges)
            high = np.fmax.reduceat(values, edges)
            times = np.repeat(times[edges], 2)
            values = np.stack([low, high], axis=1).ravel()
            gaps = 2 * np.searchsorted(edges, gaps)
        axes.plot(
            np.insert(times, gaps, times[gaps]),
            np.insert(values, gaps, np.nan),
            color=color,
            linewidth=width,
        )

    def shade(self, axes: Axes, spans: Sequence[tuple[int, int, str]]) -> None:
        """Shades stretches of time, each given by its first sample, its end and a word; if they are
        few, writes the words in lines above.
        """
        (low, high) = axes.get_xlim()
        taken = [0.0] * self.lines if len(spans) <= _MOST_NAMED else []
        for begin, end, word in spans:
            # the next sample may come after a gap
            first = self.times[begin]
            after = self.times[end - 1] + self.step
            axes.axvspan(first, after, color=GENERATED, alpha=0.3, linewidth=0.5)
            width = 0.012 + 0.0085 * len(word)  # of text of 7 points, in widths of the panel
            left = (first - low) / (high - low)
            is_last = left + width > 1
            if is_last:
                left = (after - low) / (high - low) - width
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


def foot(figure: matplotlib.figure.Figure, text: str) -> None:
    """Writes the line below a figure."""
    figure.text(EDGE / DOUBLE, 0.08 / figure.get_size_inches()[1], text, size=7, color=QUIET)


def _shown_channels(scored: ScoredTelemetry) -> list[str]:
    """The channels that are drawn: of many, those that raised most events, and the first ones."""
    raised = [name for event in scored.events for name in event.channels]
    names = list(scored.columns)
    return sorted(sorted(names, key=raised.count, reverse=True)[:MOST_CHANNELS], key=names.index)


def drawable(text: str, most_letters: int) -> str:
    """Returns text as one line that the font can draw: unknown characters are replaced, and longer
    text is shortened.
    """
    letters = font_manager.get_font(font_manager.findfont("DejaVu Sans")).get_charmap()
    known = "".join(letter if ord(letter) in letters else "?" for letter in printable(text))
    return known if len(known) <= most_letters else f"{known[: most_letters - 3]}..."
