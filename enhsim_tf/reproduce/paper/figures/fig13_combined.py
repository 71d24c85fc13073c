"""Figure 13: the coarse simulation, the enhanced signal with noise, and telemetry."""

import matplotlib.figure

from enhsim_tf.common.plot_style import COARSE, DOUBLE, ENHANCED, GENERATED, REAL, name_axes, new_sheet, panels, title_words
from enhsim_tf.realism.measures import roughness
from enhsim_tf.reproduce.paper.figures.paper_figure import Arrays, PaperFigure
from enhsim_tf.reproduce.paper.figures.window_arrays import draw_seed, spread_windows, time_axis
from enhsim_tf.reproduce.paper.pipeline import Experiment


def arrays(experiment: Experiment) -> Arrays:
    """A held-out window: coarse, enhanced, enhanced with noise, and the telemetry of the same times."""
    window = {key: values[0] for key, values in spread_windows(experiment, "test", 1, "figure 13").items()}
    enhanced = experiment.simulator.enhance(window["coarse"][None])[0]
    noise = experiment.simulator.noise.generate(1, seed=draw_seed(experiment.data.draw("figure 13, noise")))[0]
    shown = {"coarse": window["coarse"], "enhanced": enhanced, "combined": enhanced + noise, "telemetry": window["target"]}
    return shown | time_axis(experiment)


def draw(data: Arrays) -> matplotlib.figure.Figure:
    """Draws Figure 13."""
    clean, noisy, real = (roughness(data[key]) for key in ("enhanced", "combined", "telemetry"))
    compared = "less rough than" if noisy < 0.9 * real else "rougher than" if noisy > 1.1 * real else "as rough as"
    figure, down = new_sheet(
        DOUBLE,
        4.2,
        f"With generated noise added, the enhanced signal is {compared} telemetry",
        f"Roughness (standard deviation of first differences) in this window: {clean:.3f} enhanced, {noisy:.3f} with noise, {real:.3f} real.",
    )
    axes = panels(figure, down + 0.2, 3, 1, sharex=True, sharey=True)
    first, second, third = axes[:, 0]
    first.plot(data["time"], data["coarse"], color=COARSE, linewidth=1.2)
    first.plot(data["time"], data["enhanced"], color=ENHANCED, linewidth=1.4)
    second.plot(data["time"], data["combined"], color=GENERATED, linewidth=0.6)
    third.plot(data["time"], data["telemetry"], color=REAL, linewidth=0.6)
    for panel, words in (
        (first, (("Simulator output", COARSE), ("enhanced", ENHANCED))),
        (second, (("Enhanced, with generated noise added", GENERATED),)),
        (third, (("Real telemetry of the same time, held out", REAL),)),
    ):
        title_words(panel, words)
    name_axes(axes, data)
    return figure


FIGURE = PaperFigure(
    number=13,
    title="Simulator output, enhanced, with noise added",
    alt=(
        "One held-out window in three panels: the coarse simulation with the enhanced signal; the enhanced signal with generated "
        "noise added; real telemetry of the same time. The line under the title gives the standard deviation of the first "
        "differences of each."
    ),
    drawn_by=draw,
    arrays=arrays,
    stages=("telemetry", "enhancer", "noise GAN"),
)
