"""Design of the factorial experiment: its factors, its cells, and the order in which they are computed.

A cell is one combination of four factors. Its arm of training windows is the signal of its enhancer plus noise of its generator. What
follows was fixed before the first run:

- `windows`: the enhancer and the generator learn from as many windows as the paper's pipeline (few) or the residual pipeline (many).
- `extraction`: the generator learns the telemetry minus its moving average, or minus the signal of the cell's enhancer (residual).
- `enhancer`: the paper's network, or ridge regression whose penalty is chosen by cross-validation over blocks of time.
- `generator`: the paper's GAN, the convolutional GAN, a fitted autoregression, or whole windows of the extracted noise drawn again.

The cell of ridge regression, residuals and whole windows contains no network. All combinations are computed, so extraction by the
moving average is also combined with ridge regression. This needs no further training, because that noise does not depend on the enhancer.

Two deviations from a full design limit its cost. With many windows, the network is trained as in the residual pipeline (2 epochs, falling
learning rate), because the paper's 40 epochs would take ten times as long. The detectors are the five that train in a second.
"""

import dataclasses
import itertools

FEW, MANY = "few", "many"
MOVING_AVERAGE, RESIDUAL = "moving average", "residual"
NETWORK, RIDGE = "network", "ridge"
PAPER_GAN, CONVOLUTIONAL_GAN, AUTOREGRESSION, WHOLE_WINDOWS = "paper's GAN", "convolutional GAN", "autoregression", "whole windows"
LEVELS = {
    "windows": (FEW, MANY),
    "extraction": (MOVING_AVERAGE, RESIDUAL),
    "enhancer": (NETWORK, RIDGE),
    "generator": (PAPER_GAN, CONVOLUTIONAL_GAN, AUTOREGRESSION, WHOLE_WINDOWS),
}
"""Levels of each factor; the first is that of the paper."""
GENERATORS = (WHOLE_WINDOWS, AUTOREGRESSION, CONVOLUTIONAL_GAN)
"""Levels of the generator with which the paper's GAN is compared, the main comparison first."""
REFERENCES = ("coarse", "real")
"""Arms outside the factorial: the two ends of the gap that the cells close."""


@dataclasses.dataclass(frozen=True)
class Cell:
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
        return " / ".join(dataclasses.astuple(self))

    @property
    def source(self) -> tuple[str, str, str]:
        """What the noise of the cell is learnt from: cells with the same source and generator share one noise model."""
        return self.windows, self.extraction, "" if self.extraction == MOVING_AVERAGE else self.enhancer


CELLS = {cell.name: cell for cell in itertools.starmap(Cell, itertools.product(*LEVELS.values()))}
"""All cells by name."""
PAPER_CELL = Cell(FEW, MOVING_AVERAGE, NETWORK, PAPER_GAN)
WITHOUT_NETWORK = Cell(MANY, RESIDUAL, RIDGE, WHOLE_WINDOWS)
PUBLISHED = {
    "coarse": "coarse",
    "real": "real",
    "enhanced + GAN": PAPER_CELL.name,
    "enhanced + AR": Cell(FEW, MOVING_AVERAGE, NETWORK, AUTOREGRESSION).name,
    "residual + convolutional GAN": Cell(MANY, RESIDUAL, NETWORK, CONVOLUTIONAL_GAN).name,
    "residual + AR": Cell(MANY, RESIDUAL, NETWORK, AUTOREGRESSION).name,
}
"""Arms of the experiment on robustness that are cells here, with the same windows, seeds and trainings."""


def parts() -> list[list[str]]:
    """Names of references and cells in four parts, in the order in which they are computed.

    The first part trains no network. The second trains the paper's networks and completes the main comparison, with whole windows. The
    third fits the autoregressions, and the fourth trains the convolutional GAN, which takes as long as everything before it.
    """
    found: list[list[Cell]] = [[], [], [], []]
    for cell in CELLS.values():
        if cell.generator in (AUTOREGRESSION, CONVOLUTIONAL_GAN):
            found[2 + (cell.generator == CONVOLUTIONAL_GAN)].append(cell)
        else:
            found[cell.enhancer == NETWORK or cell.generator == PAPER_GAN].append(cell)
    ordered = [sorted(cells, key=lambda cell: (cell.generator == PAPER_GAN, cell.source)) for cells in found]
    without, *others = [[cell.name for cell in cells] for cells in ordered]
    return [[*REFERENCES, *without], *others]
