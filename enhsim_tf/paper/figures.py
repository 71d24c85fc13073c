"""Figures 1 to 14 of the paper; the fourteenth is commented out in its source.

Each function draws one figure from a pipeline, which trains what the figure needs; its docstring is
the figure's text alternative, for readers who cannot see it. Figures 1 and 11 are drawings that are
kept beside this file. Figures 5 to 7, faces of another system's making in the paper, have
counterparts: real and generated windows in random order.
"""

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import matplotlib.dates
import matplotlib.figure
import numpy as np

from enhsim_tf.common.atomic_files import replace_file
from enhsim_tf.common.backend import keras
from enhsim_tf.common.figure import Figure, save
from enhsim_tf.common.plot_style import (
    AVERAGE,
    COARSE,
    DASHED,
    DOUBLE,
    EDGE,
    ENHANCED,
    FOOT,
    GENERATED,
    LINE,
    QUIET,
    REAL,
    SINGLE,
    beside,
    label_ends,
    name_axes,
    new_sheet,
    panels,
    title_words,
)
from enhsim_tf.paper.claims import enhancement, noise_resemblance
from enhsim_tf.paper.enhancer import build_enhancer
from enhsim_tf.paper.noise import build_discriminator, build_generator
from enhsim_tf.paper.pipeline import Pipeline

DRAWINGS = Path(__file__).with_name("drawings")
LETTERS = "abcdefgh"
COUNTERPART = "A counterpart of a face in the paper, which another system made."
FACTS = {"time_unit": "min", "unit": "dimensionless"}  # of all axes that show windows

FIGURES: dict[str, Figure] = {}
"""All figures by name, in the order of their numbers."""
TRAINED = ("fig04", "fig05", "fig06", "fig07", "fig12", "fig13")
"""Those that show a trained network, which a run draws last."""
Draw = Callable[[Pipeline], matplotlib.figure.Figure | None]


def paper_figure(name: str, title: str) -> Callable[[Draw], Draw]:
    """Makes a function one of `FIGURES`. The function draws the figure, or only describes a drawing
    that is kept.
    """

    def add(draw: Draw) -> Draw:
        FIGURES[name] = Figure(int(name[3:5]), title, " ".join(draw.__doc__.split()), draw)
        return draw

    return add


def sample(pipeline: Pipeline, part: str, number: int, purpose: str) -> dict[str, np.ndarray]:
    """Some windows of a part, and the minutes since the beginning of each as `minutes`."""
    drawn = pipeline.windows(part, number, purpose)
    return drawn | {
        "minutes": pipeline.telemetry.interval / 60 * np.arange(pipeline.settings.window)
    }


@paper_figure("fig01_pipeline", "Enhanced simulation pipeline")
def pipeline_diagram(pipeline: Pipeline) -> None:
    """Diagram: a square-wave simulation goes through the enhancer to clean data, a latent vector
    through the generator to noise; their sum is the final output beside real telemetry. Telemetry
    trains the enhancer, and its noise trains the GAN.
    """


@paper_figure("fig02_source_target", "Training source and target time series")
def training_pairs(pipeline: Pipeline) -> matplotlib.figure.Figure:
    """Three training windows: above the coarse simulation, a sum of square waves, below the
    telemetry of the same time.
    """
    pairs = sample(pipeline, "train", 3, "figure 2")
    figure, down = new_sheet(
        DOUBLE,
        3.1,
        "The simulator has the rhythm of the telemetry, not its shape",
        "Windows begin at random times.",
    )
    axes = panels(figure, down + 0.2, 2, 3, sharex=True, sharey=True)
    begins = pipeline.parts["train"].time[pairs["start"]]
    for column, begin in enumerate(begins):
        axes[0, column].set_title(
            f"from day {begin / 86_400:.2f}", loc="right", color=QUIET, size=7
        )
        axes[0, column].plot(pairs["minutes"], pairs["coarse"][column], color=COARSE, linewidth=1.2)
        axes[1, column].plot(pairs["minutes"], pairs["target"][column], color=REAL, linewidth=0.6)
    for row, name in enumerate(("Source", "Target")):
        axes[row, 0].set_title(name, weight="bold")
    name_axes(axes, FACTS)
    return figure


