"""Figure 5: real and generated windows of telemetry in random order."""

import matplotlib.figure

from enhsim_tf.reproduce.paper.figures.guessing import guessing_figure, shuffled
from enhsim_tf.reproduce.paper.figures.paper_figure import Arrays, PaperFigure
from enhsim_tf.reproduce.paper.figures.window_arrays import draw_seed, spread_windows, time_axis
from enhsim_tf.reproduce.paper.pipeline import Experiment


def arrays(experiment: Experiment) -> Arrays:
    """Windows of real and of generated telemetry, shuffled."""
    rng = experiment.data.draw("figure 5")
    real = spread_windows(experiment, "test", 4, "figure 5, real")["target"]
    return shuffled(real, experiment.simulator.generate(4, seed=draw_seed(rng)), rng) | time_axis(experiment)


def draw(data: Arrays) -> matplotlib.figure.Figure:
    """Draws Figure 5."""
    return guessing_figure(data, "windows of telemetry")


FIGURE = PaperFigure(
    number=5,
    title="Real or generated: windows of telemetry (counterpart of a borrowed picture)",
    alt=(
        "Real and generated windows of telemetry in random order, each with a letter, for the reader to tell apart; the answer is printed upside down at the foot."
    ),
    drawn_by=draw,
    arrays=arrays,
    stages=("telemetry", "enhancer", "noise GAN"),
)
