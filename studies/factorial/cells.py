"""Design of the study: its factors and its cells, which were fixed before the first run.

A cell is one combination of four factors. Its training data are the signal of its enhancer plus
noise of its generator.

- `windows`: the enhancer and the generator learn from as many windows as the paper's pipeline (few)
  or the residual pipeline (many).
- `extraction`: the generator learns the telemetry minus its moving average, or minus the signal of
  the cell's enhancer (residual).
- `enhancer`: the paper's network, or ridge regression whose penalty is chosen by cross-validation
  over blocks of time.
- `generator`: the paper's GAN, a fitted autoregression, or whole windows of the extracted noise
  drawn again.

Two deviations from a full design limit its cost. With many windows, the network is trained as in
the residual pipeline (2 epochs, falling learning rate), because the paper's 40 epochs would take
ten times as long. The detectors are the five that train in a second.
"""

import itertools
from typing import NamedTuple

FEW = "few"
MANY = "many"
MOVING_AVERAGE = "moving average"
RESIDUAL = "residual"
NETWORK = "network"
RIDGE = "ridge"
PAPER_GAN = "paper's GAN"
AUTOREGRESSION = "autoregression"
WHOLE_WINDOWS = "whole windows"
LEVELS = {
    "windows": (FEW, MANY),
    "extraction": (MOVING_AVERAGE, RESIDUAL),
    "enhancer": (NETWORK, RIDGE),
    "generator": (PAPER_GAN, AUTOREGRESSION, WHOLE_WINDOWS),
}
"""Levels of each factor; the first is that of the paper."""
GENERATORS = (WHOLE_WINDOWS, AUTOREGRESSION)
"""Levels of the generator with which the paper's GAN is compared, the main comparison first."""
REFERENCES = ("coarse", "real")
"""Training data outside the factorial: the two ends of the gap that the cells close."""
DETECTORS = (
    "limit check",
    "PCA residual",
    "nearest neighbours",
    "isolation forest",
    "one-class SVM",
)


class Cell(NamedTuple):
    """A combination of the four factors.

    Args:
        windows: How many windows the enhancer and the generator learn from.
        extraction: What is subtracted from telemetry to obtain the noise.
        enhancer: What maps coarse windows to the signal.
        generator: What learns and draws the noise.
    """

    windows: str
    extraction: str
    enhancer: str
    generator: str

    @property
    def name(self) -> str:
        """Name of the cell in tables."""
        return " / ".join(self)

    @property
    def source(self) -> tuple[str, str, str]:
        """What the noise of the cell is learnt from. Noise of the moving average does not depend on
        the enhancer.
        """
        return (
            self.windows,
            self.extraction,
            "" if self.extraction == MOVING_AVERAGE else self.enhancer,
        )


CELLS = {cell.name: cell for cell in itertools.starmap(Cell, itertools.product(*LEVELS.values()))}
"""All cells by name."""
PAPER_CELL = Cell(FEW, MOVING_AVERAGE, NETWORK, PAPER_GAN)
WITHOUT_NETWORK = Cell(MANY, RESIDUAL, RIDGE, WHOLE_WINDOWS)


def cells_by_source() -> dict[tuple[str, str, str], list[Cell]]:
    """The cells whose noise is learnt from the same windows, with those of one generator next to
    each other.
    """
    ordered = sorted(CELLS.values(), key=lambda cell: (cell.source, cell.generator))
    return {
        source: list(cells)
        for source, cells in itertools.groupby(ordered, key=lambda cell: cell.source)
    }