@paper_figure("fig03_enhancer", "Enhancing MLP neural network")
def enhancer_layers(pipeline: Pipeline) -> matplotlib.figure.Figure:
    """Table of the enhancer's layers with their output shapes and numbers of parameters."""
    return layer_table(build_enhancer(pipeline.settings), "The enhancer is wide and shallow")


@paper_figure("fig04_enhanced_simulation", "Enhanced simulation")
def enhanced_simulation(pipeline: Pipeline) -> matplotlib.figure.Figure:
    """A held-out window: the stepped simulation, the enhanced signal and the true signal; below,
    the difference of the last two.
    """
    window = sample(pipeline, "test", 1, "figure 4")
    enhanced = pipeline.enhance(window["coarse"])[0]
    truth = window["truth"][0]
    errors = enhancement(pipeline)
    words = ", ".join(
        f"{name} {errors[f'{key}nrmse']:.3f}"
        for name, key in (("coarse", "coarse_"), ("enhanced", ""), ("ridge", "ridge_"))
    )
    figure, down = new_sheet(
        DOUBLE,
        3.5,
        "The enhancer turns steps into a waveform",
        "A held-out window. Error on all test windows, in standard deviations of the signal: "
        f"{words}.",
    )
    above, below = panels(figure, down + 0.1, 2, 1, right=0.85, height_ratios=(3, 1), sharex=True)[
        :, 0
    ]
    above.plot(window["minutes"], window["coarse"][0], color=COARSE, linewidth=1.2)
    above.plot(window["minutes"], enhanced, color=ENHANCED, linewidth=1.4)
    above.plot(window["minutes"], truth, color=REAL, linewidth=0.8, linestyle=DASHED)
    name = pipeline.truth_name
    label_ends(
        above,
        {
            "coarse": (window["coarse"][0], COARSE),
            "enhanced": (enhanced, ENHANCED),
            name: (truth, REAL),
        },
    )
    below.axhline(0, color=LINE, linewidth=0.6)
    below.plot(window["minutes"], enhanced - truth, color=ENHANCED, linewidth=0.8)
    beside(below, 0.5, f"enhanced\n− {name}", ENHANCED)
    name_axes(np.array([[above], [below]]), FACTS)
    return figure


