"""Figure 6: real and generated windows of noise in random order."""

import matplotlib.figure

from enhsim_tf.reproduce.paper.figures.guessing import guessing_figure, shuffled
from enhsim_tf.reproduce.paper.figures.paper_figure import Arrays, PaperFigure
from enhsim_tf.reproduce.paper.figures.window_arrays import draw_seed, time_axis
from enhsim_tf.reproduce.paper.pipeline import Experiment


def arrays(experiment: Experiment) -> Arrays:
    """Windows of real and of generated noise, shuffled, and the effective ranks of many of each."""
    rng = experiment.data.draw("figure 6")
    real = experiment.data.noise_windows("test", 4, "figure 6, real")
    rows = shuffled(real, experiment.simulator.noise.generate(4, seed=draw_seed(rng)), rng)
    measured = experiment.resemblance
    ranks = {
        "rank_generated": measured["noise_rank"],
        "rank_real": measured["noise_real_rank"],
        "rank_windows": measured["noise_num_windows"],
    }
    return rows | ranks | time_axis(experiment)


def draw(data: Arrays) -> matplotlib.figure.Figure:
    """Draws Figure 6."""
    generated, real, number = (float(data[f"rank_{key}"]) for key in ("generated", "real", "windows"))
    return guessing_figure(data, "windows of noise", f"effective rank of {number:,.0f} windows: {generated:.0f} generated, {real:.0f} real")


FIGURE = PaperFigure(
    number=6,
    title="Real or generated: windows of noise (counterpart of a borrowed picture)",
    alt=(
        "Real and generated windows of noise in random order, each with a letter, for the reader to tell apart; the answer is "
        "printed upside down at the foot, with the effective rank of generated and of real noise."
    ),
    drawn_by=draw,
    arrays=arrays,
    stages=("telemetry", "enhancer", "noise GAN", "resemblance"),
)
