"""Figure 1: the nine steps of the pipeline, with the waveforms of one window."""

import matplotlib.figure
import numpy as np
from matplotlib.patches import Circle, Rectangle

from enhsim_tf.common.plot_style import (
    BLUE_TINT,
    COARSE,
    DOUBLE,
    EDGE,
    ENHANCED,
    FOOT,
    GENERATED,
    GREY_TINT,
    LINE,
    ORANGE_TINT,
    QUIET,
    REAL,
    new_sheet,
)
from enhsim_tf.reproduce.paper.figures.diagram_parts import arrow, box, card, drawing_board, inset, words
from enhsim_tf.reproduce.paper.figures.fig13_combined import arrays as combined_window
from enhsim_tf.reproduce.paper.figures.paper_figure import Arrays, PaperFigure
from enhsim_tf.reproduce.paper.figures.window_arrays import spread_windows, window_noise
from enhsim_tf.reproduce.paper.pipeline import Experiment


def arrays(experiment: Experiment) -> Arrays:
    """The waveforms of one held-out window in each step, and the widths of the networks."""
    simulator, data = experiment.simulator, combined_window(experiment)
    held_out = spread_windows(experiment, "test", 1, "figure 13")
    noise, _ = window_noise(experiment, held_out["offset"][0])
    latent = experiment.data.draw("figure 1").standard_normal(simulator.noise.generator.input_shape[1])
    networks = {"enhancer": simulator.enhancer, "generator": simulator.noise.generator, "discriminator": simulator.noise.discriminator}
    widths = {
        f"{name}_units": np.array([layer.units for layer in model.layers if hasattr(layer, "units")]) for name, model in networks.items()
    }
    generated = data["combined"] - data["enhanced"]
    return data | widths | {"noise": noise, "generated_noise": generated, "latent": latent.astype(np.float32)}


