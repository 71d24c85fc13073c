"""What the lessons share: the paper's pipeline, its figures and claims, published results of studies, pictures, and answers.

Jupyter starts the kernel of a lesson in the folder of the lesson, where it finds this module. Importing it puts the clone on the path, so
that a lesson finds `enhsim_tf` and `studies` beside it. A lesson takes the paper's pipeline from here only.
"""

import base64
import contextlib
import inspect
import io
import json
import os
import sys
import tempfile
import textwrap
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib.figure
import matplotlib.style
from IPython.display import Markdown, display
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from enhsim_tf.common.errors import InputError
from enhsim_tf.common.plot_style import COARSE, ENHANCED, GENERATED, QUIET, REAL, STYLE
from enhsim_tf.common.stages import Stages, default_cache
from enhsim_tf.paper.claims import BASIC, CLAIMS, SHOWN, WHOLE, degraded_windows, judge
from enhsim_tf.paper.figures import FIGURES, save_figure
from enhsim_tf.paper.pipeline import Pipeline
from enhsim_tf.paper.report import needed, short
from enhsim_tf.paper.settings import make_settings

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

FULL, SMOKE = "full", "smoke"
DRAWN_BY_HAND = ("fig01_pipeline", "fig11_gan_training")  # figures that are kept as drawings
BUDGET = "ENHSIM_TF_BUDGET"  # environment variable with the budget of the pipeline
STATIC = "ENHSIM_TF_STATIC"  # set while a lesson is executed to be read: its sliders then need no kernel
NOT_ANSWERED, RIGHT, NOT_YET = "Not yet answered.", "Right.", "Not yet."
_MOST_FRAMES = 10  # drawn beforehand for a slider
_frames: list[tuple[bytes, dict[str, Any]]] | None = (
    None  # of a slider while they are drawn, instead of being displayed
)
_SCREEN = 120 / 200  # pixels of the page for a pixel of the picture
_LEDGER = {known.id: known for known in CLAIMS}
_PART = {
    BASIC: "",
    WHOLE: " (to hold in full)",
    SHOWN: " (shown, does not decide)",
}  # of a limit in a verdict


# -- the pipeline ------------------------------------------------------------------------------------------------------------


def open_pipeline() -> tuple[Pipeline, str]:
    """Opens the paper's pipeline with seed 0, at the budget in the environment variable `ENHSIM_TF_BUDGET`, or at full budget.

    A stage runs when a cell first asks for it, and is kept for all lessons and for `python -m enhsim_tf.reproduce`.

    Returns:
        The pipeline and its budget.

    Raises:
        InputError: If there is no such budget.
    """
    budget = os.environ.get(BUDGET, FULL)
    if budget not in (FULL, SMOKE):
        raise InputError(f"Expected {BUDGET} to be {FULL} or {SMOKE}. Received: {budget!r}.")
    print(f"{budget.capitalize()} budget, seed 0.")
    stages = Stages(
        default_cache(), tell=lambda line: None if line.endswith("(from the cache)") else print(line)
    )
    return Pipeline(make_settings(budget), stages), budget


def show(pipeline: Pipeline, name: str) -> None:
    """Shows a figure of the paper as `figures/` holds it, and the folded code that draws it.

    Args:
        pipeline: As `open_pipeline` returns it.
        name: One of `FIGURES`.
    """
    is_smoke = pipeline.settings.iterations < make_settings().iterations
    caption = f"seed {pipeline.settings.seed} · python -m enhsim_tf.reproduce --only {name.split('_')[0]}"
    with tempfile.TemporaryDirectory() as folder:
        save_figure(name, pipeline, Path(folder), caption, is_smoke)
        _show_picture(Path(folder, f"{name}.png").read_bytes(), FIGURES[name].alt)
    if name not in DRAWN_BY_HAND:
        say(_code_of(name))


