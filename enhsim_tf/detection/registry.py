"""Names and factories of the detectors that `score` offers (title and abstract of the paper).

To add a detector, write its class in `detectors.py` and add one line to `DETECTORS`. This module imports nothing slow, so that the command line
can list the names.
"""

import importlib
import inspect
from collections.abc import Callable
from functools import partial
from typing import Any

RESIDUAL = "residual"
"""Name of the detector that judges the size of the difference between telemetry and a fitted simulator (see `scoring.Scorer`). It needs
a simulator, so it is no member of `DETECTORS`."""


def _make(kind: str, seed: int) -> Any:
    """Creates a detector, with the seed if its constructor takes one."""
    made = getattr(importlib.import_module("enhsim_tf.detection.detectors"), kind)
    return made(seed=seed) if "seed" in inspect.signature(made).parameters else made()


DETECTORS: dict[str, Callable[[int], Any]] = {
    "limit check": partial(_make, "LimitCheck"),
    "PCA residual": partial(_make, "PCAResidual"),
    "innovation": partial(_make, "Innovation"),
    "largest step": partial(_make, "LargestStep"),
    "moving deviation": partial(_make, "MovingDeviation"),
}
"""Maps a name to a factory, which takes a seed and returns an unfitted detector. The last two are trivial scores, which every useful detector
should outperform."""


def option_name(name: str) -> str:
    """The form of a detector's name on the command line, for example `pca-residual` for `PCA residual`."""
    return name.casefold().replace(" ", "-")
