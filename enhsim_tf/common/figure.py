"""A figure, and the function that saves it with its caption line."""

import dataclasses
import os
import textwrap
from collections.abc import Callable, Mapping
from pathlib import Path

import matplotlib.figure
import matplotlib.style
import numpy as np

from enhsim_tf.common.atomic_files import replace_file
from enhsim_tf.common.plot_style import EDGE, GENERATED, QUIET, STYLE


@dataclasses.dataclass(frozen=True)
class Figure:
    """A figure.

    Args:
        number: Its number.
        title: What it shows, in a few words.
        alt: Text alternative for readers who cannot see the figure.
        drawn_by: Function that draws the figure from its arrays.
    """

    number: int
    title: str
    alt: str
    drawn_by: Callable[[Mapping[str, np.ndarray]], matplotlib.figure.Figure]

    def draw(self, data: Mapping[str, np.ndarray]) -> matplotlib.figure.Figure:
        """Draws the figure of its arrays in the common style."""
        with matplotlib.style.context(STYLE):
            return self.drawn_by(data)


def save(
    figure: Figure,
    name: str,
    data: Mapping[str, np.ndarray],
    folder: str | os.PathLike,
    caption: str,
    is_smoke: bool,
) -> list[Path]:
    """Draws a figure and writes it with its caption line. The same data give the same bytes.

    Args:
        figure: The figure.
        name: Name of its files.
        data: Its arrays.
        folder: An existing folder.
        caption: Caption line, printed at the bottom.
        is_smoke: Whether the arrays come from a smoke run, which a watermark then says.

    Returns:
        The paths of the files.
    """
    drawn = figure.draw(data)
    width, height = drawn.get_size_inches()
    lines = textwrap.wrap(caption, int((width - 2 * EDGE) * 20.5))
    small = {"size": 7, "color": QUIET, "linespacing": 1.05, "parse_math": False}
    drawn.text(EDGE / width, 0.06 / height, "\n".join(lines), **small, va="bottom", gid="caption")
    if is_smoke:
        mark = {
            "size": 6.2 * width,
            "weight": "bold",
            "color": GENERATED,
            "alpha": 0.22,
            "rotation": 15,
        }
        drawn.text(
            0.5, 0.5, "SMOKE BUDGET", **mark, ha="center", va="center", zorder=10, gid="watermark"
        )
    paths = [Path(folder) / f"{name}.{kind}" for kind in ("png", "svg")]
    with matplotlib.style.context(STYLE):
        for path in paths:
            undated = {"Date": None} if path.suffix == ".svg" else {"Software": None}
            with replace_file(path) as temporary:
                drawn.savefig(
                    temporary, metadata={"Title": figure.title, "Description": figure.alt} | undated
                )
    return paths
