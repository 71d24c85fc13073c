"""The figures of the paper by name: what each is called, what it shows to those who do not see it, how it is drawn and kept.

`figure_data` makes the arrays, `curves` and `diagrams` draw them. Drawing takes arrays alone: it trains nothing, saves
nothing and shows nothing, and needs neither TensorFlow nor a screen.
"""

import dataclasses
import os
import textwrap
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib.figure
import matplotlib.style
import numpy as np

from enhsim_tf.files import replace_file
from enhsim_tf.reproduce import curves, diagrams
from enhsim_tf.reproduce.caption import caption_of_findings
from enhsim_tf.sheet import EDGE, GENERATED, QUIET, STYLE

WATERMARK = "SMOKE BUDGET"


@dataclasses.dataclass(frozen=True)
class Figure:
    """A figure of the paper.

    Args:
        number: Its number; 14 is the one the paper commented out.
        title: The paper's caption.
        alt: What it shows, in words, for those who do not see it.
        drawn_by: Makes it from its arrays.
    """

    number: int
    title: str
    alt: str
    drawn_by: Callable[[Mapping[str, np.ndarray]], matplotlib.figure.Figure]

    def draw(self, data: Mapping[str, np.ndarray]) -> matplotlib.figure.Figure:
        """Draws the figure in the style of all.

        Args:
            data: The arrays that `figure_data.FIGURE_DATA` makes for it.
        """
        with matplotlib.style.context(STYLE):
            return self.drawn_by(data)


FIGURES: dict[str, Figure] = {
    "fig01_pipeline": Figure(
        1,
        "Enhanced simulation pipeline",
        "Diagram of nine numbered steps. A light simulator (1) makes approximate, quantised data (2), which a trained enhancer (3) turns into "
        "clean data (5). Telemetry from a real source (4) in the store, the goal, trains the enhancer; less its moving average it is the "
        "environmental noise (6) that trains a GAN (8), which turns random numbers of a latent space (7) into generated noise (9). Clean data "
        "and generated noise add up to the combined output, drawn beside real telemetry of the same times.",
        diagrams.pipeline,
    ),
    "fig02_source_target": Figure(
        2,
        "Training source and target time series",
        "Training windows in two rows: above the coarse simulation, a sum of square waves; below the telemetry of the same times.",
        curves.source_target,
    ),
    "fig03_enhancer": Figure(
        3,
        "Enhancing MLP neural network",
        "Table of the enhancer's layers with their output shapes and numbers of parameters, and the total.",
        lambda data: diagrams.layer_table(data, f"{int(data['total']) / 1e6:.1f} million parameters enhance a window"),
    ),
    "fig04_enhanced_simulation": Figure(
        4,
        "Enhanced simulation",
        "One held-out window: the stepped coarse simulation, the enhanced signal and the signal it should follow; below, the difference of the "
        "last two. The title and the line under it give the errors.",
        curves.enhanced_simulation,
    ),
    "fig05_real_or_generated": Figure(
        5,
        "Real or generated: windows of telemetry (counterpart of a borrowed picture)",
        "Real and generated windows of telemetry in random order, lettered, to be told apart; the answer stands upside down at the foot.",
        curves.real_or_generated,
    ),
    "fig06_real_or_generated_noise": Figure(
        6,
        "Real or generated: windows of noise (counterpart of a borrowed picture)",
        "Real and generated windows of noise in random order, lettered, to be told apart; the answer stands upside down at the foot. The line "
        "under the title gives the effective rank of generated and of real noise.",
        curves.real_or_generated_noise,
    ),
    "fig07_real_or_generated_series": Figure(
        7,
        "Real or generated: long stretches of telemetry (counterpart of a borrowed picture)",
        "Long stretches of telemetry, held-out real and generated ones in random order, lettered, to be told apart; the answer stands upside "
        "down at the foot.",
        curves.real_or_generated_series,
    ),
    "fig08_source_noise": Figure(
        8,
        "Extracted source noise",
        "Above, a window of telemetry with its centred moving average; below, the difference of the two, which is the noise, with lines at one "
        "standard deviation. The title gives the standard deviation.",
        curves.source_noise,
    ),
    "fig09_generator": Figure(
        9,
        "Generator construction",
        "Table of the generator's layers with their output shapes and numbers of parameters, and the total.",
        lambda data: diagrams.layer_table(
            data, f"{_shape(data['input_shape'])} numbers become {_shape(data['output_shape'][-1])} samples of noise"
        ),
    ),
    "fig10_discriminator": Figure(
        10,
        "Discriminator construction",
        "Table of the discriminator's layers with their output shapes and numbers of parameters, and the total.",
        lambda data: diagrams.layer_table(data, f"{_shape(data['input_shape'])} samples of noise become one judgement"),
    ),
    "fig11_gan_training": Figure(
        11,
        "GAN training",
        "Diagram of the two phases of an iteration. First the discriminator learns alone: real noise, tagged 1, and noise from the frozen "
        "generator, tagged 0, go in, and the loss moves the discriminator's weights only. Then the generator learns: its noise goes through the "
        "frozen discriminator with the tag reversed to 1, and the loss moves the generator's weights only.",
        diagrams.gan_training,
    ),
    "fig12_accuracy_loss": Figure(
        12,
        "Accuracy and loss for real and fake classifications",
        "Two panels over the iterations of training: the discriminator's accuracy and its loss, each for real and for generated noise, with a "
        "line at chance. The title gives the last accuracies.",
        curves.accuracy_loss,
    ),
    "fig13_combined": Figure(
        13,
        "Simulator output, enhanced, with noise added",
        "One held-out window in three panels: the coarse simulation with the enhanced signal; the enhanced signal with generated noise added; "
        "real telemetry of the same times. The line under the title gives the standard deviation of the first differences of each.",
        curves.combined,
    ),
    "fig14_telemetry_store": Figure(
        14,
        "Example telemetry signals in the store",
        "The beginning of the stored telemetry series over its timestamps.",
        curves.telemetry_store,
    ),
}


