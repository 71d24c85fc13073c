"""Diagrams and tables of the paper's figures: the pipeline, adversarial training, and the layers of networks.

Positions and sizes are in inches, so that boxes and text keep their size.
"""

import re
from collections.abc import Mapping, Sequence

import matplotlib.figure
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, FancyBboxPatch, Polygon, Rectangle

from enhsim_tf.common.plot_style import (
    BLUE_TINT,
    COARSE,
    DOUBLE,
    EDGE,
    ENHANCED,
    FOOT,
    GENERATED,
    GREY_TINT,
    IN_PRINT,
    LINE,
    ORANGE_TINT,
    QUIET,
    REAL,
    SINGLE,
    new_sheet,
)

_DASHES = (0, (2.6, 1.6))


def _drawing_board(figure: matplotlib.figure.Figure) -> Axes:
    """Axes without a frame over the whole figure, in inches from its lower left corner."""
    width, height = figure.get_size_inches()
    return figure.add_axes((0, 0, 1, 1), xlim=(0, width), ylim=(0, height), frame_on=False, xticks=(), yticks=())


def _box(axes: Axes, x: float, y: float, width: float, height: float, fill: str = "white", edge: str = LINE, **options) -> None:
    """A box with rounded corners; `options` are passed to the patch."""
    style = "round,pad=0,rounding_size=0.06"
    axes.add_patch(FancyBboxPatch((x, y), width, height, boxstyle=style, facecolor=fill, edgecolor=edge, **{"linewidth": 0.8} | options))


def _arrow(axes: Axes, points: Sequence[tuple[float, float]], dashed: bool = False, color: str = REAL, linewidth: float = 1.1) -> None:
    """An arrow along straight pieces, in inches."""
    points = np.array(points, float)
    along = (points[-1] - points[-2]) / np.hypot(*(points[-1] - points[-2]))
    neck, across = points[-1] - 0.08 * along, 0.038 * along[::-1] * (1, -1)
    style = {"linestyle": _DASHES if dashed else "-", "color": color, "linewidth": linewidth, "solid_joinstyle": "miter"}
    axes.plot(*np.vstack([points[:-1], neck]).T, **style, zorder=2.5, solid_capstyle="butt")
    axes.add_patch(Polygon([points[-1], neck + across, neck - across], facecolor=color, edgecolor="none", zorder=2.6))


def _badge(axes: Axes, x: float, y: float, number: int) -> None:
    """The number of a step of the paper."""
    axes.add_patch(Circle((x, y), 0.105, facecolor=REAL, edgecolor="white", linewidth=1, zorder=3))
    axes.text(x, y - 0.005, str(number), color="white", weight="bold", size=8, ha="center", va="center_baseline", zorder=4)


def _words(axes: Axes, x: float, top: float, text: str, size: float = 7, color: str = QUIET, **options) -> None:
    """Lines of text at equal distances below `top`."""
    for number, line in enumerate(text.split("\n")):
        axes.text(x, top - size / 72 * (0.95 + 1.3 * number), line, size=size, color=color, **options)


def _card(
    axes: Axes, x: float, top: float, size: tuple[float, float], heading: str, text: str, number: int | None = None, **options
) -> None:
    """A box with a heading, small print and the number of its step. Text is centred in a grey box, which has no curve."""
    _box(axes, x, top - size[1], *size, **options)
    down = (size[1] - 0.12 * (2 + text.count("\n"))) / 2 - 0.04 if options.get("fill") == GREY_TINT else 0.1
    _words(axes, x + 0.13, top - down, heading, 7.5, REAL, weight="bold")
    _words(axes, x + 0.13, top - down - 0.15, text)
    if number is not None:
        _badge(axes, x, top, number)


def _inset(figure: matplotlib.figure.Figure, left: float, bottom: float, width: float, height: float, **options) -> Axes:
    """Axes without frame in a rectangle given in inches."""
    across, up = figure.get_size_inches()
    place = (left / across, bottom / up, width / across, height / up)
    return figure.add_axes(place, frame_on=False, xticks=(), yticks=(), **options)


