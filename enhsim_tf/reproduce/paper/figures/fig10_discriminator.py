"""Figure 10: the layers of the discriminator."""

import matplotlib.figure

from enhsim_tf.reproduce.paper.figures.layer_table import draw_layers, layer_rows, num_samples
from enhsim_tf.reproduce.paper.figures.paper_figure import Arrays, PaperFigure
from enhsim_tf.reproduce.paper.pipeline import Experiment


def arrays(experiment: Experiment) -> Arrays:
    """The layers of the network before training."""
    return layer_rows(experiment.untrained_noise_networks()[1])


def draw(data: Arrays) -> matplotlib.figure.Figure:
    """Draws Figure 10."""
    return draw_layers(
        data, f"The discriminator maps {num_samples(data['input_shape'])} samples of noise to the probability that they are real"
    )


FIGURE = PaperFigure(
    number=10,
    title="Discriminator construction",
    alt=("Table of the discriminator's layers with their output shapes and numbers of parameters, and the total."),
    drawn_by=draw,
    arrays=arrays,
    stages=("telemetry",),
)
