"""The common style of all figures: heading, panels, colours, and labels beside the curves.

The colours remain distinguishable in greyscale and for colour-blind readers because they differ in
lightness. Curves that share a panel also differ in line style, width or label.
"""

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib.figure
import numpy as np
from matplotlib.axes import Axes

STYLE = ("default", Path(__file__).with_name("style.mplstyle"))  # for `matplotlib.style.context`
REAL = "#1a1a1a"
COARSE = "#8c8c8c"
ENHANCED = "#0072b2"
GENERATED = "#d55e00"
AVERAGE = "#e69f00"
# residual windows, ridge regression, other learnt noise
RESIDUALS = "#009e73"
RIDGE = "#56b4e9"
LEARNT = "#cc79a7"
# secondary text; outlines
QUIET = "#595959"
LINE = "#8c8c8c"
# darker colours for text that names a curve
IN_PRINT = {COARSE: QUIET, GENERATED: "#b85000", AVERAGE: "#946300"}
DASHED = (0, (4, 2))  # line style of the second curve of a panel
GREY_TINT = "#f3f3f3"
# widths of one and two journal columns, in inches
SINGLE = 3.5
DOUBLE = 7.2
FOOT = 0.26  # free space for the caption line at the bottom of each figure, in inches
EDGE = 0.10  # distance from the edges of the figure to its text, in inches


def new_sheet(
    width: float, height: float, title: str, subtitle: str = ""
) -> tuple[matplotlib.figure.Figure, float]:
    """Creates an empty figure with a title, the main message, and a subtitle that qualifies it.

    Returns:
        The figure, and the height of the heading; all lengths are in inches.
    """
    figure = matplotlib.figure.Figure(figsize=(width, height))
    down = 0.10
    for text, size, weight, color, letters_an_inch in (
        (title, 9, "bold", REAL, 13.5),
        (subtitle, 7.5, "normal", QUIET, 18.5),
    ):
        for line in textwrap.wrap(text, int((width - 2 * EDGE) * letters_an_inch)):
            figure.text(
                EDGE / width,
                1 - (down + size / 72) / height,
                line,
                size=size,
                weight=weight,
                color=color,
                parse_math=False,
            )
            down += 1.35 * size / 72
        down += 0.04
    return figure, down


def panels(
    figure: matplotlib.figure.Figure,
    down: float,
    rows: int,
    columns: int,
    right: float = 0.15,
    gap: tuple[float, float] = (0.24, 0.14),
    height_ratios: Sequence[float] | None = None,
    **shared: bool,
) -> np.ndarray:
    """Adds a grid of axes below the heading.

    Args:
        figure: The figure.
        down: Distance from the top of the figure to the grid, in inches, as are `right` and `gap`.
        rows: Number of rows.
        columns: Number of columns.
        right: Distance from the grid to the right edge of the figure.
        gap: Distance between rows and between columns.
        height_ratios: Relative heights of the rows.
        **shared: `sharex` and `sharey` of `Figure.subplots`.

    Returns:
        Array of axes of shape `(rows, columns)`.
    """
    width, height = figure.get_size_inches()
    left = 0.66
    bottom = FOOT + 0.38
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


def name_axes(axes: np.ndarray, data: Mapping[str, Any]) -> None:
    """Labels the time axis and the value axis of a grid once, with their units."""
    figure = axes[0, 0].figure
    width, height = axes[0, 0].figure.get_size_inches()
    last = axes[-1, -1].get_position()
    first = axes[0, 0].get_position()
    figure.text(
        (first.x0 + last.x1) / 2, (FOOT + 0.04) / height, f"time ({data['time_unit']})", ha="center"
    )
    figure.text(
        0.17 / width,
        (first.y1 + last.y0) / 2,
        f"value ({data['unit']})",
        rotation=90,
        ha="center",
        va="center",
    )


def beside(axes: Axes, height: float, text: str, color: str) -> None:
    """Puts a label to the right of the axes, at a height from 0 to 1 of them, in the colour of its
    curve or darker.
    """
    style = {
        "color": IN_PRINT.get(color, color),
        "va": "center",
        "linespacing": 1.05,
        "annotation_clip": False,
    }
    axes.annotate(text, (1, height), (5, 0), "axes fraction", "offset points", **style)


def label_ends(axes: Axes, curves: Mapping[str, tuple[Any, str]]) -> None:
    """Labels the right ends of curves, given for each label as values and colour, and moves labels
    apart that would overlap.
    """
    low, high = axes.get_ylim()
    inches = axes.get_position().height * axes.figure.get_size_inches()[1]
    ends = sorted(
        (float(np.ravel(values)[-1]), name, color) for name, (values, color) in curves.items()
    )
    at = np.array([(value - low) / (high - low) for value, _, _ in ends])
    needed = np.array([0.13 * (1 + name.count("\n")) / inches for _, name, _ in ends])
    for _ in range(200):  # move overlapping neighbours apart until none overlap
        overlap = np.maximum((needed[1:] + needed[:-1]) / 2 - np.diff(at), 0)
        at[1:] += overlap / 2
        at[:-1] -= overlap / 2
    for height, (_, name, color) in zip(at, ends, strict=True):
        beside(axes, height, name, color)


def title_words(axes: Axes, words: Sequence[tuple[str, str]]) -> None:
    """Writes a title of pairs of word and colour: each word has the colour of the curve that it
    names.
    """
    width = axes.get_position().width * axes.figure.get_size_inches()[0]
    place = 0.0
    for word, color in words:
        style = {"color": IN_PRINT.get(color, color), "weight": "bold", "annotation_clip": False}
        axes.annotate(word, (place, 1), (0, 4), "axes fraction", "offset points", **style)
        place += (0.06 * len(word) + 0.12) / width
