"""Figure 12: accuracy and loss of the discriminator during training."""

import matplotlib.figure
import numpy as np
from matplotlib.axes import Axes

from enhsim_tf.common.plot_style import DASHED, DOUBLE, GENERATED, LINE, QUIET, REAL, label_ends, new_sheet, panels
from enhsim_tf.reproduce.paper.figures.paper_figure import Arrays, PaperFigure
from enhsim_tf.reproduce.paper.pipeline import Experiment


def arrays(experiment: Experiment) -> Arrays:
    """Accuracy and loss of the discriminator on real and on generated noise, by iteration."""
    measures = [f"{measure}_{kind}" for measure in ("accuracy", "loss") for kind in ("real", "generated")]
    return {key: experiment.noise_history[key] for key in ("iteration", *measures)}


def draw(data: Arrays) -> matplotlib.figure.Figure:
    """Draws Figure 12."""
    iteration = data["iteration"]
    real, generated = (float(data[f"accuracy_{kind}"][-1]) for kind in ("real", "generated"))
    figure, down = new_sheet(
        DOUBLE,
        2.9,
        f"After {int(iteration[-1]):,} iterations, {100 * real:.0f} % of real and {100 * generated:.0f} % of generated noise is classified correctly",
        f"By the discriminator, on a new batch of each kind every {int(iteration[1] - iteration[0]):,} iterations. The first point is before training.",
    )
    accuracy, loss = panels(figure, down + 0.22, 1, 2, right=0.75, gap=(0, 1.15))[0]
    before, *after = zip(data["loss_real"], data["loss_generated"], strict=True)
    top = 1.4 * np.max(after, initial=np.log(2))
    if max(before) > top:  # the loss before training may be so large that the rest of the curve could not be read
        beyond = [f"{value:.2g} {kind}" for value, kind in zip(before, ("real", "generated"), strict=True) if value > top]
        note = f"before training, off scale:\n{', '.join(beyond)}"
        loss.annotate(note, (0.22, 0.99), xycoords="axes fraction", size=7, color=QUIET, va="top")
    plot_measure(accuracy, data, "accuracy", 1, "share classified correctly", (0.5, "0.5"))
    plot_measure(loss, data, "loss", top, "binary cross-entropy (nats)", (np.log(2), "ln 2"))
    return figure


def plot_measure(axes: Axes, data: Arrays, measure: str, top: float, label: str, chance: tuple[float, str]) -> None:
    """Accuracy or loss on real and generated rows by iteration, with a line at the level of chance."""
    axes.set(ylim=(0, top), ylabel=label, xlabel="iteration")
    axes.margins(x=0.03)
    axes.axhline(chance[0], color=LINE, linewidth=0.8, linestyle=(0, (1, 1.5)))
    ends = {}
    for kind, color, look in (
        ("real", REAL, {"marker": "o"}),
        ("generated", GENERATED, {"marker": "s", "mfc": "white", "linestyle": DASHED}),
    ):
        axes.plot(data["iteration"], data[f"{measure}_{kind}"], color=color, linewidth=1.2, markersize=3.5, clip_on=top != 1, **look)
        ends[kind] = data[f"{measure}_{kind}"], color
    axes.set_title(measure.capitalize(), weight="bold", pad=8)
    # beside the ends it would push away the two labels that have to stand there: both curves end near it where training is balanced
    axes.set_title(f"dotted: chance ({chance[1]})", loc="right", size=7, color=QUIET, pad=8)
    axes.xaxis.set_major_formatter("{x:,.0f}")
    label_ends(axes, ends)


FIGURE = PaperFigure(
    number=12,
    title="Accuracy and loss for real and fake classifications",
    alt=(
        "Two panels over the iterations of training: the discriminator's accuracy and its loss, each for real and for generated "
        "noise, with a line at chance. The title gives the last accuracies."
    ),
    drawn_by=draw,
    arrays=arrays,
    stages=("telemetry", "noise GAN"),
)