def pipeline(data: Mapping[str, np.ndarray]) -> matplotlib.figure.Figure:
    """Figure 1: the nine numbered steps of the paper and their sum, with the waveforms of one window."""
    figure, _ = new_sheet(DOUBLE, 4.5, "Two networks turn a coarse simulation into realistic telemetry")
    axes, height, gap = _drawing_board(figure), 1.02, 0.3
    top = [FOOT + 0.14 + height * (3 - row) + gap * (2 - row) for row in range(3)]
    centre = [y - height / 2 for y in top]
    wide = np.array([0.98, 1.27, 1.27, 1.27, 1.24])
    left = EDGE + 0.08 + np.cumsum([0, *(wide[:-1] + 0.235)])
    right, middle = left + wide, left + wide / 2

    # all signals have the same scale, so that amplitudes can be compared
    signals = np.concatenate([data[key] for key in ("telemetry", "coarse", "enhanced", "combined")])
    level, reach = signals.mean(), 1.05 * np.abs(signals - signals.mean()).max()

    def curve(column: int, bottom: float, key: str, color: str, about: float = level) -> None:
        small = _inset(figure, left[column] + 0.1, bottom, wide[column] - 0.2, height - 0.5, ylim=(about - reach, about + reach))
        small.plot(data["time"], data[key], color=color, linewidth=0.6, clip_on=False)

    def step(column: int, row: int, heading: str, text: str, number: int | None = None, **options) -> float:
        _card(axes, left[column], top[row], (wide[column], height), heading, text, number, **options)
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
    small = _inset(figure, left[1] + 0.2, bottom + 0.03, wide[1] - 0.4, height - 0.56)
    small.vlines(np.arange(len(data["latent"])), 0, data["latent"], color=GENERATED, linewidth=1.6, clip_on=False)
    small.axhline(0, color=LINE, linewidth=0.5)
    generator, discriminator = top[2] - 0.83, top[2] - 0.4
    step(2, 2, "GAN", "", 8, fill=ORANGE_TINT, edge=GENERATED)
    for y, name in ((generator, "generator"), (discriminator, "discriminator")):
        _box(axes, left[2] + 0.14, y - 0.12, wide[2] - 0.28, 0.24, edge=GENERATED)
        axes.text(middle[2], y, name, size=7.5, ha="center", va="center")
    curve(3, step(3, 2, "Generated noise", "of the environment", 9), "generated_noise", GENERATED, about=0)
    # Combined, beside what it should resemble
    axes.add_patch(Circle((middle[3], centre[1]), 0.15, facecolor="white", edgecolor=REAL, linewidth=1.1))
    axes.text(middle[3], centre[1] - 0.005, "+", size=13, ha="center", va="center_baseline")
    tall = 2.1
    begin = centre[1] + tall / 2
    _card(axes, left[4], begin, (wide[4], tall), "Combined", "high-fidelity output", edge=REAL, linewidth=1.6)
    curve(4, begin - 0.98, "combined", GENERATED)
    axes.plot((left[4] + 0.13, right[4] - 0.13), (begin - 1.11, begin - 1.11), color=LINE, linewidth=0.5)
    _words(axes, left[4] + 0.13, begin - 1.18, "real telemetry of\nthe same times")
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
        _arrow(axes, path, linewidth=1.5)
    for path in (  # taken in training only
        [(right[0], centre[1]), (left[1], centre[1])],
        [(right[1], centre[1]), (left[2], centre[1])],
        [(middle[1], top[1]), (middle[1], turn), (middle[2], turn), (middle[2], top[0] - height)],
        [(middle[2], top[1] - height), (middle[2], discriminator + 0.12)],
        [(middle[2], generator + 0.12), (middle[2], discriminator - 0.12)],
    ):
        _arrow(axes, path, dashed=True)
    for y, dashed, meaning in ((generator + 0.34, False, "generates"), (generator, True, "trains")):
        _arrow(axes, [(left[0], y), (left[0] + 0.35, y)], dashed, linewidth=1.1 if dashed else 1.5)
        axes.text(left[0] + 0.42, y, meaning, size=7, color=QUIET, va="center")
    return figure