def _code_of(name: str) -> str:
    """The code that draws a figure, as it runs in a cell of a lesson."""
    function = FIGURES[name].drawn_by
    code = inspect.getsource(function)
    code = code[code.index("def ") :]  # without its decorator
    return (
        "<details><summary>The code of this figure: copy it into a cell, and change it</summary>\n\n```python\n"
        f"from enhsim_tf.paper.figures import *\n\n\n{code}\n\n{function.__name__}(pipeline)\n```\n\n</details>"
    )


def degraded(pipeline: Pipeline, mode: str, severity: float) -> "tuple[np.ndarray, np.ndarray]":
    """Windows of the simulation and of the true signal in a degraded mode, of the same times; both have the shape `(windows, samples)`.

    Args:
        pipeline: As `open_pipeline` returns it.
        mode: One of `enhsim_tf.paper.degraded.MODES`, or `nominal`.
        severity: From 0 to 1.
    """
    coarse, truth = (
        degraded_windows(pipeline, mode, signal, severity) for signal in (pipeline.simulator, pipeline.truth)
    )
    return coarse, truth


def claim(*ids: str) -> None:
    """Displays claims of the paper: the sentence and its section."""
    for known in (_LEDGER[id] for id in ids):
        place = f"section {known.section}" if known.section[0].isdigit() else known.section
        display(Markdown(f"> **{known.id}** (paper, {place}): {known.sentence}"))


def verdict(pipeline: Pipeline, *ids: str, limits: bool = True) -> list[dict[str, Any]]:
    """Evaluates claims, and displays each verdict with its limits.

    Args:
        pipeline: As `open_pipeline` returns it.
        *ids: C1 to C9.
        limits: Whether the limits are displayed, too, each with its part in the verdict.

    Returns:
        The records as `results.json` stores them.
    """
    records = [judge(_LEDGER[id], _LEDGER[id].measure(pipeline)) for id in ids]
    for record in records:
        lines = "".join(
            f"\n> - {limit['words']}: {short(limit['value'])}, needed {needed(limit)}{_PART[limit['decides']]}"
            for limit in record["limits"]
            if limits
        )
        display(Markdown(f"> **{record['id']}: {record['verdict']}.**\n{lines}"))
    return records


def open_study(name: str) -> "tuple[dict[str, Any], dict[str, pd.DataFrame]]":
    """Reads the published results of a study.

    Args:
        name: Name of its folder in `studies/`, such as `battery`.

    Returns:
        Its findings, and its tables by the names of their files.

    Raises:
        InputError: If there is no such study.
    """
    import pandas as pd

    folder = ROOT / "studies" / name / "results"
    if not (folder / "findings.json").is_file():
        known = ", ".join(
            sorted(path.parents[1].name for path in ROOT.glob("studies/*/results/findings.json"))
        )
        raise InputError(f"Expected one of the studies {known}. Received: {name!r}.")
    read = {".parquet": pd.read_parquet, ".csv": pd.read_csv}
    tables = {path.stem: read[path.suffix](path) for path in sorted(folder.iterdir()) if path.suffix in read}
    return json.loads((folder / "findings.json").read_text(encoding="utf-8")), tables


# -- pictures and sentences --------------------------------------------------------------------------------------------------


def say(text: str) -> None:
    """Displays a sentence with computed numbers as Markdown."""
    display(Markdown(text))


@contextlib.contextmanager
def drawing(
    alt: str, columns: int = 1, height: float = 2.4, title: str = "", **shared: bool
) -> Iterator[Any]:
    """A row of panels in the common style, displayed when the `with` block ends.

    Args:
        alt: Text alternative.
        columns: Number of panels.
        height: Height in inches.
        title: What the picture says, above the panels.
        **shared: What `matplotlib.figure.Figure.subplots` takes, for example `sharey`.
    """
    with matplotlib.style.context(STYLE):
        canvas = matplotlib.figure.Figure(figsize=(7.2, height), layout="constrained")
        if title:
            canvas.suptitle(textwrap.fill(title, 96), x=0.012, ha="left", size=9, weight="bold")
        yield canvas.subplots(1, columns, **shared)
        picture = io.BytesIO()
        canvas.savefig(picture, format="png", metadata={"Software": None})
    _show_picture(picture.getvalue(), alt)


