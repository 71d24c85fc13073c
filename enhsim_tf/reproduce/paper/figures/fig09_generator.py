"""Figure 9: the layers of the generator."""

import matplotlib.figure

from enhsim_tf.reproduce.paper.figures.layer_table import draw_layers, layer_rows, num_samples
from enhsim_tf.reproduce.paper.figures.paper_figure import Arrays, PaperFigure
from enhsim_tf.reproduce.paper.pipeline import Experiment


def arrays(experiment: Experiment) -> Arrays:
    """The layers of the network before training."""
    return layer_rows(experiment.untrained_noise_networks()[0])


def draw(data: Arrays) -> matplotlib.figure.Figure:
    """Draws Figure 9."""
    return draw_layers(
        data,
        f"The generator maps a latent vector of {num_samples(data['input_shape'])} random numbers to {num_samples(data['output_shape'][-1])} samples of noise",
    )


FIGURE = PaperFigure(
    number=9,
    title="Generator construction",
    alt=("Table of the generator's layers with their output shapes and numbers of parameters, and the total."),
    drawn_by=draw,
    arrays=arrays,
    stages=("telemetry",),
)
