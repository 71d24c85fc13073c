"""Real and generated rows in random order, to be told apart by the reader (Figures 5 to 7)."""

import matplotlib.figure
import numpy as np

from enhsim_tf.common.number_words import in_words
from enhsim_tf.common.plot_style import DOUBLE, EDGE, FOOT, QUIET, REAL, name_axes, new_sheet, panels
from enhsim_tf.reproduce.paper.figures.paper_figure import Arrays


def shuffled(real: np.ndarray, generated: np.ndarray, rng: np.random.Generator) -> Arrays:
    """Real and generated rows in random order, and which rows are generated."""
    is_generated = np.repeat([False, True], [len(real), len(generated)])
    order = rng.permutation(len(is_generated))
    return {"rows": np.concatenate([real, generated])[order], "is_generated": is_generated[order]}


def guessing_figure(data: Arrays, what: str, remark: str = "", columns: int = 4) -> matplotlib.figure.Figure:
    """Real and generated rows in random order; the answer, and a remark that would help to find it, are upside down at the bottom."""
    number, generated = len(data["rows"]), int(data["is_generated"].sum())
    rows = -(-number // columns)
    verb = "is" if generated == 1 else "are"
    figure, down = new_sheet(
        DOUBLE,
        1.24 + 0.95 * rows if columns > 1 else 1.3 + 0.72 * rows,
        f"{in_words(generated).capitalize()} of these {in_words(number)} {what} {verb} generated. Which?",
        "Counterpart, not a reproduction, of a generated face that the paper shows here.",
    )
    axes = panels(figure, down + 0.2, rows, columns, gap=(0.24, 0.14), sharex=True, sharey=True)
    letters = "abcdefghijklmnop"[:number]
    for panel, row, letter in zip(axes.flat, data["rows"], letters, strict=True):
        panel.plot(data["time"], row, color=REAL, linewidth=0.5)
        panel.set_title(letter, weight="bold")
    name_axes(axes, data)
    answer = ", ".join(letter for letter, is_generated in zip(letters, data["is_generated"], strict=True) if is_generated)
    width, height = figure.get_size_inches()
    upside_down = {"size": 7, "color": QUIET, "rotation": 180, "ha": "right"}
    figure.text(1 - EDGE / width, (FOOT + 0.04) / height, f"generated: {answer}", gid="answer", **upside_down)
    figure.text(1 - EDGE / width, EDGE / height, remark, gid="remark", **upside_down)
    return figure
