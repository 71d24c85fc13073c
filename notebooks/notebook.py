"""Functions that the notebooks share: the experiment, its figures and its claims, displayed in Jupyter.

This module trains, measures and draws nothing itself. Stages come from the cache that `reproduce` fills, figures from the
functions that write `figures/`, and sentences and verdicts from `claims`.
"""

import contextlib
import functools
import importlib
import io
import json
import os
import tempfile
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib.figure
import matplotlib.style
import numpy as np
from IPython.display import Markdown, display
from PIL import Image

from enhsim_tf.common import figure
from enhsim_tf.common.errors import InputError
from enhsim_tf.common.plot_style import STYLE
from enhsim_tf.common.stages import Stages, default_cache
from enhsim_tf.reproduce.caption import figure_caption
from enhsim_tf.reproduce.paper import claims
from enhsim_tf.reproduce.paper.figures import FIGURES
from enhsim_tf.reproduce.paper.pipeline import Experiment
from enhsim_tf.reproduce.settings import make_settings
from notebooks.lesson_tools import TIMES
from studies.common.figures import in_seeds
from studies.few_windows import figures as curve_figures
from studies.few_windows import findings as curve_findings
from studies.robustness import figures as robustness_figures
from studies.robustness import findings
from studies.spacecraft import figure as labelled_figures
from studies.spacecraft import summary as labelled_findings

if TYPE_CHECKING:
    import pandas as pd

_TAKES = {"full": "minutes", "smoke": "seconds"}
# stages that take time, in their order, and what of the experiment asks for each
_STAGES = {
    "telemetry": "store",
    "enhancer": "enhancer_folder",
    "noise GAN": "noise_folder",
    "enhancement": "enhancement",
}
_STAGES |= {
    "speed": "speed",
    "false alarms": "false_alarms",
    "resemblance": "resemblance",
    "degraded": "degraded",
}
_LEDGER = {known.id: known for known in claims.CLAIMS}
_ROOT = Path(__file__).parents[1]
_STUDIES = _ROOT / "studies"
_KEPT = _STUDIES / "robustness" / "results"
_SCREEN = 120 / 200  # pixels of the page for a pixel of the picture


class Arrays(dict):
    """Arrays by name; Jupyter displays their shapes instead of their contents."""

    def __repr__(self) -> str:
        return "\n".join(
            f"{name}: {np.shape(values)} {np.asarray(values).dtype}" for name, values in self.items()
        )


class _MissingStageError(Exception):
    """Raised for a stage that was looked up and has not been run."""


class _Lookup(Stages):
    """Stages that are looked up in the cache and never run."""

    def run(self, name: str, make: Callable[[Path], None], *others: Any, **options: Any) -> Path:
        @functools.wraps(make)  # stages are identified by the source of the functions that make them
        def refuse(folder: Path) -> None:
            raise _MissingStageError(name)

        return super().run(name, refuse, *others, **options)


def open_experiment(budget: str | None = None, lesson: str | None = None) -> Experiment:
    """Opens the paper's experiment and says which stages are still to be done and how long they and the lesson take.

    A stage is done when a cell first asks for it, with a progress bar for each training, and kept for all notebooks and
    for `python -m enhsim_tf.reproduce`.

    Args:
        budget: `full` or `smoke`; None takes it from the environment variable `ENHSIM_TF_BUDGET`, or `full`.
        lesson: Number of the notebook, whose running time is told as it was measured when it was built last.
    """
    budget = budget or os.environ.get("ENHSIM_TF_BUDGET", "full")
    if budget not in _TAKES:
        raise InputError(
            f"Expected ENHSIM_TF_BUDGET to be one of: {', '.join(_TAKES)}. Received: {budget!r}."
        )
    settings, cache, results = make_settings(budget), default_cache(), _ROOT / "figures" / "results.json"
    took = json.loads(results.read_text(encoding="utf-8")) if results.is_file() else {}
    known = took["timings"] if took.get("budget") == budget else {}
    missing = prepare(Experiment(settings, _Lookup(cache, tell=lambda line: None)))
    todo = [
        f"{stage} (about {known[stage]:.0f} s)" if stage in known else f"{stage} ({_TAKES[budget]})"
        for stage in missing
    ]
    print(f"{budget.capitalize()} budget, seed {settings.seed}.", end=" ")
    print(f"Still to do, when first needed: {', '.join(todo)}." if todo else "Everything is ready.")
    if lesson is not None:
        _tell_time(lesson)
    importlib.import_module(
        "enhsim_tf.keras_tools.backend"
    )  # a notebook that imports Keras itself then computes with the package's settings
    return Experiment(
        settings,
        Stages(cache, tell=lambda line: None if line.endswith("(from the cache)") else print(line)),
        verbose=1,
    )


def _tell_time(lesson: str) -> None:
    """Prints the running time of a notebook at both budgets, from the file that `python -m notebooks.build` writes."""
    path = _ROOT / "notebooks" / TIMES
    took = json.loads(path.read_text(encoding="utf-8")).get(lesson, {}) if path.is_file() else {}
    told = [f"{took[budget]} s at {budget} budget" for budget in _TAKES if budget in took]
    if told:
        print(
            f"Apart from that, this lesson took {' and '.join(told)}\nwhen it was last executed for publication."
        )


def prepare(experiment: Experiment) -> list[str]:
    """Runs every stage. Returns the names of stages that are missing if the experiment only looks stages up."""
    missing = []
    for stage, attribute in _STAGES.items():
        try:
            getattr(experiment, attribute)
        except _MissingStageError:
            missing.append(stage)
    return missing


