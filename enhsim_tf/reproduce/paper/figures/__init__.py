"""The figures of the paper, one module each.

To add a figure, write a module in this package, for example `fig15_my_figure`, that defines `FIGURE`, a `PaperFigure`. Nothing else has
to be changed: the name of the module is the name of the figure.
"""

import importlib
import pkgutil
import re
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from enhsim_tf.reproduce.paper.figures.paper_figure import PaperFigure


class Figures(Mapping[str, "PaperFigure"]):
    """The figures of the paper by name, in the order of their numbers.

    The names are those of the modules. A module, and with it matplotlib, is imported when its figure is asked for, so that the
    command line can list the names without slow imports.
    """

    def __init__(self):
        modules = (module.name for module in pkgutil.iter_modules(__path__))
        self._names = tuple(sorted(name for name in modules if re.match(r"fig\d\d_", name)))

    def __getitem__(self, name: str) -> "PaperFigure":
        if name not in self._names:
            raise KeyError(name)
        return importlib.import_module(f"{__name__}.{name}").FIGURE

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


FIGURES = Figures()
