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
from collections.abc import Iterable

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


def rounds() -> list[list[list[str]]]:
    """Names of references and cells in the order in which they are computed.

    A round is computed for all seeds before the next one begins, and its parts seed by seed, each in all environments. The first round
    trains no network. The second trains the network on many windows, then the network on few windows and the paper's GAN, and so completes
    the main comparison of a seed. The third fits the autoregressions. The fourth trains the convolutional GAN, which takes as long as
    everything before it.

    Returns:
        The parts of each round, and the names in each part. Cells that share a noise model follow each other.
    """

    def named(cells: Iterable[Cell]) -> list[str]:
        return [cell.name for cell in sorted(cells, key=lambda cell: (cell.generator == PAPER_GAN, cell.source))]

    by_generator = {generator: [cell for cell in CELLS.values() if cell.generator == generator] for generator in LEVELS["generator"]}
    whole = {each: [cell for cell in by_generator[WHOLE_WINDOWS] if (cell.enhancer, cell.windows) == each] for each in _ENHANCERS}
    without = named(whole[RIDGE, FEW] + whole[RIDGE, MANY])
    paper = named(whole[NETWORK, FEW] + by_generator[PAPER_GAN])
    return [
        [[*REFERENCES, *without]],
        [named(whole[NETWORK, MANY]), paper],
        [named(by_generator[AUTOREGRESSION])],
        [named(by_generator[CONVOLUTIONAL_GAN])],
    ]


_ENHANCERS = tuple(itertools.product(LEVELS["enhancer"], LEVELS["windows"]))
