"""Figure 7: long stretches of real and generated telemetry in random order."""

import matplotlib.figure
import numpy as np

from enhsim_tf.reproduce.paper.figures.guessing import guessing_figure, shuffled
from enhsim_tf.reproduce.paper.figures.paper_figure import Arrays, PaperFigure
from enhsim_tf.reproduce.paper.figures.window_arrays import draw_seed, time_axis
from enhsim_tf.reproduce.paper.pipeline import Experiment

LONG_STRETCH = 3_000  # samples: six windows of the paper's example


def arrays(experiment: Experiment) -> Arrays:
    """Long stretches of held-out telemetry and as many generated ones of the same times, shuffled."""
    rng, test = experiment.data.draw("figure 7"), experiment.data.channels[0].test
    length = min(LONG_STRETCH, len(test))
    begins = np.arange(min(2, len(test) // length)) * (len(test) - length)  # a real channel may be long enough for one only
    real = np.stack([test.values[begin : begin + length] for begin in begins])
    generated = [experiment.simulator.generate_series(length, seed=draw_seed(rng), start_s=test.time_s[begin]) for begin in begins]
    return shuffled(real, np.stack(generated), rng) | time_axis(experiment, length)


def draw(data: Arrays) -> matplotlib.figure.Figure:
    """Draws Figure 7."""
    return guessing_figure(
        data,
        "stretches of telemetry",
        "the noise of a generated stretch repeats a pattern every half window",
        columns=1,
    )


FIGURE = PaperFigure(
    number=7,
    title="Real or generated: long stretches of telemetry (counterpart of a borrowed picture)",
    alt=(
        "Long stretches of telemetry, held-out real and generated ones in random order, each with a letter, for the reader to tell "
        "apart; the answer is printed upside down at the foot."
    ),
    drawn_by=draw,
    arrays=arrays,
    stages=("telemetry", "enhancer", "noise GAN"),
)