def show_detectors(rates: "pd.DataFrame", recall: "pd.DataFrame", title: str) -> None:
    """Shows false-alarm rates and recall, both with a row for each detector and a column for each kind of training data."""
    colors = {"coarse": COARSE, "enhanced": ENHANCED, "enhanced + GAN noise": GENERATED, "real": REAL}
    alt = "False-alarm rate and recall of three detectors by the data they were trained on"
    shown = {"false alarms: share of nominal windows": rates, "recall: share of faulty windows": recall}
    with drawing(alt, 2, 2.8, title, sharey=True) as panels:
        for panel, (name, shares) in zip(panels, shown.items()):
            for number, (detector, marker) in enumerate(zip(shares.index, "os^")):
                for row, kind in enumerate(shares.columns):
                    style = {"color": colors.get(kind, QUIET), "markersize": 4.5, "clip_on": False}
                    label = detector if kind == "real" and panel is panels[0] else None
                    panel.plot(
                        shares.loc[detector, kind], row + 0.22 * (number - 1), marker, **style, label=label
                    )
            panel.set(xlabel=name, xlim=(0, 1), yticks=range(len(shares.columns)), yticklabels=shares.columns)
            panel.set_xticks([0, 0.5, 1], ["0 %", "50 %", "100 %"])
            panel.grid(axis="y", linewidth=0.3)
        panels[0].axvline(0.01, color=REAL, linestyle=":", linewidth=0.8)
        panels[0].invert_yaxis()
        panels[0].figure.legend(frameon=False, loc="outside lower center", ncols=3)


def save_film(frames: "dict[int, np.ndarray]", real_sd: float) -> None:
    """Writes `figures/noise_forming.gif`, when a lesson is executed at full budget to be read.

    Args:
        frames: Generated windows by the number of iterations; the film shows the first of each.
        real_sd: Standard deviation of the real noise.
    """
    if not os.environ.get(STATIC) or os.environ.get(BUDGET, FULL) != FULL:
        return
    from matplotlib.animation import FuncAnimation, PillowWriter

    canvas = matplotlib.figure.Figure(figsize=(5.6, 2.2), dpi=80, layout="constrained")
    panel, recorded = canvas.subplots(), list(frames)
    (line,) = panel.plot(frames[recorded[0]][0], color=GENERATED, linewidth=0.6)
    panel.axhspan(-2 * real_sd, 2 * real_sd, color=REAL, alpha=0.12, linewidth=0, label="±2 sd of real noise")
    panel.set(xlabel="time (s)", ylabel="noise (dimensionless)", ylim=(-1, 1), xlim=(0, 500))
    panel.legend(facecolor="white", framealpha=1, loc="lower right")

    def redraw(iteration: int) -> None:
        line.set_ydata(frames[iteration][0])
        panel.set_title(
            f"The noise forms: iteration {iteration:,}", loc="left", fontweight="bold", fontsize=10
        )

    FigureCanvasAgg(canvas)  # which an animation draws on
    film = FuncAnimation(canvas, redraw, recorded[::2] + recorded[-1:] * 5)
    film.save(ROOT / "figures" / "noise_forming.gif", PillowWriter(fps=4))


def _show_picture(png: bytes, alt: str) -> None:
    picture, small = Image.open(io.BytesIO(png)).convert("RGB"), io.BytesIO()
    # 48 colours: a third of the bytes, the same to the eye
    picture.quantize(48, dither=Image.Dither.NONE).save(small, "png", optimize=True)
    about = {"width": int(picture.width * _SCREEN), "alt": alt}
    if _frames is not None:
        _frames.append((small.getvalue(), about))
        return
    display(
        {"image/png": small.getvalue(), "text/plain": f"Figure: {alt}"},
        metadata={"image/png": about},
        raw=True,
    )


