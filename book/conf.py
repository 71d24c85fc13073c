"""Settings of Sphinx. The sources are all of the repository, so that a link means the same in the
book and on a code host.
"""

import sys
from pathlib import Path
from typing import TYPE_CHECKING

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from docutils.utils.math.latex2mathml import tex2mathml  # noqa: E402

import enhsim_tf.common.backend  # noqa: E402, F401  starts TensorFlow before another module imports it
from enhsim_tf import __version__  # noqa: E402

if TYPE_CHECKING:
    from sphinx.application import Sphinx

project, author, copyright = (
    "enhsim_tf",
    "The enhsim_tf authors",
    "The enhsim_tf authors, Apache-2.0",
)  # noqa: A001
release = __version__
extensions = [
    "myst_nb",
    "sphinx_external_toc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
]
include_patterns = ["*.md", "book/**", "docs/*.md", "notebooks/*.ipynb", "studies/**.md"]
external_toc_path = str(ROOT / "book" / "_toc.yml")
suppress_warnings = ["etoc.toctree"]  # the toctrees of autosummary are beside the table of contents

# the stored outputs are those of the full budget; `python -m notebooks.build` makes them
nb_execution_mode = "off"
nb_ipywidgets_js: dict[str, dict] = {}  # the default loads two scripts from the network
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3

default_role = "code"  # docstrings have code between single backticks
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
autosummary_generate = True
napoleon_use_rtype = False
add_module_names = False
toc_object_entries = False

html_theme = "sphinx_book_theme"
html_title = "enhsim_tf"
html_static_path = ["_static"]
html_css_files = ["book.css"]
html_extra_path = ["_extra"]
html_copy_source = False
html_show_sphinx = False
html_math_renderer = "mathml"
html_theme_options = {
    "show_navbar_depth": 1,
    "navbar_persistent": [],  # the search of the side bar is enough
    "footer_content_items": ["copyright.html"],
    "use_download_button": False,
    "use_fullscreen_button": False,
    "show_toc_level": 2,
}


def setup(app: "Sphinx") -> None:
    """Renders formulas as MathML, which browsers show without a script, and so without a
    network.
    """
    from docutils.nodes import SkipNode

    def visit(as_block: bool):  # noqa: ANN202
        def write(writer, node) -> None:  # noqa: ANN001
            formula = tex2mathml(node.astext(), as_block=as_block)
            writer.body.append(f'<div class="formula">{formula}</div>' if as_block else formula)
            raise SkipNode

        return write

    app.add_html_math_renderer("mathml", (visit(False), None), (visit(True), None))
