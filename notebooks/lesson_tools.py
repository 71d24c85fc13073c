"""Functions that the lessons share beside figures and claims: sentences with computed numbers, answers of students, and sliders."""

import os
from collections.abc import Callable, Sequence
from typing import Any

from IPython.display import Markdown, display

STATIC = "ENHSIM_TF_STATIC"  # set while a notebook is executed to be read: it then holds pictures instead of sliders
TIMES = "times.json"  # in the folder of the notebooks: seconds that each took, by its number and the budget
NOT_ANSWERED, RIGHT, NOT_YET = "Not yet answered.", "Right.", "Not yet."


def say(text: str) -> None:
    """Displays a sentence as Markdown. Its numbers are computed, so that it cannot contradict them."""
    display(Markdown(text))


def check_answer(answer: Any, is_right: Callable[[Any], bool], hint: str) -> None:
    """Says whether a student's answer to an exercise is right.

    Args:
        answer: The answer; None for a starter cell that was not changed.
        is_right: Whether an answer is right.
        hint: What to look at if it is not.
    """
    if answer is None:
        print(NOT_ANSWERED)
        return
    try:
        right = bool(is_right(answer))
    except (
        TypeError,
        ValueError,
        IndexError,
        KeyError,
        AttributeError,
    ) as error:  # an answer of another type or shape
        print(f"{NOT_YET} The check cannot use this answer: {error}")
        return
    print(RIGHT if right else f"{NOT_YET} {hint}")


def slider(
    draw: Callable[[Any], None], label: str, values: Sequence[Any], shown: Sequence[Any], unit: str = ""
) -> None:
    """Displays a picture below a slider, or the pictures of a few values in a notebook that is executed to be read.

    Args:
        draw: Draws the picture for a value, for example with `drawing`.
        label: What the slider changes.
        values: The values of the slider, in their order.
        shown: The values whose pictures are stored; the slider starts at the first one.
        unit: Unit of the values.
    """
    if os.environ.get(STATIC):
        say(
            f"*Run this cell in Jupyter to change the {label} with a slider. Stored here: {', '.join(map(str, shown))} {unit}".rstrip()
            + ".*"
        )
        for value in shown:
            draw(value)
        return
    import ipywidgets

    name = f"{label} ({unit})" if unit else label
    control = ipywidgets.SelectionSlider(
        options=list(values),
        value=shown[0],
        description=name,
        continuous_update=False,
        style={"description_width": "initial"},
        layout={"width": "80%"},
    )
    display(control, ipywidgets.interactive_output(lambda value: draw(value), {"value": control}))
