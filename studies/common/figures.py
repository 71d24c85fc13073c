"""How the figures of studies are laid out: labels of rows, and a legend below the heading."""

from typing import Any

import matplotlib.figure
import numpy as np
from matplotlib.axes import Axes

from enhsim_tf.common.plot_style import DOUBLE


def leave_room(grid: np.ndarray, left: float, width: float, gap: float = 0.03) -> None:
    """Moves the panels of a figure of width `DOUBLE` to the right, so that the labels of its rows
    fit beside them.

    Args:
        grid: Axes of shape `(rows, columns)`.
        left: Distance from the left edge of the figure to the panels, in inches.
        width: Width of all panels and their gaps, as a share of that of the figure.
        gap: Distance between two panels, as a share of the width of the figure.
    """
    each = width / grid.shape[1]
    for (_, column), axes in np.ndenumerate(grid):
        place = axes.get_position()
        axes.set_position([left / DOUBLE + column * each, place.y0, each - gap, place.height])


def legend(
    figure: matplotlib.figure.Figure, axes: Axes, at: tuple[float, float], **style: Any
) -> None:
    """Names the curves of a panel in a legend for the whole figure.

    Args:
        figure: The figure.
        axes: The panel.
        at: Place of the legend, from the left as a share of the width, and from the top in inches.
        **style: What `Figure.legend` takes beside it.
    """
    handles, labels = axes.get_legend_handles_labels()
    place = (at[0], 1 - at[1] / figure.get_size_inches()[1])
    figure.legend(handles, labels, frameon=False, bbox_to_anchor=place, **style)