def _frames_of(draw: Callable[[Any], None], values: Sequence[Any]) -> list[tuple[bytes, dict[str, Any]]]:
    """The last picture, as PNG and with its width and text alternative, that is drawn for each value."""
    global _frames
    drawn = []
    for value in values:
        _frames = []
        try:
            draw(value)
            drawn.append(_frames[-1])
        finally:
            _frames = None
    return drawn


def _show_frames(
    frames: Sequence[tuple[bytes, dict[str, Any]]], name: str, values: Sequence[Any], first: int
) -> None:
    """Displays frames below a slider in HTML; where scripts do not run, the first one stays."""
    encoded = [base64.b64encode(png).decode() for png, _ in frames]
    about = frames[first][1]
    page = (
        f'<figure class="frames"><label style="display: block">{name} <output>{values[first]}</output><br>'
        f'<input type="range" min="0" max="{len(values) - 1}" value="{first}" style="width: 60%"></label><br>'
        f'<img alt="{about["alt"]}" width="{about["width"]}" src="data:image/png;base64,{encoded[first]}">'
        "<script>{ const figure = document.currentScript.parentElement, "
        f"values = {json.dumps([str(value) for value in values])}, frames = {json.dumps(encoded)}; "
        "figure.querySelector('input').oninput = (event) => { const at = event.target.value; "
        "figure.querySelector('output').textContent = values[at]; "
        "figure.querySelector('img').src = 'data:image/png;base64,' + frames[at]; }; }</script></figure>"
    )
    display(
        {
            "text/html": page,
            "image/png": frames[first][0],
            "text/plain": f"Figure with a slider: {about['alt']}",
        },
        metadata={"image/png": about},
        raw=True,
    )


def slider(
    draw: Callable[[Any], None], label: str, values: Sequence[Any], shown: Sequence[Any], unit: str = ""
) -> None:
    """Displays a picture below a slider. A lesson that is executed to be read holds frames drawn beforehand, for which the slider
    needs no kernel.

    Args:
        draw: Draws the picture for a value, for example with `drawing`.
        label: What the slider changes.
        values: The values of the slider, in their order; frames are drawn for at most `_MOST_FRAMES` of them, and for `shown`.
        shown: The values that must have frames; the slider starts at the first one.
        unit: Unit of the values.
    """
    name = f"{label} ({unit})" if unit else label
    if os.environ.get(STATIC):
        step = -(-len(values) // _MOST_FRAMES)
        chosen = [value for number, value in enumerate(values) if number % step == 0 or value in shown]
        _show_frames(_frames_of(draw, chosen), name, chosen, chosen.index(shown[0]))
        return
    import ipywidgets

    control = ipywidgets.SelectionSlider(
        options=list(values),
        value=shown[0],
        description=name,
        continuous_update=False,
        style={"description_width": "initial"},
        layout={"width": "80%"},
    )
    display(control, ipywidgets.interactive_output(lambda value: draw(value), {"value": control}))


# -- answers -----------------------------------------------------------------------------------------------------------------


def check_answer(answer: Any, is_right: Callable[[Any], bool], hint: str) -> None:
    """Says whether a student's answer to an exercise is right.

    Args:
        answer: The answer; None for a starter cell that was not changed.
        is_right: Whether an answer is right.
        hint: What to look at if it is not.
    """
    if answer is None:
        print(NOT_ANSWERED)
        return
    try:
        right = bool(is_right(answer))
    except (
        TypeError,
        ValueError,
        IndexError,
        KeyError,
        AttributeError,
    ) as error:  # an answer of another type or shape
        print(f"{NOT_YET} The check cannot use this answer: {error}")
        return
    print(RIGHT if right else f"{NOT_YET} {hint}")