def draw(data: Arrays) -> matplotlib.figure.Figure:
    """The nine numbered steps of the paper and their sum, with the waveforms of one window."""
    figure, _ = new_sheet(DOUBLE, 4.5, "One network maps a coarse simulation to the signal, a second adds the noise")
    axes, height, gap = drawing_board(figure), 1.02, 0.3
    top = [FOOT + 0.14 + height * (3 - row) + gap * (2 - row) for row in range(3)]
    centre = [y - height / 2 for y in top]
    wide = np.array([0.98, 1.27, 1.27, 1.27, 1.24])
    left = EDGE + 0.08 + np.cumsum([0, *(wide[:-1] + 0.235)])
    right, middle = left + wide, left + wide / 2

    # all signals have the same scale, so that amplitudes can be compared
    signals = np.concatenate([data[key] for key in ("telemetry", "coarse", "enhanced", "combined")])
    level, reach = signals.mean(), 1.05 * np.abs(signals - signals.mean()).max()

    def curve(column: int, bottom: float, key: str, color: str, about: float = level) -> None:
        small = inset(figure, left[column] + 0.1, bottom, wide[column] - 0.2, height - 0.5, ylim=(about - reach, about + reach))
        small.plot(data["time"], data[key], color=color, linewidth=0.6, clip_on=False)

    def step(column: int, row: int, heading: str, text: str, number: int | None = None, **options) -> float:
        card(axes, left[column], top[row], (wide[column], height), heading, text, number, **options)
        return top[row] - height + 0.07

    # steps 1, 2, 3 and 5: the waveform
    step(0, 0, "Simulator", "light and fast:\nsquare waves", 1, fill=GREY_TINT)
    curve(1, step(1, 0, "Approximate data", "highly quantised", 2), "coarse", COARSE)
    bottom = step(2, 0, "Enhancer", "low to high fidelity", 3, fill=BLUE_TINT, edge=ENHANCED)
    for x, units in zip(middle[2] + 0.305 * np.linspace(-1.5, 1.5, len(data["enhancer_units"])), data["enhancer_units"], strict=True):
        size = 0.4 * units / max(data["enhancer_units"])
        axes.add_patch(Rectangle((x - 0.045, bottom + 0.13), 0.09, size, facecolor=ENHANCED, edgecolor="none"))
        axes.text(x, bottom + 0.09, f"{units:,}", size=7, ha="center", va="top")
    curve(3, step(3, 0, "Clean data", "accurate, too clean", 5), "enhanced", ENHANCED)
    # steps 4 and 6: what is recorded
    step(0, 1, "Source", "real vehicle or\nhigh-fidelity\nsimulation", 4, fill=GREY_TINT)
    curve(1, step(1, 1, "Goal", "telemetry in the store"), "telemetry", REAL)
    curve(2, step(2, 1, "Environment", "telemetry − average", 6), "noise", REAL, about=0)
    # steps 7, 8 and 9: the noise
    bottom = step(1, 2, "Latent space", f"{len(data['latent'])} random numbers", 7)
    small = inset(figure, left[1] + 0.2, bottom + 0.03, wide[1] - 0.4, height - 0.56)
    small.vlines(np.arange(len(data["latent"])), 0, data["latent"], color=GENERATED, linewidth=1.6, clip_on=False)
    small.axhline(0, color=LINE, linewidth=0.5)
    generator, discriminator = top[2] - 0.83, top[2] - 0.4
    step(2, 2, "GAN", "", 8, fill=ORANGE_TINT, edge=GENERATED)
    for y, name in ((generator, "generator"), (discriminator, "discriminator")):
        box(axes, left[2] + 0.14, y - 0.12, wide[2] - 0.28, 0.24, edge=GENERATED)
        axes.text(middle[2], y, name, size=7.5, ha="center", va="center")
    curve(3, step(3, 2, "Generated noise", "of the environment", 9), "generated_noise", GENERATED, about=0)
    # Combined, beside what it should resemble
    axes.add_patch(Circle((middle[3], centre[1]), 0.15, facecolor="white", edgecolor=REAL, linewidth=1.1))
    axes.text(middle[3], centre[1] - 0.005, "+", size=13, ha="center", va="center_baseline")
    tall = 2.1
    begin = centre[1] + tall / 2
    card(axes, left[4], begin, (wide[4], tall), "Combined", "high-fidelity output", edge=REAL, linewidth=1.6)
    curve(4, begin - 0.98, "combined", GENERATED)
    axes.plot((left[4] + 0.13, right[4] - 0.13), (begin - 1.11, begin - 1.11), color=LINE, linewidth=0.5)
    words(axes, left[4] + 0.13, begin - 1.18, "real telemetry of\nthe same time")
    curve(4, begin - 2.03, "telemetry", REAL)

    turn = top[0] - height - gap / 2
    for path in (  # taken whenever telemetry is generated
        [(right[0], centre[0]), (left[1], centre[0])],
        [(right[1], centre[0]), (left[2], centre[0])],
        [(right[2], centre[0]), (left[3], centre[0])],
        [(right[1], generator), (left[2] + 0.14, generator)],
        [(right[2] - 0.14, generator), (left[3], generator)],
        [(middle[3], top[0] - height), (middle[3], centre[1] + 0.15)],
        [(middle[3], top[2]), (middle[3], centre[1] - 0.15)],
        [(middle[3] + 0.15, centre[1]), (left[4], centre[1])],
    ):
        arrow(axes, path, linewidth=1.5)
    for path in (  # taken in training only
        [(right[0], centre[1]), (left[1], centre[1])],
        [(right[1], centre[1]), (left[2], centre[1])],
        [(middle[1], top[1]), (middle[1], turn), (middle[2], turn), (middle[2], top[0] - height)],
        [(middle[2], top[1] - height), (middle[2], discriminator + 0.12)],
        [(middle[2], generator + 0.12), (middle[2], discriminator - 0.12)],
    ):
        arrow(axes, path, dashed=True)
    for y, dashed, meaning in ((generator + 0.34, False, "generates"), (generator, True, "trains")):
        arrow(axes, [(left[0], y), (left[0] + 0.35, y)], dashed, linewidth=1.1 if dashed else 1.5)
        axes.text(left[0] + 0.42, y, meaning, size=7, color=QUIET, va="center")
    return figure


FIGURE = PaperFigure(
    number=1,
    title="Enhanced simulation pipeline",
    alt=(
        "Diagram of nine numbered steps. A light simulator (1) makes approximate, quantised data (2), which a trained enhancer (3) "
        "turns into clean data (5). Telemetry from a real source (4) is stored as the goal and trains the enhancer. Telemetry minus its "
        "moving average is the environmental noise (6), which trains a GAN (8) that turns random numbers of a latent space (7) into "
        "generated noise (9). Clean data and generated noise add up to the combined output, drawn beside real telemetry of the same time."
    ),
    drawn_by=draw,
    arrays=arrays,
    stages=("telemetry", "enhancer", "noise GAN"),
)
