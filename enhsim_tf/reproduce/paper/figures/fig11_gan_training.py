"""Figure 11: the two phases of an iteration of the adversarial training."""

import matplotlib.figure
import numpy as np

from enhsim_tf.common.plot_style import (
    BLUE_TINT,
    DOUBLE,
    EDGE,
    ENHANCED,
    GENERATED,
    GREY_TINT,
    IN_PRINT,
    ORANGE_TINT,
    QUIET,
    REAL,
    new_sheet,
)
from enhsim_tf.reproduce.paper.figures.diagram_parts import DASHES, arrow, box, drawing_board
from enhsim_tf.reproduce.paper.figures.paper_figure import Arrays, PaperFigure
from enhsim_tf.reproduce.paper.pipeline import Experiment


def arrays(experiment: Experiment) -> Arrays:
    """The numbers of the adversarial training."""
    training = experiment.settings.adversarial
    numbers = {"batch_size": training.batch_size, "num_iterations": training.num_iterations, "latent": experiment.settings.noise.latent}
    return {key: np.array(value) for key, value in numbers.items()} | {"mixed_batch": np.array(training.mixed_batch)}


def draw(data: Arrays) -> matplotlib.figure.Figure:
    """The two phases of an iteration, one below the other on the same plan."""
    batch, latent, updates = f"{int(data['batch_size']):,}", int(data["latent"]), "one update" if data["mixed_batch"] else "two updates"
    title = "Each iteration trains the discriminator, then the generator through the frozen discriminator"
    figure, down = new_sheet(
        DOUBLE, 3.94, title, f"{int(data['num_iterations']):,} iterations; {batch} rows of real and of generated noise in each"
    )
    axes, tall, gap = drawing_board(figure), 1.46, 0.12
    left, wide = np.array([0.25, 1.5, 2.86, 4.28, 5.78]), np.array([0.98, 1.09, 1.1, 1.2, 1.2])
    right, middle, height = left + wide, left + wide / 2, 0.46
    first = 3.94 - down - 0.06
    phases = (
        (
            first,
            "1  The discriminator learns",
            f"from equal amounts of real and generated noise, in {updates} of its weights",
            ENHANCED,
            BLUE_TINT,
        ),
        (
            first - tall - gap,
            "2  The generator learns",
            "through the combined model, with labels that say that its rows are real",
            GENERATED,
            ORANGE_TINT,
        ),
    )
    for phase, (top, heading, text, color, tint) in enumerate(phases, 1):
        box(axes, EDGE, top - tall, DOUBLE - 2 * EDGE, tall, fill=GREY_TINT, edge="none")
        axes.text(left[0], top - 0.22, heading, size=8, weight="bold", color=REAL)
        axes.text(left[0] + 1.95, top - 0.22, text, size=7.5, color=QUIET)
        y = top - (1.1 if phase == 1 else 0.8)  # of the generated rows
        judged = top - 0.82 if phase == 1 else y

        def part(column: int, y: float, name: str, text: str, learns: bool | None = None, color: str = color, tint: str = tint) -> None:
            """A box; a network that learns is coloured, one that is frozen has a dashed outline."""
            style = {None: {}, True: {"edge": color, "fill": tint, "linewidth": 1.8}, False: {"linestyle": DASHES, "edge": QUIET}}[learns]
            box(axes, left[column], y - height / 2, wide[column], height, **style)
            axes.text(middle[column], y + 0.075, name, size=7.5, weight="bold", ha="center", va="center")
            axes.text(middle[column], y - 0.095, text, size=7, color=QUIET, ha="center", va="center")

        part(0, y, "Latent vectors", f"{batch} × {latent} numbers")
        part(1, y, "Generator", "learns" if phase == 2 else "frozen", phase == 2)
        part(2, y, "Generated noise", f"{batch} rows")
        part(3, judged, "Discriminator", "learns" if phase == 1 else "frozen", phase == 1)
        part(4, judged, "Loss", "binary cross-entropy")
        for column in (0, 1):
            arrow(axes, [(right[column], y), (left[column + 1], y)])
        arrow(axes, [(right[3], judged), (left[4], judged)])
        if phase == 1:
            part(2, top - 0.54, "Real noise", f"{batch} rows")
            for rows, into in ((top - 0.54, judged + 0.1), (y, judged - 0.1)):
                turn = right[2] + 0.16
                arrow(axes, [(right[2], rows), (turn, rows), (turn, into), (left[3], into)])
        else:
            arrow(axes, [(right[2], y), (left[3], y)])
        # the labels enter the loss from above; the gradient flows back below to the network that learns
        labels = "labels: real 1.0, generated 0.0" if phase == 1 else "label reversed: generated 1.0"
        axes.text(right[4], judged + height / 2 + 0.07, labels, size=7, ha="right")
        low, back = judged - height / 2 - 0.2, 3 if phase == 1 else 1
        arrow(
            axes,
            [(middle[4], judged - height / 2), (middle[4], low), (middle[back], low), (middle[back], judged - height / 2)],
            True,
            color,
            1.5,
        )
        updated = ("the gradient updates", "the gradient passes through the frozen discriminator and updates")[phase - 1]
        updated += f" the {('discriminator', 'generator')[phase - 1]}’s weights only"
        axes.text(right[4], low - 0.14, updated, size=7, color=IN_PRINT.get(color, color), ha="right")
    return figure


FIGURE = PaperFigure(
    number=11,
    title="GAN training",
    alt=(
        "Diagram of the two phases of an iteration. In the first, the discriminator learns: it receives real noise, labelled 1, and noise "
        "from the frozen generator, labelled 0, and the gradient of the loss updates only its own weights. In the second, the generator "
        "learns: its noise goes through the frozen discriminator with the label reversed to 1, and the gradient of the loss updates only "
        "the generator's weights."
    ),
    drawn_by=draw,
    arrays=arrays,
    stages=(),
)
