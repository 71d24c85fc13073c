"""A figure of the paper: what `Figure` holds, its arrays, and the stages that these come from."""

import dataclasses
from collections.abc import Callable

import numpy as np

from enhsim_tf.common.figure import Figure
from enhsim_tf.reproduce.paper.pipeline import Experiment

Arrays = dict[str, np.ndarray]


@dataclasses.dataclass(frozen=True)
class PaperFigure(Figure):
    """A figure of the paper.

    Args:
        number: Its number; 14 is the one the paper commented out.
        title: The paper's caption.
        alt: Text alternative for readers who cannot see the figure.
        drawn_by: Function that draws the figure from its arrays. It depends on nothing else, trains nothing, and needs neither
            TensorFlow nor a screen.
        arrays: Function that returns the arrays by name. Numbers are arrays of shape `()` and text is a unicode array, so that
            `numpy.savez` stores them without pickle.
        stages: Names of all stages of `Experiment` whose results the arrays come from.
    """

    arrays: Callable[[Experiment], Arrays]
    stages: tuple[str, ...]

    @property
    def needs_training(self) -> bool:
        """Whether the arrays come from a trained network. Other figures are drawn before training."""
        return not set(self.stages) <= {"telemetry"}