def gan_training(data: Mapping[str, np.ndarray]) -> matplotlib.figure.Figure:
    """Figure 11: the two phases of an iteration, one below the other on the same plan."""
    batch, latent, updates = f"{int(data['batch_size']):,}", int(data["latent"]), "one update" if data["mixed_batch"] else "two updates"
    title = "Each iteration trains the discriminator alone, then the generator through it"
    figure, down = new_sheet(DOUBLE, 3.94, title, f"{int(data['num_iterations']):,} iterations; {batch} rows of each kind in each")
    axes, tall, gap = _drawing_board(figure), 1.46, 0.12
    left, wide = np.array([0.25, 1.5, 2.86, 4.28, 5.78]), np.array([0.98, 1.09, 1.1, 1.2, 1.2])
    right, middle, height = left + wide, left + wide / 2, 0.46
    first = 3.94 - down - 0.06
    phases = (
        (first, "1  The discriminator learns", f"alone, from equal amounts of real and generated noise, in {updates}", ENHANCED, BLUE_TINT),
        (
            first - tall - gap,
            "2  The generator learns",
            "through the combined model; the discriminator is told that the generated rows are real",
            GENERATED,
            ORANGE_TINT,
        ),
    )
    for phase, (top, heading, text, color, tint) in enumerate(phases, 1):
        _box(axes, EDGE, top - tall, DOUBLE - 2 * EDGE, tall, fill=GREY_TINT, edge="none")
        axes.text(left[0], top - 0.22, heading, size=8, weight="bold", color=REAL)
        axes.text(left[0] + 1.95, top - 0.22, text, size=7.5, color=QUIET)
        y = top - (1.1 if phase == 1 else 0.8)  # of the generated rows
        judged = top - 0.82 if phase == 1 else y

        def part(column: int, y: float, name: str, text: str, learns: bool | None = None, color: str = color, tint: str = tint) -> None:
            """A box; a network that learns is coloured, one that is frozen has a dashed outline."""
            style = {None: {}, True: {"edge": color, "fill": tint, "linewidth": 1.8}, False: {"linestyle": _DASHES, "edge": QUIET}}[learns]
            _box(axes, left[column], y - height / 2, wide[column], height, **style)
            axes.text(middle[column], y + 0.075, name, size=7.5, weight="bold", ha="center", va="center")
            axes.text(middle[column], y - 0.095, text, size=7, color=QUIET, ha="center", va="center")

        part(0, y, "Latent vectors", f"{batch} × {latent} numbers")
        part(1, y, "Generator", "learns" if phase == 2 else "frozen", phase == 2)
        part(2, y, "Generated noise", f"{batch} rows")
        part(3, judged, "Discriminator", "learns" if phase == 1 else "frozen", phase == 1)
        part(4, judged, "Loss", "binary cross-entropy")
        for column in (0, 1):
            _arrow(axes, [(right[column], y), (left[column + 1], y)])
        _arrow(axes, [(right[3], judged), (left[4], judged)])
        if phase == 1:
            part(2, top - 0.54, "Real noise", f"{batch} rows")
            for rows, into in ((top - 0.54, judged + 0.1), (y, judged - 0.1)):
                turn = right[2] + 0.16
                _arrow(axes, [(right[2], rows), (turn, rows), (turn, into), (left[3], into)])
        else:
            _arrow(axes, [(right[2], y), (left[3], y)])
        # the tags go into the loss from above, the error flows back below to the network that learns
        tags = "tags: real 1.0, generated 0.0" if phase == 1 else "tags reversed: generated 1.0"
        axes.text(right[4], judged + height / 2 + 0.07, tags, size=7, ha="right")
        low, back = judged - height / 2 - 0.2, 3 if phase == 1 else 1
        _arrow(
            axes,
            [(middle[4], judged - height / 2), (middle[4], low), (middle[back], low), (middle[back], judged - height / 2)],
            True,
            color,
            1.5,
        )
        moved = ("the error moves", "the error passes the frozen discriminator and moves")[phase - 1]
        moved += f" the {('discriminator', 'generator')[phase - 1]}’s weights only"
        axes.text(middle[4], low - 0.14, moved, size=7, color=IN_PRINT.get(color, color), ha="right")
    return figure


def layer_table(data: Mapping[str, np.ndarray], title: str) -> matplotlib.figure.Figure:
    """Figures 3, 9 and 10: layers, their output shapes and parameters, as a typeset table."""
    names, details, leading = data["layer"], data["detail"], 0.3
    height = 0.84 + leading * (len(names) + 1) + FOOT
    figure, down = new_sheet(SINGLE, height, title)
    axes = _drawing_board(figure)
    shape, number, y = 1.72, SINGLE - EDGE, height - down - 0.2

    def rule(y: float, linewidth: float) -> None:
        axes.plot((EDGE, SINGLE - EDGE), (y, y), color=REAL, linewidth=linewidth, solid_capstyle="butt")

    def row(y: float, *cells: str, **style) -> None:
        for x, cell, side in zip((EDGE, shape, number), cells, ("left", "left", "right"), strict=True):
            axes.text(x, y, cell, ha=side, **style)

    rule(y + 0.17, 1.0)
    row(y, "Layer", "Output shape", "Parameters", size=7.5, color=QUIET)
    rule(y - 0.08, 0.5)
    y -= 0.24
    for name, kind, detail, output, parameters in zip(names, data["type"], details, data["output_shape"], data["parameters"], strict=True):
        automatic = re.fullmatch(rf"{kind.lower()}\d*", name.replace("_", ""))  # a name generated by Keras carries no information
        row(y, kind if automatic else f"{name} ({kind})", output, f"{parameters:,}", size=8)
        axes.text(EDGE, y - 0.125, detail, size=7, color=QUIET)
        y -= leading
    rule(y + 0.12, 0.5)
    total, trainable = int(data["total"]), int(data["trainable"])
    row(y - 0.04, "Total", "", f"{total:,}", size=8, weight="bold")
    rest = f"{total - trainable:,} not trainable" if total > trainable else "all trainable"
    axes.text(number, y - 0.165, rest, size=7, color=QUIET, ha="right")
    axes.text(EDGE, y - 0.165, f"input {data['input_shape']}", size=7, color=QUIET)
    rule(y - 0.24, 1.0)
    return figure
