"""The site: every page of the repository, where it lies, and a reference made from the code.

    sphinx-build -c docs . build/docs

The source folder is the repository, so that one relative link leads to one page on the site and on
a code host.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

from kerfpath import __version__

project = "kerfpath"
author = "The kerfpath authors"
copyright = "The kerfpath authors, Apache-2.0"
release = __version__

root_doc = "docs/index"
include_patterns = [
    "*.md",
    "docs/**.md",
    "benchmarks/*.md",
    "benchmarks/public/README.md",
    "examples/*/README.md",
    "src/kerfpath/studio/README.md",
]
exclude_patterns = [".*", "build", "dist", "demo-out", "tests"]

extensions = ["myst_parser", "reference.directive", "reference.docstrings", "sphinx.ext.viewcode"]
autodoc_default_options = {"members": True, "exclude-members": "model_config"}
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_typehints = "none"  # docstrings have types, shapes and units
default_role = "py:obj"
myst_heading_anchors = 4
highlight_language = "none"
nitpicky = True
smartquotes_action = "D"  # dashes alone

html_theme = "furo"
html_title = f"kerfpath {release}"
html_extra_path = ["_site"]
html_copy_source = False
html_theme_options = {  # the accents of the studio
    "light_css_variables": {
        "color-brand-primary": "#0b6b66",
        "color-brand-content": "#0b6b66",
        "color-brand-visited": "#0b6b66",
    },
    "dark_css_variables": {
        "color-brand-primary": "#4fc4b8",
        "color-brand-content": "#4fc4b8",
        "color-brand-visited": "#4fc4b8",
    },
}
html_show_sphinx = False