def save(
    name: str,
    data: Mapping[str, np.ndarray],
    folder: str | os.PathLike,
    caption: str,
    is_smoke: bool,
    saved_as: Sequence[str] = ("png", "svg"),
    figures: Mapping[str, Figure] | None = None,
) -> list[Path]:
    """Draws a figure and writes it, with its caption line and, where it is due, the mark of a smoke run.

    The same data give the same bytes.

    Args:
        name: One of `figures`.
        data: Its arrays.
        folder: An existing folder.
        caption: What ran, in small print at the bottom.
        is_smoke: Whether the arrays come from a smoke run.
        saved_as: File types.
        figures: The figures by name; None for those of the paper.

    Returns:
        The paths of the files.
    """
    about = (FIGURES if figures is None else figures)[name]
    figure = about.draw(data)
    width, height = figure.get_size_inches()
    lines = textwrap.wrap(caption, int((width - 2 * EDGE) * 20.5))
    small = {"size": 7, "color": QUIET, "linespacing": 1.05}
    figure.text(EDGE / width, 0.06 / height, "\n".join(lines), **small, va="bottom", gid="caption")
    if is_smoke:
        mark = {"size": 6.2 * width, "weight": "bold", "color": GENERATED, "alpha": 0.22, "rotation": 15}
        figure.text(0.5, 0.5, WATERMARK, **mark, ha="center", va="center", zorder=10, gid="watermark")
    paths = [Path(folder) / f"{name}.{kind}" for kind in saved_as]
    with matplotlib.style.context(STYLE):
        for path in paths:
            undated = {"Date": None} if path.suffix == ".svg" else {"Software": None}
            with replace_file(path) as temporary:
                figure.savefig(temporary, metadata={"Title": about.title, "Description": about.alt} | undated)
    return paths


def save_all(
    figures: Mapping[str, Figure], found: Mapping[str, Any], folder: str | os.PathLike, command: str, names: Sequence[str] = ()
) -> list[Path]:
    """Draws the figures of an experiment from its findings and writes them, as `save` does.

    Args:
        figures: The experiment's figures by name.
        found: Its findings.
        folder: An existing folder.
        command: What runs it, for the captions.
        names: Which; none for all.

    Returns:
        The paths of the files.
    """
    caption = caption_of_findings(found, command)
    return [path for name in names or figures for path in save(name, found, folder, caption, found["budget"] == "smoke", figures=figures)]


def _shape(words: np.ndarray) -> str:
    """The samples of a Keras shape such as `(None, 500, 1)`."""
    return str(words).strip("()").split(", ")[1]