def guess(
    title: str,
    minutes: np.ndarray,
    real: np.ndarray,
    generated: np.ndarray,
    rng: np.random.Generator,
    hint: str = "",
    columns: int = 4,
    height: float = 3.14,
) -> matplotlib.figure.Figure:
    """Real and generated rows in random order on a figure of some inches in height; which are
    generated is printed upside down, with a hint that would tell.
    """
    is_generated = np.repeat([False, True], [len(real), len(generated)])
    order = rng.permutation(len(is_generated))
    rows = -(-len(order) // columns)
    figure, down = new_sheet(DOUBLE, height, title, COUNTERPART)
    axes = panels(figure, down + 0.2, rows, columns, sharex=True, sharey=True)
    for panel, row, letter in zip(
        axes.flat, np.concatenate([real, generated])[order], LETTERS, strict=False
    ):
        panel.plot(minutes, row, color=REAL, linewidth=0.5)
        panel.set_title(letter, weight="bold")
    name_axes(axes, FACTS)
    answer = ", ".join(
        letter for letter, made in zip(LETTERS, is_generated[order], strict=False) if made
    )
    width, height = figure.get_size_inches()
    for text, y in ((f"generated: {answer}", FOOT + 0.04), (hint, EDGE)):
        figure.text(
            1 - EDGE / width, y / height, text, size=7, color=QUIET, rotation=180, ha="right"
        )
    return figure


@paper_figure("fig05_real_or_generated", "Real or generated: windows of telemetry (a counterpart)")
def guess_telemetry(pipeline: Pipeline) -> matplotlib.figure.Figure:
    """Eight windows of telemetry in random order; four are generated."""
    rng = pipeline.draw("figure 5")
    real = sample(pipeline, "test", 4, "figure 5, real")
    generated = pipeline.combine(pipeline.windows("test", 4, "figure 5, generated")["coarse"], rng)
    return guess(
        "Which windows of telemetry are generated?", real["minutes"], real["target"], generated, rng
    )


@paper_figure(
    "fig06_real_or_generated_noise", "Real or generated: windows of noise (a counterpart)"
)
def guess_noise(pipeline: Pipeline) -> matplotlib.figure.Figure:
    """Eight windows of noise in random order; four are generated."""
    rng = pipeline.draw("figure 6")
    found = noise_resemblance(pipeline)
    real = pipeline.noise_windows("test", 4, "figure 6, real")
    minutes = sample(pipeline, "test", 1, "figure 6")["minutes"]
    hint = f"effective rank: {found['rank_ratio']:.0%} of that of real noise"
    return guess(
        "Which windows of noise are generated?",
        minutes,
        real,
        pipeline.generate_noise(4, rng),
        rng,
        hint,
    )


@paper_figure("fig07_real_or_generated_series", "Real or generated: longer series (a counterpart)")
def guess_series(pipeline: Pipeline) -> matplotlib.figure.Figure:
    """Four longer series in random order; two are generated."""
    rng = pipeline.draw("figure 7")
    size = pipeline.settings.window
    series = pipeline.parts["test"]
    number = min(4, len(series.values) // size)
    starts = rng.integers(0, len(series.values) - number * size + 1, 4)[:, None] + np.arange(
        number * size
    )
    noise = pipeline.generate_noise(2 * number, rng).reshape(2, -1)
    clean = pipeline.enhance(
        pipeline.simulator(series.time[starts[2:]]).astype(np.float32).reshape(-1, size)
    ).reshape(2, -1)
    minutes = series.interval / 60 * np.arange(number * size)
    return guess(
        "Which longer series are generated?",
        minutes,
        series.values[starts[:2]],
        clean + noise,
        rng,
        columns=1,
        height=4.18,
    )


@paper_figure("fig08_source_noise", "Extracted source noise")
def source_noise(pipeline: Pipeline) -> matplotlib.figure.Figure:
    """Above a window of telemetry with its moving average, below the noise that remains."""
    settings = pipeline.settings
    window = sample(pipeline, "test", 1, "figure 8")
    series = pipeline.parts["test"].values
    noise = pipeline.noise_series("test")
    num_cut = len(series) - len(noise)  # samples without a full average
    first = num_cut // 2 if settings.average == "centred" else num_cut
    begin = min(window["start"][0], len(noise) - settings.window)
    shown = series[first + begin :][: settings.window]
    noise = noise[begin:][: settings.window]
    figure, down = new_sheet(
        DOUBLE,
        3.0,
        "The noise is what a moving average leaves of telemetry",
        f"Telemetry minus its average ({settings.average}, {settings.moving_average} samples). "
        f"Standard deviation of the noise in this window: {np.std(noise):.3f}.",
    )
    above, below = panels(figure, down + 0.2, 2, 1, sharex=True)[:, 0]
    above.plot(window["minutes"], shown, color=REAL, linewidth=0.5)
    above.plot(window["minutes"], shown - noise, color=AVERAGE, linewidth=1.4)
    title_words(above, (("telemetry", REAL), ("moving average", AVERAGE)))
    below.plot(window["minutes"], noise, color=REAL, linewidth=0.5)
    title_words(below, (("noise", REAL),))
    name_axes(np.array([[above], [below]]), FACTS)
    return figure


@paper_figure("fig09_generator", "Generator construction")
def generator_layers(pipeline: Pipeline) -> matplotlib.figure.Figure:
    """Table of the generator's layers with their output shapes and numbers of parameters."""
    return layer_table(build_generator(pipeline.settings), "A latent vector is widened to a window")


@paper_figure("fig10_discriminator", "Discriminator construction")
def discriminator_layers(pipeline: Pipeline) -> matplotlib.figure.Figure:
    """Table of the discriminator's layers with their output shapes and numbers of parameters."""
    return layer_table(
        build_discriminator(pipeline.settings), "A window is narrowed to one probability"
    )


@paper_figure("fig11_gan_training", "GAN training")
def gan_training(pipeline: Pipeline) -> None:
    """Diagram of an iteration. First the discriminator learns from real rows, labelled 1, and
    generated rows, labelled 0. Then the generator learns through the frozen discriminator, with the
    label reversed to 1.
    """


@paper_figure("fig12_accuracy_loss", "Accuracy and loss for real and fake classifications")
def accuracy_and_loss(pipeline: Pipeline) -> matplotlib.figure.Figure:
    """Accuracy and loss of the discriminator on real and on generated rows over the iterations,
    beside chance.
    """
    history = pipeline.history
    last = pipeline.settings.iterations
    chosen = history["iteration"] <= last
    share = np.mean([history[f"accuracy_{name}"][chosen] for name in ("real", "generated")])
    figure, down = new_sheet(
        DOUBLE,
        2.7,
        f"The discriminator classifies {share:.0%} of all rows correctly",
        "Mean over the iterations shown and both kinds of rows, drawn anew. Dotted: chance.",
    )
    axes = panels(figure, down + 0.2, 1, 2, right=0.8, gap=(0.24, 1.25))[0]
    for panel, key, chance, words in (
        (axes[0], "accuracy", 0.5, "share classified correctly"),
        (axes[1], "loss", np.log(2), "cross-entropy (nats)"),
    ):
        panel.axhline(chance, color=LINE, linestyle=":", linewidth=1)
        lines = {name: history[f"{key}_{name}"][chosen] for name in ("real", "generated")}
        panel.plot(
            history["iteration"][chosen], lines["real"], color=REAL, marker="o", markersize=3.5
        )
        style = {"linestyle": DASHED, "marker": "s", "markersize": 3.5, "markerfacecolor": "white"}
        panel.plot(history["iteration"][chosen], lines["generated"], color=GENERATED, **style)
        panel.set_ylim(-0.03, max(1.03, 1.05 * np.max(list(lines.values()))))
        panel.margins(x=0.03)
        panel.set(xlabel="iteration", ylabel=words)
        panel.xaxis.set_major_formatter("{x:,.0f}")
        label_ends(
            panel, {"real": (lines["real"], REAL), "generated": (lines["generated"], GENERATED)}
        )
    return figure


@paper_figure("fig13_combined", "Simulator output, enhanced, with noise added")
def combined(pipeline: Pipeline) -> matplotlib.figure.Figure:
    """The stepped simulation with the enhanced signal, the enhanced signal with generated noise,
    and real telemetry of the same time.
    """
    window = sample(pipeline, "test", 1, "figure 13")
    rng = pipeline.draw("figure 13, noise")
    enhanced = pipeline.enhance(window["coarse"])
    noisy = enhanced + pipeline.generate_noise(1, rng)
    rough = [np.std(np.diff(values[0])) for values in (enhanced, noisy, window["target"])]
    figure, down = new_sheet(
        SINGLE,
        3.5,
        "Generated noise roughens the signal",
        "Standard deviation of first differences here: enhanced {:.3f}, with noise {:.3f}, real "
        "{:.3f}.".format(*rough),
    )
    axes = panels(figure, down + 0.2, 3, 1, sharex=True, sharey=True)
    axes[0, 0].plot(window["minutes"], window["coarse"][0], color=COARSE, linewidth=1.2)
    axes[0, 0].plot(window["minutes"], enhanced[0], color=ENHANCED, linewidth=1.4)
    title_words(axes[0, 0], (("simulator output", COARSE), ("enhanced", ENHANCED)))
    axes[1, 0].plot(window["minutes"], noisy[0], color=GENERATED, linewidth=0.6)
    title_words(axes[1, 0], (("enhanced, with noise", GENERATED),))
    axes[2, 0].plot(window["minutes"], window["target"][0], color=REAL, linewidth=0.6)
    title_words(axes[2, 0], (("real telemetry of the same time", REAL),))
    name_axes(axes, FACTS)
    return figure


@paper_figure("fig14_telemetry_store", "Example telemetry signals in the store")
def stored_telemetry(pipeline: Pipeline) -> matplotlib.figure.Figure:
    """The first samples of the stored telemetry over time."""
    telemetry = pipeline.telemetry
    shown = telemetry.part(0, min(4 * pipeline.settings.window, len(telemetry.values)))
    start = np.datetime64(telemetry.start.removesuffix("Z"), "ms")
    figure, down = new_sheet(
        DOUBLE,
        2.4,
        "All steps read the telemetry from the store",
        f"“{telemetry.name}”: {len(telemetry.values):,} samples, one every "
        f"{telemetry.interval:g} s; the first {len(shown.values):,}.",
    )
    panel = panels(figure, down + 0.1, 1, 1)[0, 0]
    panel.plot(
        start + np.round(1e3 * shown.time).astype("timedelta64[ms]"),
        shown.values,
        color=REAL,
        linewidth=0.4,
    )
    locator = matplotlib.dates.AutoDateLocator()
    panel.xaxis.set_major_locator(locator)
    panel.xaxis.set_major_formatter(
        matplotlib.dates.ConciseDateFormatter(locator, show_offset=False)
    )
    name_axes(np.array([[panel]]), FACTS | {"time_unit": f"UTC, from {str(start)[:10]}"})
    return figure


def layer_table(network: keras.Sequential, title: str) -> matplotlib.figure.Figure:
    """The layers of a network with their output shapes and numbers of parameters."""
    height = 0.9 + 0.3 * (len(network.layers) + 1) + FOOT
    figure, down = new_sheet(SINGLE, height, title)
    axes = figure.add_axes((0, 0, 1, 1), xlim=(0, SINGLE), ylim=(0, height))
    axes.axis("off")
    y = height - down - 0.2

    def row(y: float, cells: Sequence[str], **style: object) -> None:
        for x, cell, side in zip(
            (EDGE, 1.72, SINGLE - EDGE), cells, ("left", "left", "right"), strict=True
        ):
            axes.text(x, y, cell, ha=side, **style)

    def rule(y: float, linewidth: float) -> None:
        axes.plot((EDGE, SINGLE - EDGE), (y, y), color=REAL, linewidth=linewidth)

    rule(y + 0.17, 1.0)
    row(y, ("Layer", "Output shape", "Parameters"), size=7.5, color=QUIET)
    rule(y - 0.08, 0.5)
    for layer in network.layers:
        y -= 0.3 if layer is not network.layers[0] else 0.24
        kind = type(layer).__name__
        is_named = layer.name.startswith(("Input", "Hidden", "Output"))
        row(
            y,
            (
                f"{layer.name} ({kind})" if is_named else kind,
                str(tuple(layer.output.shape)),
                f"{layer.count_params():,}",
            ),
            size=8,
        )
        axes.text(EDGE, y - 0.125, layer_details(layer), size=7, color=QUIET)
    y -= 0.36
    rule(y + 0.12, 0.5)
    row(
        y - 0.04,
        (f"Total, input {network.input_shape}", "", f"{network.count_params():,}"),
        size=8,
        weight="bold",
    )
    rule(y - 0.14, 1.0)
    return figure


def layer_details(layer: keras.layers.Layer) -> str:
    """The settings of a layer that the paper mentions."""
    config = layer.get_config()
    names = {"filters": "filters", "kernel_size": "window", "strides": "stride", "rate": "rate"}
    words = [
        f"{word} {config[key][0] if isinstance(config[key], tuple | list) else config[key]}"
        for key, word in names.items()
        if key in config
    ]
    return ", ".join([*words, *([config["activation"]] if config.get("activation") else [])])


def save_figure(
    name: str, pipeline: Pipeline, folder: Path, caption: str, is_smoke: bool = False
) -> None:
    """Writes one of `FIGURES` as PNG and SVG: copies a kept drawing, or draws it; see
    `common.figure.save`.
    """
    drawings = list(DRAWINGS.glob(f"{name}.*"))
    if not drawings:
        save(FIGURES[name], name, pipeline, folder, caption, is_smoke)
    for drawing in drawings:
        with replace_file(folder / drawing.name) as temporary:
            shutil.copyfile(drawing, temporary)