def show(experiment: Experiment, name: str) -> Arrays:
    """Shows a figure (one of `FIGURES`) as `figures/` holds it, and returns the arrays behind it."""
    arrays, is_smoke = FIGURES[name].arrays(experiment), experiment.settings.budget == "smoke"
    with tempfile.TemporaryDirectory() as folder:
        (path,) = figure.save(
            name, arrays, folder, figure_caption(name, experiment), is_smoke, ("png",), figures=FIGURES
        )
        _show_picture(path.read_bytes(), FIGURES[name].alt)
    return Arrays(arrays)


def open_findings() -> "tuple[dict, dict[str, pd.DataFrame]]":
    """The published results of the experiment on robustness: its findings, and the tables they are computed from."""
    found = json.loads((_KEPT / "findings.json").read_text(encoding="utf-8"))
    print(
        f"{found['num_replicates']} replicates: {in_seeds(found['seeds'])} in {len(found['environments'])} environments, kept in studies/."
    )
    return found, findings.KEPT.read(_KEPT)


def open_labelled() -> "tuple[dict, dict[str, pd.DataFrame]]":
    """The published results of the study of real telemetry: its findings, and the tables they are computed from."""
    folder = _STUDIES / "spacecraft" / "results"
    found = json.loads((folder / "findings.json").read_text(encoding="utf-8"))
    print(
        f"{len(found['channels'])} channels with {found['num_sequences']} labelled sequences, kept in studies/."
    )
    return found, labelled_findings.KEPT.read(folder)


def open_curve() -> "tuple[dict, pd.DataFrame]":
    """The published results on how few real windows suffice: the findings, and the table of rows that they are computed from."""
    found = _published("few_windows", "environments")
    return found, curve_findings.KEPT.read(_STUDIES / "few_windows" / "results")["rows"]


def open_battery() -> dict:
    """The published findings of the study of a satellite's battery."""
    return _published("battery", "regimes")


def open_factorial() -> dict:
    """The published findings of the factorial experiment, in which each part of the pipeline is replaced by a simpler one."""
    return _published("factorial", "environments")


def open_noise() -> dict:
    """The published findings of the experiment on noise models and families of noise."""
    return _published("noise_models", "families")


def _published(folder: str, cases: str) -> dict:
    found = json.loads((_STUDIES / folder / "results" / "findings.json").read_text(encoding="utf-8"))
    print(f"{in_seeds(found['seeds']).capitalize()} in {len(found[cases])} {cases}, kept in studies/.")
    return found


def show_finding(found: dict, name: str) -> None:
    """Shows a figure of an experiment from its findings: of robustness, of labelled telemetry, or of the learning curve."""
    drawn, kept = next(
        (module, of.KEPT)
        for module, of in (
            (labelled_figures, labelled_findings),
            (robustness_figures, findings),
            (curve_figures, curve_findings),
        )
        if name in module.FIGURES
    )
    with tempfile.TemporaryDirectory() as folder:
        path = next(
            path
            for path in figure.save_all(drawn.FIGURES, found, folder, kept.command, (name,))
            if path.suffix == ".png"
        )
        _show_picture(path.read_bytes(), drawn.FIGURES[name].alt)


@contextlib.contextmanager
def drawing(alt: str, columns: int = 1, height: float = 2.4, title: str = "", **shared: bool) -> Iterator:
    """A row of panels in the common style, displayed when the `with` block ends.

    Args:
        alt: Text alternative.
        columns: Number of panels.
        height: Height in inches.
        title: What the picture says, above the panels.
        **shared: What `matplotlib.figure.Figure.subplots` takes, for example `sharey`.
    """
    with matplotlib.style.context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(7.2, height), layout="constrained")
        if title:
            lines = textwrap.fill(title, 96)
            figure.suptitle(lines, x=0.012, ha="left", size=9, weight="bold")
        yield figure.subplots(1, columns, **shared)
        picture = io.BytesIO()
        figure.savefig(picture, format="png", metadata={"Software": None})
    _show_picture(picture.getvalue(), alt)


def _show_picture(png: bytes, alt: str) -> None:
    picture, small = Image.open(io.BytesIO(png)).convert("RGB"), io.BytesIO()
    picture.quantize(48, dither=Image.Dither.NONE).save(
        small, "png", optimize=True
    )  # a third of the bytes, the same to the eye
    about = {"width": int(picture.width * _SCREEN), "alt": alt}
    display(
        {"image/png": small.getvalue(), "text/plain": f"Figure: {alt}"},
        metadata={"image/png": about},
        raw=True,
    )


def claim(*ids: str) -> None:
    """Displays claims of the paper: the sentence, its section, the statistic and the tolerance."""
    for known in (_LEDGER[id] for id in ids):
        held = f"{known.statistic}; {known.tolerance}"
        place = f"section {known.section}" if known.section[0].isdigit() else known.section
        display(
            Markdown(f"> **{known.id}** (paper, {place}): {known.sentence}\n>\n> *We hold it to:* {held}.")
        )


def verdict(experiment: Experiment, *ids: str) -> list[dict]:
    """Evaluates claims, displays verdicts and findings, and returns the records as stored in `results.json`."""
    records = claims.judge(tuple(_LEDGER[id] for id in ids), experiment)
    for record in records:
        display(
            Markdown(
                f"> **{record['id']}: {record['verdict']}.** {record['finding'][0].upper()}{record['finding'][1:]}."
            )
        )
    return records
