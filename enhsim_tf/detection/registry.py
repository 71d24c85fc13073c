"""Names and factories of all anomaly detectors (title and abstract of the paper).

To add a detector, write its class in a module of this package and add one line to `BUILT_IN`. This module imports nothing slow, so that the
command line can list the names.
"""

import importlib
import inspect
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from enhsim_tf.common.errors import InputError

if TYPE_CHECKING:
    from enhsim_tf.detection.interface import Detector

BUILT_IN = {
    "limit check": "enhsim_tf.detection.detectors:LimitCheck",
    "PCA residual": "enhsim_tf.detection.detectors:PCAResidual",
    "nearest neighbours": "enhsim_tf.detection.detectors:NearestNeighbours",
    "isolation forest": "enhsim_tf.detection.detectors:IsolationForestOnFeatures",
    "one-class SVM": "enhsim_tf.detection.detectors:OneClassSVMOnFeatures",
    "dense autoencoder": "enhsim_tf.detection.autoencoders:DenseAutoencoder",
    "convolutional autoencoder": "enhsim_tf.detection.autoencoders:ConvolutionalAutoencoder",
}
"""Maps each detector's name to the path `module:class` of its class, the simplest detector first and the networks last."""

RESIDUAL = "residual"
"""Name of the detector that judges the size of the difference between telemetry and a fitted simulator (`detectors.ResidualSize`). It needs
a simulator, so it is no member of `DETECTORS`."""


def _build(path: str, seed: int) -> "Detector":
    """Imports a built-in class and creates it, with the seed if its constructor takes one."""
    module, name = path.split(":")
    detector = getattr(importlib.import_module(module), name)
    return detector(seed=seed) if "seed" in inspect.signature(detector).parameters else detector()


DETECTORS: dict[str, Callable[[int], "Detector"]] = {name: partial(_build, path) for name, path in BUILT_IN.items()}
"""Maps a name to a factory, which takes a seed and returns an unfitted detector."""

FURTHER: dict[str, Callable[[int], "Detector"]] = {
    name: partial(_build, f"enhsim_tf.detection.detectors:{kind}")
    for name, kind in (("innovation", "Innovation"), ("largest step", "LargestStep"), ("moving deviation", "MovingDeviation"))
}
"""Detectors that `score` offers besides `DETECTORS`, on which the studies' published tables are. The last two are controls: trivial scores
that every useful detector should outperform."""


def all_detectors() -> dict[str, Callable[[int], "Detector"]]:
    """All detectors that need no simulator, by name."""
    return DETECTORS | FURTHER


def option_name(name: str) -> str:
    """The form of a detector's name on the command line, for example `pca-residual` for `PCA residual`."""
    return name.casefold().replace(" ", "-")


def register(name: str, factory: Callable[[int], Any]) -> None:
    """Adds a detector to `DETECTORS`.

    Args:
        name: The detector's name in tables, and the value of `ScoreOptions.detector`.
        factory: Takes a seed and returns a new, unfitted detector, or an estimator of scikit-learn or PyOD.

    Raises:
        InputError: If a detector of this name exists already, or the factory cannot be called.

    Example:
    >>> from sklearn.neighbors import LocalOutlierFactor
    >>> register("local outlier factor", lambda seed: LocalOutlierFactor(novelty=True))
    """
    if option_name(name) in map(option_name, (RESIDUAL, *all_detectors())):
        raise InputError(f"Expected a name that no detector has yet. Received: name={name!r}. Choose another name.")
    if not callable(factory):
        raise InputError(f"Expected a factory that takes a seed. Received: {type(factory).__name__}. Wrap it, as in `lambda seed: ...`.")

    def build(seed: int) -> "Detector":
        from enhsim_tf.detection.interface import as_detector

        return as_detector(factory(seed))

    DETECTORS[name] = build
