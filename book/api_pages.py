"""Writes the sources of the reference: a page for each package, with all modules, and a list of the public names.

The pages are written to `book/api/`, which is not under version control, before Sphinx looks for its sources.
"""

import importlib
import pkgutil
import re
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import enhsim_tf

if TYPE_CHECKING:
    from sphinx.application import Sphinx

_CODE, _LITERAL = re.compile(r"(?<![`:])`([^`]+)`(?!`)"), r"``\1``"
FOLDER = Path(__file__).parent / "api"
_LEFT_OUT = ("enhsim_tf.__main__", "enhsim_tf.cli", "enhsim_tf.reproduce.__main__")  # commands, whose reference is `--help`


def pages() -> dict[str, list[str]]:
    """Returns the modules of each package, which are imported; a package of packages has a page for each of these, too."""
    found: dict[str, list[str]] = {}
    for module in pkgutil.walk_packages(enhsim_tf.__path__, "enhsim_tf."):
        if module.name.startswith(_LEFT_OUT):
            continue
        package = module.name if module.ispkg else module.name.rpartition(".")[0]
        found.setdefault(package, [])
        if not module.ispkg:
            found[package].append(module.name)
    return dict(sorted(found.items()))


def page(package: str, modules: list[str]) -> str:
    """Returns the source of a package's page, in reStructuredText."""
    title = package.removeprefix("enhsim_tf.")
    lines = [title, "=" * len(title), "", f".. automodule:: {package}", ""]
    for module in modules:
        heading = module.removeprefix(f"{package}.")
        lines += [heading, "-" * len(heading), "", f".. automodule:: {module}", ""]
    return "\n".join(lines)


def public_names() -> str:
    """Returns the table of the names that `from enhsim_tf import ...` gives, in reStructuredText."""
    lines = [".. list-table::", "   :widths: auto", ""]
    for name in sorted(enhsim_tf.__all__):
        value = getattr(enhsim_tf, name)
        role = "class" if isinstance(value, type) else "func"
        first = " ".join((value.__doc__ or "").strip().split("\n\n")[0].split())
        lines += [f"   * - :py:{role}:`~{value.__module__}.{name}`", f"     - {_CODE.sub(_LITERAL, first)}"]
    return "\n".join(lines) + "\n"


def write(folder: Path = FOLDER) -> None:
    """Writes the pages into an emptied folder."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for package, modules in pages().items():
        (folder / f"{package.removeprefix('enhsim_tf.')}.rst").write_text(page(package, modules), encoding="utf-8")
    (folder / "public_names.txt").write_text(public_names(), encoding="utf-8")


def prepare_docstring(what: str, lines: list[str]) -> list[str]:
    """Returns a docstring as Napoleon and docutils need it.

    Code between single backticks, as in Markdown, gets two. The docstring of a variable begins with an empty line, because
    Napoleon takes what precedes a colon in its first line for a type.

    Args:
        what: Kind of the object, as Sphinx calls it.
        lines: Lines of the docstring.
    """
    marked = _CODE.sub(_LITERAL, "\n".join(lines)).split("\n")
    return ["", *marked] if what in ("data", "attribute", "property") else marked


def _on_docstring(app: "Sphinx", what: str, name: str, value: object, options: object, lines: list[str]) -> None:
    lines[:] = prepare_docstring(what, lines)


def setup(app: "Sphinx") -> dict[str, bool]:
    """Connects the writing to the start of a build. TensorFlow is imported first, so that it starts as in every other use."""
    importlib.import_module("enhsim_tf.keras_tools.backend")
    app.connect("builder-inited", lambda app: write())
    app.connect("autodoc-process-docstring", _on_docstring, priority=400)  # before Napoleon, which has 500
    return {"parallel_read_safe": True, "parallel_write_safe": True}
