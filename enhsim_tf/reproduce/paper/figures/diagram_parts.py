"""Boxes, arrows and insets of the diagrams (Figures 1 and 11).

Positions and sizes are in inches, so that boxes and text keep their size.
"""

from collections.abc import Sequence

import matplotlib.figure
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, FancyBboxPatch, Polygon

from enhsim_tf.common.plot_style import GREY_TINT, LINE, QUIET, REAL

DASHES = (0, (2.6, 1.6))


def drawing_board(figure: matplotlib.figure.Figure) -> Axes:
    """Axes without a frame over the whole figure, in inches from its lower left corner."""
    width, height = figure.get_size_inches()
    return figure.add_axes((0, 0, 1, 1), xlim=(0, width), ylim=(0, height), frame_on=False, xticks=(), yticks=())


def box(axes: Axes, x: float, y: float, width: float, height: float, fill: str = "white", edge: str = LINE, **options) -> None:
    """A box with rounded corners; `options` are passed to the patch."""
    style = "round,pad=0,rounding_size=0.06"
    axes.add_patch(FancyBboxPatch((x, y), width, height, boxstyle=style, facecolor=fill, edgecolor=edge, **{"linewidth": 0.8} | options))


def arrow(axes: Axes, points: Sequence[tuple[float, float]], dashed: bool = False, color: str = REAL, linewidth: float = 1.1) -> None:
    """An arrow along straight pieces, in inches."""
    points = np.array(points, float)
    along = (points[-1] - points[-2]) / np.hypot(*(points[-1] - points[-2]))
    neck, across = points[-1] - 0.08 * along, 0.038 * along[::-1] * (1, -1)
    style = {"linestyle": DASHES if dashed else "-", "color": color, "linewidth": linewidth, "solid_joinstyle": "miter"}
    axes.plot(*np.vstack([points[:-1], neck]).T, **style, zorder=2.5, solid_capstyle="butt")
    axes.add_patch(Polygon([points[-1], neck + across, neck - across], facecolor=color, edgecolor="none", zorder=2.6))


def badge(axes: Axes, x: float, y: float, number: int) -> None:
    """The number of a step of the paper."""
    axes.add_patch(Circle((x, y), 0.105, facecolor=REAL, edgecolor="white", linewidth=1, zorder=3))
    axes.text(x, y - 0.005, str(number), color="white", weight="bold", size=8, ha="center", va="center_baseline", zorder=4)


def words(axes: Axes, x: float, top: float, text: str, size: float = 7, color: str = QUIET, **options) -> None:
    """Lines of text at equal distances below `top`."""
    for number, line in enumerate(text.split("\n")):
        axes.text(x, top - size / 72 * (0.95 + 1.3 * number), line, size=size, color=color, **options)


def card(
    axes: Axes, x: float, top: float, size: tuple[float, float], heading: str, text: str, number: int | None = None, **options
) -> None:
    """A box with a heading, small print and the number of its step. Text is centred in a grey box, which has no curve."""
    box(axes, x, top - size[1], *size, **options)
    down = (size[1] - 0.12 * (2 + text.count("\n"))) / 2 - 0.04 if options.get("fill") == GREY_TINT else 0.1
    words(axes, x + 0.13, top - down, heading, 7.5, REAL, weight="bold")
    words(axes, x + 0.13, top - down - 0.15, text)
    if number is not None:
        badge(axes, x, top, number)


def inset(figure: matplotlib.figure.Figure, left: float, bottom: float, width: float, height: float, **options) -> Axes:
    """Axes without frame in a rectangle given in inches."""
    across, up = figure.get_size_inches()
    place = (left / across, bottom / up, width / across, height / up)
    return figure.add_axes(place, frame_on=False, xticks=(), yticks=(), **options)
