"""Settings of Sphinx. The sources are all of the repository, so that a link means the same in the book and on a code host."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from enhsim_tf import __version__  # noqa: E402

project, author, copyright = "enhsim_tf", "The enhsim_tf authors", "The enhsim_tf authors, Apache-2.0"  # noqa: A001
release = __version__
root_doc = "book/index"
include_patterns = ["book/**", "docs/*.md", "notebooks/*.ipynb", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md"]
exclude_patterns = [".*", "build", "figures*", "**/.ipynb_checkpoints"]

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "book.mathml",
    "book.from_readme",
    "book.contents",
    "book.api_pages",
]
nb_execution_mode = "off"  # the stored outputs are those of the full budget; `python -m notebooks.build` makes them
nb_ipywidgets_js: dict[str, dict] = {}  # the default loads two scripts from the network
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True}
napoleon_use_rtype = False
napoleon_use_ivar = True
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
