"""Figure 3: the layers of the enhancer."""

import matplotlib.figure

from enhsim_tf.reproduce.paper.figures.layer_table import draw_layers, layer_rows
from enhsim_tf.reproduce.paper.figures.paper_figure import Arrays, PaperFigure
from enhsim_tf.reproduce.paper.pipeline import Experiment


def arrays(experiment: Experiment) -> Arrays:
    """The layers of the network before training."""
    return layer_rows(experiment.untrained_enhancer())


def draw(data: Arrays) -> matplotlib.figure.Figure:
    """Draws Figure 3."""
    return draw_layers(data, f"The enhancer maps a coarse window to a smooth one with {int(data['total']) / 1e6:.1f} million parameters")


FIGURE = PaperFigure(
    number=3,
    title="Enhancing MLP neural network",
    alt=("Table of the enhancer's layers with their output shapes and numbers of parameters, and the total."),
    drawn_by=draw,
    arrays=arrays,
    stages=("telemetry",),
)
